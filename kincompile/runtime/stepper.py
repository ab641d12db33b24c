"""A motion one time after the other, as a control loop, a GUI or a game asks for it.

A call goes on from where the motion stands: by the march of emitted code, on floats or compiled,
where nothing is out of the ordinary. Else `solve` follows the motion from there, with its careful
march, and has the last word, so that statuses are those of `solve`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from kincompile.criteria import CORNER, MAX_ITERATIONS, TOLERANCE
from kincompile.errors import AssemblyWarning, InputError
from kincompile.names import listed
from kincompile.runtime.along import lead
from kincompile.runtime.engine.code import STEPPER, column_meant
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import problem
from kincompile.runtime.results.observed import observed
from kincompile.runtime.solve import jumps_of_nu, reach_of, start_of, verdict, warn
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.inputs import Inputs, Values

EXACT = 53
"""Binary digits of whole numbers that floats hold."""

NOT_LED = (
    "{name} cannot go from the parameters that it has at t = {t:.10g} to those that are given: on "
    "the straight line between them its branch ends. Change them less, or assemble it anew by "
    ".reset(guess)."
)


class Instant:
    """A motion at one time, as a `Stepper` returns it; ``now["rod.phi"]`` gives its columns.

    Attributes
    ----------
    t : float
        The time.
    p : ndarray, shape (k,)
        Parameters.
    states : ndarray, shape (3, n)
        Coordinates and their rates, in the units of the module per second and per second squared;
        read-only. NaN where they were not found. `.q`, `.q_dot` and `.q_ddot` are its rows.
    status : Status
        CONVERGED, or what is wrong.
    """

    __slots__ = ("_code", "_say", "_y", "p", "states", "status", "t")

    def __init__(
        self,
        code: Compiled,
        t: float,
        p: Array,
        states: Array,
        status: Status = Status.CONVERGED,
        say: Callable[[], str] = str,
    ) -> None:
        states.setflags(write=False)
        self._code, self.t, self.p, self.states = code, t, p, states
        self.status, self._say = status, say
        self._y: Any = None

    @property
    def q(self) -> Array:
        """The coordinates, shape (n,)."""
        return np.asarray(self.states[0])

    @property
    def q_dot(self) -> Array:
        """Their rates, shape (n,)."""
        return np.asarray(self.states[1])

    @property
    def q_ddot(self) -> Array:
        """Their second rates, shape (n,)."""
        return np.asarray(self.states[2])

    @property
    def success(self) -> bool:
        """Whether the motion got there."""
        return self.status in (Status.CONVERGED, Status.CORNER)

    @property
    def message(self) -> str:
        """On failure what is wrong, and what to do, as `Solution.message`; else "".

        Found on each access: what the drivers ask for too much may take a second to find.
        """
        return self._say()

    @property
    def outputs(self) -> Array:
        """The outputs, their rates and second rates, shape (3, r); evaluated on first access."""
        if self._y is None:
            self._y = self._observed()
        found: Array = self._y
        return found

    def _observed(self) -> Array:
        code = self._code
        if code.observe_floats is not None and self.status is Status.CONVERGED:
            given = (*self.states.tolist(), self.t, self.p.tolist())
            try:
                return np.array(code.observe_floats(*given)).reshape(3, -1)
            except (ArithmeticError, ValueError):
                pass  # outside the domain of a function: arrays give NaN there
        q, q_dot, q_ddot = self.states[:, np.newaxis]
        found = observed(code, (q, q_dot, q_ddot), np.array([self.t]), self.p)
        return np.array([found.y[0], found.y_dot[0], found.y_ddot[0]])

    def __getitem__(self, name: str) -> float:
        """Return a coordinate or an output, its rate or its second rate.

        Raises
        ------
        InputError
            When there is no such column; the message lists those that exist.
        """
        code = self._code
        found, order = column_meant(code.name, name, code.coordinates, code.outputs)
        if found in code.outputs:
            return float(self.outputs[order, code.outputs.index(found)])
        return float(self.states[order, code.coordinates.index(found)])

    def __repr__(self) -> str:
        """Return the name, the time and the status."""
        return f"<{self._code.name} at t = {self.t:.10g}: {self.status.name}>"


class Stepper:
    """A motion that goes on from call to call, made by `kc.stepper`.

    ``now = stepper(t)`` is the motion at a time, an `Instant`, with parameters as those of the
    stepper but for those that are given: ``stepper(t, a=0.2)``, ``stepper(t, p)``. Where it cannot
    get there on its branch, the status of ``now`` says why, and it stands where it stood.

    Attributes
    ----------
    now : Instant or None
        Where it stands; None before the first call that succeeds.
    """

    def __init__(self, inputs: Inputs) -> None:
        self.now: Instant | None = None
        self._own = self._inputs = inputs  # as it was made, and as it was reset
        self._code, self._p = inputs.code, inputs.p
        self._p.setflags(write=False)
        self._places = {name: k for k, name in enumerate(self._code.parameters)}
        self._make = inputs.code.stepper
        if self._make is None and inputs.code.has(STEPPER):
            self._make = inputs.code.request(STEPPER)
        self._begin()

    def __reduce__(self) -> NoReturn:
        """Say that it cannot be copied: what C keeps of a motion has one place."""
        raise InputError(
            f"a stepper of {self._code.name} cannot be copied or pickled. Make another one, by "
            "kc.stepper(module), and call it at the time of this one."
        )

    def _begin(self) -> None:
        """Forget where the motion stands."""
        self.now, self._go, self._base = None, None, None
        self._largest = np.zeros(len(self._code.equations))  # of nu

    _go: Callable[[float, Array], tuple[Array, int]] | None
    # From where the motion goes on: just after a corner, and before what is nearly singular, whose
    # rates are too uncertain.
    _base: Instant | None
    _measured: Array  # parameters by which numbers are judged

    def reset(self, guess: Values = None) -> None:
        """Forget where the motion stands: the next call assembles it from a guess.

        Parameters
        ----------
        guess : array_like, shape (n,), or mapping, optional
            As for `solve`; without one that of the stepper.

        Raises
        ------
        InputError
            When a value has the wrong name, shape, type or is not finite.
        """
        own = self._own
        if guess is not None:
            found = _read(self._code.module, 0.0, None, guess)
            own = replace(own, guess=found.guess, without_guess=found.without_guess)
        self._inputs = own
        self._begin()

    def __call__(self, t: float, p: Values = None, **parameters: float) -> Instant:
        """Return the motion at a time.

        Parameters
        ----------
        t : float
            The time: later or earlier than the last one, near or far.
        p : array_like, shape (k,), or mapping, optional
            Parameters, as for `solve`; those that a mapping does not name are the stepper's. Where
            they are others than before, the motion goes there along the straight line of
            parameters first, then on in time.
        **parameters : float
            Parameters by name.

        Returns
        -------
        Instant
            With a status as `solve` gives it.

        Raises
        ------
        InputError
            When a value has the wrong name, shape, type or is not finite; nothing has changed then.
        """
        if type(t) is not float or not math.isfinite(t):
            given = _read(self._code.module, t, None, None)
            t = given.one_time("a stepper takes one time", "kc.solve takes many")
        own = self._p if p is None and not parameters else self._parameters(p, parameters)
        is_corner = self._code.corners and self._is_corner(t, own)
        if self._go is None or is_corner:
            return self._carefully(t, own, is_corner)
        states, status = self._go(t, own)
        if status:
            return self._carefully(t, own, is_corner=False)
        self.now = self._base = now = Instant(self._code, t, own, states)
        if own is not self._measured and not _is_like(own, self._measured):
            self._set_out(now)
        return now

    def _parameters(self, p: Values, named: dict[str, float]) -> Array:
        """Return parameters (k,), checked, in an array of their own."""
        if p is not None and named:
            raise InputError(
                f"{self._code.name}: p is given, and {listed(named)} by name: give all parameters "
                "by name, or in p."
            )
        values: Any = named if p is None else p
        own: Any = None
        if isinstance(values, Mapping):
            if values.keys() <= self._places.keys() and all(map(_is_plain, values.values())):
                own = self._p.copy()
                for name, value in values.items():
                    own[self._places[name]] = value
            else:
                values = dict(zip(self._places, self._p.tolist(), strict=True)) | dict(values)
        elif (
            type(values) is np.ndarray
            and (values.dtype, values.shape) == (self._p.dtype, self._p.shape)
            and all(map(math.isfinite, values.tolist()))
        ):
            own = values.copy()
        if own is None:  # what is refused, or numbers of another kind
            own = _read(self._code.module, 0.0, values, None).p
        own.setflags(write=False)
        return np.asarray(own)

    def _is_corner(self, t: float, p: Array) -> bool:
        """Say whether a driver has a corner at a time."""
        code, q = self._code, self._inputs.guess if self._base is None else self._base.q
        jumps = jumps_of_nu(code, q, np.array([t]), p, _reach(t), self._largest)
        return bool((jumps > CORNER * self._largest).any())

    def _carefully(self, t: float, p: Array, is_corner: bool) -> Instant:
        """Go on by the careful march, which has the last word; at first from the guess."""
        code, end = self._code, t + (_reach(t) if is_corner else 0.0)
        inputs = replace(self._inputs, t=np.array([end]), p=p)
        if self._base is not None:
            led = self._base.q if np.array_equal(p, self._base.p) else self._led(self._base, p)
            if led is None:
                say = partial(NOT_LED.format, name=code.name, t=self._base.t)
                nothing = np.full_like(self._base.states, np.nan)
                return Instant(code, t, p, nothing, Status.NOT_CONVERGED, say)
            times = np.array([self._base.t, end])
            inputs = replace(inputs, t=times, guess=led, method="march", without_guess=())
        with np.errstate(all="ignore"):
            motion, outcome = follow(inputs)
        states = motion.states[..., -1].copy()
        if outcome.status is not Status.CONVERGED:
            say = partial(verdict, inputs, motion, outcome)
            return Instant(code, t, p, states, outcome.status, say)
        warn(inputs, motion, outcome, 4)
        if self._base is None and (doubt := start_of(inputs, motion)):
            warnings.warn(doubt, AssemblyWarning, stacklevel=3)
        self.now = begin = Instant(code, end, p, states, say=motion.note.strip)
        if is_corner:
            shown = np.array([*states[:2], np.full_like(states[2], np.nan)])
            self.now = Instant(code, t, p, shown, Status.CORNER)
        self._set_out(begin)
        return self.now

    def _led(self, begin: Instant, p: Array) -> Array | None:
        """Return the position with other parameters, along the line to them; None without."""
        inputs = replace(self._inputs, t=np.array([begin.t]), p=begin.p)
        with np.errstate(all="ignore"):
            equations = problem(self._code, begin.p, begin.q, begin.t)
            return lead(inputs, equations, begin.q, p)[0]

    def _set_out(self, begin: Instant) -> None:
        """Let the march go on from a point of the motion, unless that is nearly singular."""
        t, q, p = begin.t, begin.q, begin.p
        go, status = None, 0
        if self._make is not None:
            with np.errstate(all="ignore"):
                go = self._make(q, t, p, problem(self._code, p, q, t).size)
            _, status = go(t, p)
        if status == Status.CONVERGED:
            self._go, self._base, self._measured = go, begin, p
        elif self._base is None:
            self._base = begin


def stepper(
    module: ModuleType, p: Values = None, guess: Values = None, *, through: str | None = None
) -> Stepper:
    """Return a function that gives a motion at one time after the other.

    ``step = kc.stepper(module)``, then ``now = step(t)`` as often as a control loop, a window or a
    game asks. A step costs what a loop of Newton's method by hand costs, and is checked as those of
    `solve` are. The first call assembles the mechanism from the guess, at its time.

    Parameters
    ----------
    module
        An emitted module, from ``kc.compile`` or ``kc.load``, with as many equations as
        coordinates. A `Transmission` is a function already.
    p : array_like, shape (k,), or mapping, optional
        Parameters of calls that give none; a mapping overrides the module's DEFAULTS.
    guess : array_like, shape (n,), or mapping, optional
        Where Newton starts at the first call, as for `solve`.
    through : {"smooth"}, optional
        As for `solve`: go on past a bifurcation.

    Returns
    -------
    Stepper
        It has a state, so each motion, and each thread, has one of its own.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite; all that is wrong at once.
    StructuralError
        When the equations cannot determine the coordinates.
    """
    given: object = module
    if callable(given):
        raise InputError(
            f"a {type(given).__name__} is a function already: call it, f(u), or f.at(u, near=pose) "
            "to go on from a pose."
        )
    return Stepper(_read(module, 0.0, p, guess, through))


def _reach(t: float) -> float:
    """Return how far from a time another one may be, and differ by rounding alone."""
    return reach_of(np.array([t]))


def _read(
    module: ModuleType, t: ArrayLike, p: Values, guess: Values, through: str | None = None
) -> Inputs:
    """Check what is given."""
    return read_inputs(module, t, p, guess, TOLERANCE, MAX_ITERATIONS, None, through)


def _is_like(p: Array, measured: Array) -> bool:
    """Say whether parameters are so near others that numbers are judged alike."""
    pairs = zip(p.tolist(), measured.tolist(), strict=True)
    return all(abs(x - y) <= abs(y) and abs(x - y) <= abs(x) for x, y in pairs)


def _is_plain(value: object) -> bool:
    """Say whether a value is a finite number that needs no further look."""
    if type(value) is int:
        return value.bit_length() < EXACT
    return isinstance(value, float) and math.isfinite(value)
