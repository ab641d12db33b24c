"""Folders of results: made whole or not at all, looked through for damage, written in again.

Each chunk has a record with the SHA-256 of its files, in the form of `sha256sum`, and so has what
is written when the folder is made. A record is written last: a chunk is complete where it has one,
and its files are as the record says.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from kincompile.errors import DamagedStoreWarning, InputError
from kincompile.names import escaped, listed
from kincompile.sweeps.contents import require_same

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from numpy.typing import NDArray

BEGINNING = "beginning"
"""The record of the files that a folder is made with."""

TRIES = 3
"""How often a chunk is written: a run that begins removes what another one has half written."""


@contextmanager
def kept_in(path: Path) -> Iterator[None]:
    """Turn an error of the system, while results are written, into one that says what to do."""
    try:
        yield
    except OSError as error:
        found = Path(error.filename2 or error.filename or path)
        at = found if found.is_dir() else path  # a folder in the place of a file is named
        raise InputError(
            f"cannot write to {escaped(at)}: {error.strerror or error}. What is complete there "
            "is kept: remove the cause, and the same call goes on from there."
        ) from error


def written(path: Path, write: Callable[[], None]) -> None:
    """Write into a folder, again where another run has removed a file that was half written."""
    with kept_in(path):
        for left in reversed(range(TRIES)):
            try:
                write()
                break
            except FileNotFoundError:
                if not left:
                    raise


@dataclass(frozen=True, slots=True)
class Records:
    """The records of a folder."""

    path: Path  # the folder of the results
    place: str  # the folder in it that has the records

    def write(self, name: object, files: Iterable[str]) -> None:
        """Write the record of files: beside its place, and moved there."""
        self._put(name, self._text(files))

    def there(self) -> set[str]:
        """Return the names of all records."""
        folder = self.path / self.place
        return {file.name for file in folder.iterdir()} if folder.is_dir() else set()

    def hold(self, name: object, files: Iterable[str]) -> bool:
        """Say whether files are as their record says."""
        return self._text(files) == self._kept(name)

    def remove(self, name: object) -> None:
        """Remove a record."""
        self._file(name).unlink(missing_ok=True)

    def digests(self, name: object) -> dict[str, str]:
        """Return the digest of each file of a record; of one that is damaged what can be read."""
        lines = (line.split("  ", 1) for line in self._kept(name).splitlines())
        return {line[1]: line[0] for line in lines if len(line) == 2}

    def take(self, name: object, other: Records) -> None:
        """Take the record of another folder."""
        self._put(name, other._kept(name))

    def _kept(self, name: object) -> str:
        file = self._file(name)
        try:
            return file.read_bytes().decode(errors="replace") if file.is_file() else ""
        except OSError:
            return ""

    def _put(self, name: object, text: str) -> None:
        file = self._file(name)
        partial = file.with_name(f".{file.name}.{os.urandom(4).hex()}.partial")
        file.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(text.encode())
        partial.replace(file)

    def _file(self, name: object) -> Path:
        return self.path / self.place / str(name)

    def _text(self, files: Iterable[str]) -> str:
        """Return a line for each existing file; a part without a value has none."""
        pairs = ((name, digest(self.path / name)) for name in files)
        return "".join(f"{found}  {name}\n" for name, found in pairs if found)


def digest(file: Path) -> str:
    """Return the SHA-256 of a file; "" where it cannot be read, or is a device or a pipe."""
    if not file.is_file():
        return ""
    try:
        with file.open("rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError:
        return ""


class Chunked(Protocol):
    """What writes the chunks of a folder."""

    @property
    def records(self) -> Records:
        """The records of the folder."""

    def files(self, number: int) -> list[str]:
        """Return the names of the files of a chunk, in the folder."""


def opened(
    records: Records,
    make: Callable[[Path], None],
    marks_of: Callable[[Path], object],
    marks: Mapping[str, str],
    main: str,
) -> None:
    """Make the folder of a sweep, or check that an existing one is whole and of this sweep.

    `make` fills a new folder, `marks_of` reads the marks of one, which its file `main` has.
    """
    path = records.path
    fresh = Records(path.with_name(f".{path.name}.{os.urandom(4).hex()}"), records.place)
    try:
        with kept_in(path):
            fresh.path.mkdir()
            make(fresh.path)
            fresh.write(BEGINNING, _files(fresh.path))
            if moved(fresh.path, path):
                return
        if fresh.digests(BEGINNING)[main] != records.digests(BEGINNING).get(main):
            require_same(path, marks_of(path), marks, path / main if records.there() else None)
        with kept_in(path):
            _mend(records, fresh)
            for file in path.rglob("*.partial"):  # of a run that was stopped
                file.unlink(missing_ok=True)
    finally:
        shutil.rmtree(fresh.path, ignore_errors=True)


def moved(fresh: Path, path: Path) -> bool:
    """Put a new folder in its place; say whether that was free, as of two runs it is for one."""
    if path.exists():
        return False
    try:
        fresh.replace(path)
    except OSError:
        if not path.exists():
            raise
        return False
    return True


def _mend(records: Records, fresh: Records) -> None:
    """Rewrite damaged files of those that a folder was made with."""
    wanted, known = fresh.digests(BEGINNING), records.digests(BEGINNING)
    found = {name: digest(records.path / name) for name in wanted}
    others = [name for name in wanted if found[name] not in ("", wanted[name])]
    others = [name for name in others if found[name] == known.get(name)]
    damaged = [name for name in wanted if found[name] not in (wanted[name], known.get(name))]
    shown = escaped(records.path.name)
    if damaged and others:
        raise InputError(
            f"{escaped(records.path / damaged[0])} is damaged, and cannot be written again: other "
            "versions of kincompile or of its packages made this folder. Go on with those, or give "
            "another name."
        )
    if damaged:
        _say(f"{shown}: {listed(damaged)} {_is(damaged)} damaged; {_it(damaged)} written again.")
    elif not records.there():
        _say(
            f"{shown} is of an earlier version, without the digests of its files: all its chunks "
            "are solved again."
        )
    for name in damaged:
        partial = fresh.path / name
        (records.path / name).parent.mkdir(parents=True, exist_ok=True)
        partial.replace(records.path / name)
    if not others:
        records.take(BEGINNING, fresh)


def whole(chunked: Chunked, count: int) -> NDArray[np.bool_]:
    """Say which chunks have a record."""
    there = chunked.records.there()
    return np.fromiter((str(number) in there for number in range(count)), dtype=bool, count=count)


def drop_damaged(chunked: Chunked, count: int) -> None:
    """Forget the chunks whose files are not as their records say, and say so."""
    records = chunked.records
    claimed = np.flatnonzero(whole(chunked, count)).tolist()
    damaged = [number for number in claimed if not records.hold(number, chunked.files(number))]
    if not damaged:
        return
    with kept_in(records.path):
        for number in damaged:
            records.remove(number)
    chunks = "chunks" if len(damaged) > 1 else "chunk"
    shown = f"{escaped(records.path.name)}: {chunks} {listed(damaged)}"
    _say(f"{shown} {_is(damaged)} damaged; {_it(damaged)} solved again.")


def _files(folder: Path) -> list[str]:
    """Return the names of all files of a folder, in order."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in files)


def _is(several: list[str] | list[int]) -> str:
    return "are" if len(several) > 1 else "is"


def _it(several: list[str] | list[int]) -> str:
    return "they are" if len(several) > 1 else "it is"


def _say(text: str) -> None:
    warnings.warn(text, DamagedStoreWarning, stacklevel=2)
