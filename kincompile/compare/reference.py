"""The generated side of a comparison: the program of a system, evaluated at states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile import quantities
from kincompile.compare.states import (
    Array,
    States,
    consistent_states,
    default_parameters,
    is_angular,
    random_states,
)
from kincompile.errors import InputError
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.interpret import interpret, run
from kincompile.ir.lower import lower
from kincompile.model.matrices import EquationRow, assemble
from kincompile.model.mechanism import system_of
from kincompile.names import listed, rate, suggestion

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.resolve import FreeEquation, Joint
    from kincompile.model.system import ConstraintSystem

QUANTITIES = tuple(item.name for item in quantities.OF_EQUATIONS)


@dataclass(frozen=True, slots=True)
class Values:
    """The quantities at N states: vectors (N, m) and matrices (N, m, n)."""

    arrays: Mapping[str, Array]

    def __getitem__(self, quantity: str) -> Array:
        """Return a quantity, shape (N, m) or (N, m, n)."""
        return self.arrays[quantity]

    def of(self, quantity: str) -> Array:
        """Return a quantity as matrices, shape (N, m, 1) or (N, m, n)."""
        array = self.arrays[quantity]
        return array if quantities.quantity_named(quantity).is_matrix else array[..., None]


@dataclass(frozen=True, slots=True)
class ConstraintBlock:
    """The rows and columns of one constraint; a column is None where it belongs to the ground."""

    constraint: Joint | FreeEquation
    rows: tuple[int, ...]
    columns: tuple[int | None, ...]


class Reference:
    """The formulas that the compiler derives from a model, ready to be evaluated anywhere.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    """

    def __init__(self, model: Mechanism | ConstraintSystem) -> None:
        self.system = system_of(model)
        self.program = lower(self.system)
        self.coordinates = tuple(item.name for item in self.system.coordinates)
        self.equations = self.system.equations
        self.angular = is_angular(self.system)
        self.defaults = default_parameters(self.system)
        self._latest: tuple[States, Values] | None = None
        self._consistent: dict[tuple[int, ...], States | None] = {}
        self._texts: dict[tuple[str, int, int], str] = {}

    @cached_property
    def blocks(self) -> tuple[ConstraintBlock, ...]:
        """The blocks of the constraints, in order."""
        number = {name: k for k, name in enumerate(self.coordinates)}
        return tuple(
            ConstraintBlock(
                item,
                tuple(range(first, first + len(item.equation_names))),
                tuple(None if name is None else number[name] for name in item.columns),
            )
            for first, item in zip(self.system.row_offsets, self.system.constraints, strict=True)
        )

    def block(self, name: str) -> ConstraintBlock:
        """Return the block of a constraint by its name."""
        blocks = {block.constraint.name: block for block in self.blocks}
        if name not in blocks:
            raise InputError(
                f"there is no constraint {name!r} in {self.system.name!r}"
                f"{suggestion(name, blocks)}; constraints are: {listed(blocks, 40)}."
            )
        return blocks[name]

    @cached_property
    def _rows(self) -> list[EquationRow]:
        """The rows as SymPy expressions, which people read."""
        return assemble(self.system)

    def expression(self, quantity: str, row: int, column: int) -> sympy.Expr:
        """Return an entry as a SymPy expression."""
        if quantity == "Phi_q":
            entry = self._rows[row].Phi_q.get(self.coordinates[column], 0)
        else:
            entry = getattr(self._rows[row], quantity)
        expression: sympy.Expr = sympy.sympify(entry)
        return expression

    def text(self, quantity: str, row: int, column: int) -> str:
        """Return an entry as people type it."""
        key = (quantity, row, column)
        if key not in self._texts:
            self._texts[key] = str(self.expression(*key))
        return self._texts[key]

    def values(self, states: States) -> Values:
        """Evaluate the generated quantities; those of the latest states are kept."""
        if self._latest is None or self._latest[0] is not states:
            with np.errstate(all="ignore"):
                found = interpret(self.program, states.q, states.q_dot, states.t, states.p.T)
            self._latest = states, Values(dict(zip(QUANTITIES, found, strict=False)))
        return self._latest[1]

    @cached_property
    def random(self) -> States:
        """Generic states, off the manifold."""

        def is_usable(states: States) -> Array:
            found = self.values(states)
            parts = [np.isfinite(found.of(name)).all(axis=(-2, -1)) for name in QUANTITIES]
            return np.asarray(np.logical_and.reduce(parts))

        return random_states(self.system, is_usable)

    def consistent(self, start: States, rows: Sequence[int]) -> States | None:
        """Return states near `start` at which the given equations hold, with rates that fit.

        Those near the random states are kept: many comparisons with one model need them.
        """
        if start is not self.random:
            return self._on_manifold(start, list(rows))
        key = tuple(rows)
        if key not in self._consistent:
            self._consistent[key] = self._on_manifold(start, list(rows))
        return self._consistent[key]

    def _on_manifold(self, start: States, rows: list[int]) -> States | None:
        def constraints(states: States) -> tuple[Array, Array, Array]:
            found = self.values(states)
            Phi, Phi_q, nu = (found[name][:, rows] for name in ("Phi", "Phi_q", "nu"))
            return Phi, Phi_q, nu

        return consistent_states(start, constraints)

    def compiled(
        self, expressions: Sequence[sympy.Expr]
    ) -> Callable[[States], tuple[Array, Array]]:
        """Prepare SymPy expressions of coordinates, rates, parameters and time for evaluation.

        Returns
        -------
        callable
            Gives, at states, the values and the sizes of their terms: the sum of the absolute
            values of the terms on the topmost level. Both of shape (N, number of expressions).
        """
        graph = Graph()
        convert = Converter(graph, graph.input).convert
        terms = [[convert(term) for term in sympy.Add.make_args(item)] for item in expressions]

        def evaluate(states: States) -> tuple[Array, Array]:
            values, sizes = np.zeros((2, len(states), len(terms)))
            with np.errstate(all="ignore"):
                results = run(graph.nodes, self.inputs(states), self.program.tables)
                for k, nodes in enumerate(terms):
                    for node in nodes:
                        values[:, k] += results[node]
                        sizes[:, k] += np.abs(results[node])
            return values, sizes

        return evaluate

    def evaluate(self, expressions: Sequence[sympy.Expr], states: States) -> tuple[Array, Array]:
        """Evaluate SymPy expressions once; see `compiled`."""
        return self.compiled(expressions)(states)

    def named(self, states: States, k: int) -> dict[str, float]:
        """Return one of the states as numbers by name."""
        return {name: float(value[k]) for name, value in self.inputs(states).items()}

    def inputs(self, states: States) -> dict[str, Array]:
        """Return the values of coordinates, rates, parameters and t by name, (N,) each."""
        inputs = {"t": states.t}
        for k, item in enumerate(self.system.parameters):
            inputs[item.name] = states.p[:, k]
        for k, name in enumerate(self.coordinates):
            inputs[name] = states.q[:, k]
            inputs[rate(name)] = states.q_dot[:, k]
        return inputs
