"""A simulation step by step: the integrator's states, led back to their constraints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.dynamics.happenings import SINGULAR, STOP
from kincompile.runtime.dynamics.solvers import MOST_STEPS, stepper
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.dynamics.happenings import Watch
    from kincompile.runtime.dynamics.solvers import Stepper
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.singular.events import Event

WORDS = {
    "done": "{name}: {points} points by {steps} steps of {method}. The energy is off by at most "
    "{energy:.2g} of {level:.3g}, the constraints by {residual:.2g}; what led back to them moved "
    "nothing by more than {drift:.2g}.",
    "passed": " Passed: {kind} at t = {t:.10g}.",
    "stopped": "{name} stopped at t = {t:.10g}: {why} The points before are good.",
    "start": "{name} cannot begin at t = {t:.10g}: {why}",
    "step": "{problem}. A load that jumps or grows without bounds does that, or a mechanism near a "
    "singular configuration; where it is stiff, method='Radau' or 'BDF' takes longer steps.",
    "many": "{most:,} steps were not enough to the next time. Where the mechanism is stiff, "
    "method='Radau' or 'BDF' takes longer steps; else ask for more times, or a larger rtol.",
    "drift": "its constraints cannot be held there.",
    "nothing": "a load or an equation has no finite value.",
}
"""What is said of a simulation."""


COLUMNS = (
    "q", "q_dot", "q_ddot", "kinetic", "work", "drift", "residual", "status", "steps"
)  # fmt: skip
"""Arrays with an entry for each point."""


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
        # Drift is the largest correction since the point before; so many are the steps.
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
        self.message = WORDS["start"].format(name=self._name, t=float(self.t[0]), why=why)

    def run(self, y: Array, method: str, rtol: float, atol: float | None, max_step: float) -> None:
        """Follow the motion from its first state."""
        equations, t0 = self._equations, float(self.t[0])
        if not np.isfinite(equations.rate(t0, y)).all():
            event = self._watch.singular_at(t0, y)
            self._fail(t0, event, WORDS["nothing"], Status.NOT_FINITE)
            return
        allowed = (rtol if atol is None else atol) * equations.scale
        # The work follows from the motion: it does not decide how long steps are.
        tolerance = rtol, np.concatenate((allowed, allowed, [np.inf]))
        self._watch.begin(t0, y)
        self._put(t0, y)
        self._method = method
        rates = equations.rate, equations.jacobian
        solver = stepper(method, rates, self.t[[0, -1]], y, tolerance, max_step)
        while self._index < self.t.size and self._step(solver):
            pass
        if self.message == "":
            self._say_done()

    def _step(self, solver: Stepper) -> bool:
        """Take a step with all points within it; say whether the motion goes on."""
        before, y = solver.t, solver.y
        solver.step()
        self._taken += 1
        self._total += 1
        if solver.problem or not np.isfinite(solver.y).all():
            text = WORDS["step"].format(problem=solver.problem or "the rates are not finite")
            self._fail(before, self._watch.lock_up_at(before, y), text, Status.NOT_CONVERGED)
            return False
        held, drift = self._equations.corrected(solver.t, solver.y)
        if not math.isfinite(drift):
            event = self._watch.lock_up_at(before, y)
            self._fail(before, event, WORDS["drift"], Status.NOT_CONVERGED)
            return False
        self._moved = max(self._moved, drift)
        solver.put(held)
        state = self._states(solver, held)
        happened = self._watch.events(before, solver.t, state)
        for event in happened:
            self.events.append(event)
            if self._watch.ends(event):
                self._fill(event.t, state)
                self._end(event, state)
                return False
        self._fill(solver.t, state)
        if self._taken > MOST_STEPS:
            self._fail(solver.t, None, WORDS["many"].format(most=MOST_STEPS), Status.NOT_CONVERGED)
            return False
        return True

    def _states(self, solver: Stepper, end: Array) -> Callable[[float], Array]:
        """Return the states within a step, led back to their constraints."""
        known: list[Callable[[float], Array]] = []
        last = solver.t

        def state(t: float) -> Array:
            if t == last:
                return end
            if not known:
                known.append(solver.between())
            return self._equations.corrected(t, known[0](t))[0]

        return state

    def _fill(self, end: float, state: Callable[[float], Array]) -> None:
        """Put down the points up to a time."""
        forward = math.copysign(1.0, self.t[-1] - self.t[0])
        while self._index < self.t.size and (self.t[self._index] - end) * forward <= 0:
            t = float(self.t[self._index])
            self._put(t, state(t))

    def _put(self, t: float, y: Array) -> None:
        """Put down a point."""
        k, n, equations = self._index, self._equations.n, self._equations
        q, q_dot = y[:n], y[n : 2 * n]
        point = equations.point(q, t)
        rate = equations.rate(t, y)
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
        self.message = WORDS["stopped"].format(name=self._name, t=t, why=why)

    def _end(self, event: Event, state: Callable[[float], Array]) -> None:
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
        self._put(event.t, state(event.t))

    def _say_done(self) -> None:
        """Say how it went."""
        level = float(np.nanmax(np.abs(np.stack((self.kinetic, self.work)))))
        self.message = WORDS["done"].format(
            name=self._name,
            points=self.t.size,
            steps=self._total,
            method=self._method,
            energy=float(np.abs(self.energy_drift).max()),
            level=level,
            residual=float(self.residual.max()),
            drift=float(self.drift.max()),
        )
        for event in self.events:
            passed = WORDS["passed"].format(kind=event.kind, t=event.t)
            self.message += f" {event.message}" if event.kind == STOP else passed
