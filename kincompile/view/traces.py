"""What animations and drawings of a motion show: the system, its paths, and words for both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.model.mechanism import system_of
from kincompile.model.system import model_of
from kincompile.names import listed, suggestion
from kincompile.runtime.inputs import names_of
from kincompile.runtime.results.solution import Solution, require_solution
from kincompile.view.marks import FramePoint
from kincompile.view.mechanism_plot import require_bodies

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.drawing import Drawing


def moving_system(
    solution: Solution, model: Mechanism | ConstraintSystem | None, what: str
) -> ConstraintSystem:
    """Return the system that moves in a solution, after checking that it can be shown.

    Raises
    ------
    InputError
        If there is no position, no body, or the model is another one.
    """
    require_solution(solution)
    name = solution.name
    solution.require_one_motion(what, "solve with one of the parameter sets")
    if not solution.good.any():
        raise InputError(f"{name} has no position that could be shown. {solution.message}")
    found = model_of(solution.module) if model is None else system_of(model)
    if found is None:
        raise InputError(
            f"the shapes of {name} are unknown, because its module was loaded from a file; give "
            "its mechanism too, as model=m"
        )
    names = tuple(item.name for item in found.coordinates)
    if names != solution.coordinates:
        raise InputError(
            f"{found.name} is not the model of this solution of {name}: the coordinates differ"
        )
    return require_bodies(found)


def traced_places(drawn: Drawing, names: Iterable[str] | None) -> list[FramePoint]:
    """Return the points to be traced: by name, or the named points of the model.

    Raises
    ------
    InputError
        If nothing has such a name.
    """
    frames = zip(drawn.bodies, drawn.frames, strict=True)
    places = {body: FramePoint(frame, (0.0, 0.0)) for body, frame in frames}
    places |= {joint.name: joint.place for joint in drawn.joints if joint.place is not None}
    dots = {dot.name: dot.place for dot in drawn.dots}
    places |= dots
    for name in (chosen := list(dots if names is None else names_of(names, "trace"))):
        if name not in places:
            raise InputError(
                f"{drawn.name} has nothing called {name!r} to trace{suggestion(name, places)}; "
                f"bodies, constraints and points are: {listed(places)}"
            )
    return [places[name] for name in chosen]


def described(drawn: Drawing, when: str) -> str:
    """Return a sentence about a drawing, for those who cannot see it."""
    bodies = "1 body" if len(drawn.bodies) == 1 else f"{len(drawn.bodies)} bodies"
    joints = listed(joint.name for joint in drawn.joints)
    return f"{drawn.name} {when}: {bodies}, {listed(drawn.bodies)}; constraints {joints}."
