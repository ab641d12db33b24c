"""Scripts for what a page computes itself: the functions of the mechanism, and its solver."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import kincompile.compiler as compiler
from kincompile.errors import UnsupportedError

if TYPE_CHECKING:
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

MOST_COORDINATES = 150
"""Coordinates up to which a page solves the mechanism itself."""


def solver_script(model: Mechanism | ConstraintSystem) -> str:
    """Return the script that declares `emitted`: the module, or `reason`, why there is none."""
    count = len(model.system().coordinates)
    if count > MOST_COORDINATES:
        return _without(f"{count} coordinates are too many to solve for in a page.")
    try:
        emitted = compiler.emit(model, "javascript")
    except UnsupportedError as error:
        return _without(f"This page cannot solve the mechanism: {error}")
    if emitted.unsolvable:
        return _without(f"This page cannot solve the mechanism: {emitted.unsolvable}")
    # In a function of its own, so that no name of a mechanism meets one of the page.
    return (
        f"const emitted = (() => {{\nconst module = {{ exports: {{}} }};\n{emitted.source}"
        "return module.exports;\n})();\n"
    )


def _without(reason: str) -> str:
    return f"const emitted = {json.dumps({'reason': reason})};\n".replace("<", "\\u003c")
