"""Scripts for the panel of Newton's method: the functions of the mechanism, and the method."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kincompile import criteria
from kincompile.compiler import emit
from kincompile.errors import UnsupportedError
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

MOST_COORDINATES = 60
"""Coordinates up to which the panel shows every entry of Phi_q."""

CRITERIA = ("TOLERANCE", "RESIDUAL_FACTOR", "ROUNDING", "MAX_ITERATIONS", "NO_SIZE")
"""The numbers of `criteria` that the method of the page uses."""


def newton_method() -> str:
    """Return the script of Newton's method, with the criteria of the runtime."""
    return fill("view/newton.js.jinja", {name: getattr(criteria, name) for name in CRITERIA})


def newton_script(model: Mechanism | ConstraintSystem) -> str:
    """Return the script that declares `emitted`: the functions, or `reason`, why there are none."""
    count = len(model.system().coordinates)
    if count > MOST_COORDINATES:
        return _without(f"{count} coordinates are too many to show Newton's method step by step.")
    try:
        emitted = emit(model, "javascript")
    except UnsupportedError as error:
        return _without(f"Newton's method cannot be shown: {error}")
    if emitted.unsolvable:
        return _without(f"Newton's method cannot be shown: {emitted.unsolvable}")
    # In a function of its own, so that no name of a mechanism meets one of the page.
    return (
        f"const emitted = (() => {{\nconst module = {{ exports: {{}} }};\n{emitted.source}"
        "return module.exports;\n})();\n"
    )


def _without(reason: str) -> str:
    return f"const emitted = {json.dumps({'reason': reason})};\n".replace("<", "\\u003c")
