"""Designs as a search has them: variables, and the positions at the times of its targets."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Designs:
    """Errors (B,), variables (B, nx), times (B, N) and positions (B, N, n) of B designs.

    The times are those of the grid, then of each passing target.
    """

    error: Array
    x: Array
    t: Array
    q: Array

    @classmethod
    def best(cls, parts: Sequence[Designs], most: int | None = None) -> Designs:
        """Return the designs of several parts, the best first, or the best of them."""
        some = [item for item in parts if item.error.size] or list(parts[:1])
        every: dict[str, Any] = {
            item.name: np.concatenate([getattr(x, item.name) for x in some]) for item in fields(cls)
        }
        order = np.argsort(every["error"], kind="stable")[:most]
        return cls(**{name: part[order] for name, part in every.items()})

    @classmethod
    def none(cls) -> Designs:
        """Return no designs."""
        return cls(np.empty(0), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0, 0)))
