r"""A mechanism as a function of its inputs: a step of Newton's method and the slopes, as outputs.

With the inputs u among the parameters and outputs x(q, u), at a position q near an assembled one,

.. math:: \Phi_q\,\delta = \Phi, \qquad \Phi_q S = -\Phi_u, \qquad J = x_q S + x_u .

The planned elimination is written out for each right side, as for sensitivities, in one graph: what
Phi_q alone gives is computed once. x is that of q - delta, to first order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from kincompile.criteria import AGREEMENT, SOLVED
from kincompile.errors import StructuralError
from kincompile.ir.differentiate import tangents
from kincompile.ir.elimination import plan_solve, sizes_of
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph, depending_on, pruned, reachable
from kincompile.ir.inline import inline
from kincompile.ir.looks import root_of
from kincompile.ir.observing import observing_program
from kincompile.ir.straight_solve import StraightSolve
from kincompile.model.points import OutputColumn
from kincompile.names import rate
from kincompile.quantities import turning

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import sympy

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.model.bodies import Parameter

Place = tuple[str, int]
"""Name of a vector, and the number of an entry."""


@dataclass(frozen=True, slots=True)
class TransmissionCode:
    """The code of a transmission at a position near an assembled one.

    Attributes
    ----------
    code
        Its outputs are the entries of `places`, in order.
    places
        Of each output the vector that it is in: ``change`` by which q misses, in coordinates;
        ``slopes``, those of q by the inputs, row by row; ``x``; ``J``, row by row; the
        ``determinants`` of the blocks, and lengths that keep their signs as well; ``missed``, the
        part of its terms by which an equation is missed, of those eliminated in a fixed order and
        those that repeat others.
    inputs
        Names of the parameters that are inputs.
    titles, outputs
        What the inputs and outputs are called.
    free
        Columns of the coordinates that are solved for; equations give the others by these.
    angular
        Whether each of those, and then each input, is an angle.
    size
        Of the mechanism, by which lengths are judged.
    units
        Of inputs and outputs, by what they are called.
    """

    code: InlineProgram
    places: tuple[Place, ...]
    inputs: tuple[str, ...]
    titles: tuple[str, ...]
    outputs: tuple[str, ...]
    free: tuple[int, ...]
    angular: tuple[bool, ...]
    size: float
    units: Mapping[str, str]

    def count(self, vector: str) -> int:
        """Return how many entries a vector has."""
        return sum(name == vector for name, _ in self.places)

    @property
    def parameters(self) -> list[Parameter]:
        """The parameters that are no inputs."""
        return [x for x in self.code.program.parameters if x.name not in self.inputs]

    @property
    def read(self) -> dict[str, Place]:
        """Vector and number of each name that the code may read."""
        program = self.code.program
        found = {program.coordinates[column].name: ("q", k) for k, column in enumerate(self.free)}
        found |= {item.name: ("p", k) for k, item in enumerate(self.parameters)}
        return found | {name: ("u", k) for k, name in enumerate(self.inputs)}


def transmission_code(
    code: InlineProgram,
    inputs: Mapping[str, str],
    outputs: Sequence[str],
    near: Sequence[float],
    lengths: Sequence[sympy.Expr] = (),
) -> TransmissionCode:
    """Return the code of a mechanism as a function from parameters to coordinates and outputs.

    The inputs are the names of parameters, and what they are called; `near` is a position at
    their defaults. Nothing depends on time. An output that is linear in velocities has a Jacobian
    and no value, which is NaN. `lengths` of the inputs keep their signs as determinants do: an
    equation has their squares, and is the same on the other side of zero.

    Raises
    ------
    StructuralError
        If the equations do not determine the coordinates.
    """
    program = code.program
    plan = None if program.unsolvable else plan_solve(code, is_straight=True, near=near)
    if plan is None:
        why = program.unsolvable or "Phi_q is singular at every position"
        raise StructuralError(f"{program.name!r} is no function of its inputs: {why}")
    graph = Graph(code.nodes)
    rows = [x.node for x in sorted(code.entries("Phi"), key=lambda x: x.row)]
    wanted = [_node_of(code, graph, name) for name in outputs]
    by_inputs = [tangents(graph, rows, {graph.input(name): graph.const(1)}) for name in inputs]
    made, explicit = _explicit(code, graph, rows)
    new = made.instantiate(graph.nodes, explicit.values)
    free = [k for k in range(len(program.coordinates)) if k not in explicit.columns]
    q = [made.input(program.coordinates[k].name) for k in free]
    entries = [replace(x, node=new[x.node]) for x in code.entries("Phi_q")]
    solve = StraightSolve(made, entries, plan)
    zero = made.const(0)
    change = solve.solve([zero if k in explicit.rows else new[x] for k, x in enumerate(rows)])
    step: dict[int, int] = dict(zip(q, (change[k] for k in free), strict=True))
    x = [new[node] for node in wanted]
    moved = tangents(made, x, step)
    rates = {made.input(rate(name)): explicit.values[name] for name in _column_of(program)}
    moving = depending_on(made.nodes, list(rates))
    slopes, along = [], []
    for name, own in zip(inputs, by_inputs, strict=True):
        found = solve.solve([made.neg(new[node]) for node in own])
        slopes.append([found[k] for k in free])
        way: dict[int, int] = dict(zip(q, slopes[-1], strict=True))
        way[made.input(name)] = made.const(1)
        # Of a velocity, linear in the rates of coordinates, what it is at their slopes.
        spin = dict(zip(rates, tangents(made, list(rates.values()), way), strict=True))
        along.append([tangents(made, [y], spin if y in moving else way)[0] for y in x])
    sizes = sizes_of(code)
    vectors = {
        "change": list(step.values()),
        "slopes": [node for own in zip(*slopes, strict=True) for node in own],
        "x": [made.nan() if a in moving else made.sub(a, b) for a, b in zip(x, moved, strict=True)],
        "J": [node for own in zip(*along, strict=True) for node in own],
        "determinants": [
            *_determinants(made, solve.determinants, plan),
            *map(Converter(made, made.input).convert, lengths),
        ],
        "missed": [_missed(code, made, solve, [new[x] for x in rows], sizes.entries)],
    }
    places = [(name, k) for name, nodes in vectors.items() for k in range(len(nodes))]
    nodes = [node for own in vectors.values() for node in own]
    titles = [OutputColumn(f"{name}_{k}", "") for name, k in places]
    key = tuple(inputs), tuple(outputs)
    observing = observing_program(program, "v", made, {"outputs": nodes}, titles, key=key)
    units = [x.unit for x in program.coordinates]
    of_parameters = {x.name: x.unit for x in program.parameters}
    is_angle = turning(units, [item.columns for item in program.bodies])
    return TransmissionCode(
        inline(observing),
        tuple(places),
        tuple(inputs),
        tuple(inputs.values()),
        tuple(outputs),
        tuple(free),
        (*(is_angle[k] for k in free), *(of_parameters[name] == "rad" for name in inputs)),
        sizes.length,
        {
            **{x.name: x.unit for x in program.coordinates},
            **{x.name: x.unit for x in program.outputs},
            **{title: of_parameters[name] for name, title in inputs.items()},
        },
    )


def _column_of(program: Program) -> dict[str, int]:
    """Return the columns of the coordinates by name."""
    return {x.name: k for k, x in enumerate(program.coordinates)}


@dataclass(frozen=True, slots=True)
class _Explicit:
    """Coordinates that an equation gives by the others: its rows, columns, and all as nodes."""

    rows: frozenset[int]
    columns: frozenset[int]
    values: Mapping[Any, int]


def _explicit(code: InlineProgram, graph: Graph, rows: Sequence[int]) -> tuple[Graph, _Explicit]:
    """Return a graph in which what equations give by plain numbers is put in place.

    An equation c q_k + rest = 0, with a number c and a rest without q_k, gives q_k: from body to
    body the places along a chain, and the angles of driven ones. The other coordinates are
    determined by several equations together.
    """
    program = code.program
    made = Graph()
    values: dict[Any, int] = {x[1]: made.input(x[1]) for x in graph.nodes if x[0] == "input"}
    columns = _column_of(program)
    values |= {name: made.input(name) for name in columns}
    left_out = {program.equations.index(name) for name in program.redundant}
    taken: dict[int, int] = {}
    for row, node in enumerate(rows):
        if row in left_out:
            continue
        own, number = pruned(graph.nodes, [node])
        here = made.instantiate(own, values)[number[node]]
        found = _given_by(made, here, [x for x in columns if columns[x] not in taken])
        if found is None:
            continue
        name, rest = found
        taken[columns[name]] = row
        parts = list(values.values())
        used = reachable(made.nodes, parts)
        if made.input(name) in used:
            inputs = {x[1]: made.input(x[1]) for x in made.nodes if x[0] == "input"}
            again = made.instantiate(tuple(made.nodes), {**inputs, name: rest})
            values = {key: again[value] for key, value in values.items()}
    return made, _Explicit(frozenset(taken.values()), frozenset(taken), values)


def _given_by(graph: Graph, node: int, names: Sequence[str]) -> tuple[str, int] | None:
    """Return a coordinate that an equation gives, and its value: lengths before angles."""
    slopes = {}
    for name in names:
        (slope,) = tangents(graph, [node], {graph.input(name): graph.const(1)})
        if slope != graph.const(0):
            slopes[name] = graph.value_of(slope)
    numbers = {name: abs(float(x)) for name, x in slopes.items() if x is not None}
    largest = max(numbers.values(), default=0.0)
    for name, size in numbers.items():
        if size < largest:
            continue
        code, number = pruned(graph.nodes, [node])
        inputs = {x[1]: graph.input(x[1]) for x in code if x[0] == "input"}
        rest = graph.instantiate(code, {**inputs, name: graph.const(0)})[number[node]]
        return name, graph.div(graph.neg(rest), graph.const(slopes[name] or 1))
    return None


def _node_of(code: InlineProgram, graph: Graph, name: str) -> int:
    """Return the node of a coordinate or of an output."""
    names = code.program.names_of("outputs")
    if name not in names:
        return graph.input(name)
    row = names.index(name)
    return next(entry.node for entry in code.entries("outputs") if entry.row == row)


def _determinants(graph: Graph, found: Sequence[int], plan: SolvePlan) -> list[int]:
    """Return the determinant of each block: of one eliminated in a fixed order of its pivots."""
    products, rest = [], iter(found)
    for block in plan.blocks:
        product = graph.const(1)
        for _ in block.rows if len(block.rows) > plan.straight else block.rows[:1]:
            product = graph.mul(product, next(rest))
        products.append(product)
    return products


def _missed(
    code: InlineProgram,
    graph: Graph,
    solve: StraightSolve,
    rows: Sequence[int],
    sizes: Mapping[tuple[int, int], float],
) -> int:
    """Return by what part of their terms equations are missed, compared with `SOLVED`."""
    squares = []
    for name in code.program.redundant:
        row = code.program.equations.index(name)
        terms = sum(size for (own, _), size in sizes.items() if own == row) or 1.0
        part = graph.mul(graph.const(SOLVED / (AGREEMENT * terms)), rows[row])
        squares.append(graph.square(part))
    looks = [look.missed(graph) for look in solve.looks()]
    return root_of(graph, (*looks, *squares))
