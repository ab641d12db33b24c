"""Other forms of the same constraint: other equations that hold where the generated ones hold.

An author's Phi is right if it vanishes where the constraint holds, near the motion, and its rows of
Phi_q span the generated ones there. What Phi_q, nu and gamma must then be follows from that Phi: by
the compiler's own differentiation of formulas, by differences of functions. Where there is no Phi,
a Phi_q whose rows are gradients and span the generated ones is that of some such Phi.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Expression, Rotated, Vector, dot
from kincompile.calculus.space import EulerRotation
from kincompile.checker.agreement import ON_MANIFOLD
from kincompile.checker.formula_faults import everywhere
from kincompile.checker.reference import QUANTITIES, ConstraintBlock, Reference
from kincompile.checker.states import Array, States
from kincompile.checker.vectors import joint_values, with_roles_exchanged
from kincompile.errors import KincompileError
from kincompile.model.absolute import AbsoluteDistance
from kincompile.model.relative import Distance
from kincompile.model.resolve import Joint
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.model.system import ConstraintSystem

if TYPE_CHECKING:
    from kincompile.checker.given_forms import Subject
    from kincompile.checker.written import Written

ACCURACY = 1e-6
"""Relative accuracy of what is differentiated by differences."""
STEP = 2e-3
"""Of the size of a coordinate; the formulas below are of the sixth order."""
FIRST = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
SECOND = ((0, -49 / 36), (1, 3 / 2), (2, -3 / 20), (3, 1 / 90))
INDEPENDENT = 1e-6
"""Smallest singular value of a combination of rows of length 1 that loses none of them."""

ROLES = "roles of i and j"
EQUIVALENT = "equivalent form"
EXTENSION = "another rotation matrix off p^T p = 1"
LENGTH = "the length instead of its square"
ANGLE = "an angle instead of its sine"
OTHER = "another equation that holds where the generated one holds"
COMBINED = "the rows are combinations of the generated ones: only the row spaces of Phi_q agree"

Evaluate = Callable[[States], Mapping[str, Array]]
"""Gives the quantities at states, (N, rows, 1) or (N, rows, n)."""
Function = Callable[[States], Array]
"""Gives one quantity at states."""


@dataclass(frozen=True, eq=False)
class Form:
    """Formulas that stand in the place of some generated rows."""

    # kind, text: the convention that it is; `text` says what is written.
    kind: str
    text: str
    rows: tuple[int, ...]  # the rows of the system, in the order of the form's own
    evaluate: Evaluate  # gives its quantities at states
    joint: Joint | None = None
    write: Callable[[], Reference | None] | None = None  # gives its formulas, where they are known
    sizes: Evaluate | None = None  # gives the sizes of the terms of its quantities at states
    accuracy: float = 0.0  # relative accuracy of its values; 0 where they are exact
    # Whether it is the author's own, from which the author's other formulas have to follow.
    defines: bool = False

    @cached_property
    def formulas(self) -> Reference | None:
        """Its formulas, written out when they are asked for; None where they are not known."""
        return None if self.write is None else self.write()


def exchanged(block: ConstraintBlock, subject: Subject) -> Form | None:
    """Return a constraint with its bodies in each other's roles, where that is the same constraint.

    A relative angle that is driven is not: it would turn the other way.
    """
    return subject.kept(("exchanged", block.rows), lambda: _exchanged(block, subject))


def _exchanged(block: ConstraintBlock, subject: Subject) -> Form | None:
    joint, reference = block.constraint, subject.reference
    other = with_roles_exchanged(joint) if isinstance(joint, Joint) else None
    if other is None:
        return None
    text = "the roles of bodies i and j are exchanged"
    form = _of_joint(ROLES, text, other, block, reference)
    return form if _is_equivalent(form, subject) else None


def _of_joint(
    kind: str, text: str, other: Joint, block: ConstraintBlock, reference: Reference
) -> Form:
    """Return the form of another joint that stands in the place of a constraint."""
    kept = [k for k, name in enumerate(other.columns) if name is not None]
    columns = [reference.columns[name] for name in other.columns if name is not None]

    @lru_cache(maxsize=4)  # by the states themselves, which are compared as objects
    def evaluate(states: States) -> Mapping[str, Array]:
        found = joint_values(other, reference, states)
        values = {name: found.of(name) for name in QUANTITIES}
        Phi_q = np.zeros((len(states), len(block.rows), len(reference.coordinates)))
        Phi_q[:, :, columns] = values["Phi_q"][:, :, kept]
        for body, own in zip(reference.system.bodies, reference.body_columns, strict=True):
            turns = list(own[3:])
            Phi_q[:, :, turns] = reference.in_axes(Phi_q[:, :, turns], body, states)
        return {**values, "Phi_q": Phi_q}

    return Form(kind, text, block.rows, evaluate, joint=other)


def own_form(
    subject: Subject, rows: Sequence[int], Phi: Written, own: Sequence[int]
) -> Form | None:
    """Return the form that an author's own Phi defines, None if it is another constraint."""
    form, reference = None, subject.reference
    if Phi.expressions is not None:
        form = _derived(reference, rows, [Phi.expressions[k] for k in own])
    if form is None:
        form = _differenced(
            reference, rows, lambda states: Phi.evaluate(states).values[:, list(own)]
        )
    if not _is_equivalent(form, subject):
        return None
    return replace(_named(form, subject), defines=True)


def _derived(reference: Reference, rows: Sequence[int], Phi: Sequence[sympy.Expr]) -> Form | None:
    """Return the form of other equations, differentiated by the compiler; None if it cannot."""
    formulas = _formulas(reference, Phi)
    if formulas is None:
        return None

    def evaluate(states: States) -> Mapping[str, Array]:
        values = formulas.values(states)
        return {name: values.of(name) for name in QUANTITIES}

    def sizes(states: States) -> Mapping[str, Array]:
        return {name: formulas.term_sizes(name, states) for name in QUANTITIES}

    return Form(EQUIVALENT, OTHER, tuple(rows), evaluate, write=lambda: formulas, sizes=sizes)


def _formulas(reference: Reference, Phi: Sequence[sympy.Expr]) -> Reference | None:
    """Return the formulas of other equations of the coordinates; None if they cannot be derived."""
    system = reference.system
    free = system.coordinates[sum(map(len, system.body_columns)) :]
    try:
        return reference.another(
            ConstraintSystem(
                system.name,
                [item.name for item in free],
                Phi,
                parameters=system.parameters,
                guess=[item.guess for item in free],
                bodies=system.bodies,
                length_unit=system.length_unit,
                mass_unit=system.mass_unit,
                end=system.end,
            )
        )
    except KincompileError:
        return None


def _differenced(reference: Reference, rows: Sequence[int], Phi: Function) -> Form:
    """Return the form of other equations that are a function, differentiated by differences."""

    def evaluate(states: States) -> Mapping[str, Array]:
        now = min(1.0, reference.system.end)
        zero, one = np.zeros_like(states.q), np.ones_like(states.t)
        values = {
            "Phi": Phi(states),
            "Phi_q": _by_coordinates(Phi, reference, states)[..., 0, :],
            "nu": -_difference(Phi, states, (zero, one), FIRST, now),
            "gamma": -_difference(Phi, states, (states.q_dot, one), SECOND, now),
        }
        return reference.expressed(values, states)

    return Form(EQUIVALENT, OTHER, tuple(rows), evaluate, accuracy=ACCURACY)


def _by_coordinates(function: Function, reference: Reference, states: States) -> Array:
    columns, still = [], np.zeros_like(states.t)
    for k, size in enumerate(reference.base.sizes):
        direction = np.zeros_like(states.q)
        direction[:, k] = 1.0
        columns.append(_difference(function, states, (direction, still), FIRST, size))
    return np.stack(columns, axis=-1)


def _difference(
    function: Function,
    states: States,
    direction: tuple[Array, Array],
    weights: Sequence[tuple[int, float]],
    size: float,
) -> Array:
    """Return a derivative of a function of q and t along a direction, at each state."""
    order, (dq, dt), step = 1 if weights is FIRST else 2, direction, STEP * size
    total: Array | float = 0.0
    for k, weight in weights:
        ahead, behind = (
            function(replace(states, q=states.q + h * dq, t=states.t + h * dt))
            for h in (k * step, -k * step)
        )
        total = total + weight * (ahead - behind if order == 1 else ahead + behind)
    return np.asarray(total / step**order)


def jacobian_form(subject: Subject, rows: Sequence[int], Phi_q: Function) -> Form | None:
    """Return the form of which a Jacobian alone is known, None if it is that of no equations.

    Its nu and gamma are known where the equations hold: the same combinations of the generated ones
    as the rows. Elsewhere the combination that comes nearest stands for them.
    """

    def evaluate(states: States) -> Mapping[str, Array]:
        own, values = Phi_q(states), subject.reference.values(states)
        generated = {name: values.of(name)[:, list(rows)] for name in QUANTITIES}
        factor = own @ np.linalg.pinv(generated["Phi_q"], rcond=1e-10)
        return {**{name: factor @ item for name, item in generated.items()}, "Phi_q": own}

    form = Form(EQUIVALENT, OTHER, tuple(rows), evaluate, defines=True)
    is_one = _is_equivalent(form, subject) and _is_gradient(Phi_q, subject)
    return _named(form, subject) if is_one else None


def _is_gradient(Phi_q: Function, subject: Subject) -> bool:
    """Return whether each row is the gradient of some function of q: its curl vanishes."""
    states, sizes = subject.states, subject.reference.base.sizes
    Phi_q = subject.reference.gradient(Phi_q)
    second = _by_coordinates(Phi_q, subject.reference, states) * (sizes[:, None] * sizes)
    size = np.max(np.abs(second)) + np.max(np.abs(Phi_q(states) * sizes))
    return bool(np.max(np.abs(second - np.swapaxes(second, -1, -2))) <= ACCURACY * size)


def known_forms(block: ConstraintBlock, subject: Subject) -> Iterator[Form]:
    """Yield the forms that are known without an author's Phi."""
    yield from subject.kept(("known", block.rows), lambda: tuple(_known_forms(block, subject)))


def _known_forms(block: ConstraintBlock, subject: Subject) -> Iterator[Form]:
    yield from _other_extensions(block, subject)
    if _is_distance(block):
        assert isinstance(block.constraint, Joint)
        length = sympy.sympify(block.constraint.scalars["C"])
        Phi = subject.reference.expression("Phi", block.rows[0], 0)
        if form := _derived(subject.reference, block.rows, [sympy.sqrt(Phi + length**2) - length]):
            yield replace(form, text=LENGTH)


def _other_extensions(block: ConstraintBlock, subject: Subject) -> Iterator[Form]:
    """Yield a constraint in space with other rotation matrices, equal where p^T p = 1.

    They have other derivatives by p than the homogeneous A = E G^T; by small rotations the same.
    """
    joint = block.constraint
    if subject.reference is not subject.reference.base:
        return
    if not isinstance(joint, Joint) or joint.template.dimension == 2:
        return
    for text, write in EXTENSIONS.items():
        Phi = tuple(everywhere(item, partial(_extended, write)) for item in joint.template.Phi)
        other = replace(joint, template=replace(joint.template, Phi=Phi))
        if Phi != joint.template.Phi:
            # Its faults are those of its entries: derivatives of (1 - p^T p) v have no name.
            form = _of_joint(EXTENSION, text, other, block, subject.reference)
            yield replace(form, joint=None, write=partial(_written, other, subject.reference))


def _written(joint: Joint, reference: Reference) -> Reference | None:
    """Return the formulas of a joint by itself."""
    expansion = Expansion(SymbolicEnvironment(joint), joint.template.dimension)
    Phi = [item for Phi in joint.template.Phi for item in expansion.components(Phi)]
    return _formulas(reference, Phi)


def _extended(write: Callable[..., Vector], node: Expression) -> Expression | None:
    """Return a turned vector by another rotation matrix, None of other nodes."""
    match node:
        case Rotated(EulerRotation(p), vector, ()):
            return write(node, vector, dot(p, p))
    return None


EXTENSIONS: Mapping[str, Callable[..., Vector]] = {
    "A = (2 e0^2 - 1) I + 2 (e e^T + e0 e~) instead of E G^T": (
        lambda turned, vector, square: turned + (square - 1) * vector
    ),
    "A = (1 - 2 e^T e) I + 2 (e e^T + e0 e~) instead of E G^T": (
        lambda turned, vector, square: turned + (1 - square) * vector
    ),
    "A = E G^T/(p^T p) instead of E G^T": lambda turned, vector, square: square**-1 * turned,
}
"""What is written, and what stands for A v, by A v, v and p^T p."""


def _is_distance(block: ConstraintBlock) -> bool:
    """Return whether a constraint is a distance, whose Phi is d^T d - C^2."""
    joint = block.constraint
    return isinstance(joint, Joint) and isinstance(joint.written, Distance | AbsoluteDistance)


def _named(form: Form, subject: Subject) -> Form:
    """Return a form with its name, found by how its rows of Phi_q vary."""
    states, reference = subject.states, subject.reference
    with np.errstate(all="ignore"):
        own = form.evaluate(states)["Phi_q"]
    for block in subject.blocks:
        for known in known_forms(block, subject) if block.rows == form.rows else ():
            if np.allclose(own, known.evaluate(states)["Phi_q"], rtol=ACCURACY):
                return replace(form, text=known.text)
    generated = reference.values(states)["Phi_q"][:, list(form.rows)]
    # The row of an angle is the same at every state, and has nothing in the columns of lengths.
    turns = ~np.any(own[0][:, ~reference.angular], axis=-1)
    of_angle = (np.ptp(own, axis=0) == 0).all(axis=-1) & turns
    if np.any(of_angle & (np.ptp(generated, axis=0) > 0).any(axis=-1)):
        return replace(form, text=ANGLE)
    return form if _has_own_rows(form, subject) else replace(form, text=COMBINED)


def _has_own_rows(form: Form, subject: Subject) -> bool:
    """Return whether each row is a multiple of a generated one where the equations hold."""
    states = subject.near(form.rows)
    assert states is not None, "forms are looked for there"
    generated = subject.reference.values(states)["Phi_q"][:, list(form.rows)]
    own = form.evaluate(states)["Phi_q"]
    return all(
        any(is_same_space(own[:, [k]], generated[:, [other]]) for other in range(len(form.rows)))
        for k in range(len(form.rows))
    )


def _is_equivalent(form: Form, subject: Subject) -> bool:
    """Return whether a form holds where the generated rows hold, and is as many equations there."""
    states, reference = subject.near(form.rows), subject.reference
    if states is None:
        return False
    with np.errstate(all="ignore"):
        values = form.evaluate(states)
    if not all(np.isfinite(values[name]).all() for name in ("Phi", "Phi_q")):
        return False
    reach = np.sum(np.abs(values["Phi_q"]) * reference.arms, axis=-1)
    is_zero = np.abs(values["Phi"][..., 0]) <= ON_MANIFOLD * np.max(reach, axis=0)
    generated = reference.values(states)["Phi_q"][:, list(form.rows)]
    return bool(is_zero.all()) and is_same_space(values["Phi_q"], generated)


def is_same_space(rows: Array, generated: Array) -> bool:
    """Return whether the rows of two Jacobians span the same space at each state."""
    lengths = [np.linalg.norm(item, axis=-1, keepdims=True) for item in (rows, generated)]
    if not all(np.all(np.isfinite(length) & (length > 0)) for length in lengths):
        return False
    a, b = rows / lengths[0], generated / lengths[1]
    combined = a @ np.linalg.pinv(b, rcond=1e-10)
    smallest = np.linalg.svd(combined, compute_uv=False)[:, -1]
    off = np.max(np.abs(combined @ b - a))
    return bool(off <= ON_MANIFOLD and np.min(smallest) >= INDEPENDENT)
