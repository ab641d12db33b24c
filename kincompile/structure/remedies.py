"""Remedies for redundant equations and for coordinates without a driver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

from kincompile.model.resolve import FreeEquation, Joint, held_text
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.rank import RankReport


@dataclass(frozen=True, slots=True)
class Surplus:
    """A constraint with equations that depend on those before it.

    Attributes
    ----------
    constraint, kind
        Its name and type, as ``"Revolute"``; ``"Equation"`` for a free one.
    is_driver
        Whether it is a function of time.
    equations
        Names of its equations that depend on others.
    conflicting
        Whether they cannot hold together with those; else they repeat them.
    repeats
        Names of the constraints that they depend on.
    others
        Names of its equations that do not depend on others, and are to be kept.
    instead
        The type of constraint that keeps them; "" where there is none.
    advice
        How to say so, with places for ``{simpler}`` and ``{kept}``.
    miss
        The largest of its equations' values where those hold that they depend on; NaN where that
        is nowhere.
    """

    constraint: str
    kind: str
    is_driver: bool
    equations: tuple[str, ...]
    conflicting: bool
    repeats: tuple[str, ...]
    others: tuple[str, ...]
    instead: str
    advice: str
    miss: float

    @property
    def text(self) -> str:
        """What is wrong, in words."""
        what, partners = listed(self.equations), listed(self.repeats)
        s = "s" if len(self.equations) == 1 else ""
        verdict = "conflicting" if self.conflicting else "redundant"
        if not self.repeats:
            return (
                f"{verdict}: {what} determine{s} nothing, for at assembled positions all its "
                "derivatives are zero"
            )
        if self.conflicting:
            by = "" if math.isnan(self.miss) else f", by {self.miss:.4g} at the start"
            return f"{verdict}: {what} contradict{s} {partners}{by}"
        demands = "demands" if len(self.repeats) == 1 else "demand"
        return (
            f"{verdict}: {what} repeat{s} what {partners} {demands}, harmless as long as the "
            "lengths are exact"
        )

    @property
    def remedy(self) -> str:
        """What removes it, as a request."""
        if self.is_driver:
            return f"remove the driver {self.constraint}: nothing is left for it to move"
        if not self.conflicting:
            return self._removal
        return f"correct the lengths, points or values of {self.constraint}, or {self._removal}"

    @property
    def _removal(self) -> str:
        called = f"the {self.kind} {self.constraint}"
        kept = listed(self.others)
        if self.kind == "Equation":
            return f"leave out {listed(self.equations)}"
        if not self.others:
            return f"remove {called}"
        if self.instead:
            return f"replace {called} by {self.advice.format(simpler=self.instead, kept=kept)}"
        return f"replace {called} by a constraint that demands {kept} alone, such as an Equation"


@dataclass(frozen=True, slots=True)
class MissingDriver:
    """A driver that would take a degree of freedom away.

    Attributes
    ----------
    kind
        Its type, as ``"AbsoluteAngle"``; ``"Equation"`` for a coordinate that belongs to no body.
    drives
        Name of the body, or of the coordinate.
    joint
        Name of the joint whose motion it drives; "" where it drives none.
    instead
        What else takes the freedom away; "" where nothing does.
    axis
        The axis of the ground that it turns the body about, ``"x"``, ``"y"`` or ``"z"``; "" where
        it needs none.
    """

    kind: str
    drives: str
    joint: str = ""
    instead: str = ""
    axis: str = ""

    @property
    def text(self) -> str:
        """The driver in words."""
        if self.kind == "Equation":
            return f"an equation that gives {self.drives}"
        place = f" at {self.joint}" if self.joint else ""
        other = f" (or {self.instead})" if self.instead else ""
        about = f" about the {self.axis} axis" if self.axis else ""
        return f"{self.kind} of {self.drives}{about}{place}{other}"


def advice(missing: Sequence[MissingDriver]) -> str:
    """Return how many drivers are missing, and which to add."""
    count = "a driver is" if len(missing) == 1 else f"{len(missing)} drivers are"
    # An AbsoluteOrientation drives three.
    drivers = listed(dict.fromkeys(item.text for item in missing))
    return f"{count} missing: add, for instance, {drivers}, as a function of kc.t"


def held_advice(system: ConstraintSystem) -> tuple[str, ...]:
    """Return for each freedom that is held which equation does it, and what else would."""
    found = []
    for item in system.constraints:
        if isinstance(item, FreeEquation) and item.holds:
            balls = balls_of(system, item.spinning)
            other = f"a {system.ground.kind.turning[3]} in place of {balls[0]}" if balls else ""
            other = other or "a joint that does not let it turn, or an Equation of your own"
            found.append(f"{held_text(item.holds)} by {item.name}. To choose how, take {other}")
    return tuple(found)


def balls_of(system: ConstraintSystem, body: str) -> list[str]:
    """Return the names of the ball joints of a body."""
    kinds = system.ground.kind.turning[2:3]
    return [
        item.name
        for item in system.constraints
        if isinstance(item, Joint)
        and item.type_name in kinds
        and body in (other.name for other in item.bodies)
    ]


def rank_problem(system: ConstraintSystem, ranks: RankReport) -> str:
    """Return that equations depend on others, and so leave coordinates undetermined."""
    n, m = len(system.coordinates), len(system.equations)
    return (
        f"{system.name!r} has {m} equations for {n} coordinates, but at assembled positions only "
        f"{ranks.rank} of them are independent: velocities are not determined"
    )


def surpluses(system: ConstraintSystem, ranks: RankReport) -> tuple[Surplus, ...]:
    """Return the constraints that have redundant equations, then those with conflicting ones."""
    names = system.equations
    owner = [item for item in system.constraints for _ in item.equation_names]
    dependent = {names[row] for row in ranks.partners}
    found: list[Surplus] = []
    for conflicting, rows in ((False, ranks.redundant), (True, ranks.conflicting)):
        for item, members in groupby(rows, key=lambda row: owner[row]):
            own = list(members)
            partners = sorted({other for row in own for other in ranks.partners[row]})
            found.append(
                _surplus(
                    item,
                    tuple(names[row] for row in own),
                    conflicting,
                    tuple(dict.fromkeys(owner[other].name for other in partners)),
                    tuple(name for name in item.equation_names if name not in dependent),
                    max(abs(ranks.residuals[row]) for row in own) if ranks.assembled else math.nan,
                )
            )
    return tuple(found)


def _surplus(
    item: Joint | FreeEquation,
    equations: tuple[str, ...],
    conflicting: bool,
    repeats: tuple[str, ...],
    others: tuple[str, ...],
    miss: float,
) -> Surplus:
    kind, instead, advice = "Equation", "", ""
    if isinstance(item, Joint):
        kind, advice = item.type_name, item.written.replaced_by
        lost = [name.removeprefix(f"{item.name}.") for name in equations]
        simpler = item.written.keeping_others(lost)
        instead = simpler.__name__ if simpler else ""
    return Surplus(
        item.name, kind, item.is_driver, equations, conflicting, repeats, others, instead, advice,
        miss,
    )  # fmt: skip


def least_squares_will_do(system: ConstraintSystem, ranks: RankReport) -> bool:
    """Return whether there are too many equations, but all that are too many agree with the others.

    Without a driver or a parameter nothing moves, and too many equations are a mistake rather than
    a special geometry.
    """
    n, m = len(system.coordinates), len(system.equations)
    agree = ranks.assembled and ranks.rank == n and len(ranks.redundant) == m - n
    moves = bool(system.parameters) or any(item.is_driver for item in system.constraints)
    return m > n and agree and moves
