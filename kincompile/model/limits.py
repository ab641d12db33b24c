"""Limits of joints: the least and the greatest value of a hinge, a slider or a driver."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from kincompile.model import declared as kinds
from kincompile.model.declarations import checked_number
from kincompile.model.declared import declared, given
from kincompile.model.resolve import Joint, resolve_joint
from kincompile.names import listed, shown, suggestion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.arguments import Argument
    from kincompile.model.constraint import Constraint
    from kincompile.model.expressions import Scalar
    from kincompile.model.scope import Scope


@declared
class JointLimit:
    """The least and the greatest value of a joint or a driver; made by `Mechanism.limit`."""

    joint: str = given(kinds.NAME, "Name of a hinge, a slider or a driver.")
    least: Scalar = given(kinds.EXPRESSION, "Its least value [rad or length].", default=-math.inf)
    greatest: Scalar = given(
        kinds.EXPRESSION, "Its greatest value [rad or length].", default=math.inf
    )

    def measuring(self, joint: Joint) -> Constraint | None:
        """Return the constraint whose C is the value: a driver itself, else one of value 0."""
        return joint.written if joint.has_value else joint.written.measured(self.seen(joint))

    def seen(self, joint: Joint) -> Mapping[str, tuple[Scalar, ...]]:
        """Return the points and directions of a joint, by which its value counts."""
        return joint.points

    def ends(self, values: dict[str, float], problems: list[str], unit: str) -> list[float]:
        """Return least and greatest value with parameters; note what is no number."""
        where = f"limit of {self.joint!r}"
        return [
            float(end)
            if end in (-math.inf, math.inf)
            else checked_number(end, where, values, problems, unit)
            for end in (self.least, self.greatest)
        ]


def value_of(constraint: Constraint) -> Argument:
    """Return the argument that is the value C of a constraint."""
    return next(item for item in constraint.arguments().values() if item.symbol == "C")


def check_limits(
    limits: Sequence[JointLimit], names: Sequence[str], resolved: Sequence[Any], scope: Scope
) -> None:
    """Note what is wrong with limits of the constraints of these names."""
    known = {item.name: item for item in resolved}
    twice = [name for name, count in Counter(item.joint for item in limits).items() if count > 1]
    scope.problems += [f"limit of {name!r}: there are two; leave one out" for name in twice]
    for item in limits:
        where = f"limit of {item.joint!r}"
        if item.joint not in names:
            near = suggestion(item.joint, names) or f"; constraints are: {listed(names)}"
            scope.problems.append(f"{where}: there is no joint {shown(item.joint)}{near}")
            continue
        if item.joint not in known:
            continue  # what is wrong with it is said of itself
        joint = known[item.joint]
        measuring = item.measuring(joint) if isinstance(joint, Joint) else None
        if measuring is None:
            what = f"a {joint.type_name}" if isinstance(joint, Joint) else "a free equation"
            scope.problems.append(
                f"{where}: {what} has no value of its own; give limits of hinges, sliders and "
                "drivers"
            )
            continue
        if not joint.has_value:
            resolve_joint(measuring, scope)
        unit, problems = value_of(measuring).unit, list[str]()
        least, greatest = item.ends(scope.defaults, problems, unit)
        scope.problems += problems
        if not problems and not least < greatest:
            scope.problems.append(
                f"{where}: it goes from {least:g} to {greatest:g}; give the least value first"
            )
