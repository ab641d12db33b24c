"""The moving pictures of the README and of the site: `kincompile draw` of the examples."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

import kincompile as kc
from docs.builders.places import EXAMPLES
from docs.builders.space import joints_in_space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES = 48
"""Positions of a thumbnail; a browser draws what is between them."""

TRACES = {"wrecker_boom": ["hook"], "four_bar": ["coupler"]}
"""What leaves a line, where the model names no point."""

THUMBNAILS = (
    "wrecker_boom", "jansen", "four_bar", "shaper", "klann", "double_wishbone", "gear_train",
    "cam_flat_follower", "rack_and_pinion",
)  # fmt: skip
"""The examples that the README shows; the first is its large picture."""


def drawn() -> dict[str, str]:
    """Return the pictures of the README, and of joints in space, by the name of their file."""
    moved = {f"{name}.svg": moving(name) for name in THUMBNAILS}
    return {**moved, "joints_in_space.svg": joints_in_space()}


def moving(name: str) -> str:
    """Return the motion of an example as an SVG that moves; of free equations, as curves."""
    model = kc.read_model(EXAMPLES / f"{name}.toml")
    times = np.linspace(0, float(model.end), FRAMES + 1)
    solution = kc.solve(kc.compile(model), times)
    if isinstance(model, kc.ConstraintSystem):
        return svg_text(solution.plot().figure)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.svg"
        kc.animate(solution, path, seconds=6, trace=TRACES.get(name))
        return path.read_text(encoding="utf-8")


def svg_text(figure: Figure) -> str:
    """Return a figure of matplotlib as an SVG, the same each time."""
    text = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "kincompile", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
