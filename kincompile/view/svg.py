"""A mechanism as SVG: at a position, or in motion by SMIL. There is no script in it.

Each stroke is written once, in the frame it moves with; the frame's motion is that of the body's
coordinates, so that a picture of many frames stays small. What changes its shape, such as a
cylinder, has a shape for each frame.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from functools import cache
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.picture import DASHES, FILL
from kincompile.report.svg import ROUND, element, label, outline
from kincompile.report.templates import read
from kincompile.view.labels import BASE, Name, around, box_of, leader, placed
from kincompile.view.marks import GROUND_FRAME, moves_with
from kincompile.view.polylines import Polyline, polylines
from kincompile.view.shapes import HUES, mixed
from kincompile.view.worlds import drawn_by

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, FramePoint

WIDTH, HEIGHT = 960.0, 720.0
"""Largest sides of a picture [px]."""

THICK = 8.0
"""Size of marks [px] beside which lines have the widths of their looks."""

FONT = 1.4
"""Height of names, in sizes of marks."""

DOT = "dot"
"""The look of named points, which are drawn over paths."""

DARK_FILL = 0.32
"""Opacity of the areas of bodies on dark paper."""

SAME = 1e-9
"""Distance, in sizes of the mechanism, up to which a stroke does not change its shape."""

STILL = "@media(prefers-reduced-motion:reduce){.moving{display:none}.still{display:inline}}"
"""Shows the first frame alone to those who do not want motion."""


@dataclass(frozen=True, slots=True)
class Timing:
    """When the frames of a motion are shown."""

    seconds: float  # playing time
    parts: Array  # shape (F,): the part of it at which each frame is shown, from 0 to 1

    @property
    def attributes(self) -> dict[str, str]:
        """The attributes of an animation."""
        uneven = np.abs(self.parts - np.linspace(0, 1, self.parts.size)).max() > 1e-6
        times = ";".join(f"{part:.5g}" for part in self.parts) if uneven else ""
        return {"dur": f"{self.seconds:g}s", "repeatCount": "indefinite", "keyTimes": times}


@dataclass(frozen=True, slots=True)
class _Motion:
    """How a group of strokes moves: shifts [px], shape (F, 2), and turns [degrees], shape (F,)."""

    shift: Array
    turn: Array | None

    @property
    def start(self) -> str:
        """The transform of the first frame."""
        turned = "" if self.turn is None else f" rotate({_number(self.turn[0])})"
        return f"translate({_pair(self.shift[0])}){turned}"

    def animation(self, clock: Mapping[str, str]) -> str:
        """Return the elements that move a group by a clock; without one, nothing."""
        if not clock:
            return ""
        elements = _transform("translate", "replace", map(_pair, self.shift), clock)
        if self.turn is not None:
            elements += _transform("rotate", "sum", map(_number, self.turn), clock)
        return elements


class _Sheet:
    """From the lengths of a model to pixels, y downwards."""

    def __init__(self, drawn: Drawing, q: Array, paths: Iterable[Array]) -> None:
        left, right, low, high = drawn.extent(q)
        room = 2 * drawn.size  # stands and arrows reach beyond the extent
        corners = [np.array(((left - room, low - room), (right + room, high + room)))]
        points = np.concatenate([*corners, *paths])
        low_corner, high_corner = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        wide, tall = high_corner - low_corner
        self.scale = float(min(WIDTH / wide, HEIGHT / tall))
        self.width, self.height = self.scale * float(wide), self.scale * float(tall)
        self._corner = np.array((low_corner[0], high_corner[1]))

    def at(self, points: Array) -> Array:
        """Return where points of the ground are."""
        return self.along(points - self._corner)

    def along(self, points: Array) -> Array:
        """Return points of a frame, or directions, as lengths on the sheet."""
        return np.asarray(self.scale * points * (1.0, -1.0), dtype=np.float64)


def as_svg(
    drawn: Drawing,
    q: Array,
    description: str,
    *,
    paths: Sequence[Array] = (),
    timing: Timing | None = None,
    millimetres: float | None = None,
    view: str = "isometric",
) -> str:
    """Return a mechanism as the text of an SVG file.

    Its colours are those of the page, on light and on dark paper; in space on white paper.

    Parameters
    ----------
    q : ndarray, shape (F, n)
        Positions; of several the first is shown where nothing moves.
    paths
        Lines over the mechanism, each of shape (k, 2), in space (k, 3).
    timing
        When the positions are shown; without, the first one is.
    millimetres
        Length of the model's unit where the picture has its true size, in space across the view.
    """
    draw: Callable[..., str] = drawn_by("SVG", drawn.dimension)
    return draw(drawn, q, description, paths, timing, millimetres, view)


def svg_in_plane(
    drawn: Drawing,
    q: Array,
    description: str,
    paths: Sequence[Array],
    timing: Timing | None,
    millimetres: float | None,
    view: str,
) -> str:
    """Return a mechanism in the plane, which has one view; `as_svg` says what is given."""
    sheet = _Sheet(drawn, q, paths)
    unit = sheet.scale * drawn.size
    line = max(1.0, unit / THICK)
    traces = "".join(_trace(k, sheet.at(path), line) for k, path in enumerate(paths))
    frames = q if timing is not None else q[:1]
    size, font = (sheet.width, sheet.height), FONT * unit
    names = names_beside(drawn, lambda place: sheet.at(place.at(frames)), font, size)
    parts = traces.join(_layers(drawn, q[:1], sheet, line, {}, names))
    moving = ""
    if timing is not None and len(q) > 1:
        moving = traces.join(_layers(drawn, q, sheet, line, timing.attributes, names))
    true_size = None if millimetres is None else millimetres / sheet.scale
    paper = _paint("", "paper")
    heading = drawn.name, description
    return document(heading, size, font, paper, (parts, moving), _dark_rules(), true_size)


def document(
    heading: tuple[str, str],
    size: tuple[float, float],
    font: float,
    paper: Mapping[str, str],
    parts: tuple[str, str],
    style: str = "",
    true_size: float | None = None,
) -> str:
    """Return the text of a file: title and description, width and height [px], and its parts.

    `parts` are a picture, and what moves in its place, "" for nothing; `paper` has the attributes
    of the background, `true_size` is the length of a pixel [mm].
    """
    shown, moving = parts
    if moving:
        still = element("g", shown, class_="still", display="none")
        shown = f"{still}\n{element('g', moving, class_='moving')}"
        style += STILL
    wide, tall = map(_number, size)
    if true_size is not None:
        wide, tall = (f"{side * true_size:.7g}mm" for side in size)
    rules = f"{element('style', style)}\n" if style else ""
    title, description = map(escape, heading)
    inside = (
        f'\n<title id="title">{title}</title>\n<desc id="description">{description}</desc>\n'
        f"{rules}{element('rect', width='100%', height='100%', **paper)}\n{shown}\n"
    )
    whole = element(
        "svg", inside, xmlns="http://www.w3.org/2000/svg", viewBox=f"0 0 {_pair(size)}",
        width=wide, height=tall, role="img", aria_labelledby="title description", **ROUND,
        font_family="system-ui,sans-serif", font_size=_number(font),
    )  # fmt: skip
    return f"{whole}\n"


def _layers(
    drawn: Drawing,
    q: Array,
    sheet: _Sheet,
    line: float,
    clock: Mapping[str, str],
    names: Sequence[BesideDot],
) -> tuple[str, str]:
    """Return what is below the paths, and above them: the named points with their names."""
    strokes = _shown(drawn, q)
    below = [_stroke(item, q, sheet, line, clock) for item in strokes if item.stroke.look != DOT]
    above = [_stroke(item, q, sheet, line, clock) for item in strokes if item.stroke.look == DOT]
    for dot, name in zip(drawn.dots, names, strict=True):
        motion = _Motion(sheet.at(dot.place.at(q)), None)
        above.append((motion, name.at(np.zeros(2), 2 * line, _paint)))
    return _together(below, clock), _together(above, clock)


def _together(strokes: Iterable[tuple[_Motion | None, str]], clock: Mapping[str, str]) -> str:
    """Return elements; neighbours that move together are one group."""
    found = []
    for (start, moves), items in itertools.groupby(strokes, lambda item: _group(item[0], clock)):
        text = "".join(text for _, text in items)
        found.append(f"{element('g', moves + text, transform=start)}\n" if start else text)
    return "".join(found)


def _group(motion: _Motion | None, clock: Mapping[str, str]) -> tuple[str, str]:
    """Return the transform of a group, and the elements that move it."""
    return (motion.start, motion.animation(clock)) if motion else ("", "")


def _shown(drawn: Drawing, q: Array) -> list[Polyline]:
    return [
        item
        for item in polylines(drawn)
        if item.stroke.look != "gap"
        or max(np.ptp(item.at(row), axis=0).max() for row in q) > 1e-3 * drawn.size
    ]


def _stroke(
    item: Polyline, q: Array, sheet: _Sheet, line: float, clock: Mapping[str, str]
) -> tuple[_Motion | None, str]:
    points = [item.at(row) for row in q]
    moved = _rigid(item, points, q, sheet)
    if moved is not None:
        motion, own = moved
        return motion, _path(outline(own, item.is_area, _pair), item, line)
    shapes = [outline(sheet.at(shape), item.is_area, _pair) for shape in points]
    values = element("animate", attributeName="d", values=";".join(shapes), **clock)
    return None, _path(shapes[0], item, line, values)


def _rigid(
    item: Polyline, points: Sequence[Array], q: Array, sheet: _Sheet
) -> tuple[_Motion | None, Array] | None:
    """Return the rigid motion of a stroke and its points [px] in it; None where it has none."""
    if len({shape.shape for shape in points}) > 1:
        return None
    found = np.stack(points)
    tolerance = SAME * np.nanmax(np.abs(found)) + SAME * item.size

    def is_constant(shape: Array) -> bool:
        return bool(np.nanmax(np.abs(shape - shape[0])) <= tolerance)

    if is_constant(found):
        return None, sheet.at(found[0])
    for frame in sorted({item.frame, *moves_with(item.mark)} - {GROUND_FRAME}):
        origin, turn = q[:, frame.columns[:2]], q[:, frame.columns[2]]
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        x, y = np.moveaxis(found - origin[:, None], -1, 0)
        local = np.stack((c * x + s * y, c * y - s * x), axis=-1)
        if is_constant(local):
            return _Motion(sheet.at(origin), -np.degrees(turn)), sheet.along(local[0])
    middle = np.nanmean(found, axis=1)
    apart = found - middle[:, None]
    return (_Motion(sheet.at(middle), None), sheet.along(apart[0])) if is_constant(apart) else None


def _path(shape: str, item: Polyline, line: float, inside: str = "") -> str:
    look = item.look
    hue = "quiet" if item.frame == GROUND_FRAME else f"body{item.frame.index % len(HUES['light'])}"
    fill = (look.face or f"pale-{hue}") if item.is_area else ""
    lengths = (_number(line * float(part)) for part in DASHES.get(look.dash, "").split())
    drawn = element(
        "path",
        inside,
        d=shape,
        **_paint((look.line or hue) if look.width else "", fill),
        stroke_width=_number(line * look.width) if look.width else "",
        stroke_dasharray=" ".join(lengths),
    )
    return f"{drawn}\n"


def _trace(index: int, points: Array, line: float) -> str:
    """Return the elements of a path: in a colour of its own, on a rim of paper."""
    shape, hue = outline(points, False, _pair), f"body{(index + 4) % len(HUES['light'])}"
    widths = (("paper", 3), (hue, 1.5))
    return "".join(
        element("path", d=shape, **_paint(colour, ""), stroke_width=_number(width * line)) + "\n"
        for colour, width in widths
    )


@dataclass(frozen=True, slots=True)
class BesideDot:
    """The name of a point, and the way from the point to its middle [px], y downwards."""

    name: str
    shift: Array
    font: float

    def at(self, place: Array, rim: float, paint: Callable[[str, str], Mapping[str, str]]) -> str:
        """Return its elements, on a rim of paper of a width, and where it is far a leader line.

        `paint` returns the attributes of a stroke and a fill.
        """
        middle = place + self.shift
        line = leader(place, middle, box_of(self.name, self.font))
        led = ""
        if line is not None:
            shape, width = outline(line.tolist(), False, _pair), _number(rim / 3)
            led = element("path", d=shape, **paint("ink", ""), stroke_width=width) + "\n"
        x, y = map(_number, (middle[0], middle[1] + BASE * self.font))
        colours = paint("paper", "ink")
        stroke = {"stroke_width": _number(rim), "paint_order": "stroke"}
        written = label(self.name, x=x, y=y, text_anchor="middle", **colours, **stroke)
        return f"{led}{written}\n"


def names_beside(
    drawn: Drawing, seen: Callable[[FramePoint], Array], font: float, size: tuple[float, float]
) -> list[BesideDot]:
    """Return the names of points on a picture of a size, away from joints and from each other.

    `seen` returns where a place is in each frame, shape (F, 2) [px], y downwards.
    """
    names = []
    for dot in drawn.dots:
        box = box_of(dot.name, font)
        names.append(Name(seen(dot.place), box, around(box, font / 4) * (1, -1)))
    if not names:
        return []
    joints = np.stack([seen(place) for place in drawn.places], axis=1)
    shifts = placed(names, joints, font / 4, np.array(((0.0, 0.0), size)))
    return [BesideDot(dot.name, way, font) for dot, way in zip(drawn.dots, shifts, strict=True)]


def _transform(kind: str, additive: str, values: Iterable[str], clock: Mapping[str, str]) -> str:
    changed = {"attributeName": "transform", "type": kind, "additive": additive}
    return element("animateTransform", **changed, values=";".join(values), **clock)


def _pair(point: Iterable[float]) -> str:
    x, y = point
    return f"{_number(x)} {_number(y)}"


def _number(value: float) -> str:
    """Return a number of pixels or degrees, to 1/100."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


# ---- colours ----


def _paint(stroke: str, fill: str) -> dict[str, str]:
    """Return the attributes of colours by name: those on light paper, and classes for dark."""
    light = {**_palettes()["light"], "": ""}
    names = [f"{kind}-{name}" for kind, name in (("s", stroke), ("f", fill)) if name]
    return {"stroke": light[stroke], "fill": light[fill] or "none", "class_": " ".join(names)}


def _dark_rules() -> str:
    rules = "".join(
        f".s-{name}{{stroke:{colour}}}.f-{name}{{fill:{colour}}}"
        for name, colour in _palettes()["dark"].items()
    )
    return f"@media(prefers-color-scheme:dark){{{rules}}}"


@cache
def _palettes() -> Mapping[str, Mapping[str, str]]:
    """Return the colours on light and on dark paper by name: those of the page's style sheet."""
    found = re.findall(
        r"--(\w+): light-dark\((#\w+), (#\w+)\);", read("view/style.css").partition("}")[0]
    )
    palettes = {scheme: {name: pair[k] for name, *pair in found} for k, scheme in enumerate(HUES)}
    for scheme, part in (("light", FILL), ("dark", DARK_FILL)):
        palette = palettes[scheme]
        hues = {f"body{k}": hue for k, hue in enumerate(HUES[scheme])}
        hues["quiet"] = palette["quiet"]
        palette |= hues
        for name, hue in hues.items():
            palette[f"pale-{name}"] = mixed(hue, part, palette["paper"])
    return palettes
