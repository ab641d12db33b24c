"""A mechanism in space as SVG, on white paper: at a position, or in motion, frame after frame.

Nothing of it moves rigidly on the picture, so that every frame has its own paths.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.picture import svg_path
from kincompile.report.svg import element
from kincompile.view.picture import Scale
from kincompile.view.shapes import INKS
from kincompile.view.solid_picture import Camera, seen_paths, trace
from kincompile.view.svg import HEIGHT, WIDTH, document, names_beside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, FramePoint
    from kincompile.view.svg import Timing

NAME, RIM = 15.0, 3.0
"""Height of names, and width of the rim of paper around them [px]."""


def svg_in_space(
    drawn: Drawing,
    q: Array,
    description: str,
    paths: Sequence[Array],
    timing: Timing | None,
    millimetres: float | None,
    view: str,
) -> str:
    """Return a mechanism in space as the text of an SVG file; `as_svg` says what is given."""
    camera = Camera.named(view)
    shown = q if timing is not None else q[:1]
    frames = [seen_paths(drawn, row, camera) for row in shown]
    traces = [camera.seen(path)[:, :2] for path in paths]
    scale = Scale([*(path.points for frame in frames for path in frame), *traces], (WIDTH, HEIGHT))
    lines = [path for k, points in enumerate(traces) for path in trace(k, scale.at(points))]
    size, paper = (scale.width, scale.height), {"fill": INKS["paper"]}

    def at(place: FramePoint, positions: Array = shown) -> Array:
        x, y = scale.at(camera.seen(place.at(positions))[..., :2]).T
        return np.stack((x, scale.height - y), axis=-1)

    names = [*zip(drawn.dots, names_beside(drawn, at, NAME, size), strict=True)]
    pictures = [
        "\n".join(
            svg_path(path, scale.height)
            for path in (*(replace(item, points=scale.at(item.points)) for item in frame), *lines)
        )
        + "".join(name.at(at(dot.place, row), RIM, _paint) for dot, name in names)
        for frame, row in zip(frames, shown, strict=True)
    ]
    moving = "".join(_frames(pictures, timing)) if timing and len(pictures) > 1 else ""
    true_size = None if millimetres is None else millimetres / scale.factor
    heading = drawn.name, description
    return document(heading, size, NAME, paper, (pictures[0], moving), true_size=true_size)


def _frames(pictures: Sequence[str], timing: Timing) -> list[str]:
    """Return groups of which one is shown at a time."""
    ends = [*timing.parts[1:].tolist(), 1.0]
    clock = {"dur": f"{timing.seconds:g}s", "repeatCount": "indefinite"}
    changes = (
        element(
            "animate", attributeName="display", calcMode="discrete", values="none;inline;none",
            keyTimes=f"0;{start:.4g};{end:.4g}", **clock,
        )
        for start, end in zip(timing.parts.tolist(), ends, strict=True)
    )  # fmt: skip
    return [
        element("g", f"{change}{picture}", display="none") + "\n"
        for change, picture in zip(changes, pictures, strict=True)
    ]


def _paint(stroke: str, fill: str) -> dict[str, str]:
    """Return the attributes of colours by name, on white paper alone."""
    return {"stroke": INKS.get(stroke, ""), "fill": INKS.get(fill, "none")}
