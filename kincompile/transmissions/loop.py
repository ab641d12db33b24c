"""From a mechanism and names to a loop that is a function: as many freedoms as inputs.

What no output sees may move as it likes, as a rod between two balls turns about its own axis; a
position needs it all the same, so it is held.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.errors import InputError
from kincompile.ir.held_rows import holding
from kincompile.ir.holding import moved_outputs
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.ir.redundancy import missing_drivers, rank_report
from kincompile.model.inputs import input_name, input_rate, with_inputs
from kincompile.model.mechanism import system_of
from kincompile.names import column_name, listed, unknown
from kincompile.structure.idle import loose_bodies
from kincompile.structure.rank import DEPENDENT
from kincompile.structure.remedies import advice
from kincompile.tables import counted
from kincompile.transmissions.twists import require_linear, twists_in, with_spins

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.rank import RankReport

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Loop:
    """A mechanism as a function of its inputs: what a transmission is compiled from.

    Attributes
    ----------
    system : ConstraintSystem
        The mechanism whose inputs are parameters, with what is held.
    inputs : tuple of str
        Names of drivers and coordinates.
    parameters : tuple of str
        The parameters that they are: the last of the system.
    outputs : tuple of str
        Coordinates and outputs of the system, the components of points one by one.
    held : tuple of str
        Freedoms that no output sees: coordinates, and ``"spin of rod"`` of a body in space.
    twists : tuple of str
        Outputs that are velocities, as ``"omega_x_foot"``: linear in the rates of the inputs.
    rates : tuple of str
        The parameters that these are, before the others, where there are twists.
    """

    system: ConstraintSystem
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    held: tuple[str, ...]
    twists: tuple[str, ...] = ()
    rates: tuple[str, ...] = ()


def loop_of(
    model: Mechanism | ConstraintSystem,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    moving: bool = False,
) -> Loop:
    """Return a mechanism as a function of its inputs.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.
    inputs
        Names of drivers, or of other constraints that have a value, and of coordinates, as
        ``"phi_crank"`` or ``"crank.phi"``.
    outputs
        Names of coordinates, outputs, points and angular velocities, ``"omega_x_foot"``.
    moving
        Whether the rates of inputs are parameters too, where an output is a velocity.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If a name is unknown, something depends on time, the inputs are not as many as the degrees
        of freedom, or do not determine an output.
    """
    system = with_spins(system_of(model), list(map(str, outputs)))
    columns = _columns(system, outputs)
    twists = twists_in(system, columns)
    is_moving = moving and bool(twists)
    system, names = with_inputs(system, inputs, moving=is_moving)
    program = lower(system)
    ranks = rank_report(system, program)
    require_linear(system, program, twists, ranks.state)
    matrix = interpret(program, ranks.state[0], 0 * ranks.state[0], ranks.state[1])[1][0]
    _require_freedoms(system, names, matrix * ranks.scale)
    if len(ranks.motions):
        _require_determined(system, program, ranks, names, columns)
        rows = holding(system, program, ranks, ranks.motions, loose_bodies(system))
        system = system.holding(rows)
    parameters, rates = (tuple(map(own, names)) for own in (input_name, input_rate))
    return Loop(system, names, parameters, columns, system.held, twists, rates if is_moving else ())


def _columns(system: ConstraintSystem, outputs: Sequence[str]) -> tuple[str, ...]:
    """Return the coordinates and outputs that are meant."""
    given = {item.name: depends for item, depends in _time_of_outputs(system)}
    points = {item.name: item.output_names for item in system.body_points}
    coordinates = [item.name for item in system.coordinates]
    problems: list[str] = []
    found: list[str] = []
    for name in map(str, outputs):
        own = points.get(name, (column_name(name),))
        found += own
        if own[0] not in (*coordinates, *given):
            text = f"{system.name} has no coordinate, output or point {name!r}"
            known = [*points, *given, *coordinates]
            problems.append(unknown(text, name, known, "; or ask for it with m.output"))
        elif given.get(own[0]):
            problems.append(
                f"output {name!r} of {system.name} depends on t, and a transmission has no time: "
                "write it without t."
            )
    problems += [
        f"output {name!r} of {system.name} is there {count} times: name it once."
        for name, count in Counter(found).items()
        if count > 1
    ]
    if not found:
        problems.append(
            f"{system.name} is given no outputs: name coordinates, outputs or points. There are "
            f"{listed([*points, *given, *coordinates])}."
        )
    if problems:
        raise InputError(problems)
    return tuple(found)


def _time_of_outputs(system: ConstraintSystem) -> list[tuple[Any, bool]]:
    """Return the outputs, and whether each depends on time."""
    t = sympy.Symbol("t")
    return [(item, t in sympy.sympify(item.expression).free_symbols) for item in system.outputs]


def _require_freedoms(system: ConstraintSystem, names: Sequence[str], matrix: Array) -> None:
    """Refuse more inputs than there are degrees of freedom, given Phi_q (m, n) in scales."""
    equations = [name if name in system.equations else f"input_{name}" for name in names]
    rows = [system.equations.index(name) for name in equations]
    others = np.delete(matrix, rows, axis=0)
    freedoms = _rank(matrix) - _rank(others)
    if freedoms < len(names):
        raise InputError(
            f"{system.name} has {counted(freedoms, 'degree')} of freedom for the inputs "
            f"{listed(names)}: leave out {len(names) - freedoms} of them. A driver with a number "
            "as its value counts as a joint: name it as an input, not the coordinate that it holds."
        )


def _rank(matrix: Array) -> int:
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    if not lengths.all() or not matrix.size:
        matrix, lengths = matrix[lengths[:, 0] > 0], lengths[lengths > 0][:, np.newaxis]
    return int(np.linalg.matrix_rank(matrix / lengths, DEPENDENT)) if matrix.size else 0


def _require_determined(
    system: ConstraintSystem,
    program: Program,
    ranks: RankReport,
    names: Sequence[str],
    columns: Sequence[str],
) -> None:
    """Refuse outputs that move while all inputs rest."""
    places = [item.name for item in system.coordinates]
    moving = {places[k] for k in np.flatnonzero(np.abs(ranks.motions).max(axis=0) > DEPENDENT)}
    if outputs := system.outputs:
        apart = np.abs(moved_outputs(program, ranks)).max(axis=(0, 1))
        found = zip(outputs, apart, strict=True)
        moving |= {item.name for item, x in found if x > DEPENDENT}
    if wrong := [name for name in columns if name in moving]:
        missing = missing_drivers(system, ranks)
        raise InputError(
            f"the inputs {listed(names)} of {system.name} do not determine {listed(wrong)}: "
            f"{counted(len(ranks.motions), 'degree')} of freedom left. Name more inputs, a "
            f"coordinate or a driver for each; {advice(missing)}."
        )
