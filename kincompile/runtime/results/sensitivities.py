r"""Exact derivatives of a motion by parameters: position, velocity, acceleration and outputs.

The right sides come from the mechanism with its sensitivities (`ir/sensitive.py`), compiled on
request; the matrix is the mechanism's own Phi_q for all of them,

.. math:: \Phi_q q_a = -\Phi_a, \qquad \Phi_q \dot q_a = \nu_a - C \dot q, \qquad
          \Phi_q \ddot q_a = \gamma_a - C \ddot q, \qquad C = (\Phi_q q_a + \Phi_a)_q,

so that it is factored once a point, whatever the number of parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import SMALLEST_DETERMINANT
from kincompile.errors import InputError, UnsupportedError
from kincompile.html import Shown
from kincompile.names import (
    column_name,
    listed,
    parameters_problem,
    quotient_unit,
    rate,
    suggestion,
)
from kincompile.runtime.engine.code import SENSITIVITIES, code_of
from kincompile.runtime.engine.planned import Planned, stacked
from kincompile.runtime.memory import empty
from kincompile.runtime.results.columns import rate_unit
from kincompile.runtime.results.observed import observed
from kincompile.runtime.results.solution import require_solution
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Code
    from kincompile.runtime.results.solution import Solution

    Lanes = Sequence[Any]
    Solver = Callable[[Lanes], Lanes]
    Coupling = Sequence[tuple[int, int, Any]]

BLOCK = 2000
"""Points at a time, so that intermediate arrays stay in the cache."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sensitivities(Shown):
    """Derivatives of a motion by k parameters, over N points of n coordinates and r outputs.

    ``found["phi_rod", "a"]``, ``found["rod.phi_dot", "a"]`` and the like give them by name. All are
    NaN where the motion was not found, or has no velocity. Of B parameter sets, all arrays have a
    leading axis of length B.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time.
    q_p, q_dot_p, q_ddot_p : ndarray, shape (N, n, k)
        Derivatives of the coordinates, their rates and second rates.
    y_p, y_dot_p, y_ddot_p : ndarray, shape (N, r, k)
        Those of the outputs; NaN where an output has no such rate.
    name
        Name of the mechanism.
    coordinates, outputs, parameters : tuple of str
        What the axes belong to.
    units : dict
        Unit of each coordinate, output and parameter.
    """

    t: Array
    q_p: Array
    q_dot_p: Array
    q_ddot_p: Array
    y_p: Array
    y_dot_p: Array
    y_ddot_p: Array
    name: str
    coordinates: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: dict[str, str]

    def __getitem__(self, names: tuple[str, str]) -> Array:
        """Return the derivative of a column by a parameter, shape (N,).

        Raises
        ------
        InputError
            When there is no such column, or no such parameter among those asked for.
        """
        column, parameter = _pair(names, self.name)
        k = self._place(parameter)
        name, order = self._found(column)
        if name in self.coordinates:
            values = (self.q_p, self.q_dot_p, self.q_ddot_p)[order]
            return values[..., self.coordinates.index(name), k]
        values = (self.y_p, self.y_dot_p, self.y_ddot_p)[order]
        return values[..., self.outputs.index(name), k]

    def unit(self, column: str, parameter: str) -> str:
        """Return the unit of the derivative of a column by a parameter: that of their quotient."""
        self._place(parameter)
        name, order = self._found(column)
        return quotient_unit(rate_unit(self.units[name], order), self.units[parameter])

    def _place(self, name: str) -> int:
        """Return the number of a parameter."""
        if name in self.parameters:
            return self.parameters.index(name)
        near = suggestion(name, self.parameters) or "."
        raise InputError(
            f"{self.name} has no sensitivities to {name!r}{near} There are those to "
            f"{listed(self.parameters)}; ask kc.sensitivities for others."
        )

    def _found(self, column: str) -> tuple[str, int]:
        """Return the coordinate or output, and the order of the rate, that a name means."""
        wanted, known = column_name(column), (*self.coordinates, *self.outputs)
        for name in known:
            for order in range(3):
                if rate(name, order) == wanted:
                    return name, order
        near = suggestion(wanted, known) or "."
        raise InputError(
            f"{self.name} has no column {column!r}{near} There are {listed(known)}; add _dot or "
            "_ddot for the rates."
        )

    def to_text(self) -> str:
        """Return a table: by parameter, the largest absolute derivative of each column."""
        rows = [
            (name, parameter, f"{_largest(self[name, parameter]):.6g}", self.unit(name, parameter))
            for name in (*self.coordinates, *self.outputs)
            for parameter in self.parameters
        ]
        lines = table(("column", "by", "largest", "unit"), rows, right=("largest",))
        return "\n".join([self.headline(), *indented(lines)])

    def headline(self) -> str:
        """Return the name and the parameters."""
        return f"{self.name}: sensitivities to {listed(self.parameters)} at {self.t.size} times"


def _largest(values: Array) -> float:
    found = np.abs(values[np.isfinite(values)])
    return float(found.max()) if found.size else np.nan


def _pair(names: object, mechanism: str) -> tuple[str, str]:
    """Return a column and a parameter, checked."""
    match names:
        case (str(column), str(parameter)):
            return column, parameter
    raise InputError(
        f"sensitivities of {mechanism} are asked for by a column and a parameter, as in "
        f'found["rod.phi", "a"], not by {names!r}.'
    )


def sensitivities(solution: Solution, parameters: str | Sequence[str]) -> Sensitivities:
    r"""Differentiate a motion by parameters, exactly.

    With :math:`\Phi(q, t, p) = 0` all derivatives of q, its rates and the outputs are solutions of
    linear systems whose matrix is Phi_q. Their right sides are derived and compiled on request.

    Parameters
    ----------
    solution
        A motion, or one for each of several parameter sets.
    parameters
        Names of parameters.

    Returns
    -------
    Sensitivities
        ``found["rod.phi", "a"]`` is :math:`\partial\varphi_{rod}/\partial a` over time.

    Raises
    ------
    InputError
        If this is no Solution, or one that was pickled or solved with a module from a file, or a
        name is none of a parameter, or is there twice.
    UnsupportedError
        If the mechanism is so large that its module is in grouped form.
    """
    require_solution(solution)
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    if problem := parameters_problem(names, tuple(solution.parameters), solution.name):
        raise InputError(problem)
    module = solution.require_module("its sensitivities")
    larger = _compiled(module, names)
    p = np.array(list(solution.parameters.values()), dtype=np.float64)
    found = _over_motion(solution, code_of(module), code_of(larger), p, len(names))
    q_p, q_dot_p, q_ddot_p = (np.moveaxis(part, (0, 1), (-1, -2)) for part in found)
    y_p, y_dot_p, y_ddot_p = _of_outputs(solution, larger, found, p)
    outputs = solution.observed
    return Sensitivities(
        solution.t,
        *(q_p, q_dot_p, q_ddot_p),
        *(y_p, y_dot_p, y_ddot_p),
        solution.name,
        solution.coordinates,
        outputs.names,
        names,
        {**solution.units, **outputs.units},
    )


def _of_outputs(
    solution: Solution, larger: ModuleType, found: Array, p: Array
) -> tuple[Array, ...]:
    """Return the derivatives of outputs and their rates, (..., N, r, k) each."""
    shape, k, r = solution.q.shape[:-1], found.shape[1], len(solution.observed.names)
    if not r:
        return (np.empty((*shape, 0, k)),) * 3
    motion = []
    for own, part in zip((solution.q, solution.q_dot, solution.q_ddot), found, strict=True):
        derivatives = np.moveaxis(part, (0, 1), (-2, -1)).reshape(*shape, -1)
        motion.append(np.concatenate((own, derivatives), axis=-1))
    seen = observed(larger, (motion[0], motion[1], motion[2]), solution.t, p.T)
    return tuple(
        np.swapaxes(part[..., r:].reshape(*shape, k, r), -1, -2)
        for part in (seen.y, seen.y_dot, seen.y_ddot)
    )


def _compiled(module: ModuleType, names: tuple[str, ...]) -> ModuleType:
    """Return the module of a mechanism with its sensitivities."""
    compiled = vars(module).get(SENSITIVITIES)
    if compiled is None and code_of(module).evaluate is not None:
        raise UnsupportedError(
            f"{module.NAME} is in grouped form, as large mechanisms are, and that has no "
            "sensitivities: differentiate a part of it, or use form='inline'."
        )
    if compiled is None:
        raise InputError(
            f"the module of {module.NAME} was loaded from a file, which knows no more than its "
            "own functions: compile the model, solve with that, then ask for sensitivities."
        )
    larger: ModuleType = compiled(names)
    return larger


def _over_motion(solution: Solution, code: Code, larger: Code, p: Array, k: int) -> Array:
    """Return the derivatives of q, q_dot and q_ddot, shape (3, k, n, ..., N)."""
    shape, n = solution.q.shape[:-1], len(code.coordinates)
    motion = [part.reshape(-1, n).T for part in (solution.q, solution.q_dot, solution.q_ddot)]
    times = np.broadcast_to(solution.t, shape).ravel()
    sets = p if p.ndim == 1 else np.repeat(p, shape[-1], axis=1)
    found = empty((3, k, n, times.size))
    finite = np.isfinite(motion[1].sum(axis=0))
    with np.errstate(all="ignore"):
        for start in range(0, times.size, BLOCK):
            own = slice(start, start + BLOCK)
            parameters = p if p.ndim == 1 else sets[:, own]
            states = [state[:, own] for state in motion]
            _fill(code, _Points(larger, parameters, times[own], *states), found[..., own])
    if not finite.all():
        found[..., ~finite] = np.nan
    return found.reshape(3, k, n, *shape)


def _fill(code: Code, points: _Points, found: Array) -> None:
    """Fill in the derivatives at a batch of points, shape (3, k, n, N)."""
    left = np.isfinite(points.q_dot.sum(axis=0))
    if code.lanes is not None:
        solve, trusted = _planned(code, points)
        points.fill(found, solve, len(code.equations))
        left &= ~trusted
    if left.any():
        p = points.p[:, left] if points.p.ndim > 1 else points.p
        states = [state[:, left] for state in (points.q, points.q_dot, points.q_ddot)]
        some = _Points(points.larger, p, points.t[left], *states)
        part = np.empty((*found.shape[:-1], np.count_nonzero(left)))
        some.fill(part, _dense(code, some), len(code.equations))
        found[..., left] = part


class _Zero:
    """A lane that is zero at all points: what is multiplied by it costs nothing.

    Most parameters move few coordinates, and which ones is found while the lanes are computed.
    """

    __array_ufunc__ = None  # so that arrays leave the operation to it

    def __float__(self) -> float:
        """Return zero, where it is put into an array."""
        return 0.0

    def _itself(self, _: object = None) -> _Zero:
        return self

    def _other(self, other: Any) -> Any:
        return other

    def __rsub__(self, other: Any) -> Any:
        """Return the other."""
        return other

    def __sub__(self, other: Any) -> Any:
        """Return the other with its sign changed."""
        return -other

    __mul__ = __rmul__ = __truediv__ = __neg__ = _itself
    __add__ = __radd__ = _other


ZERO = _Zero()


def _is_zero(lane: Any) -> bool:
    """Return whether a lane is the plain number zero."""
    return not isinstance(lane, np.ndarray | _Zero) and lane == 0


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """A batch of points, a lane each coordinate, and the larger mechanism there."""

    larger: Code
    p: Array
    t: Array
    q: Array
    q_dot: Array
    q_ddot: Array

    def fill(self, found: Array, solve: Solver, m: int) -> None:
        """Fill in the derivatives, shape (3, k, n, N), by a solve with Phi_q of m equations."""
        lanes, k = self.larger.module.LANES, found.shape[1]
        f, n = self.larger.arrays, len(self.q)
        Phi_a = lanes["position"](f, [*self.q, *([ZERO] * (k * n))], self.t, self.p)
        sides = [-x for x in Phi_a[: m * (k + 1)]]
        q = [*self.q, *_solved(found[0], solve, sides)]
        coupling = self._coupling(q, m, n)
        nu = _reduced(lanes["nu"](f, q, self.t, self.p), coupling, self.q_dot)
        q_dot = [*self.q_dot, *_solved(found[1], solve, nu)]
        gamma = lanes["gamma"](f, q, q_dot, self.t, self.p)
        _solved(found[2], solve, _reduced(gamma, coupling, self.q_ddot))

    def _coupling(self, q: Lanes, m: int, n: int) -> list[tuple[int, int, Any]]:
        """Return row, column and value of the entries left of the diagonal blocks."""
        module, code = self.larger.module, self.larger
        values = module.LANES["position"](code.arrays, q, self.t, self.p)
        constants = vars(module)["_CONSTANTS"]
        varying = iter(values[len(code.equations) :])
        entries = []
        for number, (row, column) in enumerate(code.pattern.tolist()):
            constant = constants.get(number)
            value = next(varying) if constant is None else constant
            if row >= m and column < n:
                entries.append((row, column, value))
        return entries


def _reduced(sides: Lanes, coupling: Coupling, rates: Array) -> Lanes:
    """Return right sides without the part of the rates that are known."""
    sides = list(sides)
    for row, column, value in coupling:
        sides[row] = sides[row] - value * rates[column]
    return sides


def _solved(found: Array, solve: Solver, sides: Lanes) -> Lanes:
    """Fill in derivatives, shape (k, n, N), and return their lanes; `sides` has q's own first."""
    lanes: list[Any] = []
    m = len(sides) // (len(found) + 1)
    for part, place in enumerate(found, start=1):
        own = [ZERO if _is_zero(x) else x for x in sides[m * part : m * (part + 1)]]
        solution = solve(own)
        for row, lane in zip(place, solution, strict=True):
            row[:] = lane
        lanes.extend(solution)
    return lanes


def _planned(code: Code, points: _Points) -> tuple[Solver, NDArray[np.bool_]]:
    """Return the planned solve, and where it can be trusted."""
    engine = Planned(code, points.p)
    point = engine.evaluate(points.q, points.t)
    sizes = np.abs(engine.determinants(point))
    smallest = SMALLEST_DETERMINANT * np.max(sizes, axis=1, initial=0.0, where=sizes < np.inf)
    return partial(engine.solve, point), np.all(sizes > smallest[:, np.newaxis], axis=0)


def _dense(code: Code, points: _Points) -> Solver:
    """Return the solve by singular values; of redundant equations by least squares."""
    found = code.Phi_q(points.q.T.copy(), points.t, points.p.T)
    inverses = np.linalg.pinv(found)
    return lambda b: np.einsum("lij,jl->il", inverses, stacked(b, points.t.size))
