"""The motion that `solve` found, point by point, and what Phi_q says of its points.

The condition number is free of units: how much an error may grow in the solve. The branch is shown
by the signs of the determinants of the structural blocks: two assembled positions that differ in a
sign cannot be reached from each other without passing a singular configuration. The planned solve
of a module, in one piece or in blocks, has the determinants at hand.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.html import Tabled, picture_html
from kincompile.names import listed
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Dense, Planned
from kincompile.runtime.engine.sparse import Sparse
from kincompile.runtime.problem import problem
from kincompile.runtime.results.columns import MotionTable
from kincompile.runtime.results.html import solution_html
from kincompile.runtime.results.measures import measures
from kincompile.runtime.results.observed import observed
from kincompile.runtime.results.plot import plot_columns, plot_html
from kincompile.runtime.results.shapes import Dwell, PathDeviation, dwell, path_deviation
from kincompile.runtime.singular.events import BIFURCATION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import ModuleType

    from matplotlib.axes import Axes
    from numpy.typing import NDArray
    from scipy.spatial.transform import Rotation

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.columns import Observed
    from kincompile.runtime.results.measures import Measures

    Signs = NDArray[np.int8]

BLOCK = 512
"""Points at a time, so that memory is bounded."""

STRIP = 2048
"""Points at a time whose determinants are taken, so that arrays stay in the cache."""

LARGEST_DENSE = 300
"""Coordinates up to which all singular values are computed; beyond, the condition is estimated,
but where equations are redundant."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Solution(MotionTable):
    """Position, velocity and acceleration over a time grid of N points, n coordinates.

    Where B variants were solved, all arrays but `t` have a leading axis of length B.
    ``solution["phi_rod"]``, ``solution["x_crank_dot"]`` and ``solution["x_crank_ddot"]`` give
    columns by name, and so do ``solution["rod.phi"]`` and ``solution["crank.x_dot"]``.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time, in the order in which it was asked for.
    q, q_dot, q_ddot : ndarray, shape (N, n)
        Coordinates and their first and second time derivatives, in the units of `units` per second
        and per second squared. NaN where they were not found: `status` then says why.
    status : ndarray of int, shape (N,)
        A `Status` for each point; 0 where everything converged.
    residual : ndarray, shape (N,)
        Largest absolute value of Phi after the last correction; NaN where nothing was evaluated.
    iterations : ndarray of int, shape (N,)
        Newton iterations since the previous point, sub-steps included; of `kc.simulate` steps.
    success : bool
        Whether every point converged.
    message : str
        One sentence; on failure the time, the status, the equations with the largest residual and
        what to do.
    name : str
        Name of the mechanism.
    coordinates, equations : tuple of str
        Names of the columns of q and of the rows of Phi.
    units : dict
        Unit of each coordinate and parameter, "" if none.
    parameters : dict
        Value of each parameter that was used; of variants one each, shape (B,).
    sweep : dict
        Of variants, the arrays of values that were given, by the names of their parameters.
    statistics : dict
        How it was found: ``coarse``, points of the coarse march of a grid; ``marched``, points that
        were followed one by one with a pivoted solve; of large mechanisms ``pivoted``, solves for
        which the planned one was not good enough. Of a simulation ``steps`` and ``evaluations``.
    events : list of Event
        Lock-ups, bifurcations and jumps, in order, each with `.kind`, `.t`, `.bodies`, `.message`.
        Those of variants are found by solving a variant alone.
    module : module or None
        The emitted module; None in a copy from another process.
    doubt : str
        That the first position is on another branch than the guess or the drawing shows, or that
        another one is as near to it; "" without a doubt.
    reasons : tuple of str
        Of a motion that failed what happened, which limit it met, what to do, and the residuals;
        "" where that is not known.
    """

    iterations: NDArray[np.int64]
    success: bool
    equations: tuple[str, ...]
    statistics: dict[str, int]
    module: ModuleType | None
    _observed: dict[str, Observed] = field(default_factory=dict)
    doubt: str = ""
    reasons: tuple[str, ...] = ()

    @property
    def observed(self) -> Observed:
        """The outputs and their rates; evaluated on first access."""
        if "outputs" not in self._observed:
            code = code_of(self.require_module("its outputs"))
            self._observed["outputs"] = self._over_motion(code)
        return self._observed["outputs"]

    @property
    def joints(self) -> Observed:
        """Columns on request: the points of the joints, ``x_<joint>`` and so on.

        In space the angular velocities of bodies too, ``omega_x_<body>`` to ``omega_zeta_<body>``.
        """
        if "joints" not in self._observed:
            code = code_of(self.require_module("its joints"))
            self._observed["joints"] = self._over_motion(code.points())
        return self._observed["joints"]

    def _over_motion(self, code: Compiled) -> Observed:
        return observed(code, (self.q, self.q_dot, self.q_ddot), self.t, self.p)

    def observing(self, outputs: Observed) -> Solution:
        """Return the same motion with other outputs."""
        units = {**self.units, **outputs.units}
        return replace(self, units=units, _observed={**self._observed, "outputs": outputs})

    def require_module(self, wanted: str) -> ModuleType:
        """Return the emitted module; raise an error that names what needs it if it is not here."""
        if self.module is None:
            raise InputError(
                f"this Solution of {self.name} was pickled, and the compiled module was not: read "
                f"{wanted} before pickling, or solve again."
            )
        return self.module

    @property
    def condition(self) -> NDArray[np.float64]:
        """Condition number of the scaled Phi_q at every point, shape (N,); NaN without a position.

        Lengths are measured in sizes of the mechanism and angles in radians, so that it does not
        depend on units. Computed on each access. 1e8 and more is a singular configuration.
        """
        return self._at_points(conditions)

    @property
    def branch(self) -> NDArray[np.int8]:
        """Branch signature of every point, shape (N, blocks); 0 without a position.

        The signs of the determinants of the structural blocks of Phi_q: as long as none changes,
        the motion stays on its branch. Computed on each access.
        """
        if len(self.equations) > len(self.coordinates):
            passed = [event.t for event in self.events if event.kind == BIFURCATION]
            return counted_signatures(self.q, self.t, passed)
        return self._at_points(signatures)

    def variant(self, number: int) -> Solution:
        """Return one of the variants, counted from 0, as a solution of its own.

        Raises
        ------
        InputError
            When there is none of this number.
        """
        if self.q.ndim == 2 or not -len(self.q) <= number < len(self.q):
            count = f"{len(self.q)} variants, counted from 0" if self.q.ndim > 2 else "no variants"
            raise InputError(f"this Solution of {self.name} has {count}: there is no {number!r}.")
        names = ("q", "q_dot", "q_ddot", "status", "residual", "iterations")
        arrays: dict[str, Any] = {name: getattr(self, name)[number] for name in names}
        own = {name: float(values[number]) for name, values in self.parameters.items()}
        one = replace(self, **arrays, parameters=own, sweep={}, _observed={})
        return replace(one, success=bool(one.good.all()))

    def _at_points(self, function: Callable[..., NDArray[Any]]) -> NDArray[Any]:
        """Return a function of code, q, t and p for the motion, or for that of each variant."""
        code = code_of(self.require_module(".condition and .branch"))
        if self.q.ndim == 2:
            return function(code, self.q, self.t, self.p)
        variants = zip(self.q, self.p, strict=True)
        return np.array([function(code, q, self.t, one) for q, one in variants])

    def __getstate__(self) -> list[Any]:
        """Return everything but the module, which cannot be pickled; outputs are evaluated now."""
        if self.module is not None:
            _ = self.observed
        given = {item.name: getattr(self, item.name) for item in fields(self)}
        return list((given | {"module": None}).values())

    def __setstate__(self, state: list[Any]) -> None:
        """Restore the attributes that `__getstate__` returned."""
        for item, value in zip(fields(self), state, strict=True):
            object.__setattr__(self, item.name, value)

    def measures(self) -> Measures:
        """Measure what every output does, points included, and how far every driver can go.

        Returns
        -------
        Measures
            Of each output the extremes with their times, stroke, dead points, period and time
            ratio, mean and root mean square; of each driver the values at which the mechanism
            locks up. ``print(solution.measures())`` shows tables. Times are located between those
            of the grid, to 1e-9 of the span; a reversal that the grid does not show is missed.

        Raises
        ------
        InputError
            If the solution is one of variants, holds no point that was found, or was pickled.
        """
        return measures(self, code_of(self.require_module("its measures")), self.p)

    def straightness(self, point: str, between: Any = None, line: Any = None) -> PathDeviation:
        """Return how far the path of a point in the plane is from a straight line.

        Parameters
        ----------
        point
            Name of a point or a drawn joint, or of a body, whose origin is meant.
        between
            The part of the motion: two times, or the range of a column, as
            ``{"crank.phi": (1, 2)}``; all of it without.
        line
            Two places (x, y) on the line; without, the line with the least sum of squared distances
            at equal steps of time.

        Returns
        -------
        PathDeviation
            The largest distance to either side, when it is, and the line.

        Raises
        ------
        InputError
            If there is no such point, or no such part of the motion.
        """
        return path_deviation(self, point, between, "line", line)

    def roundness(self, point: str, between: Any = None, circle: Any = None) -> PathDeviation:
        """Return how far the path of a point in the plane is from a circle.

        It is as `straightness`; `circle` is a centre and a radius, ``(x, y, r)``.
        """
        return path_deviation(self, point, between, "circle", circle)

    def dwell(self, column: str, within: float, at: float | str = "max") -> Dwell:
        """Return how long a column stays near a value: time, and how far each driver moves.

        Parameters
        ----------
        column
            A coordinate or an output.
        within
            How far it may be from the value, in its unit, to either side.
        at
            The value, or ``"max"`` or ``"min"``: its greatest or least one.

        Returns
        -------
        Dwell
            The longest dwell. Of a motion that ends as it began, one that goes on behind the end is
            one.

        Raises
        ------
        InputError
            If there is no such column, or the tolerance is not positive.
        """
        code = code_of(self.require_module("its dwells"))
        return dwell(self, code, self.p, column, within, at)

    def plot(
        self,
        *names: str,
        x: str | None = None,
        ax: Axes | None = None,
        angle_unit: str = "rad",
    ) -> Axes:
        """Draw columns over time, or over another column: ``plot("ram.y", x="crank.phi")``.

        Over time events and gaps are marked. Over another column dots stand at equal times, and
        ``plot("foot.y", x="foot.x")`` is the path of a point, with equal scales. Each variant has
        a colour, with a legend, or a colour bar where they are many.

        Parameters
        ----------
        *names
            Columns, as ``"phi_rod_dot"`` or ``"rod.phi_dot"``; without any, the outputs that move,
            and of a model without outputs the coordinates that do.
        x : str, optional
            The column along the horizontal axis; without it, time.
        ax : matplotlib.axes.Axes, optional
            Draws all of them into this plot. Without it there is a new figure with a panel for
            each unit, so that metres and radians do not share an axis.
        angle_unit : {"rad", "deg"}
            What angles and their rates are drawn in.

        Returns
        -------
        matplotlib.axes.Axes
            `ax`, or the first panel; ``.figure.axes`` has all.

        Raises
        ------
        InputError
            When no column has such a name; the message lists those that exist.
        UnsupportedError
            When matplotlib is not installed.
        """
        return plot_columns(self, names, x, ax, angle_unit)

    def _repr_html_(self) -> str:
        return solution_html(self) + (picture_html(self) or plot_html(self))

    def __repr__(self) -> str:
        """Return the name, the grid and the outcome in one line."""
        ends = f"t = {self.t[0]:g}" + (f" to {self.t[-1]:g}" if self.t.size > 1 else "")
        points = f"{self.t.size} point" + ("s" if self.t.size > 1 else "")
        if self.q.ndim > 2:
            points = f"{len(self.q)} variants of {points}"
        return f"<Solution of {self.name}: {points}, {ends}; {self._outcome()}>"

    def _outcome(self) -> str:
        """Return the outcome in a few words."""
        if self.success:
            return f"converged, largest residual {np.max(self.residual):.1e}"
        good = np.count_nonzero(self.good)
        return f"failed, {good} of {self.status.size} points converged; see .message"


class OfMotion(Tabled):
    """What is known over a motion: ``found["rod.phi"]`` and the like give its columns by name."""

    __slots__ = ()

    motion: Solution

    @property
    def name(self) -> str:
        """Name of the mechanism."""
        return self.motion.name

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the values of a column, shape (N,).

        Raises
        ------
        InputError
            When there is no such column.
        """
        return self.motion[name]


def require_solution(value: object) -> None:
    """Check that a value is a Solution; else say what was given, and how to get a solution."""
    if not isinstance(value, Solution):
        raise InputError(
            f"expected a Solution, got {type(value).__name__}: solve first, "
            "solution = kc.solve(kc.compile(model), t)."
        )


FIRST = "e0_"


def orientation(solution: MotionTable, body: object) -> Rotation:
    """Return the orientation of a body in space, or of this name, at every point of a motion.

    Returns
    -------
    scipy.spatial.transform.Rotation
        As many rotations as points: ``.as_matrix()`` gives A, shape (N, 3, 3), which turns
        body-fixed vectors into global ones; ``.as_rotvec()``, ``.as_euler("zxz")`` angles. It is
        not a number where no position was found, and refuses such points.

    Raises
    ------
    InputError
        If there is no such body in space, if there are several motions, or a point was not found.
    """
    from scipy.spatial.transform import Rotation

    name = str(getattr(body, "name", body))
    solution.require_one_motion("rotations are those of", "take one with .variant(k)")
    if f"{FIRST}{name}" not in solution.coordinates:
        known = [item.removeprefix(FIRST) for item in solution.coordinates if item[:3] == FIRST]
        raise InputError(
            f"{solution.name} has no body {name!r} in space; such bodies are: {listed(known)}."
        )
    p = np.stack([solution[f"e{k}_{name}"] for k in range(4)], axis=-1)
    if not np.isfinite(p).all():
        count = np.count_nonzero(~np.isfinite(p).all(axis=-1))
        raise InputError(
            f"{solution.name}: {count} of {len(p)} points have no position; see solution.message, "
            "and take a part of the motion that was found."
        )
    found: Rotation = Rotation.from_quat(p[:, [1, 2, 3, 0]])
    return found


def conditions(code: Compiled, q: Array, t: Array, p: Array) -> Array:
    """Return the condition number of the scaled Phi_q at every point of a motion, shape (N,).

    Lengths count in sizes of the mechanism, angles in radians, and each equation in what its terms
    contribute at a generic position: the number is the same in metres and in millimetres. For
    positions q (N, n) at t (N,); NaN where q is, and without equations.
    """
    result = np.full(t.size, np.nan)
    found = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not (found.size and code.equations):
        return result
    with np.errstate(all="ignore"):
        first = found[0]
        equations = problem(code, p, np.ascontiguousarray(q[first]), float(t[first]))
        columns = equations.reference
        rows = equations.weights()
        for start in range(0, found.size, BLOCK):
            part = found[start : start + BLOCK]
            if columns.size <= LARGEST_DENSE or rows.size > columns.size:
                matrices = code.Phi_q(np.ascontiguousarray(q[part]), t[part], p)
                even = rows[:, np.newaxis] * matrices * columns
                sizes = np.linalg.svd(even, compute_uv=False)
                result[part] = sizes[:, 0] / sizes[:, -1]
            else:
                result[part] = [_estimate(code, q[k], t[k], p, rows, columns) for k in part]
    return result


def _estimate(code: Compiled, q: Array, t: float, p: Array, rows: Array, columns: Array) -> float:
    """Return an estimate in the 1-norm (Higham and Tisseur) from a sparse factorization."""
    # Importing SciPy's sparse matrices takes longer than the whole runtime.
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import LinearOperator, onenormest, splu

    i, j = code.pattern.T
    values = rows[i] * code.nonzeros(np.ascontiguousarray(q), t, p) * columns[j]
    matrix = csc_array((values, (i, j)), shape=(rows.size, columns.size))
    try:
        factored: Any = splu(matrix)
    except RuntimeError:  # exactly singular
        return np.inf
    inverse: Any = LinearOperator(  # type: ignore[call-arg, misc]  # its __new__ hides the names
        matrix.shape,
        matvec=factored.solve,
        rmatvec=lambda b: factored.solve(b, trans="T"),
        matmat=factored.solve,
        rmatmat=lambda b: factored.solve(b, trans="T"),
        dtype=np.float64,
    )
    return float(onenormest(inverse) * abs(matrix).sum(axis=0).max())


def signatures(code: Compiled, q: Array, t: Array, p: Sequence[float]) -> Signs:
    """Return the signature of each point of a motion, shape (N, blocks), for q (N, n) at t (N,).

    It is 0 where q is NaN.
    """
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    with np.errstate(all="ignore"):
        parts = list(_signs(code, q[known], t[known], np.asarray(p, dtype=np.float64)))
    found = np.nan_to_num(np.concatenate(parts)) if parts else np.zeros((0, 1))
    result = np.zeros((t.size, found.shape[1]), dtype=np.int8)
    result[known] = found
    return result


def _signs(code: Compiled, q: Array, t: Array, p: Array) -> Iterator[Array]:
    """Yield the signs of known positions, some at a time."""
    if code.lanes is None:
        engine = Sparse(code, p) if code.blocks else Dense(code, p)
        for position, time in zip(q, t.tolist(), strict=True):
            yield np.array([engine.signs(engine.evaluate(np.ascontiguousarray(position), time))])
        return
    planned = Planned(code, p)
    for start in range(0, t.size, STRIP):
        lanes = np.ascontiguousarray(q[start : start + STRIP].T)
        point = planned.evaluate(lanes, t[start : start + STRIP])
        yield np.sign(planned.determinants(point, point)).T


def counted_signatures(q: Array, t: Array, passed: Sequence[float]) -> Signs:
    """Return the signature of a motion with redundant equations, shape (N, 1); 0 where q is NaN.

    They have no determinant; the sign is that of the start, and changes with every bifurcation that
    was passed, at these times.
    """
    way = np.abs(t - t[0])
    count = sum(((way > abs(time - t[0])).astype(int) for time in passed), np.zeros(t.size, int))
    signs = np.where(np.isfinite(q).all(axis=1), 1 - 2 * (count % 2), 0)
    return signs.astype(np.int8)[:, np.newaxis]
