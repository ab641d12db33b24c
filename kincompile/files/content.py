"""The content of a file from anyone: a regular file, of a bounded size, as text in UTF-8.

Every file that the package reads comes through here: models, analyses, formulas derived by hand.
A pipe could keep a reader waiting and a device has no end, so neither is read.
"""

from __future__ import annotations

import os
import stat
from typing import TYPE_CHECKING

from kincompile.errors import InputError, ModelError
from kincompile.names import escaped

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

MAX_BYTES = 8_000_000
"""Largest file, read or refused in seconds; a mechanism of 10,000 bodies has half of this."""


def file_content(
    path: Path, most: int = MAX_BYTES, *, endings: Iterable[str] = (), follows_links: bool = True
) -> bytes:
    """Return the bytes of a regular file.

    Parameters
    ----------
    endings
        Endings that a reader may have forgotten, for a hint where there is no such file.

    Raises
    ------
    InputError
        If there is no such file, it is not a regular file, or it cannot be read.
    ModelError
        If it has too many bytes.
    """
    shown = escaped(path)
    extra = getattr(os, "O_NONBLOCK", 0)  # to open a pipe without a writer
    if not follows_links:
        extra |= getattr(os, "O_NOFOLLOW", 0)
        if path.is_symlink():
            raise InputError(f"cannot read {shown}: it is a link; give the file itself")
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | extra)) as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise InputError(
                    f"cannot read {shown}: it is a pipe or a device; save its content in a file"
                )
            content = stream.read(most + 1) or b""
    except InputError:  # it is a ValueError, too
        raise
    except FileNotFoundError:
        near = [path.with_name(path.name + ending) for ending in endings if path.name]
        hints = (f"did you mean {escaped(other)}?" for other in near if other.is_file())
        hint = next(hints, "check the path")
        raise InputError(f"cannot read {shown}: there is no such file; {hint}") from None
    except IsADirectoryError:
        raise InputError(f"cannot read {shown}: it is a folder; give a file in it") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"cannot read {shown}: {reason}; check the path and its permissions"
        ) from error
    if len(content) > most:
        raise ModelError(f"{shown}: the file has more than {most:,} bytes; make it smaller")
    return content


def decoded(path: Path, content: bytes) -> str:
    """Return bytes as text.

    Raises
    ------
    ModelError
        If they are not UTF-8, with the line.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ModelError(
            f"{escaped(path)}, line {line}: this is not text in UTF-8 "
            f"(byte 0x{content[error.start]:02x}); save the file as UTF-8"
        ) from None
