"""Folders of results: made whole or not at all, cleaned, and what a full disk says."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.names import escaped

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def kept_in(path: Path) -> Iterator[None]:
    """Turn an error of the system, while results are written, into one that says what to do."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"cannot write to {escaped(path)}: {error.strerror or error}. What is complete there "
            "is kept: remove the cause, and the same call goes on from there."
        ) from error


@contextmanager
def made_whole(path: Path) -> Iterator[Path]:
    """Give a temporary folder that takes the place of `path` at the end."""
    folder = path.with_name(f".{path.name}.{os.urandom(4).hex()}")
    with kept_in(path):
        try:
            folder.mkdir()
            yield folder
            folder.replace(path)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def remove_unfinished(path: Path, pattern: str) -> None:
    """Remove the files of chunks that a run was writing when it was stopped."""
    for file in path.rglob(pattern):
        file.unlink(missing_ok=True)
