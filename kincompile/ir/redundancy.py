"""The generic rank of a system, by the interpreter, and what it means for compiling."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from kincompile.errors import StructuralError
from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.model.resolve import Joint
from kincompile.names import listed, rate
from kincompile.quantities import turning
from kincompile.structure.choice import rows_left_out
from kincompile.structure.counting import counting_problem
from kincompile.structure.rank import ANGLES_FIRST, RankReport, drivers_of, generic_rank
from kincompile.structure.remedies import (
    MissingDriver,
    advice,
    balls_of,
    least_squares_will_do,
    rank_problem,
    surpluses,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.constraint import Constraint
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern
    from kincompile.structure.rank import Evaluate
    from kincompile.structure.remedies import Surplus

# Freedoms that nothing sees, redundant equations and `inspect` ask for that of one system.
_RANKS: WeakKeyDictionary[ConstraintSystem, RankReport] = WeakKeyDictionary()
HALF_TURN = 0.1
"""e0 of an orientation so near to half a turn that no AbsoluteOrientation should begin there."""


def rank_report(
    system: ConstraintSystem, program: Program, guess: NDArray[np.float64] | None = None
) -> RankReport:
    """Return the rank of a system at generic assembled states, with default parameters.

    The guess, shape (n,), is where it is meant to be assembled; without it, the system's own.
    """
    if guess is not None:
        return _ranks(system, program, guess)
    if system not in _RANKS:
        own = np.array([item.guess for item in system.coordinates])
        _RANKS[system] = _ranks(system, program, own)
    return _RANKS[system]


def _ranks(system: ConstraintSystem, program: Program, guess: NDArray[np.float64]) -> RankReport:
    return generic_rank(
        evaluation(program),
        guess,
        _angular(system),
        driver_rows(system),
        _rows(system, lambda item: isinstance(item, Joint) and item.written.is_own),
        float(system.end),
        system.equations,
    )


def evaluation(program: Program) -> Evaluate:
    """Return what gives Phi and Phi_q at states, with default parameters."""
    found = interpreter(program, ("Phi", "Phi_q"))

    def evaluate(
        q: NDArray[np.float64], t: NDArray[np.float64]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        Phi, Phi_q = found(q, np.zeros_like(q), t)
        return Phi, Phi_q

    return evaluate


def driver_rows(system: ConstraintSystem) -> list[int]:
    """Return the rows of constraints that are functions of time."""
    return _rows(system, lambda item: item.is_driver)


def _rows(system: ConstraintSystem, wanted: Callable[[Joint | FreeEquation], bool]) -> list[int]:
    """Return the rows of some of the constraints."""
    return [
        first + row
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
        if wanted(item)
        for row in range(len(item.equation_names))
    ]


def redundant_equations(
    system: ConstraintSystem, program: Program, pattern: Pattern
) -> tuple[tuple[str, ...], str, str]:
    """Return which of more equations than coordinates the solve leaves out.

    They depend on others at every assembled position. With them come a warning about them, and
    what is wrong: nothing where they agree with the others.
    """
    report = rank_report(system, program)
    found = surpluses(system, report)
    if least_squares_will_do(system, report):
        joints = [
            range(first, first + len(item.equation_names))
            for item, first in zip(system.constraints, system.row_offsets, strict=True)
            if isinstance(item, Joint) and not item.is_driver
        ]
        rows = rows_left_out(evaluation(program), report, float(system.end), joints)
        left_out = tuple(system.equations[row] for row in rows)
        return left_out, _warning(system, found, left_out), ""
    if report.motions.size:
        sentences = [rank_problem(system, report), advice(missing_drivers(system, report))]
        sentences += [f"{item.text}; {item.remedy}" for item in found]
        return (), "", ". ".join(sentences)
    names = [name for item in found for name in item.equations]
    sentences = [counting_problem(system, pattern, names)]
    sentences += [f"{item.text}; {item.remedy}" for item in found]
    return (), "", ". ".join(sentences)


def undriven(system: ConstraintSystem, program: Program) -> str:
    """Return which drivers are missing though there are equations enough; "" if none are."""
    missing = missing_drivers(system, rank_report(system, program))
    return f"{advice(missing)}." if missing else ""


def missing_drivers(system: ConstraintSystem, ranks: RankReport) -> tuple[MissingDriver, ...]:
    """Return a driver for each degree of freedom: with all of them, nothing may move by itself.

    At joints that have drivers of their own first, then of bodies and coordinates.
    """
    if not len(ranks.motions):
        return ()
    pairs = [
        (item, driver)
        for item in system.constraints
        if isinstance(item, Joint)
        for driver in item.written.drivers(item.points)
    ]
    rates, weights = _rates(system, [driver for _, driver in pairs], ranks)
    taken, left = drivers_of(ranks.motions, rates, weights)
    found = [_driver_at(*pairs[k]) for k in taken]
    singly = _of_bodies(system, ranks)
    rows = np.array([row for _, row, _ in singly])
    chosen, _ = drivers_of(left, rows, np.array([weight for *_, weight in singly]))
    return (*found, *_together(system, [singly[k][0] for k in sorted(chosen)], ranks))


def _of_bodies(
    system: ConstraintSystem, ranks: RankReport
) -> list[tuple[MissingDriver, NDArray[Any], float]]:
    """Return a driver of each freedom of bodies and coordinates, its row in scales, its weight.

    A body in space turns about the axes of the ground; its Euler parameters have no drivers.
    """
    unit, weights = np.eye(ranks.scale.size), np.where(_angular(system), ANGLES_FIRST, 1.0)
    values = {x.name: value for x, value in zip(system.coordinates, ranks.state[0][0], strict=True)}
    found = []
    for body, columns in zip(system.bodies, system.body_columns, strict=True):
        for kind, column in zip(body.kind.drivers, columns, strict=True):
            if kind != body.kind.turning[0]:
                found.append((MissingDriver(kind, body.name), unit[column], weights[column]))
        for axis, (_, spin, _) in zip("xyz", body.on_request, strict=False):
            row = sum(
                float(spin.diff(rate(name)).evalf(subs=values)) * unit[column]
                for name, column in zip(body.coordinates, columns, strict=True)
            )
            driver = MissingDriver(body.kind.turning[1], body.name, axis=axis)
            found.append((driver, row / np.linalg.norm(row), ANGLES_FIRST))
    first = sum(map(len, system.body_columns))
    for name, row, weight in zip(list(values)[first:], unit[first:], weights[first:], strict=True):
        found.append((MissingDriver("Equation", name), row, weight))
    return found


def _together(
    system: ConstraintSystem, drivers: Sequence[MissingDriver], ranks: RankReport
) -> Iterator[MissingDriver]:
    """Return drivers of bodies as they are said: three turns of one body are its orientation.

    That is singular at half a turn. One turn about the line through two ball joints needs no
    driver, but a joint fewer.
    """
    turns = Counter(item.drives for item in drivers if item.axis)
    start = dict(zip((x.name for x in system.coordinates), ranks.nearest, strict=True))
    whole, _, ball, joint = system.ground.kind.turning
    for item in drivers:
        balls = balls_of(system, item.drives)
        if not item.axis:
            yield item
        elif turns[item.drives] == len("xyz") and abs(start[f"e0_{item.drives}"]) > HALF_TURN:
            yield MissingDriver(whole, item.drives)
        elif balls and turns[item.drives] == 1:
            yield replace(item, instead=f"a {joint} in place of the {ball} {balls[0]}")
        else:
            yield item


def _angular(system: ConstraintSystem) -> NDArray[np.bool_]:
    """Return which coordinates have the scale of angles."""
    return np.array(turning((item.unit for item in system.coordinates), system.body_columns))


def _driver_at(joint: Joint, driver: Constraint) -> MissingDriver:
    """Return a driver of a joint, of the one of its bodies that is not the ground."""
    moved = [body.name for body in joint.bodies if not body.is_ground]
    return MissingDriver(type(driver).__name__, moved[-1], joint.name)


def _rates(
    system: ConstraintSystem, drivers: Sequence[Constraint], ranks: RankReport
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the rows that drivers would add to Phi_q, (k, n), of length one in scales; weights."""
    if not drivers:
        return np.zeros((0, ranks.scale.size)), np.zeros(0)
    _, Phi_q = evaluation(lower(system.rewritten(system.constraints, drivers)))(*ranks.state)
    rows = Phi_q[0, -len(drivers) :] * ranks.scale
    angles = [any(x.unit == "rad" for x in item.arguments().values()) for item in drivers]
    return (
        rows / np.linalg.norm(rows, axis=1, keepdims=True),
        np.where(angles, ANGLES_FIRST, 1.0),
    )


def independence(
    system: ConstraintSystem, program: Program
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return equations that repeat others, and free coordinates; refuse what contradicts others."""
    report = rank_report(system, program)
    if report.conflicting:
        found = [item for item in surpluses(system, report) if item.conflicting]
        sentences = ". ".join(f"{item.text}; {item.remedy}" for item in found)
        raise StructuralError(f"{system.name}: {sentences}.")
    equations = tuple(system.equations[row] for row in report.redundant)
    return equations, tuple(system.coordinates[column].name for column in report.drive)


def _warning(system: ConstraintSystem, found: Sequence[Surplus], left_out: Sequence[str]) -> str:
    """Return the warning about consistent redundant equations."""
    sentences = ". ".join(f"{item.text}; to remove it, {item.remedy}" for item in found)
    said = {name for item in found for name in item.equations}
    others = "" if said == set(left_out) else f". Left out of the solve are {listed(left_out)}"
    return (
        f"{system.name!r} has redundant equations: the others are solved, and whether these "
        f"agree is checked at every point. {sentences}{others}"
    )
