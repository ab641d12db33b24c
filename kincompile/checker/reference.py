"""The generated side of a comparison: the program of a system, evaluated at states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import sympy

from kincompile import quantities
from kincompile.checker.agreement import OF_ROW, ROUNDING, Right, finite, positive
from kincompile.checker.comparison import Difference
from kincompile.checker.rounding import cancelled
from kincompile.checker.states import (
    SEED,
    Array,
    States,
    consistent_states,
    default_parameters,
    given_states,
    is_angular,
    random_states,
)
from kincompile.criteria import size_of
from kincompile.errors import InputError
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.interpret import interpreter, run
from kincompile.ir.lower import lower
from kincompile.model.matrices import EquationRow, assemble
from kincompile.model.mechanism import system_of
from kincompile.names import listed, rate, suggestion

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from kincompile.checker.comparison import Convention
    from kincompile.ir.graph import Node
    from kincompile.model.bodies import Body
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.resolve import FreeEquation, Joint
    from kincompile.model.system import ConstraintSystem

Kept = TypeVar("Kept")

QUANTITIES = tuple(item.name for item in quantities.OF_EQUATIONS)

OF_LOADS = ("M", "Q")
"""What is compared of a mechanism with masses and loads, besides."""

COMPARED = (*QUANTITIES, *OF_LOADS)
"""All that is compared of a mechanism."""

OF_TRANSMISSIONS = ("J", "J_dot", "effort", "x")
"""What is compared of a transmission."""

MATRICES, MOVING = ("Phi_q", "M", "J", "J_dot"), ("gamma", "Q")
"""Quantities with several columns, and those of a mechanism that depend on rates."""

FAR = 100
"""In sizes: from a mechanism that stands farther away than this, states lie about its guess."""

ASIDE = 0.4
"""How far from the guess the states lie that are brought onto the manifold, in sizes."""


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


def numbered(letter: str, number: int, name: str) -> list[tuple[str, str]]:
    """Return how a name may be written by its number."""
    return [(f"{letter}{number}", name), (f"{letter}_{number}", name)]


@dataclass(frozen=True, slots=True)
class ConstraintBlock:
    """The rows and columns of one constraint; a column is None where it belongs to the ground."""

    constraint: Joint | FreeEquation
    rows: tuple[int, ...]
    columns: tuple[int | None, ...]


class Reference:
    """The formulas that the compiler derives from a model, ready to be evaluated anywhere.

    Raises
    ------
    ModelError
        If the model cannot be used as written.

    Attributes
    ----------
    kept
        What comparisons at the random states have found out about the system, for the next ones.
    name
        Name of the mechanism.
    own
        Names of its parameters.
    base
        The formulas by the coordinates of the system; itself, except in another form.
    arms
        The scale of each coordinate, (n,): the size of the mechanism, 1 for angles.
    sizes
        How far states are spread in each coordinate, (n,).
    is_far
        Whether the mechanism stands so far from the origin that states lie about its guess.
    """

    convention: Convention | None = None
    """The form that it is, where that is not the system's own."""
    is_global: bool = False
    forces: Mapping[str, str] = MappingProxyType({})
    """Names of efforts that formulas may use, with what they are: of a mechanism none."""

    def __init__(self, model: Mechanism | ConstraintSystem) -> None:
        self.system = system_of(model)
        self.name = self.system.name
        self.own = tuple(item.name for item in self.system.parameters)
        self.program = lower(self.system)
        self.base = self
        self.constraints = tuple(self.system.constraints)
        self.body_columns = tuple(self.system.body_columns)
        self.coordinates = tuple(item.name for item in self.system.coordinates)
        self.spins = {
            name: spin for body in self.system.bodies for name, spin, _ in body.on_request
        }
        self.rates = frozenset((*map(rate, self.coordinates), *self.spins))
        self.equations = self.system.equations
        self.angular = is_angular(self.system)
        self.defaults = default_parameters(self.system)
        self.columns = {name: k for k, name in enumerate(self.coordinates)}
        self._values: WeakKeyDictionary[States, Values] = WeakKeyDictionary()
        self.kept: dict[Hashable, Any] = {}
        self._evaluated: WeakKeyDictionary[States, dict[sympy.Expr, Array]] = WeakKeyDictionary()
        self._inputs: WeakKeyDictionary[States, dict[str, Array]] = WeakKeyDictionary()
        guess = np.array([item.guess for item in self.system.coordinates])
        place = np.max(np.abs(guess), where=~self.angular, initial=0.0)
        arm = np.max(self.arms, where=~self.angular, initial=0.0)
        self.is_far = bool(place > FAR * arm)
        self.sizes = np.where(self.angular, 1.0, arm if self.is_far else place or 1.0)

    def _share(self, base: Reference) -> None:
        """Take from another reference to the same system what does not depend on columns."""
        self.base, self.system, self.program = base, base.system, base.program
        self.name, self.own = base.name, base.own
        self.spins, self.rates, self.defaults = base.spins, base.rates, base.defaults
        self._evaluated, self._inputs = base._evaluated, base._inputs
        self._values, self.kept = WeakKeyDictionary(), {}

    def another(self, model: Mechanism | ConstraintSystem) -> Reference:
        """Return the formulas of another system of these coordinates, in this form."""
        return Reference(model)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of values, one of which may be written for another: coordinates, parameters."""
        return (*self.base.coordinates, *self.own)

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of angles, one of which may be written for another."""
        pairs = zip(self.coordinates, self.angular, strict=True)
        return tuple(name for name, is_angle in pairs if is_angle)

    def names(self) -> tuple[tuple[str, str], ...]:
        """Return names that formulas use, each with the symbol that it is and that has a rate.

        Courses number them: x1, y1, phi1, also x_1, are those of body 1, and q1 of all.
        """
        found = [(name, name) for name in self.coordinates]
        bodies = zip(self.system.bodies, self.body_columns, strict=True)
        for number, (body, columns) in enumerate(bodies, 1):
            for letter, column in zip(body.kind.letters, columns, strict=True):
                found += numbered(letter, number, self.coordinates[column])
        for number, name in enumerate(self.coordinates, 1):
            found += numbered("q", number, name)
        return tuple(found)

    def names_help(self) -> str:
        """Return in words which names formulas may use."""
        names = [*self.coordinates, *self.own, "t"]
        text = f"the names are: {listed(names, 60)}, and rates such as {rate(names[0])}"
        if self.spins:
            text += f", {listed(self.spins, 6)}"
        if self.system.bodies:
            numbers = listed(f"{k} {body.name}" for k, body in enumerate(self.system.bodies, 1))
            text += (
                f"; bodies are numbered: {numbers}, so that x1 is {self.coordinates[0]}; for a "
                "name of your own write a line 'name = formula'"
            )
        return text

    def arguments(self, quantity: str, given: Sequence[str] | None) -> list[tuple[str, ...]]:
        """Return what a function of a quantity is called with: a choice of names of values.

        Parameters
        ----------
        given
            The names of its arguments, None where they are not known.

        Raises
        ------
        InputError
            If there are too few.
        """
        names = ("q", "q_dot", "t") if quantity in MOVING else ("q", "t")
        if given is not None and len(given) < len(names):
            raise InputError(
                f"{quantity}: the function takes {len(given)} arguments; expected {names}."
            )
        return [(*names, "p") if given is None or len(given) > len(names) else names]

    def method(
        self, quantity: str, function: Any, names: Sequence[str] | None
    ) -> tuple[Callable[..., object], tuple[str, ...]] | None:
        """Return a method of a transmission with its arguments: of a mechanism there are none."""
        del quantity, function, names
        return None

    def argument(self, name: str, states: States) -> Array:
        """Return values that a function is called with, the states first."""
        found: Array = getattr(states, name)
        return found

    @cached_property
    def blocks(self) -> tuple[ConstraintBlock, ...]:
        """The blocks of the constraints, in order."""
        counts = (len(item.equation_names) for item in self.constraints)
        offsets = list(accumulate(counts, initial=0))[:-1]
        return tuple(
            ConstraintBlock(
                item,
                tuple(range(first, first + len(item.equation_names))),
                tuple(None if name is None else self.columns[name] for name in item.columns),
            )
            for first, item in zip(offsets, self.constraints, strict=True)
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
        return assemble(self.system)

    @cached_property
    def _of_loads(self) -> dict[str, sympy.ImmutableDenseMatrix]:
        return {"M": self.system.M, "Q": self.system.Q}

    def expression(self, quantity: str, row: int, column: int) -> sympy.Expr:
        """Return an entry as a SymPy expression."""
        if quantity in OF_LOADS:
            found: sympy.Expr = self._of_loads[quantity][row, column]
            return found
        if quantity == "Phi_q":
            entry = self._rows[row].Phi_q.get(self.coordinates[column], 0)
        else:
            entry = getattr(self._rows[row], quantity)
        expression: sympy.Expr = sympy.sympify(entry)
        return expression

    def text(self, quantity: str, row: int, column: int) -> str:
        """Return an entry as people type it."""
        return self.printed(self.expression(quantity, row, column))

    def later(self, quantity: str, row: int, column: int) -> Callable[[], str]:
        """Return what gives an entry as people type it: few are read, and SymPy takes long."""
        return lambda: self.text(quantity, row, column)

    def printed(self, expression: object) -> str:
        """Return an expression, or a number, as text; SymPy takes long over it."""
        key = ("text", type(expression), expression)
        if key not in self.kept:
            self.kept[key] = str(expression)
        return str(self.kept[key])

    def values(self, states: States) -> Values:
        """Evaluate the generated quantities, once at each states."""
        if states not in self._values:
            with np.errstate(all="ignore"):
                found = self._interpreted(states.q, states.q_dot, states.t, states.p.T)
            names = [item.name for item in self.program.quantities]
            self._values[states] = Values(dict(zip(names, found, strict=True)))
        return self._values[states]

    @cached_property
    def _interpreted(self) -> Callable[..., tuple[Array, ...]]:
        """What evaluates the program: to prepare it takes as long as to evaluate it."""
        return interpreter(self.program)

    @cached_property
    def random(self) -> States:
        """Generic states, off the manifold."""

        def is_usable(states: States) -> Array:
            found = self.values(self.normalised(states))
            parts = [np.isfinite(found.of(name)).all(axis=(-2, -1)) for name in QUANTITIES]
            return np.asarray(np.logical_and.reduce(parts))

        return self.normalised(
            random_states(self.system, is_usable, self.base.sizes, self.base.is_far)
        )

    def normalised(self, states: States) -> States:
        """Return states at which formulas in this form are compared: all, by r and p."""
        return states

    @cached_property
    def fixed(self) -> States:
        """The same states with the default parameters."""
        return self.random.with_default_parameters(self.defaults)

    def given_states(self, given: Mapping[str, ArrayLike]) -> States:
        """Return the states to which the values of arrays belong."""
        return self.normalised(given_states(given, self.system))

    @cached_property
    def arms(self) -> Array:
        """The scale of each coordinate: the size of the mechanism, 1 for angles, (n,)."""
        bodies = [unit for body in self.system.bodies for unit in body.kind.units]
        is_turn = self.angular.copy()
        is_turn[: len(bodies)] |= np.array([unit is not None for unit in bodies], dtype=bool)
        guess = np.array([item.guess for item in self.system.coordinates])
        zero = np.zeros(1)

        def entries(q: Array) -> tuple[Array, Array]:
            at = States(q[None], 0 * q[None], zero, self.defaults[None], zero)
            found = self.values(at)
            return found["Phi"][0], found["Phi_q"][0].ravel()

        with np.errstate(all="ignore"):
            return np.where(is_turn, 1.0, size_of(entries, None, is_turn, guess) or 1.0)

    def scaled(self, values: Mapping[str, Array], states: States) -> dict[str, Right]:
        """Return quantities in this form, (N, rows, 1 or n) each, with the scales of their rows.

        A row has the scale of its largest contribution: an entry of Phi_q times the scale of its
        coordinate.
        """
        Phi_q = np.max(finite(np.abs(values["Phi_q"])) * self.arms, axis=-1, keepdims=True)
        reach, rate = positive(Phi_q), self.rate(states)
        nu, gamma = (np.abs(finite(values[name])) for name in ("nu", "gamma"))
        scales = {
            "Phi": reach,
            "Phi_q": reach / self.arms,
            "nu": np.maximum(reach * rate, nu),
            "gamma": np.maximum(reach * rate**2, gamma),
        }
        return {name: self.right(values[name], scales[name], states) for name in scales}

    def right(self, values: Array, scale: Array, states: States) -> Right:
        """Return values with their scales, and what is lost where the mechanism stands far away."""
        place = np.max(np.abs(states.q) / self.base.arms, axis=-1)[:, None, None]
        return Right(values, scale, (OF_ROW + ROUNDING * place) * scale)

    def rate(self, states: States) -> float:
        """Return the largest rate of states in sizes and radians; 1 where they rest."""
        return float(np.max(np.abs(states.q_dot) / self.base.sizes)) or 1.0

    def expressed(self, values: Mapping[str, Array], states: States) -> Mapping[str, Array]:
        """Return quantities by the coordinates, (N, rows, 1 or n) each, in this form: as is."""
        del states
        return values

    def in_axes(self, block: Array, body: Body, states: States) -> Array:
        """Return columns by the rotation of a body, (N, rows, k), in this form: as they are."""
        del body, states
        return block

    def gradient(self, Phi_q: Callable[[States], Array]) -> Callable[[States], Array]:
        """Return a function that gives Phi_q by the coordinates, not in this form."""
        return Phi_q

    def near(self, rows: Sequence[int], like: States) -> States | None:
        """Return states near the assembled guess at which the given equations hold.

        Times and parameters are those of `like`, rates are near them. Near the guess, for an
        equation may hold in other assemblies too: where the sine of an angle vanishes, the angle is
        0 or pi. None where no states are found.
        """
        return self._on_manifold(self.about_guess(like), list(rows))

    def about_guess(self, like: States) -> States:
        """Return states with other positions, about the assembled guess."""
        aside = np.random.default_rng(SEED).uniform(-ASIDE, ASIDE, like.q.shape)
        return replace(like, q=self._start + self.sizes * aside)

    @cached_property
    def _start(self) -> Array:
        """The guess, assembled where that is possible."""
        guess = np.array([item.guess for item in self.system.coordinates])
        states = replace(self.random.take(np.arange(2)), q=np.tile(guess, (2, 1)), t=np.zeros(2))
        states = states.with_default_parameters(self.defaults)
        found = self._on_manifold(states, list(range(len(self.equations))))
        return guess if found is None else found.q[0]

    def _on_manifold(self, start: States, rows: list[int]) -> States | None:
        def constraints(states: States) -> tuple[Array, Array, Array]:
            found = self.values(states)
            Phi, Phi_q, nu = (found[name][:, rows] for name in ("Phi", "Phi_q", "nu"))
            return Phi, Phi_q, nu

        return consistent_states(start, constraints)

    def evaluate(self, expressions: Sequence[sympy.Expr], states: States) -> tuple[Array, Array]:
        """Evaluate SymPy expressions of coordinates, rates, parameters and time.

        Returns
        -------
        tuple of arrays
            The values and the sizes of their terms: the sum of the absolute values of the terms, in
            brackets too. Both of shape (N, number of expressions).
        """
        known = self._evaluated.setdefault(states, {})
        self._add(known, [item for item in expressions if item not in known], states)
        values, sizes = np.array([known[item] for item in expressions]).transpose(1, 2, 0)
        return values, sizes

    def term_sizes(self, quantity: str, states: States) -> Array:
        """Return the sizes of the terms of a quantity, (N, m, 1) or (N, m, n)."""
        columns = len(self.coordinates) if quantity == "Phi_q" else 1
        places = [(row, column) for row in range(len(self.equations)) for column in range(columns)]
        _, sizes = self.evaluate([self.expression(quantity, *place) for place in places], states)
        return sizes.reshape(len(states), -1, columns)

    def _add(
        self, known: dict[sympy.Expr, Array], expressions: Sequence[sympy.Expr], states: States
    ) -> None:
        """Evaluate expressions that are not known yet: value and size of each, (2, N)."""
        nodes, terms = _converted(tuple(expressions))
        with np.errstate(all="ignore"):
            inputs, tables = self.inputs(states), self.program.tables
            results = run(nodes, inputs, tables)
            lost = cancelled(nodes, results, inputs, tables)
            for item, own in zip(expressions, terms, strict=True):
                known[item] = np.zeros((2, len(states)))
                for node in own:
                    known[item][0] += results[node]
                    known[item][1] += np.abs(results[node]) + lost[node]

    def difference(self, states: States, written: Array, right: Array) -> Difference:
        """Return the state at which an entry differs the most, of values of shape (N,)."""
        k = int(np.argmax(np.nan_to_num(np.abs(written - right), nan=np.inf, posinf=np.inf)))
        state = {name: float(value[k]) for name, value in self.inputs(states).items()}
        return Difference(state, float(right[k]), float(written[k]))

    def inputs(self, states: States) -> dict[str, Array]:
        """Return the values of coordinates, rates, parameters and t by name, (N,) each.

        In space also those of the angular velocities of bodies.
        """
        if states not in self._inputs:
            self._inputs[states] = self._inputs_at(states)
        return self._inputs[states]

    def _inputs_at(self, states: States) -> dict[str, Array]:
        inputs = {"t": states.t}
        for k, item in enumerate(self.system.parameters):
            inputs[item.name] = states.p[:, k]
        for k, name in enumerate(self.base.coordinates):
            inputs[name] = states.q[:, k]
            inputs[rate(name)] = states.q_dot[:, k]
        graph = Graph()
        convert = Converter(graph, graph.input).convert
        nodes = {name: convert(spin) for name, spin in self.spins.items() if name not in inputs}
        results = run(graph.nodes, inputs, self.program.tables)
        return inputs | {name: results[node] for name, node in nodes.items()}


@lru_cache(maxsize=8)  # formulas are read in hundreds of ways, each at states of its own
def _converted(expressions: tuple[sympy.Expr, ...]) -> tuple[list[Node], list[list[int]]]:
    """Return expressions as a graph, and the nodes of the terms of each."""
    graph = Graph()
    convert = Converter(graph, graph.input).convert
    terms = [[convert(term) for term in sympy.Add.make_args(item)] for item in expressions]
    return graph.nodes, terms
