r"""Forces along a motion: reactions of joints, torques of drivers, what shakes the ground.

They follow from :math:`\Phi_q^T \lambda = Q - M \ddot q`, by code that is derived and compiled on
request. Where redundant joints share a load, or a position is singular, the system is solved by
singular values: a force that varies along the null space of the system is not determined, and NaN.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import HALF, RANK, SAME, TINY, probe_of
from kincompile.errors import InputError, SingularConfigurationWarning
from kincompile.html import Tabled
from kincompile.names import column_name, listed, multiplier, unknown
from kincompile.runtime.engine.code import FORCES, JOINTS, code_of
from kincompile.runtime.engine.linear import powers_of_rows
from kincompile.runtime.results.columns import largest
from kincompile.runtime.results.observed import Points
from kincompile.runtime.results.solution import OfMotion, Solution, orientation, require_solution
from kincompile.tables import without_noise

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled


@dataclass(frozen=True, slots=True, eq=False)
class Reaction:
    """What a joint does to its bodies, over N points; of variants with a leading axis.

    Attributes
    ----------
    force : ndarray, shape (N, 2), in space (N, 3)
        On body j, or the one body, along the fixed axes. On body i it is the opposite.
    moment : ndarray, shape (N,), in space (N, 3) along the fixed axes
        On body j, about the joint's point of it.
    moment_on_i : ndarray, shape (N,), in space (N, 3)
        On body i, about the joint's point of that.
    along_axis : ndarray, shape (N, 2), in space (N, 3)
        The force on body j along the joint's axis and across it, in space along f and g of the
        joint's triad, which turns with body j; NaN without an axis.
    moment_along_axis : ndarray, in space of shape (N, 3)
        The moment on body j along the same axes; in the plane `moment`.
    """

    force: Array
    moment: Array
    moment_on_i: Array
    along_axis: Array
    moment_along_axis: Array

    @property
    def size(self) -> Array:
        """The magnitude of the force, shape (N,)."""
        return np.asarray(np.linalg.norm(self.force, axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """What a driver does: force or torque along its value, and power [force length/s], (N,)."""

    value: Array
    power: Array
    unit: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Forces(OfMotion):
    """Forces over a motion of N points.

    ``found["A.F_x"]``, ``found["motor.drive"]`` and the like give columns by name, and so do those
    of the motion. All are NaN where the motion was not found, or has no acceleration.

    Attributes
    ----------
    motion : Solution
        The motion with the forces as columns: it can be written, plotted and shown.
    names : tuple of str
        Names of the columns of forces.
    multipliers : ndarray, shape (N, m)
        lambda, one for each equation.
    undetermined : tuple of str
        Names of multipliers and forces that no rigid model can know, because redundant joints
        share a load; they are NaN.
    """

    header = ("force", "largest", "unit")
    numbers = ("largest",)

    motion: Solution
    names: tuple[str, ...]
    multipliers: Array
    undetermined: tuple[str, ...]
    _joints: dict[str, tuple[str, ...]]
    _held: Mapping[str, str]

    def _column(self, name: str) -> Array:
        """Return a force, zeros where it is not a column since it vanishes."""
        if name in self.names:
            return self.motion.observed.column(name, 0).values
        return np.where(np.isnan(self.multipliers[..., 0]), np.nan, 0.0)

    @property
    def reactions(self) -> dict[str, Reaction]:
        """The reactions by the name of the joint."""
        return {name: self._reaction(name, bodies) for name, bodies in self._joints.items()}

    @property
    def _axes(self) -> str:
        """The fixed axes: two in the plane, three in space."""
        is_spatial = any(x.startswith("e0_") for x in self.motion.coordinates)
        return "xyz" if is_spatial else "xy"

    def _moment(self, kind: str, name: str) -> Array:
        """Return a moment of a joint, shape (N,), in space (N, 3)."""
        if self._axes == "xy":
            return self._column(f"{kind}_{name}")
        return np.stack([self._column(f"{kind}_{axis}_{name}") for axis in "xyz"], axis=-1)

    def _reaction(self, name: str, bodies: tuple[str, ...]) -> Reaction:
        drive, axes = f"drive_{name}", self._axes
        force = np.stack([self._column(f"F_{axis}_{name}") for axis in axes], axis=-1)
        moment = self._moment("T", name)
        has_forces = any(f"F_{axis}_{name}" in self.names for axis in axes)
        if axes == "xy" and drive in self.names and f"T_{name}" not in self.names:
            moment = moment if has_forces else self._column(drive)
        on_i = self._moment("T_i", name) if len(bodies) > 1 else np.full_like(moment, np.nan)
        if axes == "xy":
            return Reaction(
                force, moment, on_i, self._by_axis(name, ["F_along", "F_across"]), moment
            )
        ways = [f"{letter}_{way}" for letter in "FT" for way in ("along", "f", "g")]
        along_axis, about_axis = np.split(self._by_axis(name, ways), 2, axis=-1)
        return Reaction(force, moment, on_i, along_axis, about_axis)

    def _by_axis(self, name: str, ways: Sequence[str]) -> Array:
        """Return what a joint bears along its axis and across it, NaN where it has no axis."""
        columns = [f"{way}_{name}" for way in ways]
        if not any(column in self.names for column in columns):
            return np.full((*self.multipliers.shape[:-1], len(ways)), np.nan)
        return np.stack([self._column(column) for column in columns], axis=-1)

    @property
    def drivers(self) -> dict[str, Drive]:
        """What the drivers do, by name."""
        units = self.motion.observed.units
        found = {}
        for column in self.names:
            name = column.removeprefix("drive_")
            if name != column and name in self._joints:
                value, power = self._column(column), self._column(f"P_{name}")
                found[name] = Drive(value, power, units[column])
        return found

    @property
    def ground(self) -> Reaction:
        """What shakes the ground: force and moment about the origin."""
        force = np.stack([self._column(f"F_{axis}_ground") for axis in self._axes], axis=-1)
        moment = self._moment("T", "ground")
        nothing, no_axis = np.full_like(moment, np.nan), np.full_like(force, np.nan)
        return Reaction(force, moment, nothing, no_axis, nothing)

    def in_axes_of(self, body: str, force: Array) -> Array:
        """Return forces (N, 2), in space (N, 3), in the axes of a body, which turn with it."""
        expected = (*self.motion.t.shape, len(self._axes))
        if np.shape(force)[-2:] != expected:
            raise InputError(f"the force has shape {np.shape(force)}, expected {expected}.")
        if self._axes == "xyz":
            turned = orientation(self.motion, body).as_matrix()
            return np.asarray(np.einsum("...ji,...j->...i", turned, force))
        angle = self.motion[f"{body}.phi"]
        x, y = force[..., 0], force[..., 1]
        c, s = np.cos(angle), np.sin(angle)
        return np.stack((c * x + s * y, c * y - s * x), axis=-1)

    def measures(self) -> ForceMeasures:
        """Measure what drivers and joints bear: peak, root mean square and mean.

        Raises
        ------
        InputError
            If the solution is one of variants, or holds no point that was found.
        """
        self.motion.require_one_motion("measures are those of", "take a variant: .variant(0)")
        return force_measures(self.name, self.motion.t, self.columns())

    def columns(self) -> dict[str, tuple[Array, str]]:
        """Return values and unit of what is measured: drives, powers, loads, sizes of reactions."""
        units = self.motion.observed.units
        is_planar = self._axes == "xy"
        kinds = ("drive_", "P_", "load_", *(("T_",) if is_planar else ()))
        found = {
            name: (self._column(name), units[name]) for name in self.names if name.startswith(kinds)
        }
        for name, reaction in (*self.reactions.items(), ("ground", self.ground)):
            unit = units.get(f"F_x_{name}", units.get(f"F_y_{name}"))
            if unit is not None:
                found[f"F_{name}"] = reaction.size, unit
            if not is_planar and f"T_x_{name}" in self.names:
                size = np.asarray(np.linalg.norm(reaction.moment, axis=-1))
                found[f"T_{name}"] = size, units[f"T_x_{name}"]
        return found

    def plot(self, *names: str, **options: Any) -> Axes:
        """Draw columns over time or over another column, as `Solution.plot`; drives without names.

        Raises
        ------
        InputError
            When no column has such a name.
        UnsupportedError
            When matplotlib is not installed.
        """
        chosen = names or tuple(name for name in self.names if name.startswith("drive_"))
        return self.motion.plot(*(chosen or self.names), **options)

    def summary(self) -> str:
        """Return the table of measures, of variants that of the largest magnitudes."""
        if self.motion.q.ndim > 2 or not np.isfinite(self.multipliers).any():
            return self.to_text()
        return "\n".join([str(self.measures()), *self.remarks()])

    def rows(self) -> list[tuple[str, ...]]:
        """Return of each drive, load and reaction the largest magnitude."""
        columns = self.columns().items()
        return [(name, f"{largest(values):.6g}", unit) for name, (values, unit) in columns]

    def remarks(self) -> list[str]:
        """Return a line on what is not determined, if anything is, and on each held freedom."""
        shared = [name for name in self.undetermined if not name.startswith("lambda_")]
        found = [f"not determined, since redundant joints share it: {listed(shared)}"]
        return [*(found if shared else ()), *map(self._bearing, self._held)]

    def _bearing(self, row: str) -> str:
        """Return in words the freedom that an equation holds, and its multiplier."""
        every = np.abs(self.multipliers)
        own = every[..., self.motion.equations.index(row)]
        if not np.nanmax(own, initial=0.0) > HALF * np.nanmax(every, initial=0.0):
            return f"{self._held[row]}; no load turns it"
        return (
            f"{self._held[row]}. Loads or its inertia would turn it, and forces depend on how it "
            f"is held: {multiplier(row)} is up to {np.nanmax(own):.3g}"
        )

    def headline(self) -> str:
        """Return the name and the number of times."""
        return f"{self.name}: forces at {self.motion.t.size} times"


def forces(solution: Solution) -> Forces:
    r"""Return the forces along a motion: inverse dynamics.

    Parameters
    ----------
    solution
        A motion, or one for each of several parameter sets, of a mechanism with masses or forces.

    Returns
    -------
    Forces
        ``found.reactions["A"].force``, ``found.drivers["motor"].value``, ``found["A.F_x"]``.

    Raises
    ------
    InputError
        If this is no Solution, or one that was pickled or solved with a module from a file, or the
        mechanism has no loads.
    UnsupportedError
        If the mechanism is so large that its module is in grouped form.

    Warns
    -----
    SingularConfigurationWarning
        Where loads have no value, as a spring of length zero has no direction: forces are NaN.
    """
    require_solution(solution)
    code = code_of(solution.require_module("its forces"))
    joints = _joints(code)
    points = Points.of(solution)
    names, units, found, shared = _forces(code, points)
    if np.isnan(found).any() and (text := _without_loads(code, points)):
        warnings.warn(text, SingularConfigurationWarning, stacklevel=2)
    values = np.moveaxis(found.reshape(len(names), *solution.q.shape[:-1]), 0, -1)
    m = len(solution.equations)
    added = names[m:]
    merged = solution.observed.joined(added, {name: units[name] for name in added}, values[..., m:])
    motion = solution.observing(merged)
    return Forces(motion, added, values[..., :m], shared, dict(joints), code.held)


def no_value(name: str, bodies: Sequence[str], t: float) -> str:
    """Say that loads have no value at a time."""
    return (
        f"{name}: the loads on {listed(dict.fromkeys(bodies))} have no value at t = {t:.10g}. A "
        "spring of length zero has no direction: move one of its ends; or look for a root of a "
        "negative number in the loads."
    )


def _joints(code: Compiled) -> Mapping[str, tuple[str, ...]]:
    """Return the bodies of each constraint; refuse a mechanism whose forces cannot be had."""
    if not code.has_loads:
        raise InputError(
            f"{code.name} has no masses and no forces, so that nothing bears a load: give its "
            "bodies masses, m.body(..., mass=..., inertia=...), or add forces such as kc.Force."
        )
    return code.request(JOINTS)


def _forces(
    code: Compiled, points: Points
) -> tuple[tuple[str, ...], dict[str, str], Array, tuple[str, ...]]:
    """Return names, units, values (K, L) of multipliers and forces, and what is shared."""
    names, units = _names(code)
    left = finite = np.isfinite(points.q_ddot.sum(axis=0))
    if (planned := code.request(FORCES, True)) is not None:
        (found,), is_trusted = points.solved(planned, len(names), 1)
        left = finite & ~is_trusted
    else:
        found = np.empty((len(names), points.t.size))
    if not finite.all():
        found[:, ~finite] = np.nan
    shared = np.zeros(len(names), dtype=bool)
    for own, some in points.parts(left):
        part, loose = _by_matrices(code, some)
        found[:, own] = part.T
        shared |= loose
    return names, units, found, tuple(np.array(names)[shared].tolist())


def _names(code: Compiled) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return names and units of the multipliers and forces."""
    own = tuple(multiplier(name) for name in code.equations)
    if (planned := code.request(FORCES, True)) is not None:
        names = planned.outputs[planned.outputs.index(own[0]) :]
        return names, {name: planned.units[name] for name in names}
    given = code.request(FORCES, False)
    assert given is not None
    units = dict.fromkeys(own, "") | {name: given.units[name] for name in given.outputs}
    return (*own, *given.outputs), units


def _without_loads(code: Compiled, points: Points) -> str:
    """Say where the loads on which bodies have no value; "" where all have."""
    at = points.at(np.flatnonzero(np.isfinite(points.q_ddot.sum(axis=0))))
    with np.errstate(all="ignore"):
        bad = ~np.isfinite(code.Q(at.q.T, at.q_dot.T, at.t, at.p.T))
    if not bad.any():
        return ""
    owners = code.owners()
    names = np.array([owners[name] for name in code.coordinates])[bad.any(axis=0)]
    t = at.t[int(np.argmax(bad.any(axis=1)))]
    return no_value(code.name, tuple(names.tolist()), float(t))


def _by_matrices(own: Compiled, points: Points) -> tuple[Array, NDArray[np.bool_]]:
    """Return values by singular values, (L, K), and which of them redundant joints share."""
    q, q_dot, t, p = points.q.T, points.q_dot.T, points.t, points.p.T
    matrix = own.Phi_q(q, t, p)
    powers = powers_of_rows(matrix)
    matrix = powers[:, :, np.newaxis] * matrix
    inertia = np.einsum("lij,lj->li", own.M(q, t, p), points.q_ddot.T)
    loads = own.Q(q, q_dot, t, p)
    sides = loads - inertia
    left, values, right = np.linalg.svd(matrix, full_matrices=True)
    zero = values <= RANK * values[:, :1]
    inverse = np.where(zero, 0.0, 1 / np.where(zero, 1.0, values))
    size = values.shape[1]
    parts = inverse * np.einsum("lij,lj->li", right[:, :size], sides)
    factors = np.einsum("lij,lj->li", left[:, :, :size], parts)
    # Multipliers that do no work, mixed so that each shows wherever one of them does.
    idle = np.concatenate((zero, np.ones((len(zero), len(left[0]) - size), dtype=bool)), axis=1)
    mixed = np.where(idle, probe_of(idle.shape[1]), 0.0)
    loose = powers * np.einsum("lij,lj->li", left, mixed)
    moved = np.abs(_given(own, points, loose) - _given(own, points, 0 * loose))
    found = _given(own, points, powers * factors)
    is_shared = moved > HALF * np.abs(loose).max(axis=-1, keepdims=True, initial=0.0)
    rest = np.abs(np.einsum("lij,li->lj", matrix, factors) - sides).max(axis=-1)
    off = rest > SAME * (np.abs(loads) + np.abs(inertia)).max(axis=-1, initial=TINY)
    found[is_shared] = np.nan
    found[off] = np.nan
    return found, np.asarray(is_shared[~off].any(axis=0))


def _given(own: Compiled, points: Points, factors: Array) -> Array:
    """Return multipliers (L, m) and the forces that they give, shape (L, m + K)."""
    code = own.request(FORCES, False)
    assert code is not None
    p = np.broadcast_to(points.p.T, (len(factors), len(points.p)))
    both = np.concatenate((p, factors), axis=-1)
    return np.concatenate((factors, points.observe(code, both.T)[0].T), axis=-1)


@dataclass(frozen=True, slots=True)
class ForceMeasure:
    """What a force, a torque or a power does in the time that was solved.

    Attributes
    ----------
    name, unit
        Of the column; ``F_A`` is the magnitude of the reaction of joint A.
    least, greatest, t_least, t_greatest : float
        The extremes among the points of the grid, and when.
    mean, rms : float
        Over time, by the trapezoidal rule between the points.
    """

    name: str
    unit: str
    least: float
    t_least: float
    greatest: float
    t_greatest: float
    mean: float
    rms: float

    @property
    def peak(self) -> float:
        """The largest magnitude."""
        return max(abs(self.least), abs(self.greatest))


@dataclass(frozen=True, slots=True, repr=False)
class ForceMeasures(Tabled):
    """Measures of forces: ``measures["motor.drive"]`` gives one; str is a table."""

    header = ("force", "peak", "at t", "rms", "mean", "unit")
    numbers = header[1:5]

    name: str
    items: tuple[ForceMeasure, ...]

    def __getitem__(self, name: str) -> ForceMeasure:
        """Return the measures of a force."""
        known = {item.name: item for item in self.items}
        wanted = name if name in known else column_name(name)
        if wanted not in known:
            text = f"{self.name} has no force {name!r} that is measured"
            raise InputError(unknown(text, wanted, known))
        return known[wanted]

    def rows(self) -> list[tuple[str, ...]]:
        """Return the peak of each force, when it is reached, and means."""
        rows: list[tuple[str, ...]] = []
        for item in self.items:
            at = item.t_greatest if item.peak == abs(item.greatest) else item.t_least
            numbers = (item.peak, at, item.rms, without_noise(item.mean, item.peak))
            texts = (f"{x:.6g}" for x in numbers)
            rows.append((item.name, *texts, item.unit))
        return rows

    def headline(self) -> str:
        """Return the name."""
        return f"{self.name}: forces"


def force_measures(name: str, t: Array, columns: Mapping[str, tuple[Array, str]]) -> ForceMeasures:
    """Measure columns of forces, each given by values (N,) and unit; refuse what has no forces."""
    good = np.isfinite([values for values, _ in columns.values()]).any(axis=0)
    if not good.any():
        raise InputError(f"{name} has no point at which forces were found: see .motion.message.")
    return ForceMeasures(
        name,
        tuple(
            force_measure(key, unit, t, values)
            for key, (values, unit) in columns.items()
            if np.isfinite(values).any()
        ),
    )


def force_measure(name: str, unit: str, t: Array, values: Array) -> ForceMeasure:
    """Measure one column of forces (N,), NaN where it has no value; somewhere it has one."""
    good = np.isfinite(values)
    times, own = t[good], values[good]
    order = np.argsort(times, kind="stable")
    times, own = times[order], own[order]
    low, high = int(own.argmin()), int(own.argmax())
    span = times[-1] - times[0]
    mean, square = float(own.mean()), float(np.square(own).mean())
    if span > 0:
        mean = float(np.trapezoid(own, times) / span)
        square = float(np.trapezoid(own**2, times) / span)
    extremes = float(own[low]), float(times[low]), float(own[high]), float(times[high])
    return ForceMeasure(name, unit, *extremes, mean, float(np.sqrt(square)))
