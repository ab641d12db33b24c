r"""What a constraint does to its bodies and its driver, derived from the work of its multipliers.

The constraint forces do the virtual work :math:`-\lambda^T \delta\Phi`. Moved along an axis, a body
shows the force on it; turned about a point of its own, the moment about that point. A driver
C(t) does the work :math:`\lambda^T \Phi_C \delta C`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.calculus.symbols import C, PlaneFrame
from kincompile.calculus.template import Template
from kincompile.derive.rules import along

if TYPE_CHECKING:
    from kincompile.calculus.symbols import Frame
    from kincompile.derive.rules import Direction


@dataclass(frozen=True, slots=True)
class Reaction:
    """What a constraint does to one of its bodies."""

    force: tuple[ex.Scalar, ...]  # components along the fixed axes
    # About the joint's point of this body, or its origin where it has none; in space components
    # along the fixed axes.
    moment: tuple[ex.Scalar, ...]


@dataclass(frozen=True, slots=True)
class Reactions:
    """Reactions of a constraint type, in its multipliers and its own symbols."""

    bodies: tuple[Reaction, ...]  # of each of its bodies
    # What the driver does, along its value C: a force or a torque; zero where there is no C.
    drive: ex.Scalar
    # The force on the last body along the joint's axis and, in the plane, across it; in space along
    # the axis h and along f and g, then the moment so; none without an axis.
    along_axis: tuple[ex.Scalar, ...]


def multipliers(template: Template, size: int) -> tuple[ex.Symbol | ex.VectorSymbol, ...]:
    """Return the multipliers of the row blocks of a type with vectors of `size` components."""
    return tuple(
        ex.VectorSymbol(f"lambda_{k}", size)
        if isinstance(Phi, ex.Vector)
        else ex.Symbol(f"lambda_{k}")
        for k, Phi in enumerate(template.Phi)
    )


@cache
def placed(frame: Frame) -> Template:
    """Return a template whose multipliers are the generalised forces on a body."""
    kept: list[ex.Scalar] = []
    for item in frame.coordinates:
        if isinstance(item, ex.VectorSymbol):
            kept += (-ex.dot(ex.Basis(k, item.size), item) for k in range(item.size))
        else:
            kept.append(-item)
    return Template("Placed", (frame,), (), tuple(kept))


@cache
def derive_reactions(
    template: Template, points: tuple[str | None, ...], axis: tuple[str, str] | None
) -> Reactions:
    """Derive the reactions of a constraint type.

    Parameters
    ----------
    points
        The symbol of the joint's point on each of its bodies.
    axis
        The symbol of the joint's axis, and the index of the body that it is fixed in.
    """
    bodies = tuple(
        _reaction(template, frame, point)
        for frame, point in zip(template.frames, points, strict=True)
    )
    by_axis = _along_axis(template, axis, points[-1])
    return Reactions(bodies, -_work(template, {C: ex.ONE}), by_axis)


def _along_axis(
    template: Template, axis: tuple[str, str] | None, point: str | None
) -> tuple[ex.Scalar, ...]:
    """Return the work for displacements of the last body along the axis and across it.

    In space also for turns about these, where they are fixed in that body.
    """
    if axis is None:
        return ()
    symbol, index = axis
    (frame,) = (item for item in template.frames if item.index == index)
    v, last = ex.VectorSymbol(symbol, frame.size), template.frames[-1]
    unit = ex.Norm(v) ** -1 * frame.A(v)
    if isinstance(frame, PlaneFrame):
        return tuple(_work(template, {last.r: way}) for way in (unit, ex.perpendicular(unit)))
    if not symbol.startswith("h_"):
        return (_work(template, {last.r: unit}),)
    triad = [ex.VectorSymbol(f"{letter}_{index}", frame.size) for letter in "hfg"]
    force = [_work(template, {last.r: frame.A(item)}) for item in triad]
    turns = [dict([frame.turned_about(item)]) for item in triad] if frame == last else []
    return (*force, *(_work(template, _about(last, point, turn)) for turn in turns))


def _reaction(template: Template, frame: Frame, point: str | None) -> Reaction:
    force = (_work(template, {frame.r: ex.Basis(k, frame.size)}) for k in range(frame.size))
    moment = tuple(_work(template, _about(frame, point, turn)) for turn in frame.turns)
    return Reaction(tuple(force), frame.along_fixed_axes(moment))


def _about(frame: Frame, point: str | None, turn: Direction) -> Direction:
    """Return a turn of a body about one of its points, without one about its origin."""
    if point is None:
        return turn
    return {**turn, frame.r: -along(frame.A(ex.VectorSymbol(point, frame.size)), turn)}


def _work(template: Template, direction: Direction) -> ex.Scalar:
    size = template.frames[0].size
    terms: list[ex.Scalar] = [ex.ZERO]
    for Phi, factor in zip(template.Phi, multipliers(template, size), strict=True):
        change = along(Phi, direction)
        if isinstance(change, ex.Vector):
            assert isinstance(factor, ex.Vector)
            terms.append(-ex.dot(factor, change))
        else:
            assert isinstance(factor, ex.Scalar)
            terms.append(-(factor * change))
    return ex.sum_of(tuple(terms))
