"""Where names stand in a drawing: with the least overlap, and a leader line where one is far.

Lengths are pixels or points, as the drawing has them; boxes are centred, shape (..., 2).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.view.marks import Array

LETTER, LINE = 0.62, 1.1
"""Width of a letter and height of a line, in heights of the font."""

BASE = 0.35
"""How far the base of letters is below their middle, in heights of the font."""

SIDES = np.array([(1, 1), (-1, 1), (0, 1), (1, -1), (-1, -1), (0, -1), (1, 0), (-1, 0)])
"""Where a name may stand about its place, the best side first."""

STEPS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.5)
"""How much farther away it may be, in heights of the name."""

OVERLAP, RANK = 10.0, 2.0
"""What a unit of overlap with a name or a joint costs, and each place that is not the best."""

FAR = 0.9
"""Distance from its place, in heights of a name, from which a leader line goes there."""

SWEEPS = 2
"""How often names that still overlap are placed again."""

MOST_FRAMES = 24
"""Frames of a motion for which places are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Name:
    """A name to be placed, by a shift that all frames have in common."""

    places: Array  # shape (F, 2): what it names, in each frame
    size: Array  # shape (2,): width and height of its box
    shifts: Array  # shape (k, 2): from a place to where the middle may be, the best first


def box_of(text: str, font: float) -> Array:
    """Return the size of a text, estimated from its letters."""
    return np.array((LETTER * font * len(text), LINE * font))


def around(size: Array, gap: float) -> Array:
    """Return the shifts about a place, at growing distances; the first is up and to the right."""
    return np.concatenate([SIDES * (size / 2 + gap + step * size[1]) for step in STEPS])


def placed(
    names: Sequence[Name], joints: Array, radius: float, page: Array, lines: Array | None = None
) -> Array:
    """Return the shifts of names, shape (n, 2), that overlap least.

    Parameters
    ----------
    joints : ndarray, shape (F, m, 2)
        Places that no name should cover, each with a radius.
    page : ndarray, shape (2, 2)
        Two corners of the picture, outside of which no name should be.
    lines : ndarray, shape (F, k, 2), optional
        Points of lines, which names avoid where that costs nothing.
    """
    if not names:
        return np.zeros((0, 2))
    some = np.unique(np.linspace(0, len(joints) - 1, MOST_FRAMES).astype(int))
    costs = [_fixed_costs(item, some, joints, radius, page, lines) for item in names]
    middles = np.zeros((len(some), len(names), 2))
    sizes = np.array([item.size for item in names])
    shifts, is_placed = np.zeros((len(names), 2)), np.zeros(len(names), dtype=bool)
    for sweep, k in itertools.product(range(1 + SWEEPS), range(len(names))):
        own = names[k].places[some][:, None]
        others = is_placed & (np.arange(len(names)) != k)
        if sweep and not _overlaps(
            middles[:, k : k + 1], sizes[k], middles[:, others], sizes[others]
        ):
            continue
        taken = _overlaps(own + names[k].shifts, sizes[k], middles[:, others], sizes[others])
        best = int(np.argmin(costs[k] + OVERLAP * taken))
        shifts[k], is_placed[k] = names[k].shifts[best], True
        middles[:, k] = own[:, 0] + shifts[k]
    return shifts


def leader(place: Array, middle: Array, size: Array) -> Array | None:
    """Return the line from a name to its place, shape (2, 2); None where they are close."""
    nearest = middle + np.clip(place - middle, -size / 2, size / 2)
    is_far = float(np.hypot(*(nearest - place))) > FAR * size[1]
    return np.stack((nearest, place)) if is_far else None


def _fixed_costs(
    item: Name, some: Array, joints: Array, radius: float, page: Array, lines: Array | None
) -> Array:
    """Return what each shift of a name costs whatever the others do, shape (k,)."""
    middles = item.places[some][:, None] + item.shifts
    hidden = _overlaps(middles, item.size, joints[some], np.full(2, 2 * radius))
    whole = np.ptp(page, axis=0)
    inside = _overlaps(middles, item.size, page.mean(axis=0)[None, None], whole)
    cost = OVERLAP * (hidden + float(np.prod(item.size)) - inside) + RANK * np.arange(len(hidden))
    if lines is not None:
        cost = cost + _overlaps(middles, item.size, lines[some], np.full(2, 3.0))
    return np.asarray(cost)


def _overlaps(middles: Array, size: Array, others: Array, sizes: Array) -> Array:
    """Return the area of each box, shape (F, k, 2), on all others, as a mean over frames."""
    apart = np.abs(middles[:, :, None] - others[:, None])
    sides = np.clip((size + sizes) / 2 - apart, 0, np.minimum(size, sizes))
    return np.asarray(sides.prod(axis=-1).sum(axis=-1).mean(axis=0))
