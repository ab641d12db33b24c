"""`kincompile view MODEL --watch`: a page that follows its model while one writes it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from kincompile.cli.serve import LivePage, served
from kincompile.cli.shared import NOT_CONVERGED
from kincompile.cli.watched import Stamp, stamp
from kincompile.errors import package_of_extra
from kincompile.files.content import file_content
from kincompile.names import escaped_lines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

INTERVAL = 200
"""Time after which a run is asked whether it has ended, without an event of a file [ms]."""

LONGEST = 20_000
"""Characters of messages that a page shows."""

RUN = (
    "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); "
    "from kincompile.cli.watched import run; run()"
)
"""What a process runs: it imports from where this one does."""


def follow(model: str, options: Sequence[str]) -> None:
    """Serve the page of a model until interrupted; reload it when a file it reads is saved.

    The options are those of `kincompile view` for its motion.
    """
    with package_of_extra("watchfiles", "watch"):
        import watchfiles
    file_content(Path(model))
    page = LivePage(Path(model).name)
    with TemporaryDirectory() as folder:
        runs = _Runs(model, options, page, Path(folder))
        try:
            with served(page) as address:
                click.echo(f"{model} is shown at {address} until Ctrl-C ends this", err=True)
                while True:
                    folders = runs.folders()
                    for _ in watchfiles.watch(
                        *folders,
                        recursive=False,
                        watch_filter=None,
                        rust_timeout=INTERVAL,
                        yield_on_timeout=True,
                        debounce=2 * INTERVAL,
                    ):
                        runs.go_on()
                        if runs.folders() != folders:
                            break
        except KeyboardInterrupt:
            pass
        finally:
            runs.stop()


class _Runs:
    """The runs of a model, one at a time: a new one when a file has changed since it was read.

    What counts is the state of files, so that no change is lost while a run lasts or the watched
    folders change.
    """

    def __init__(self, model: str, options: Sequence[str], page: LivePage, folder: Path) -> None:
        self._path = Path(model).resolve()
        self._page = page
        self._page_file, self._messages = folder / "page.html", folder / "messages"
        self._report = folder / "report.json"
        arguments = ["view", *options, "-o", str(self._page_file), "--", model]
        paths = json.dumps(sys.path)
        self._command = [
            sys.executable, "-P", "-B", "-c", RUN, paths, str(self._report), str(self._path.parent),
            *arguments,
        ]  # fmt: skip
        self._stamps: dict[str, Stamp] = {}
        self._process: subprocess.Popen[bytes] | None = None

    def folders(self) -> set[str]:
        """Return the folders of the files that were read, as far as they exist."""
        folders = {self._path.parent, *(Path(path).parent for path in self._stamps)}
        return {str(folder) for folder in folders if folder.is_dir()}

    def go_on(self) -> None:
        """Begin a run where a file has changed; take what a run has made when it has ended."""
        if any(stamp(path) != own for path, own in self._stamps.items()) or not self._stamps:
            self._begin()
        elif self._process is not None and self._process.poll() is not None:
            code, self._process = self._process.returncode, None
            self._take(code)

    def stop(self) -> None:
        """End a run that is going on."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def _begin(self) -> None:
        self.stop()
        self._page_file.unlink(missing_ok=True)
        self._report.unlink(missing_ok=True)
        known = {str(self._path), *self._stamps}
        self._stamps = {path: stamp(path) for path in known}
        with self._messages.open("wb") as messages:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.DEVNULL, stdout=messages, stderr=messages
            )

    def _take(self, code: int) -> None:
        """Show the page that a run has made, or what it says."""
        said = self._messages.read_text(encoding="utf-8", errors="replace").strip()
        said = escaped_lines(said.replace(f"Wrote {self._page_file}", "").strip())[-LONGEST:]
        is_good = code in (0, NOT_CONVERGED) and self._page_file.exists()
        if is_good:
            self._page.show(self._page_file.read_text(encoding="utf-8"))
        else:
            said = said or f"The process of {self._path.name} ended with {code}, without a page."
            self._page.fail(said)
        click.echo("\n".join(filter(None, (said, "The page is new." if is_good else ""))), err=True)
        self._stamps |= self._read()
        if not is_good:  # what the model did not find may be made beside it
            beside = str(self._path.parent)
            self._stamps[beside] = stamp(beside)
        else:
            self._stamps.pop(str(self._path.parent), None)

    def _read(self) -> Mapping[str, Stamp]:
        """Return the stamps of the files that a run has read."""
        try:
            found = json.loads(self._report.read_text(encoding="utf-8"))
        except OSError:  # the process has been ended from outside
            return {}
        return {path: own and (own[0], own[1]) for path, own in found.items()}
