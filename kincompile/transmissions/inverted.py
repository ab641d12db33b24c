"""The inverse of a loop: its outputs are the inputs, and its inputs what is found."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import sympy

from kincompile.errors import InputError, UnsupportedError
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Parameter
from kincompile.model.equation import Equation
from kincompile.model.expressions import as_sympy
from kincompile.model.inputs import input_name
from kincompile.model.outputs import Output
from kincompile.model.resolve import Joint
from kincompile.names import listed
from kincompile.transmissions.loop import Loop

if TYPE_CHECKING:
    from collections.abc import Sequence


def inverted(loop: Loop, x: Sequence[float]) -> Loop:
    """Return the loop whose inputs are the outputs of another, with these values at first.

    An equation for each output takes the place of the drivers, whose values are outputs.
    """
    system, m, n = loop.system, len(loop.inputs), len(loop.outputs)
    if m != n:
        raise InputError(
            f"{system.name} has {m} inputs and {n} outputs, and an inverse needs as many of both: "
            f"choose {m} of {listed(loop.outputs)}."
        )
    if loop.twists:
        raise InputError(
            f"{system.name} has velocities among its outputs, {listed(loop.twists)}, which no "
            "position gives: leave them out of a transmission that is inverted."
        )
    own = [*system.parameters[: len(system.parameters) - m]]
    expressions = {item.name: as_sympy(item.expression) for item in system.outputs}
    units = {item.name: item.unit for item in system.coordinates}
    units |= {item.name: item.unit or "" for item in system.outputs}
    more, parameters = [], []
    for name, value in zip(loop.outputs, x, strict=True):
        symbol = sympy.Symbol(input_name(name))
        if symbol.name in units or symbol.name in {item.name for item in own}:
            raise InputError(
                f"{system.name} has the name {symbol.name!r}, which the inverse takes for the "
                f"value of {name}: rename it."
            )
        expression = expressions.get(name, sympy.Symbol(name))
        more.append(Equation(f"output_{name}", expression - symbol))
        parameters.append(Parameter(symbol.name, float(value), units[name]))
    replaced = {f"input_{name}" for name in loop.inputs} | set(loop.inputs)
    kept = [item for item in system.constraints if item.name not in replaced]
    names, found = [], []
    for name, parameter in zip(loop.inputs, loop.parameters, strict=True):
        if any(item.name == name for item in system.coordinates):
            names.append(name)
            continue
        unit = next(item.unit for item in system.parameters if item.name == parameter)
        names.append(parameter)
        found.append(Output(parameter, _measured(loop, name), unit))
    changed = system.rewritten(kept, more, (*own, *parameters), found)
    given = tuple(item.name for item in parameters)
    return Loop(changed, loop.outputs, given, tuple(names), loop.held)


def _measured(loop: Loop, name: str) -> sympy.Expr:
    """Return the value of a driver as an expression of coordinates, from its row of Phi."""
    system, given_value = loop.system, sympy.Symbol(input_name(name))
    item = next(x for x in system.constraints if x.name == name)
    first = system.row_offsets[system.constraints.index(item)]
    rows = [system.Phi[first + k] for k in range(len(item.equation_names))]
    assert isinstance(item, Joint)
    (given,) = (x for x in item.written.arguments().values() if x.symbol == "C")
    if len(rows) > 1:
        raise UnsupportedError(
            f"the inverse of {system.name} needs the value of the {item.type_name} {name!r}, "
            f"which has {len(rows)} equations: make a coordinate the input, or a driver with one."
        )
    rest = rows[0].subs(given_value, 0)
    if given.kind is Kind.DISTANCE:
        return cast("sympy.Expr", sympy.sqrt(rest))
    slope = rows[0].diff(given_value)
    return cast("sympy.Expr", -rest / slope.subs(given_value, 0))
