"""A progress bar on stderr."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

PATIENCE = 0.5
"""Seconds after which a progress bar appears."""


@contextmanager
def progress_bar() -> Iterator[Callable[[int, int], None] | None]:
    """Give a progress bar that appears when work has lasted long; None without a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    appears = time.monotonic() + PATIENCE
    bar: Any = None

    def show(done: int, total: int) -> None:
        nonlocal bar
        if bar is None and time.monotonic() >= appears:
            bar = _started_bar(total)
        if bar is not None:
            bar.update(bar.task_ids[0], completed=done)

    try:
        yield show
    finally:
        if bar is not None:
            bar.stop()


def _started_bar(total: int) -> Any:
    """Show a bar; rich is loaded here, because few runs last long enough to need it."""
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    bar.add_task("solving", total=total)
    bar.start()
    return bar
