"""One run of a watched model, in a process of its own, with a report of the files it has read.

The run is that of the command line. A process of its own has every imported file as it is saved
now, and can be ended at any time, whatever the model does.
"""

from __future__ import annotations

import json
import os
import sys
import sysconfig
from importlib.util import source_from_cache
from pathlib import Path
from typing import Any

import kincompile
from kincompile.cli import main

Stamp = tuple[int, int] | None
"""Time of change [ns] and size of a file; None where there is none."""


def stamp(path: str) -> Stamp:
    """Return what tells whether a file has changed."""
    try:
        found = Path(path).stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


class _Reads:
    """The files that a process reads: Python files of its author, and what is in a folder."""

    def __init__(self, folder: str) -> None:
        package = Path(kincompile.__file__).parent
        installed = {os.path.realpath(path) for path in sysconfig.get_paths().values()}
        self._others = tuple(
            path + os.sep for path in (*installed, str(package), str(package.parent / "templates"))
        )
        self._folder = folder + os.sep
        self._written: set[str] = set()
        self._read: dict[str, Stamp] = {}

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Note the opening of a file, of which Python tells its audit hooks."""
        if event != "open" or not isinstance(arguments[0], str):
            return
        path, mode, flags = os.path.realpath(arguments[0]), arguments[1], arguments[2]
        writes = set(mode) & set("wax+") if mode else flags & (os.O_WRONLY | os.O_RDWR)
        if path.endswith(".pyc"):
            try:
                path = source_from_cache(path)
            except ValueError:  # compiled by hand, without its source
                return
        is_own = path.endswith(".py") or path.startswith(self._folder)
        if not is_own or path.startswith(self._others):
            return
        if writes:
            self._written.add(path)
        else:
            self._read.setdefault(path, stamp(path))

    def report(self) -> dict[str, Stamp]:
        """Return the stamps that files had when they were read, without those also written."""
        return {path: own for path, own in self._read.items() if path not in self._written}


def run() -> None:
    """Run the command line: the arguments are where to report, the model's folder, and its own."""
    _, report, folder, *arguments = sys.argv
    sys.argv[1:] = arguments
    reads = _Reads(folder)
    sys.addaudithook(reads.hook)
    try:
        main()
    finally:
        Path(report).write_text(json.dumps(reads.report()), encoding="utf-8")
