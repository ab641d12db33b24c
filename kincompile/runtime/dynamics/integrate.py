"""A simulation step by step: the integrator's states, led back to their constraints.

Integrators are those of libraries: SciPy's DOP853, Radau and BDF, and CVODE of SUNDIALS. After a
step of a one-step method the state is led back to its constraints, and the next step goes on from
there. BDF and CVODE keep a history of states that must not be touched: their states are led back
where they are given out. Implicit methods get the derivatives of the rates.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import ACROSS, ACROSS_LATER, ACROSS_LEFT, ORDINARY, SAME_TIME, TINY
from kincompile.errors import InputError, package_of_extra
from kincompile.runtime.dynamics.happenings import (
    MIDDLE,
    SINGULAR,
    STOP,
    ahead,
    foreseen,
    passage,
    times_to,
)
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.dynamics.happenings import Passage, Watch
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.singular.events import Event

    States = Callable[[float], Array]
    Between = Callable[[], States]
    Rate = Callable[[float, Array], Array]
    """The rate of a state at a time, or its derivatives by the state."""

METHODS = ("DOP853", "Radau", "BDF", "CVODE")
"""Integrators: explicit of order 8, implicit of order 5, and multistep for stiff systems."""

HISTORY = ("BDF", "CVODE")
"""Those that keep a history of states."""

FAILED = "the step that its tolerances ask for has become too small for floating point"

MOST_STEPS = 100_000
"""Steps of a method between two of the times that were asked for, after which it is given up."""

STRICTER = 0.1
"""Part of the tolerance that CVODE gets: Newton's method ends there at a tenth of it, with a matrix
up to 50 steps old, in SciPy's BDF at its root. And since it judges the mean of all numbers, with
those that never count, one of them may be wrong by the root of their number."""

DRIFTS = "its constraints cannot be held there."

FAILS = (
    "A load that jumps or grows without bounds does that, or a mechanism near a singular "
    "configuration; where it is stiff, method='Radau' or 'BDF' takes longer steps."
)

MANY = (
    f"{MOST_STEPS:,} steps were not enough to the next time. Where the mechanism is stiff, "
    "method='Radau' or 'BDF' takes longer steps; else ask for more times, or a larger rtol."
)
"""Why a simulation ends."""

COLUMNS = (
    "q", "q_dot", "q_ddot", "kinetic", "work", "drift", "residual", "status", "steps"
)  # fmt: skip
"""Arrays with an entry for each point."""


def stepper(
    method: str,
    rates: tuple[Rate, Rate],
    t: tuple[float, float],
    y: Array,
    tolerance: tuple[float, Array],
    max_step: float,
    first: float | None = None,
) -> Stepper:
    """Return an integrator, one of `METHODS`, at its first state.

    The rates are that of a state at a time, and the derivatives of it by the state; `t` are the
    first and last time; the tolerance is relative, and absolute for each number; `first` is the
    length of the first step, where it is known.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}: give one of {', '.join(METHODS)}.")
    make = _Multistep if method == "CVODE" else Stepper
    return make(method, rates, t, y, tolerance, max_step, first)


class Stepper:
    """An integrator that goes from step to step: a solver of SciPy."""

    problem = ""  # why it can go no further; "" as long as it can
    # t, y: time and state after the last step
    t: float
    y: Array
    length: float  # how long the next step is meant to be
    _has_history = True

    def __init__(
        self, method: str, rates: tuple[Rate, Rate], t: tuple[float, float], y: Array,
        tolerance: tuple[float, Array], max_step: float, first: float | None,
    ) -> None:  # fmt: skip
        from scipy import integrate

        rtol, atol = tolerance
        self._rate, jacobian = rates
        self._has_history, self._longest = method in HISTORY, max_step
        given = {} if method == "DOP853" else {"jac": jacobian}
        solver = getattr(integrate, method)
        self._solver: Any = solver(
            self._rate, t[0], y, t[1], rtol=rtol, atol=atol, max_step=max_step,
            first_step=first, **given,
        )  # fmt: skip
        self._read()

    def _read(self) -> None:
        self.t, self.y = float(self._solver.t), np.asarray(self._solver.y)
        self.length = float(min(self._solver.h_abs, self._longest))

    def step(self, longest: float) -> None:
        """Take a step, no longer than this and not beyond the last time."""
        self._solver.max_step = min(self._longest, longest)
        try:
            self._solver.step()
        except ValueError:  # numbers that are not finite, in the linear algebra of Radau
            self.problem = FAILED
        if self._solver.status == "failed":
            self.problem = FAILED
        self._read()

    def put(self, y: Array) -> None:
        """Go on from another state, where there is no history."""
        if not self._has_history:
            self.y = self._solver.y = y
            self._solver.f = self._rate(self._solver.t, y)

    def between(self) -> Callable[[float], Array]:
        """Return the states within the last step, by the integrator's own interpolation."""
        found: Callable[[float], Array] = self._solver.dense_output()
        return found


class _Multistep(Stepper):
    """CVODE of SUNDIALS, from scikit-sundae."""

    def __init__(
        self, method: str, rates: tuple[Rate, Rate], t: tuple[float, float], y: Array,
        tolerance: tuple[float, Array], max_step: float, first: float | None,
    ) -> None:  # fmt: skip
        del method
        rate, jacobian = rates
        with package_of_extra("scikit-sundae", "stiff"):
            from sksundae.cvode import CVODE

        def into(t: float, y: Array, found: Array) -> int:
            found[:] = rate(t, y)
            return int(not np.isfinite(found).all())  # 1: try a smaller step

        def slopes_into(t: float, y: Array, _rate: Array, found: Array) -> int:
            found[:] = jacobian(t, y)
            return int(not np.isfinite(found).all())

        rtol, atol = (part * STRICTER / np.sqrt(y.size) for part in tolerance)
        longest = max_step if np.isfinite(max_step) else 0.0
        finite = np.where(np.isfinite(atol), atol, 1 / TINY)  # one that never counts
        self.t, self.y, self._end = t[0], y, t[1]
        self.length = first or 0.0
        self._solver = CVODE(
            into, rtol=float(rtol), atol=finite,
            first_step=math.copysign(self.length, t[1] - t[0]), max_step=longest,
            max_num_steps=MOST_STEPS, jacfn=slopes_into,
        )  # fmt: skip
        self._solver.init_step(self.t, y)

    def step(self, longest: float) -> None:
        left = self._end - self.t
        stop = self._end if longest >= abs(left) else self.t + math.copysign(longest, left)
        found = self._solver.step(self._end, "onestep", tstop=stop)
        if not found.success:
            self.problem = f"CVODE says: {found.message}"
            return
        self.length = abs(float(found.t) - self.t)
        self.t, self.y = float(found.t), np.asarray(found.y)

    def between(self) -> Callable[[float], Array]:
        """Return the interpolation of its history, which a request for a time behind it gives."""
        return lambda t: np.asarray(self._solver.step(t).y)


class Step:
    """A step from one time to another, and the states within it, led back to their constraints.

    Across a singular configuration it has a passage and its event.
    """

    passage: Passage | None = None
    event: Event | None = None

    def __init__(
        self, equations: Equations, begin: float, end: float, last: Array, between: Between
    ) -> None:
        self._equations, self._between = equations, between
        self.begin, self.end, self.last = begin, end, last
        self._known: States | None = None

    def at(self, t: float) -> Array:
        """Return the state at a time."""
        if t == self.end:
            return self.last
        self._known = self._known or self._between()
        y = self._known(t)
        if self.passage is None or not self.passage.covers(t):
            return self._equations.corrected(t, y)[0]
        q, q_dot, _ = self.passage.at(t)
        return np.concatenate((q, q_dot, y[-1:]))

    def rate(self, t: float, y: Array) -> Array:
        """Return the rate of its state at a time."""
        if self.passage is None or not self.passage.covers(t):
            return self._equations.rate(t, y)
        _, q_dot, q_ddot = self.passage.at(t)
        return np.concatenate((q_dot, q_ddot, [0.0]))


class Integration:
    """A simulation and what it found, N times and n coordinates."""

    def __init__(
        self, equations: Equations, inputs: Inputs, watch: Watch, progress: Progress | None
    ) -> None:
        self._equations, self._watch, self.t = equations, watch, inputs.t
        self._name = inputs.code.name
        self._progress = progress or (lambda done, total: None)
        size = inputs.t.size
        # NaN where the motion was not reached.
        self.q, self.q_dot, self.q_ddot = np.full((3, size, equations.n), np.nan)
        # Drift is the largest correction since the point before.
        self.kinetic, self.work, self.drift, self.residual = np.full((4, size), np.nan)
        self.status = np.full(size, int(Status.NOT_REACHED))
        self.steps = np.zeros(size, dtype=np.int64)
        self.events: list[Event] = []
        self.message = ""
        self._index, self._moved, self._taken, self._total = 0, 0.0, 0, 0

    @property
    def energy_drift(self) -> Array:
        """Kinetic energy less that at the start, less the work."""
        return np.asarray(self.kinetic - self.kinetic[0] - self.work)

    @property
    def statistics(self) -> dict[str, int]:
        """Steps taken, and evaluations of the accelerations and of their Jacobian."""
        equations = self._equations
        return {
            "steps": self._total,
            "evaluations": equations.evaluations,
            "jacobians": equations.jacobians,
        }

    def never_began(self, why: str) -> None:
        """Note that there is no state to begin from."""
        self.status[0] = Status.NOT_CONVERGED
        self.message = f"{self._name} cannot begin at t = {self.t[0]:.10g}: {why}"

    def run(self, y: Array, method: str, rtol: float, atol: float | None, max_step: float) -> None:
        """Follow the motion from its first state."""
        equations, t0 = self._equations, float(self.t[0])
        equations.corrected(t0, y)
        equations.turn_to_pivots()
        if not np.isfinite(equations.rate(t0, y)).all():
            event = self._watch.singular_at(t0, y[: equations.n])
            why = "a load or an equation has no finite value."
            self._fail(t0, event, why, Status.NOT_FINITE)
            return
        allowed = (rtol if atol is None else atol) * equations.scale
        # The work follows from the motion: it does not decide how long steps are.
        self._tolerance = rtol, np.concatenate((allowed, allowed, [np.inf]))
        self._method, self._longest = method, max_step
        self._watch.begin(t0, y)
        self._put(t0, y, equations.rate(t0, y))
        solver = self._begun(t0, y, None)
        while self._index < self.t.size:
            following = self._step(solver)
            if following is None:
                break
            solver = following
        if self.message == "":
            self._say_done()

    def _begun(self, t: float, y: Array, first: float | None) -> Stepper:
        """Return the integrator at a state, which satisfies its constraints."""
        self._held, self._times, self._tried = y, times_to(self._equations, t, y), math.inf
        rates, end = (self._equations.rate, self._equations.jacobian), float(self.t[-1])
        first = first and min(first, abs(end - t))
        return stepper(self._method, rates, (t, end), y, self._tolerance, self._longest, first)

    def _step(self, solver: Stepper) -> Stepper | None:
        """Take a step with all points within it; return what goes on, None where nothing does."""
        before, y, length = solver.t, self._held, solver.length
        coming = ahead(self._times, self._forward)
        step = self._across(before, y, coming) if self._is_near(y, coming, length) else None
        if step is None and self._movement(y, coming) <= ACROSS_LEFT:
            self._stop(before, y, DRIFTS)
            return None
        if step is None:
            solver.step(ORDINARY * coming)
            if solver.problem or not np.isfinite(solver.y).all():
                problem = solver.problem or "the rates are not finite"
                self._stop(before, y, f"{problem}. {FAILS}")
                return None
            held, drift = self._equations.corrected(solver.t, solver.y)
            if self._equations.turn_to_pivots():
                return self._begun(before, y, length)
            step = Step(self._equations, before, solver.t, held, solver.between)
            times = times_to(self._equations, step.end, held) if math.isfinite(drift) else None
            if times is None or ahead(times, -self._forward) < abs(step.end - before):
                return self._shorter(step, y)
            self._moved = max(self._moved, drift)
            solver.put(held)
            self._held, self._times = held, times
        self._taken += 1
        self._total += 1
        for event in self._watch.events(before, step.end, step.at, step.event):
            self.events.append(event)
            if self._watch.ends(event):
                self._fill(event.t, step)
                self._end(event, step)
                return None
        self._fill(step.end, step)
        if self._taken > MOST_STEPS:
            self._fail(step.end, None, MANY, Status.NOT_CONVERGED)
            return None
        if step.passage is None or self._index == self.t.size:
            return solver
        return self._begun(step.end, step.last, length)

    def _is_near(self, y: Array, coming: float, length: float) -> bool:
        """Say whether a step across the singular configuration that comes is to be tried."""
        if coming > self._tried:
            self._tried = math.inf
        is_near = self._movement(y, coming) <= ACROSS or length > ORDINARY * coming
        if not (is_near and coming <= ACROSS_LATER * self._tried):
            return False
        self._tried = coming
        return True

    def _movement(self, y: Array, time: float) -> float:
        """Return how far a state moves in a time at most, in scales."""
        n, scale = self._equations.n, self._equations.scale
        return time * float((np.abs(y[n : 2 * n]) / scale).max(initial=0.0))

    def _shorter(self, step: Step, y: Array) -> Stepper | None:
        """Take half of a step that cannot be led back, or has a singular configuration in it."""
        half = abs(step.end - step.begin) / 2
        if half > SAME_TIME * max(abs(step.begin), abs(step.end)):
            return self._begun(step.begin, y, half)
        self._stop(step.begin, y, DRIFTS)
        return None

    def _across(self, t: float, y: Array, coming: float) -> Step | None:
        """Return a step across the singular configuration that comes; None where none succeeds."""
        equations = self._equations
        length = foreseen(equations, t, y, self._forward * coming) / MIDDLE
        if not abs(length) <= self._longest:
            return None
        rates, span = (equations.held_rate, equations.jacobian), (t, t + length)
        solver = stepper("DOP853", rates, span, y, self._tolerance, math.inf, abs(span[1] - t))
        solver.step(math.inf)
        if solver.problem or solver.t != span[1]:
            return None
        held, drift = equations.corrected(solver.t, solver.y)
        if not math.isfinite(drift):
            return None
        step = Step(equations, t, solver.t, held, solver.between)
        step.passage = passage(equations, t, solver.t, step.at)
        if step.passage is None:
            return None
        step.event = self._watch.singular_at(step.passage.t, step.at(step.passage.t)[: equations.n])
        if step.event is None:
            return None
        self._moved = max(self._moved, drift)
        return step

    @property
    def _forward(self) -> float:
        return math.copysign(1.0, self.t[-1] - self.t[0])

    def _fill(self, end: float, step: Step) -> None:
        """Put down the points up to a time."""
        while self._index < self.t.size and (self.t[self._index] - end) * self._forward <= 0:
            t = float(self.t[self._index])
            y = step.at(t)
            self._put(t, y, step.rate(t, y))

    def _put(self, t: float, y: Array, rate: Array) -> None:
        """Put down a point."""
        k, n, equations = self._index, self._equations.n, self._equations
        q, q_dot = y[:n], y[n : 2 * n]
        point = equations.point(q, t)
        self.q[k], self.q_dot[k], self.q_ddot[k] = q, q_dot, rate[n : 2 * n]
        self.kinetic[k] = q_dot @ equations.inertia(q, t) @ q_dot / 2
        self.work[k], self.drift[k] = y[-1], self._moved
        good = point is not None and equations.holds(point) and np.isfinite(rate).all()
        self.status[k] = Status.CONVERGED if good else Status.NOT_CONVERGED
        if point is not None:
            self.residual[k] = np.abs(point.Phi).max(initial=0.0)
        self.steps[k] = self._taken
        self._moved, self._taken = 0.0, 0
        self._index += 1
        self._progress(self._index, self.t.size)

    def _fail(self, t: float, event: Event | None, why: str, status: Status) -> None:
        """Note why the motion ends, and at which point."""
        if event is not None:
            self.events.append(event)
            why, status = event.message, Status.SINGULAR
        self.status[self._index] = status
        self.message = f"{self._name} stopped at t = {t:.10g}: {why} The points before are good."

    def _stop(self, t: float, y: Array, why: str) -> None:
        """Note why the motion ends at a state, near a singular configuration or elsewhere."""
        event = self._watch.end_at(t, y[: self._equations.n])
        self._fail(t, event, why, Status.NOT_CONVERGED)

    def _end(self, event: Event, step: Step) -> None:
        """End the motion at an event."""
        if event.kind == SINGULAR:
            self._fail(event.t, None, event.message, Status.SINGULAR)
            return
        assert event.kind == STOP
        k = self._index
        if k and self.t[k - 1] == event.t:
            k -= 1
        self._index = k
        self.t = np.append(self.t[:k], event.t)
        for name in COLUMNS:
            setattr(self, name, getattr(self, name)[: k + 1])
        y = step.at(event.t)
        self._put(event.t, y, step.rate(event.t, y))

    def _say_done(self) -> None:
        """Say how it went."""
        level = float(np.nanmax(np.abs(np.stack((self.kinetic, self.work)))))
        self.message = (
            f"{self._name}: {self.t.size} points by {self._total} steps of {self._method}. The "
            f"energy drifts by at most {np.abs(self.energy_drift).max():.2g} of {level:.3g}. The "
            f"constraint residual is at most {self.residual.max():.2g}; projections moved no "
            f"coordinate by more than {self.drift.max():.2g}."
        )
        for event in self.events:
            passed = f"Passed: {event.kind} at t = {event.t:.10g}."
            self.message += f" {event.message if event.kind == STOP else passed}"
