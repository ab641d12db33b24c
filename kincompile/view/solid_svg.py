"""A mechanism in space as SVG, on white paper: at a position, or in motion, frame after frame.

Nothing of it moves rigidly on the picture, so that every frame has its own paths.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.picture import svg_path
from kincompile.report.svg import element, label
from kincompile.view.picture import Scale
from kincompile.view.shapes import INKS
from kincompile.view.solid_picture import Camera, seen_paths, trace
from kincompile.view.svg import HEIGHT, WIDTH, document

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array
    from kincompile.view.svg import Timing

NAME = 15
"""Height of names [px]."""


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
    pictures = [
        "\n".join(
            svg_path(path, scale.height)
            for path in (*(replace(item, points=scale.at(item.points)) for item in frame), *lines)
        )
        + "".join(_name(dot.name, camera.seen(dot.place.at(row)), scale) for dot in drawn.dots)
        for frame, row in zip(frames, shown, strict=True)
    ]
    moving = "".join(_frames(pictures, timing)) if timing and len(pictures) > 1 else ""
    size, paper = (scale.width, scale.height), {"fill": INKS["paper"]}
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


def _name(name: str, seen: Array, scale: Scale) -> str:
    """Return the element of a name, beside its point where there is room, on a rim of paper."""
    place = scale.at(np.asarray(seen)[:2])
    is_right = place[0] + NAME * len(name) < scale.width
    x, y = place[0] + (NAME / 2 if is_right else -NAME / 2), scale.height - place[1] - NAME / 2
    written = label(
        name, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor="" if is_right else "end", fill=INKS["ink"],
        stroke=INKS["paper"], stroke_width=3, paint_order="stroke",
    )  # fmt: skip
    return f"{written}\n"
