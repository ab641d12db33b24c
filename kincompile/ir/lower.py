"""From a constraint system to a program: each constraint is an instance of its type's kernel."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import sympy

from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import constraint_kernel, derivative_name, equation_kernel
from kincompile.ir.program import Instance, Kernel, Program
from kincompile.model.expressions import alpha, t
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.model.spline import PeriodicSpline, SplineTable
from kincompile.names import body_coordinates, rate

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.calculus.template import Template
    from kincompile.model.bodies import Body
    from kincompile.model.system import ConstraintSystem


def lower(system: ConstraintSystem) -> Program:
    """Return the program of a system: kernels x instances."""
    columns = {item.name: column for column, item in enumerate(system.coordinates)}
    graph = Graph()
    instances = []
    tables: dict[str, SplineTable] = {}
    for first_row, constraint in zip(system.row_offsets, system.constraints, strict=True):
        if isinstance(constraint, FreeEquation):
            kernel = equation_kernel(constraint)
            bindings = tuple(graph.input(name) for name in kernel.inputs)
            bodies: tuple[str, ...] = ()
        else:
            kernel = constraint_kernel(constraint.template)
            bindings = _bind(constraint, kernel, graph)
            bodies = tuple(body.name for body in constraint.bodies)
            tables.update(_tables(constraint))
        own = tuple(None if name is None else columns[name] for name in constraint.columns)
        instances.append(
            Instance(
                kernel,
                constraint.name,
                constraint.source,
                constraint.text,
                constraint.is_driver,
                bodies,
                first_row,
                own,
                bindings,
            )
        )
    frames = tuple((body.name, columns[body_coordinates(body.name)[2]]) for body in system.bodies)
    return Program(
        system.name,
        system.coordinates,
        system.parameters,
        system.equations,
        frames,
        tuple(graph.nodes),
        tuple(instances),
        tables,
        _fingerprint(system, graph, instances, tables),
    )


def _fingerprint(
    system: ConstraintSystem,
    graph: Graph,
    instances: list[Instance],
    tables: dict[str, SplineTable],
) -> str:
    content = (
        system.name,
        system.coordinates,
        system.parameters,
        system.equations,
        graph.nodes,
        instances,
        sorted(tables.items()),
    )
    return hashlib.sha256(repr(content).encode()).hexdigest()[:32]


def _tables(joint: Joint) -> dict[str, SplineTable]:
    splines = (
        item for profile in joint.profiles.values() for item in profile.atoms(PeriodicSpline)
    )
    return {item.table_name: item.table for item in splines}


def _bind(joint: Joint, kernel: Kernel, graph: Graph) -> tuple[int, ...]:
    """Return the node of each of the kernel's inputs."""
    convert = Converter(graph, graph.input).convert
    known = _coordinate_nodes(joint, graph)
    known.update(
        {symbol: convert(value) for symbol, value in joint.scalars.items() if symbol != "C"}
    )
    for symbol, (x, y) in joint.points.items():
        known[f"{symbol}.x"], known[f"{symbol}.y"] = convert(x), convert(y)
    functions = _function_nodes(joint, convert)
    return tuple(known[name] if name in known else functions(name) for name in kernel.inputs)


def _coordinate_nodes(joint: Joint, graph: Graph) -> dict[str, int]:
    """Return the template's coordinates, rates and frames as nodes of the system's coordinates."""
    known: dict[str, int] = {}
    for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
        known.update(_body_nodes(frame.index, body, graph))
    names = joint.columns[3 * len(joint.bodies) :]
    for contact, name in zip(joint.template.contacts, names, strict=True):
        assert name is not None
        known[contact.alpha.name] = graph.input(name)
        known[contact.alpha_dot.name] = graph.input(rate(name))
    return known


def _body_nodes(index: str, body: Body, graph: Graph) -> dict[str, int]:
    def node(name: str) -> int:
        return graph.const(0) if body.is_ground else graph.input(name)

    x, y, phi = body_coordinates(body.name)
    angle = node(phi)
    return {
        f"r_{index}.x": node(x),
        f"r_{index}.y": node(y),
        f"phi_{index}": angle,
        f"r_{index}_dot.x": node(rate(x)),
        f"r_{index}_dot.y": node(rate(y)),
        f"phi_{index}_dot": node(rate(phi)),
        f"cos phi_{index}": graph.call("cos", angle),
        f"sin phi_{index}": graph.call("sin", angle),
    }


def _function_nodes(joint: Joint, convert: Callable[..., int]) -> Callable[[str], int]:
    """Return what gives the node of C, C', C'', or of rho and its derivatives at the contact."""
    contacts = _contact_symbols(joint.template, joint.columns)

    def node(name: str) -> int:
        symbol, order = name.rstrip("'"), name.count("'")
        assert derivative_name(symbol, order) == name
        if symbol in joint.profiles:
            rho = joint.profiles[symbol].diff(alpha, order)
            return convert(rho.subs(alpha, contacts[symbol]))
        value = joint.scalars[symbol]
        return convert(value if order == 0 else sympy.sympify(value).diff(t, order))

    return node


def _contact_symbols(
    template: Template, columns: tuple[str | None, ...]
) -> dict[str, sympy.Symbol]:
    names = columns[3 * len(template.frames) :]
    return {
        contact.rho().name: sympy.Symbol(name)
        for contact, name in zip(template.contacts, names, strict=True)
    }
