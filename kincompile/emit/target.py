"""What a target is, and what it gives: named files, written whole or not at all."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from kincompile.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.ir.inline import InlineProgram


@dataclass(frozen=True, slots=True)
class Emitted:
    """The files of one target.

    Attributes
    ----------
    name
        Name of the mechanism.
    files
        Text by file name; the first is the main one.
    """

    name: str
    files: Mapping[str, str]

    @property
    def source(self) -> str:
        """Text of the main file."""
        return next(iter(self.files.values()))

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the files into a folder, which is made if it is missing, and return their paths.

        Raises
        ------
        InputError
            If the folder cannot be written to.
        """
        # Where the folder cannot be made, writing the first file says why.
        with suppress(OSError):
            Path(folder).mkdir(parents=True, exist_ok=True)
        paths = []
        for name, text in self.files.items():
            path = Path(folder) / name
            write_atomically(path, text)
            paths.append(path)
        return tuple(paths)


class Target(Protocol):
    """A language to emit."""

    def __call__(self, code: InlineProgram) -> Emitted:
        """Return the files of a program."""
