"""A joint's derivation in vectors: abbreviations, blocks of Phi_q, the rules that fired."""

from __future__ import annotations

from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation, TurnedFrame
from kincompile.derive.partials import partials
from kincompile.derive.rules import Rule, along
from kincompile.report import formulas as fm
from kincompile.report.document import Math

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.calculus.template import Template
    from kincompile.derive.rules import Step
    from kincompile.report.document import Runs

_PHI = ex.Symbol("phi")
_A, _B = fm.Glyph("A"), fm.Glyph("B")
_TURNING = ex.RotationSlope(
    EulerRotation(ex.VectorSymbol("p", 4)), ex.VectorSymbol("omega", 3), is_small=True
)
"""A omega'~."""

RULES: Mapping[Rule, Runs] = {
    Rule.SUM: ("sum rule",),
    Rule.PRODUCT: ("product rule",),
    Rule.CHAIN: ("chain rule",),
    Rule.A_TO_B: (Math(fm.Equated((fm.DerivativeSymbol(_A, _PHI, "d"), _B))),),
    Rule.B_TO_A: (Math(fm.Equated((fm.DerivativeSymbol(_B, _PHI, "d"), fm.Joined(("-", _A))))),),
    Rule.A_TO_SLOPE: ("d(A s) = B(p, s) dp",),
    Rule.SLOPE: ("d(B(p, s) w) = B(w, s) dp",),
    Rule.TURN: (Math(fm.Equated((fm.Glyph("A", dots=1), _TURNING))),),
    Rule.ANGLE: ("d atan2(s, c) = (c ds - s dc)/(s² + c²)",),
    Rule.DRIVER: ("driver, a function of ", Math(ex.Symbol("t"))),
    Rule.PROFILE: ("profile, chain rule",),
}
"""The rules worth a line; that a constant has no derivative is not."""


def parts(expression: Any) -> Iterator[ex.Expression]:
    """Yield an expression and everything it is made of, outside in."""
    yield expression
    match expression:
        case ex.Sum(items) | ex.VectorSum(items) | ex.Product(items):
            inner: tuple[ex.Expression, ...] = items
        case (
            ex.Dot(left, right)
            | ex.Scaled(left, right)
            | ex.Angle(left, right)
            | ex.Cross(left, right)
        ):
            inner = (left, right)
        case ex.Power(base, _) | ex.Circular(_, base):
            inner = (base,)
        case ex.Rotated(rotation, vector):
            inner = (*rotation.coordinates, vector)
        case other:
            inner = (other.vector,) if hasattr(other, "vector") else ()
    for item in inner:
        yield from parts(item)


def abbreviations(template: Template) -> dict[ex.Expression, fm.Glyph]:
    """Name what occurs again and again: the distance vector d, the angle of a gear, their rates."""
    found = [item for Phi in template.Phi for item in parts(Phi)]
    separations = list(dict.fromkeys(v for item in found for v in _separations(item)))
    q_dot = template.motion
    names: dict[ex.Expression, fm.Glyph] = {}
    for k, vector in enumerate(separations, 1):
        index = str(k) if len(separations) > 1 else ""
        names[vector] = fm.Glyph("d", index)
        names[along(vector, q_dot)] = fm.Glyph("d", index, dots=1)
    for item in found:
        match item:
            case ex.Rotated(PlaneRotation(angle), ex.Basis()) if not isinstance(angle, ex.Symbol):
                names[angle] = fm.Glyph("vartheta", bold=False)
                names[along(angle, q_dot)] = fm.Glyph("vartheta", dots=1, bold=False)
    return names


def _separations(expression: ex.Expression) -> Iterator[ex.Vector]:
    """Yield the sums with a position in them that a scalar product has as a factor."""
    for side in (expression.left, expression.right) if isinstance(expression, ex.Dot) else ():
        terms = side.terms if isinstance(side, ex.VectorSum) else ()
        if any(isinstance(term, ex.VectorSymbol) for term in terms):
            yield side


def is_zero(entry: ex.Expression) -> bool:
    """Return whether an expression is zero as it stands."""
    return entry in (ex.ZERO, ex.ZERO_VECTOR)


def block_entry(entry: ex.Expression, coordinate: ex.Expression, Phi: ex.Expression) -> fm.Formula:
    """Return an entry of Phi_q as the textbook writes it: k I, a row u^T, or the entry itself."""
    if is_zero(entry):
        return fm.ZERO_BLOCK if isinstance(coordinate, ex.Vector) else entry
    if isinstance(coordinate, ex.Symbol):
        return entry
    if isinstance(Phi, ex.Vector):
        return _times_identity(entry) if isinstance(entry, ex.Scalar) else entry
    assert isinstance(entry, ex.Vector)
    return fm.Transposed(entry)


def _times_identity(factor: ex.Scalar) -> fm.Formula:
    if factor == ex.ONE:
        return fm.IDENTITY
    return fm.Joined(("-", fm.IDENTITY)) if factor == -ex.ONE else fm.Joined((factor, fm.IDENTITY))


def block_columns(template: Template) -> list[tuple[fm.Formula, slice]]:
    """Return what each block of Phi_q is a derivative by, q_i or alpha_i, and its coordinates."""
    ends = accumulate((len(item.coordinates) for item in template.owners), initial=0)
    names: list[fm.Formula] = [
        fm.Joined((frame.r, ",", frame.coordinates[1]))
        if isinstance(frame, TurnedFrame)
        else fm.Glyph("q", frame.index)
        for frame in template.frames
    ]
    names += [contact.alpha for contact in template.contacts]
    return [(name, slice(*own)) for name, own in zip(names, pairwise(ends), strict=True)]


def block_rows(template: Template, coordinates: slice) -> tuple[tuple[fm.Formula, ...], ...]:
    """Return the block of Phi_q by some coordinates, a row for each row block."""
    return tuple(
        tuple(block_entry(item.entry, item.coordinate, Phi) for item in row[coordinates])
        for Phi, row in zip(template.Phi, partials(template), strict=True)
    )


def telling(steps: Sequence[Step]) -> list[Step]:
    """Return the steps worth showing, each once: those of a rule that gave something."""
    kept = [
        step
        for step in steps
        if step.rule in RULES and not is_zero(step.derivative) and not _is_multiple(step.expression)
    ]
    return list(dict.fromkeys(kept))


def _is_multiple(expression: ex.Expression) -> bool:
    """Return whether an expression is a number times something: no rule worth a line."""
    match expression:
        case ex.Scaled(ex.Number(), _) | ex.Product((ex.Number(), _)):
            return True
    return False


def known_vectors(template: Template) -> list[ex.Vector]:
    """Return the turned points and directions that occur, A_i s_i before B_i s_i."""
    found: dict[ex.Rotated, None] = {}
    for Phi, row in zip(template.Phi, partials(template), strict=True):
        for expression in (Phi, *(partial.entry for partial in row)):
            for item in parts(expression):
                match item:
                    case ex.Rotated(PlaneRotation(ex.Symbol()), ex.VectorSymbol()):
                        found[item] = None
                    case ex.Rotated(EulerRotation(), ex.VectorSymbol(), ()):
                        found[item] = None
    return [*sorted(found, key=lambda item: item.order)]
