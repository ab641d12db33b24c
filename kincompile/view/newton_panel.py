"""Scripts for the panel of Newton's method: the functions of the mechanism, and the method."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

import kincompile.compiler as compiler
from kincompile import criteria
from kincompile.errors import UnsupportedError
from kincompile.runtime.problem import problem
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from types import ModuleType

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

MOST_COORDINATES = 60
"""Coordinates up to which the panel shows every entry of Phi_q."""

CRITERIA = ("TOLERANCE", "RESIDUAL_FACTOR", "ROUNDING", "MAX_ITERATIONS")
"""The numbers of `criteria` that the method of the page uses."""


def newton_method() -> str:
    """Return the script of Newton's method, with the criteria of the runtime."""
    return fill("view/newton.js.jinja", {name: getattr(criteria, name) for name in CRITERIA})


def newton_script(model: Mechanism | ConstraintSystem, module: ModuleType | None = None) -> str:
    """Return the script that declares `emitted`: the functions, or `reason`, why there are none.

    The module is what the model was compiled to, if it was.
    """
    count = len(model.system().coordinates)
    if count > MOST_COORDINATES:
        return _without(f"{count} coordinates are too many to show Newton's method step by step.")
    try:
        emitted = compiler.emit(model, "javascript")
    except UnsupportedError as error:
        return _without(f"Newton's method cannot be shown: {error}")
    if emitted.unsolvable:
        return _without(f"Newton's method cannot be shown: {emitted.unsolvable}")
    if module is None:
        module = compiler.compile(model)
    with np.errstate(all="ignore"):
        size = problem(module, module.DEFAULTS, module.GUESS, 0.0).size
    # In a function of its own, so that no name of a mechanism meets one of the page.
    return (
        f"const emitted = (() => {{\nconst module = {{ exports: {{}} }};\n{emitted.source}"
        f"return {{ ...module.exports, SIZE: {size!r} }};\n}})();\n"
    )


def _without(reason: str) -> str:
    return f"const emitted = {json.dumps({'reason': reason})};\n".replace("<", "\\u003c")
