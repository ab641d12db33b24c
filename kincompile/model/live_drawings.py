"""Whether drawings that do not say so are live: commands that show them ask for it."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_ARE_LIVE: ContextVar[bool] = ContextVar("are_live", default=False)


def are_live() -> bool:
    """Return whether drawings are live that do not say whether they are."""
    return _ARE_LIVE.get()


@contextmanager
def live_drawings() -> Iterator[None]:
    """Let drawings be live that do not say whether they are."""
    token = _ARE_LIVE.set(True)
    try:
        yield
    finally:
        _ARE_LIVE.reset(token)
