"""A mechanism whose inputs are parameters: what a transmission is compiled from.

An input is a driver, whose value C(t) becomes a parameter, or a coordinate q_k, for which an
equation is added, q_k - u = 0. Time stands still: nothing else may depend on it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import InputError
from kincompile.model.bodies import Parameter
from kincompile.model.equation import Equation
from kincompile.model.expressions import depends_on, evaluate, t
from kincompile.model.mechanism import system_of
from kincompile.model.resolve import Joint
from kincompile.names import column_name, listed, quotient_unit, unknown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem


def input_name(name: str) -> str:
    """Return the name of the parameter that an input becomes."""
    return f"u_{name}"


def input_rate(name: str) -> str:
    """Return the name of the parameter that the rate of an input is."""
    return f"v_{name}"


def with_inputs(
    model: Mechanism | ConstraintSystem, inputs: Sequence[str], *, moving: bool = False
) -> tuple[ConstraintSystem, tuple[str, ...]]:
    """Return the mechanism whose inputs are parameters, and the names of its inputs.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.
    inputs
        Names of drivers, or of other constraints that have a value, and of coordinates, as
        ``"phi_crank"`` or ``"crank.phi"``.
    moving
        Whether inputs move at rates, u + v t: at t = 0 velocities are then those of the rates.

    Returns
    -------
    ConstraintSystem
        Without loads. Its last parameters, `input_name` of each input, have the value of a driver
        at t = 0 as their default, or the guess of a coordinate. Before them are the rates, 0 by
        default, where inputs are `moving`.
    tuple of str
        The names as the mechanism has them: ``"phi_crank"`` for ``"crank.phi"``.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If an input is no driver and no coordinate, or something else depends on time; all that is
        wrong at once.
    """
    system = system_of(model)
    valued = {x.name: x for x in system.constraints if isinstance(x, Joint) and x.has_value}
    coordinates = {item.name: item for item in system.coordinates}
    names = tuple(x if x in valued else column_name(x) for x in map(str, inputs))
    if problems := [*_unknown(system, names, [*valued, *coordinates]), *_moving(system, names)]:
        raise InputError(problems)
    parameters, rates, more, values = [], [], [], {}
    for name in names:
        symbol = sympy.Symbol(input_name(name))
        values[name] = symbol + sympy.Symbol(input_rate(name)) * t if moving else symbol
        if name in valued:
            value, unit = _value(system, valued[name])
        else:
            value, unit = coordinates[name].guess, coordinates[name].unit
            more.append(Equation(f"input_{name}", sympy.Symbol(name) - values[name]))
        parameters.append(Parameter(symbol.name, value, unit))
        rates += [Parameter(input_rate(name), 0.0, quotient_unit(unit, "s"))] if moving else []
    given = {name: _given(valued[name], values[name]) for name in names if name in valued}
    changed = [given.get(item.name, item) for item in system.constraints]
    return system.rewritten(changed, more, (*system.parameters, *rates, *parameters)), names


def _unknown(system: ConstraintSystem, names: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return what is wrong with the names of inputs."""
    if not names:
        return [
            f"{system.name} is given no inputs: name drivers or coordinates. There are "
            f"{listed(known)}."
        ]
    found = []
    taken = {item.name for item in system.coordinates} | {item.name for item in system.outputs}
    taken |= {item.name for item in system.parameters}
    for name, count in Counter(names).items():
        is_known = name in known
        if count > 1:
            found.append(f"input {name!r} of {system.name} is there {count} times: name it once.")
        elif not is_known and name in {item.name for item in system.constraints}:
            found.append(
                f"input {name!r} of {system.name} is a constraint without a value of its own: name "
                "the coordinate that it drives, and leave it out of the model."
            )
        elif not is_known:
            text = f"{system.name} has no driver and no coordinate {name!r}"
            found.append(unknown(text, name, known, "; or add a driver of this name"))
        for own, what in ((input_name(name), "value"), (input_rate(name), "rate")):
            if is_known and own in taken:
                found.append(
                    f"{system.name} has the name {own!r}, which the input {name!r} takes for its "
                    f"{what}: rename it."
                )
    return found


def _moving(system: ConstraintSystem, names: Sequence[str]) -> list[str]:
    """Return what depends on time and is no input."""
    found = []
    for item in system.constraints:
        if isinstance(item, Joint):
            value = item.scalars["C"] if item.has_value and item.name not in names else 0
            if depends_on(value, ("t",)):
                driven = item.type_name, f"name it among the inputs, {item.name!r}"
                found.append(_still(system, item, *driven))
        elif item.is_driver:
            name = f"leave it out, and name the coordinate that it drives: {listed(item.columns)}"
            found.append(_still(system, item, "equation", name))
    return found


def _still(system: ConstraintSystem, item: Joint | FreeEquation, kind: str, instead: str) -> str:
    return (
        f"the {kind} {item.name!r} of {system.name} depends on t and is no input, but a "
        f"transmission has no time: {instead}, or give it a value without t."
    )


def _value(system: ConstraintSystem, driver: Joint) -> tuple[float, str]:
    """Return the value of a driver at t = 0, and its unit."""
    (given,) = (x for x in driver.written.arguments().values() if x.symbol == "C")
    defaults = {x.name: x.default for x in system.parameters if x.default is not None}
    value = evaluate(driver.scalars["C"], {**defaults, "t": 0.0})
    if value is None:
        raise InputError(
            f"the driver {driver.name!r} of {system.name} has no value at t = 0, which is "
            "the first of its input: give it one, a number is enough."
        )
    return value, system.length_unit if given.unit == "length" else given.unit


def _given(item: Joint, value: sympy.Expr) -> Joint:
    """Return a driver whose value is given by parameters."""
    arguments = item.written.arguments()
    (place,) = (name for name, given in arguments.items() if given.symbol == "C")
    changed: dict[str, Any] = {place: value}
    written = replace(item.written, **changed)
    return replace(item, written=written, scalars={**item.scalars, "C": value})
