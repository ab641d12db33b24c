r"""Exact derivatives of a motion by parameters: position, velocity, acceleration and outputs.

The matrix is the mechanism's own Phi_q for all of them. Straight-line code with the planned
elimination in it (`ir/implicit.py`) gives them, compiled on request for these parameters. Where
that may not be trusted, and of redundant equations, the right sides come from the mechanism with
its sensitivities (`ir/sensitive.py`),

.. math:: \Phi_q q_a = -\Phi_a, \qquad \Phi_q \dot q_a = \nu_a - C \dot q, \qquad
          \Phi_q \ddot q_a = \gamma_a - C \ddot q, \qquad C = (\Phi_q q_a + \Phi_a)_q.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

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
from kincompile.runtime.memory import empty
from kincompile.runtime.results.columns import rate_unit
from kincompile.runtime.results.observed import observed
from kincompile.runtime.results.solution import require_solution
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Code, SensitiveModules
    from kincompile.runtime.results.solution import Solution

    Coupling = Sequence[tuple[int, int, Array]]

BLOCK = 500
"""Points whose matrices are taken at a time, so that they fit into memory."""


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


def sensitivities(
    solution: Solution, parameters: str | Sequence[str], of: str | Sequence[str] | None = None
) -> Sensitivities:
    r"""Differentiate a motion by parameters, exactly.

    With :math:`\Phi(q, t, p) = 0` all derivatives of q, its rates and the outputs are solutions of
    linear systems whose matrix is Phi_q. Their code is derived and compiled on request, and kept.

    Parameters
    ----------
    solution
        A motion, or one for each of several parameter sets.
    parameters
        Names of parameters.
    of
        Coordinates and outputs that are wanted, ``["foot.x", "rod.phi"]``; all where it is not
        given. Of a few columns many parameters cost hardly more than one: they are differentiated
        by solves with the transposed matrix.

    Returns
    -------
    Sensitivities
        ``found["rod.phi", "a"]`` is :math:`\partial\varphi_{rod}/\partial a` over time.

    Raises
    ------
    InputError
        If this is no Solution, or one that was pickled or solved with a module from a file, or a
        name is none of a parameter or column, or is there twice.
    UnsupportedError
        If the mechanism is so large that its module is in grouped form.
    """
    require_solution(solution)
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    if problem := parameters_problem(names, tuple(solution.parameters), solution.name):
        raise InputError(problem)
    code = code_of(solution.require_module("its sensitivities"))
    outputs = getattr(code.module, "OUTPUTS", ())
    columns = (*code.coordinates, *outputs)
    if of is not None:
        columns = _columns((of,) if isinstance(of, str) else of, columns, solution.name)
    found = _over_motion(solution, code, names, columns)
    size = len(set(columns) & set(code.coordinates))
    parts = found[:, :, :size], found[:, :, size:]
    q_p, y_p = (np.moveaxis(part, (1, 2), (-1, -2)) for part in parts)
    return Sensitivities(
        solution.t,
        *(q_p[0], q_p[1], q_p[2]),
        *(y_p[0], y_p[1], y_p[2]),
        solution.name,
        columns[:size],
        columns[size:],
        names,
        dict(code.units),
    )


def _columns(of: Sequence[str], known: Sequence[str], mechanism: str) -> tuple[str, ...]:
    """Return the names of columns, the coordinates first."""
    wanted = [column_name(name) for name in of]
    for given, name in zip(of, wanted, strict=True):
        if name not in known:
            near = suggestion(name, known) or "."
            raise InputError(
                f"{mechanism} has no coordinate or output {given!r}{near} There are "
                f"{listed(known)}; derivatives of rates come with them."
            )
    return tuple(name for name in known if name in wanted)


def _modules(module: ModuleType) -> SensitiveModules:
    """Return what compiles a mechanism's sensitivities."""
    found: SensitiveModules | None = vars(module).get(SENSITIVITIES)
    if found is None and code_of(module).evaluate is not None:
        raise UnsupportedError(
            f"{module.NAME} is in grouped form, as large mechanisms are, and that has no "
            "sensitivities: differentiate a part of it, or use form='inline'."
        )
    if found is None:
        raise InputError(
            f"the module of {module.NAME} was loaded from a file, which knows no more than its "
            "own functions: compile the model, solve with that, then ask for sensitivities."
        )
    return found


def _over_motion(
    solution: Solution, code: Code, names: tuple[str, ...], columns: tuple[str, ...]
) -> Array:
    """Return derivatives of columns and their rates, shape (3, parameters, columns, ..., N)."""
    shape, n = solution.q.shape[:-1], len(code.coordinates)
    motion = [part.reshape(-1, n).T for part in (solution.q, solution.q_dot, solution.q_ddot)]
    times = np.broadcast_to(solution.t, shape).ravel()
    p = np.array(list(solution.parameters.values()), dtype=np.float64)
    sets = p if p.ndim == 1 else np.repeat(p, shape[-1], axis=1)
    points = _Points(code, _modules(code.module), names, columns, sets, times, *motion)
    finite = np.isfinite(motion[1].sum(axis=0))
    with np.errstate(all="ignore"):
        found, trusted = points.by_plan()
        left = np.flatnonzero(finite & ~trusted)
        for start in range(0, left.size, BLOCK):
            some = left[start : start + BLOCK]
            found[..., some] = points.at(some).by_matrices()
    if not finite.all():
        found[..., ~finite] = np.nan
    if not (accelerated := np.isfinite(motion[2].sum(axis=0))).all():  # a corner of a driver
        own = sum(name in code.coordinates for name in columns)
        found[2, :, :own, ~accelerated] = np.nan
    return found.reshape(*found.shape[:3], *shape)


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """A batch of points, and what is asked there: columns by parameters."""

    code: Code
    modules: SensitiveModules
    names: tuple[str, ...]
    columns: tuple[str, ...]
    p: Array
    t: Array
    q: Array
    q_dot: Array
    q_ddot: Array

    def at(self, some: NDArray[np.intp]) -> _Points:
        """Return some of the points."""
        p = self.p if self.p.ndim == 1 else self.p[:, some]
        states = (state[:, some] for state in (self.q, self.q_dot, self.q_ddot))
        return _Points(
            self.code, self.modules, self.names, self.columns, p, self.t[some], *states
        )  # fmt: skip

    def by_plan(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return the derivatives by the planned elimination, and where that can be trusted."""
        module = self.modules.observing(self.names, self.columns)
        size = len(self.names), len(self.columns)
        if module is None:
            return np.empty((3, *size, self.t.size)), np.zeros(self.t.size, dtype=bool)
        code = code_of(module)
        seen = empty((3, len(module.OUTPUTS), self.t.size))
        assert code.observe_into is not None
        code.observe_into((self.q, self.q_dot, self.q_ddot), self.t, self.p, seen)
        blocks = len(module.OUTPUTS) - math.prod(size)
        sizes = np.abs(seen[0, :blocks])
        smallest = SMALLEST_DETERMINANT * np.max(sizes, axis=1, initial=0.0, where=sizes < np.inf)
        trusted = np.all(sizes > smallest[:, np.newaxis], axis=0)
        found: Array = seen[:, blocks:].reshape(3, *size, -1)
        return found, trusted

    def by_matrices(self) -> Array:
        """Return the derivatives by singular values; of redundant equations by least squares."""
        larger = self.modules.larger(self.names)
        m, n, k = len(self.code.equations), len(self.code.coordinates), len(self.names)
        q, q_dot, q_ddot, t, p = self.q.T, self.q_dot.T, self.q_ddot.T, self.t, self.p.T
        inverses = np.linalg.pinv(self.code.Phi_q(q, t, p))

        def solved(sides: Array) -> Array:
            """Return derivatives, (L, k n), for right sides below the mechanism's own."""
            own = sides[:, m:].reshape(-1, k, m)
            found: Array = np.einsum("lij,lkj->lki", inverses, own).reshape(-1, k * n)
            return found

        held = np.concatenate((q, np.zeros((len(q), k * n))), axis=1)
        every_q = np.concatenate((q, solved(-larger.Phi(held, t, p))), axis=1)
        coupling = _coupling(larger, every_q, t, p, m, n)
        nu = _reduced(larger.nu(every_q, t, p), coupling, q_dot)
        every_q_dot = np.concatenate((q_dot, solved(nu)), axis=1)
        gamma = _reduced(larger.gamma(every_q, every_q_dot, t, p), coupling, q_ddot)
        every = every_q, every_q_dot, np.concatenate((q_ddot, solved(gamma)), axis=1)
        found = np.array(every)[..., n:].reshape(3, -1, k, n)
        if outputs := getattr(self.code.module, "OUTPUTS", ()):
            seen = observed(larger, every, t, p)
            y = np.array((seen.y, seen.y_dot, seen.y_ddot))[..., len(outputs) :]
            found = np.concatenate((found, y.reshape(3, -1, k, len(outputs))), axis=-1)
        known = (*self.code.coordinates, *outputs)
        places = [known.index(name) for name in self.columns]
        by_point: Array = np.moveaxis(found[..., places], 1, -1)
        return by_point


def _coupling(larger: ModuleType, q: Array, t: Array, p: Array, m: int, n: int) -> Coupling:
    """Return row, column and values of the entries left of the diagonal blocks."""
    entries = larger.Phi_q_nonzeros(q, t, p)
    return [
        (row, column, entries[:, number])
        for number, (row, column) in enumerate(larger.PATTERN.tolist())
        if row >= m and column < n
    ]


def _reduced(sides: Array, coupling: Coupling, rates: Array) -> Array:
    """Return right sides without the part of the rates that are known."""
    for row, column, values in coupling:
        sides[:, row] -= values * rates[:, column]
    return sides
