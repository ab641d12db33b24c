"""The moving pictures of the README and of the site: `kincompile draw` of the examples."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

import kincompile as kc
from docs.builders.badges import badges
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
"""The examples that the README and examples/README.md show; the first is the large picture."""

STILL = ("double_wishbone_with_steering", "delta_robot", "stewart_gough")
"""Those in space: a picture of solids at 48 times would take megabytes."""


def drawn() -> dict[str, str]:
    """Return the pictures of the README, and of joints in space, by the name of their file."""
    moved = {f"{name}.svg": moving(name) for name in THUMBNAILS}
    stands = {f"{name}.svg": still(name) for name in STILL}
    return {**moved, **stands, "joints_in_space.svg": joints_in_space(), "badges.svg": badges()}


def moving(name: str) -> str:
    """Return the motion of an example as an SVG that moves; of free equations, as curves."""
    model, solution = solved(name)
    if isinstance(model, kc.ConstraintSystem):
        return svg_text(solution.plot().figure)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.svg"
        kc.animate(solution, path, seconds=6, trace=TRACES.get(name))
        return path.read_text(encoding="utf-8")


def still(name: str) -> str:
    """Return an example in space at its start, with the paths of its points, as an SVG."""
    with tempfile.TemporaryDirectory() as folder:
        _, solution = solved(f"space/{name}")
        path = Path(folder) / "start.svg"
        kc.draw(solution, path)
        return path.read_text(encoding="utf-8")


def solved(name: str) -> tuple[kc.Mechanism | kc.ConstraintSystem, kc.Solution]:
    """Return an example and its motion."""
    model = kc.read_model(EXAMPLES / f"{name}.toml")
    return model, kc.solve(kc.compile(model), np.linspace(0, float(model.end), FRAMES + 1))


def svg_text(figure: Figure) -> str:
    """Return a figure of matplotlib as an SVG, the same each time."""
    text = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "kincompile", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
