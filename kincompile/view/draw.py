"""`draw`: a mechanism at one time of its motion as a file: SVG for slides, DXF for CAD."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError
from kincompile.names import METRES, listed
from kincompile.view.drawing import drawing
from kincompile.view.dxf import as_dxf
from kincompile.view.svg import as_svg
from kincompile.view.traces import described, moving_system, traced_places
from kincompile.writing import require_writable, write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.view.drawing import Drawing

ENDINGS = (".svg", ".dxf")
"""Endings of the files that are written."""

STANDARD = ("isometric", "front", "side", "top")
"""Views of a mechanism in space."""

SAME_TIME = 1e-9
"""Difference, in durations of the motion, up to which two times are one."""


def draw(
    solution: Solution,
    path: str | os.PathLike[str],
    t: float | None = None,
    *,
    model: Mechanism | ConstraintSystem | None = None,
    trace: Iterable[str] | None = None,
    true_size: bool = False,
    view: str | None = None,
) -> Path:
    """Write a drawing of a mechanism at one time of its motion.

    Parameters
    ----------
    solution
        The motion of one set of parameters.
    path
        File to write, whole or not at all: ``.svg``, or ``.dxf``, in the unit of the model with a
        layer for each body, the ground, the joints and the paths.
    t
        One of the times of the solution; without, the first that has a position.
    model
        The mechanism; needed only for a solution of a module that was loaded from a file.
    trace
        Names of points, bodies and constraints: points, origins and places whose paths are drawn.
        Without, those of the points of the model are.
    true_size
        Whether an SVG has the size of the mechanism, where it otherwise fits a screen.
    view : {"isometric", "front", "side", "top"}, optional
        From where an SVG shows a mechanism in space: isometric by default, along y, against x, or
        against z.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        If there is nothing to show at that time, or the file cannot be written.
    UnsupportedError
        If ezdxf, which DXF needs, is not installed.
    """
    file = Path(path)
    if file.suffix.lower() not in ENDINGS:
        raise InputError(f"cannot write {path}: end its name in {' or '.join(ENDINGS)}")
    require_writable(file)
    system = moving_system(solution, model, "a drawing shows")
    row = row_at(solution, t)
    shapes = drawing(system, solution.parameters, solution.q[solution.good])
    if view is not None:
        _require_view(shapes, view)
    paths = [place.at(solution.q) for place in traced_places(shapes, trace)]
    if file.suffix.lower() == ".dxf":
        text = as_dxf(shapes, solution.q[row], system.length_unit, paths)
    else:
        size = millimetres(system) if true_size else None
        description = described(shapes, f"at t = {solution.t[row]:g} s")
        seen = view or STANDARD[0]
        q = solution.q[row : row + 1]
        text = as_svg(shapes, q, description, paths=paths, millimetres=size, view=seen)
    return write_atomically(file, text)


def _require_view(shapes: Drawing, view: str) -> None:
    """Check that a mechanism can be seen from somewhere."""
    if not shapes.is_spatial:
        raise InputError(f"{shapes.name} moves in a plane, which has one view: leave out view")
    if view not in STANDARD:
        raise InputError(f"there is no view {view!r}; views are {listed(STANDARD)}")


def row_at(solution: Solution, t: float | None) -> int:
    """Return the index of a time of a motion, where there is a position.

    Raises
    ------
    InputError
        If the motion has no such time, or no position there.
    """
    times = solution.t
    if t is None:
        return int(np.flatnonzero(solution.good)[0])
    row = int(np.abs(times - t).argmin())
    if not abs(times[row] - t) <= SAME_TIME * (float(np.ptp(times)) or 1.0):
        raise InputError(
            f"the motion of {solution.name} is solved from t = {times.min():g} to "
            f"{times.max():g}, and t = {t:g} is not among its {times.size} times; the nearest is "
            f"{times[row]:g}: give that one, or solve for times with t = {t:g} among them"
        )
    if not solution.good[row]:
        raise InputError(f"{solution.name} has no position at t = {t:g}. {solution.message}")
    return row


def millimetres(system: ConstraintSystem) -> float:
    """Return the size of a model's unit of length [mm].

    Raises
    ------
    InputError
        If it is no known unit.
    """
    if system.length_unit not in METRES:
        raise InputError(
            f"the unit of length of {system.name} is {system.length_unit!r}: a true size needs one "
            f"of {listed(METRES)}"
        )
    return 1000 * METRES[system.length_unit]
