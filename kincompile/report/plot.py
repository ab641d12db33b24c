"""Plots of results as SVG of our own: lines, bands and dots over two axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kincompile.report.svg import element, label, outline

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WIDTH, HEIGHT = 400, 260
"""Of a plot [points]."""

LEFT, RIGHT, TOP, BOTTOM = 62, 12, 26, 40
"""Margins, for labels."""

TICKS = 5
"""About how many numbers stand along an axis."""

LETTER, GAP = 6.2, 12
"""Width of a letter at most, and between texts."""


COLOURS = {
    "ink": "currentColor", "quiet": "#808a96", "line": "#80808066", "link": "#2a7de1",
    "numeric": "#d2691e",
}  # fmt: skip
"""Of plots outside a page of ours, on light and on dark paper."""


class Layer(NamedTuple):
    """What a plot shows, (N,) each; NaN interrupts a line."""

    kind: str  # "line", "dots", or "band" from y to high
    x: Array
    y: Array
    high: Array | None = None
    colour: str = "var(--link)"
    name: str = ""  # in the legend


def plot_svg(
    title: str,
    x_label: str,
    y_label: str,
    layers: Sequence[Layer],
    *,
    is_true: bool = False,
    rows: Sequence[str] = (),
) -> str:
    """Return a plot as an `svg` element; the title says what it shows, for who cannot see it.

    `is_true` gives both axes one scale, as a path wants. `rows` are names that stand at y = 0, 1,
    2, ... in place of numbers, as bars want.
    """
    numbers = [
        _extent(np.concatenate([np.ravel(part) for part in parts]))
        for parts in (
            [item.x for item in layers],
            [part for item in layers for part in (item.y, item.high) if part is not None],
        )
    ]
    wide, tall = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    if is_true:
        scale = max((b - a) / pixels for (a, b), pixels in zip(numbers, (wide, tall), strict=True))
        middles = [(a + b) / 2 for a, b in numbers]
        numbers = [
            (middle - scale * pixels / 2, middle + scale * pixels / 2)
            for middle, pixels in zip(middles, (wide, tall), strict=True)
        ]
    (x0, x1), (y0, y1) = numbers

    def pair(point: Iterable[float]) -> str:
        x, y = point
        across, up = wide * (x - x0) / (x1 - x0), tall * (y - y0) / (y1 - y0)
        return f"{LEFT + across:.1f} {HEIGHT - BOTTOM - up:.1f}"

    inside = [
        *_axes(numbers, pair, bool(rows)),
        *(_drawn(item, pair) for item in layers),
        *_rows(rows, numbers[0][0], pair),
        label(x_label, x=LEFT + wide / 2, y=HEIGHT - 6, text_anchor="middle", fill="var(--ink)"),
        label(y_label, x=0, y=13, fill="var(--ink)"),
        *_legend(layers),
    ]
    return element(
        "svg", "".join(inside), viewBox=f"0 0 {WIDTH} {HEIGHT}", width=WIDTH, height=HEIGHT,
        role="img", aria_label=title, font_size=11, style="max-width: 100%; height: auto",
    )  # fmt: skip


def coloured(plots: str) -> str:
    """Return plots with colours of their own, for a notebook."""
    colours = "; ".join(f"--{name}: {colour}" for name, colour in COLOURS.items())
    return f'<div style="{colours}">{plots}</div>'


def _extent(values: Array) -> tuple[float, float]:
    """Return the ends of an axis: those of the finite values, and a little more."""
    found = values[np.isfinite(values)]
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    size = max(abs(low), abs(high)) or 1.0
    more = 0.04 * (high - low) if high - low > 1e-9 * size else 0.5 * size
    return low - more, high + more


def _ticks(low: float, high: float, most: int = TICKS) -> list[tuple[float, str]]:
    """Return round numbers along an axis, with their texts."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.7 * rough)
    first, last = math.ceil(low / step), math.floor(high / step)
    digits = max(0, -math.floor(math.log10(step)))
    largest = max(abs(low), abs(high))
    text = "{:.3g}" if largest >= 1e6 or largest < 1e-4 else f"{{:.{digits}f}}"
    return [(k * step, text.format(k * step)) for k in range(first, last + 1)]


def _apart(low: float, high: float) -> list[tuple[float, str]]:
    """Return the numbers of the axis across: as many as have room beside each other."""
    wide, found = WIDTH - LEFT - RIGHT, _ticks(low, high)
    for most in range(TICKS - 1, 0, -1):
        needed = max((LETTER * len(text) + GAP / 2 for _, text in found), default=0.0)
        if len(found) < 2 or wide * (found[1][0] - found[0][0]) / (high - low) >= needed:
            break
        found = _ticks(low, high, most)
    return found


def _axes(
    numbers: Sequence[tuple[float, float]],
    pair: Callable[[Iterable[float]], str],
    has_rows: bool,
) -> Iterator[str]:
    """Yield the lines of the grid, with their numbers; across only where there are no rows."""
    (x0, x1), (y0, y1) = numbers
    for x, text in _apart(x0, x1):
        yield element("path", d=outline([(x, y0), (x, y1)], False, pair), stroke="var(--line)")
        at = pair((x, y0)).split()[0]
        yield label(text, x=at, y=HEIGHT - 24, text_anchor="middle", fill="var(--quiet)")
    for y, text in () if has_rows else _ticks(y0, y1):
        yield element("path", d=outline([(x0, y), (x1, y)], False, pair), stroke="var(--line)")
        height = float(pair((x0, y)).split()[1]) + 4
        yield label(text, x=LEFT - 6, y=f"{height:.1f}", text_anchor="end", fill="var(--quiet)")


def _rows(
    names: Sequence[str], left: float, pair: Callable[[Iterable[float]], str]
) -> Iterator[str]:
    """Yield the names of rows, in the plot at its left."""
    for row, name in enumerate(names):
        x, y = map(float, pair((left, row)).split())
        yield label(name, x=f"{x + 4:.1f}", y=f"{y + 4:.1f}", fill="var(--ink)")


def _drawn(item: Layer, pair: Callable[[Iterable[float]], str]) -> str:
    """Return the element of a layer; a dot is a line of no length with round ends."""
    points = np.column_stack((item.x, item.y))
    if item.kind == "band" and item.high is not None:
        good = np.isfinite(item.y) & np.isfinite(item.high)
        back = np.column_stack((item.x, item.high))[good][::-1]
        d = outline(np.vstack((points[good], back)).tolist(), True, pair)
        return element("path", d=d, fill=item.colour, fill_opacity=0.2)
    if item.kind == "dots":
        whole = points[np.isfinite(points).all(axis=1)].tolist()
        d = "".join(f"M{pair(point)}h0" for point in whole)
        return element("path", d=d, stroke=item.colour, stroke_width=5, stroke_linecap="round")
    d = outline(points.tolist(), False, pair)
    return element("path", d=d, fill="none", stroke=item.colour, stroke_width=1.6)


def _legend(layers: Sequence[Layer]) -> Iterator[str]:
    """Yield the names of layers, at the top right."""
    right = float(WIDTH - RIGHT)
    for item in reversed([item for item in layers if item.name]):
        yield label(item.name, x=f"{right:.1f}", y=13, text_anchor="end", fill=item.colour)
        right -= LETTER * len(item.name) + GAP
