"""What a target is, and what it gives: named files, written whole or not at all."""

from __future__ import annotations

import io
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kincompile.html import Shown
from kincompile.names import listed
from kincompile.tables import indented
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.printer import Dialect, Printer
    from kincompile.ir.inline import InlineProgram
    from kincompile.quantities import Quantity


@dataclass(frozen=True, slots=True, repr=False)
class Emitted(Shown):
    """The files of one target.

    Attributes
    ----------
    name
        Name of the mechanism.
    files
        Text by file name; the first is the main one.
    arrays
        Arrays that belong to the main file; none for most targets.
    unsolvable
        Why the equations cannot determine the coordinates, so that there is no motion to solve
        for; "" where they can.
    needs
        What code for a controller needs there: bytes and operations; "" for all other code.
    ends
        What the main file has at its end, by the ending of another name that it is given.
    """

    name: str
    files: Mapping[str, str]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    unsolvable: str = ""
    needs: str = ""
    ends: Mapping[str, str] = field(default_factory=dict)

    def to_text(self) -> str:
        """Return which files there are."""
        sizes = [f"{name}, {text.count(chr(10))} lines" for name, text in self.files.items()]
        lines = [*sizes, *([f"{self.name}.npz"] if self.arrays else [])]
        lines += [f"no motion to solve for: {self.unsolvable}"] if self.unsolvable else []
        lines += [self.needs] if self.needs else []
        return "\n".join([self.headline(), *indented([*lines, ".source is the main file's text"])])

    def headline(self) -> str:
        """Return the name and its files."""
        return f"{self.name} as {listed([*self.files, *self.companions[len(self.files) - 1 :]])}"

    @property
    def main(self) -> str:
        """Name of the main file."""
        return next(iter(self.files))

    @property
    def source(self) -> str:
        """Text of the main file."""
        return next(iter(self.files.values()))

    @property
    def companions(self) -> tuple[str, ...]:
        """Names of the files beside the main one."""
        arrays = (f"{self.name}.npz",) if self.arrays else ()
        return (*list(self.files)[1:], *arrays)

    def write(self, folder: str | Path, main: str | None = None) -> tuple[Path, ...]:
        """Write the files into a folder, which is made if it is missing, and return their paths.

        Parameters
        ----------
        folder
            Where to write.
        main
            Another name for the main file; JavaScript in one that ends in .mjs is an ES module.

        Raises
        ------
        InputError
            If the folder cannot be written to.
        """
        # Where the folder cannot be made, writing the first file says why.
        with suppress(OSError):
            Path(folder).mkdir(parents=True, exist_ok=True)
        paths = []
        for k, (name, text) in enumerate(self.files.items()):
            path = Path(folder) / (main if main and k == 0 else name)
            write_atomically(path, text + (self.ends.get(path.suffix, "") if k == 0 else ""))
            paths.append(path)
        if self.arrays:
            path = Path(folder) / self.companions[-1]
            write_atomically(path, _packed(self.arrays))
            paths.append(path)
        return tuple(paths)


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return arrays as the bytes of a .npz file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


@dataclass(frozen=True, slots=True)
class Start:
    """Where code for one point at a time begins: a position at t = 0, and the mechanism's size."""

    real: str  # the type of its numbers
    q: tuple[float, ...] = ()
    size: float = 1.0


class Target(Protocol):
    """A language to emit: what the module `target` of its folder has.

    Loops, names and schedules are not its concern: `emission` calls `function` for each evaluator,
    then `files`.
    """

    DIALECT: Dialect
    """How it writes expressions."""
    RESERVED: tuple[str, ...]
    """Words of the language, and names that its functions use."""

    def evaluators(self, given: Sequence[Quantity]) -> Mapping[str, tuple[str, ...]]:
        """Return its functions for these quantities, and those that each gives."""

    def function(
        self, name: str, code: InlineProgram, listing: Listing, printer: Printer
    ) -> list[str]:
        """Return the lines of a function."""

    def files(
        self, code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
    ) -> Mapping[str, str]:
        """Return the files, the main one first, given the lines of the functions by name."""


class OneTarget(Target, Protocol):
    """The same for one point at a time: the class `Target` of the module `one` of its folder."""

    def needs(self, code: InlineProgram) -> str:
        """Return how large a state is, and how many operations a correction takes."""
