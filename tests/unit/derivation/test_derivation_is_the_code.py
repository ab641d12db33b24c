"""The last step of each derivation is the emitted expression, and the first ones lead to it."""

import math
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.calculus.expressions import Number, Pi, Power, Product, Sum, Symbol
from kincompile.derivations.expanded import Writer, minus
from kincompile.derive.derivation import derive
from kincompile.emitters.emission import emit_program
from kincompile.ir.graph import Graph
from kincompile.ir.inline import inline
from kincompile.ir.interpret import BINARY, FUNCTIONS
from kincompile.ir.lower import lower
from kincompile.model.resolve import Joint
from kincompile.names import rate
from kincompile.report.document import Display
from kincompile.report.formulas import (
    Call,
    Choice,
    Decimal,
    DerivativeSymbol,
    Differential,
    Equated,
    Glyph,
    Quotient,
    Relation,
)
from kincompile.runtime.load import from_source

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


def evaluate(formula: Any, values: dict[Any, float], tables: Any) -> Any:
    """Return the number of a displayed formula, which knows nothing of the code it came from."""
    match formula:
        case Number(value) | Decimal(value):
            return float(value)
        case Pi():
            return math.pi
        case Symbol(name):
            return values[name]
        case Glyph() | Differential() | DerivativeSymbol():
            return values[formula]
        case Sum(terms):
            return sum(evaluate(term, values, tables) for term in terms)
        case Product(factors):
            return math.prod(evaluate(factor, values, tables) for factor in factors)
        case Power(base, exponent):
            return evaluate(base, values, tables) ** exponent
        case Quotient(top, bottom):
            return evaluate(top, values, tables) / evaluate(bottom, values, tables)
        case Call(name, arguments):
            numbers = [evaluate(item, values, tables) for item in arguments]
            table = name.rstrip("'")
            if table in tables:
                return tables[table](numbers[0], name.count("'"))
            return (FUNCTIONS.get(name) or getattr(np, name))(*numbers)
        case Choice(condition, first, second):
            chosen = first if evaluate(condition, values, tables) else second
            return evaluate(chosen, values, tables)
        case Relation(relation, left, right):
            sides = evaluate(left, values, tables), evaluate(right, values, tables)
            return BINARY[relation](*sides)
    raise TypeError(formula)


def rebuilt(formula: Any, graph: Graph) -> int:
    """Return the node that a displayed formula is, reading its operations from left to right."""
    match formula:
        case Number(value):
            return graph.const(value)
        case Decimal(value):
            return graph.const(value)
        case Pi():
            return graph.pi()
        case Symbol(name):
            return graph.input(name)
        case Sum((first, *terms)):
            node = rebuilt(first, graph)
            for term in terms:
                node = graph.add(node, rebuilt(term, graph))
            return node
        case Product((Number(value), *factors)) if value == -1:
            return graph.neg(rebuilt(Product(tuple(factors)), graph))
        case Product((first, *factors)):
            node = rebuilt(first, graph)
            for factor in factors:
                node = graph.mul(node, rebuilt(factor, graph))
            return node
        case Power(base, 2):
            return graph.square(rebuilt(base, graph))
        case Quotient(top, bottom):
            return graph.div(rebuilt(top, graph), rebuilt(bottom, graph))
        case Call(name, (argument,)) if "rho" in name:
            return graph.table(name.rstrip("'"), name.count("'"), rebuilt(argument, graph))
        case Call(name, arguments):
            return graph.call(name, *(rebuilt(item, graph) for item in arguments))
        case Choice(condition, first, second):
            return graph.select(*(rebuilt(item, graph) for item in (condition, first, second)))
        case Relation(relation, left, right):
            return graph.compare(relation, rebuilt(left, graph), rebuilt(right, graph))
    raise TypeError(formula)


@pytest.fixture(scope="session", params=["gallery", "four_bar", "gear_train", "example_3_7_5"])
def model(request: pytest.FixtureRequest, gallery: Any, example_named: Any) -> Any:
    return gallery if request.param == "gallery" else example_named(request.param).model


def test_that_a_displayed_formula_is_the_very_node_that_is_emitted(model: Any) -> None:
    code = inline(lower(model.system()))
    writer, graph = Writer(code.nodes), Graph(code.nodes)
    for section in code.sections:
        for quantity in QUANTITIES:
            for entry in section.entries[quantity]:
                assert rebuilt(writer.formula(entry.node), graph) == entry.node


def test_that_displayed_formulas_have_the_values_of_the_emitted_module(model: Any) -> None:
    system = model.system()
    code = inline(lower(system))
    module = from_source(emit_program("numpy", code).source, system.name)
    writer, tables = Writer(code.nodes), code.program.tables
    random = np.random.default_rng(3)
    names = [item.name for item in system.coordinates]
    for t in (0.37, 1.81):
        q, q_dot = random.uniform(-1.2, 1.2, (2, len(names)))
        p = random.uniform(0.5, 1.5, len(system.parameters))
        values = dict(zip(names, q, strict=True)) | {"t": t}
        values |= dict(zip(map(rate, names), q_dot, strict=True))
        values |= dict(zip((item.name for item in system.parameters), p, strict=True))
        Phi, Phi_q, nu, gamma = module.kinematics(q, q_dot, t, p)
        expected = {"Phi": Phi[:, None], "Phi_q": Phi_q, "nu": nu[:, None], "gamma": gamma[:, None]}
        for quantity, wanted in expected.items():
            shown = np.zeros_like(wanted)
            for section in code.sections:
                for entry in section.entries[quantity]:
                    formula = writer.formula(entry.node)
                    shown[entry.row, entry.column] = evaluate(formula, values, tables)
            np.testing.assert_allclose(shown, wanted, 1e-12, 1e-12)


def test_that_the_vectors_shown_are_the_blocks_that_are_expanded(
    gallery: Any, sections_of: Any
) -> None:
    shown = [
        part
        for section in sections_of(kc.derivation(gallery))
        for block in section.blocks
        if isinstance(block, Display) and isinstance(block.formula, Equated)
        for part in block.formula.parts
    ]
    identities = {id(part) for part in shown}
    for constraint in gallery.system().constraints:
        if isinstance(constraint, Joint):
            for block in derive(constraint.template):
                for part in (block.Phi, block.velocity, block.nu, *block.gamma_terms, block.gamma):
                    assert id(part) in identities


def test_that_the_comparison_of_nodes_can_fail() -> None:
    graph = Graph()
    node = graph.sub(graph.input("x"), graph.mul(graph.const(2), graph.input("y")))
    formula = Writer(graph.nodes).formula(node)
    assert rebuilt(formula, graph) == node
    assert isinstance(formula, Sum)
    first, second = formula.terms
    assert rebuilt(Sum((second, first)), graph) == node  # the same number, the same node
    assert rebuilt(Sum((first, minus(second))), graph) != node
