"""Where a mechanism with degrees of freedom comes to rest, and how stiffly it is held there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import MAX_ITERATIONS, SLIGHT, TOLERANCE, ZERO
from kincompile.errors import InputError, SolveError, StructuralError
from kincompile.names import listed
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.results.forces import forces, no_value
from kincompile.runtime.results.solution import OfMotion, Solution
from kincompile.runtime.singular.assemblies import is_new, spread_starts
from kincompile.runtime.singular.events import involved
from kincompile.runtime.statics.balance import Balance, settle
from kincompile.runtime.statics.path import follow
from kincompile.runtime.status import Status
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.inputs import Inputs, Values
    from kincompile.runtime.results.forces import Forces
    from kincompile.runtime.singular.events import Event
    from kincompile.runtime.statics.balance import Rest

STARTS, STARTS_A_FREEDOM = 60, 20
"""Starts from which other equilibria are looked for: at least, and for each degree of freedom."""

SEARCH_STEPS = 60
"""Steps after which a search climbs no further: a spring may be stretched for ever."""

STABLE, NEUTRAL, UNSTABLE = "stable", "neutral", "unstable"
FLUTTER, UNDECIDED = "flutter", "undecided"
"""Kinds of equilibrium."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Equilibrium(OfMotion):
    """Equilibria of a mechanism at N times, f degrees of freedom.

    ``found["rod.phi"]`` and the like give columns by name, shape (N,).

    Attributes
    ----------
    motion : Solution
        The positions, with all rates zero: at each time the mechanism is at rest. It can be
        written, plotted and drawn. `.events` are the critical points that were passed or met.
    eigenvalues : ndarray, shape (N, f)
        Of the reduced stiffness, the least first, for movements in radians and sizes of the
        mechanism; NaN where there is no equilibrium. Of an unsymmetric one their real parts.
    stability : tuple of str
        ``"stable"`` where all are positive, ``"unstable"`` where one is negative, ``"neutral"``
        where some vanish and none is negative; "" where there is no equilibrium. ``"flutter"``
        where none is negative, and swings grow nevertheless, with the masses and dampers that there
        are; ``"undecided"`` where an unsymmetric stiffness allows that, and a body has no mass.
    """

    header = ("t", "equilibrium", "least eigenvalue")
    numbers = (header[0], header[2])

    motion: Solution
    eigenvalues: Array
    stability: tuple[str, ...]
    _rests: tuple[Rest, ...]
    _balance: Balance

    @property
    def t(self) -> Array:
        """The times, shape (N,)."""
        return self.motion.t

    @property
    def q(self) -> Array:
        """The positions, shape (N, n)."""
        return self.motion.q

    @property
    def success(self) -> bool:
        """Whether there is an equilibrium at every time."""
        return self.motion.success

    @property
    def message(self) -> str:
        """One sentence; where there is no equilibrium, what pushes the mechanism where."""
        return self.motion.message

    @property
    def events(self) -> list[Event]:
        """Critical points: limit points and bifurcations."""
        return self.motion.events

    @property
    def forces(self) -> Forces:
        """Reactions of joints, what holds drivers, what springs pull with; see `kc.forces`.

        Raises
        ------
        InputError
            If the module was loaded from a file.
        """
        return forces(self.motion)

    def compliance(self, *names: str) -> Array:
        """Return how far coordinates or outputs move for unit forces along them.

        Parameters
        ----------
        *names
            k of them, as ``"foot.x"``; the force along an angle is a torque.

        Returns
        -------
        ndarray, shape (N, k, k)
            Row by row what moves, column by column what is pushed. Infinite where what is pushed
            is held by nothing, NaN where there is no equilibrium.

        Raises
        ------
        InputError
            When the mechanism has no coordinate or output of a name, or none is given.
        """
        if not names:
            raise InputError('name what is pushed: found.stiffness("foot.y").')
        result = np.full((self.t.size, len(names), len(names)), np.nan)
        for k, rest in enumerate(self._rests):
            result[k] = self._compliance_at(rest, names, float(self.t[k]))
        return result

    def stiffness(self, *names: str) -> Array:
        """Return the stiffness that is felt at a coordinate, an output, or several together.

        Parameters
        ----------
        *names
            As ``"foot.y"``, or ``"foot.x", "foot.y"`` for the matrix of a point.

        Returns
        -------
        ndarray, shape (N,), or (N, k, k) for several
            Force per displacement: the inverse of `compliance`. Zero where nothing holds it,
            infinite where it cannot move.

        Raises
        ------
        InputError
            As `compliance`; of several also where they cannot move independently.
        """
        found = self.compliance(*names)
        with np.errstate(divide="ignore"):
            if len(names) == 1:
                return np.asarray(1 / found[:, 0, 0])
        known = np.isfinite(found).all(axis=(1, 2))
        values = np.linalg.svd(found[known], compute_uv=False)
        if (values[:, -1] <= ZERO * values[:, 0]).any():
            raise InputError(
                f"{listed(names)} cannot move independently of each other, so that the matrix of "
                "their stiffness is infinite: take .compliance, or fewer of them."
            )
        result = np.full_like(found, np.nan)
        result[known] = np.linalg.inv(found[known])
        return result

    def _compliance_at(self, rest: Rest, names: tuple[str, ...], t: float) -> Array:
        free = self._balance.gradients(names, rest.place.q, t) @ rest.place.free
        left, values, right = np.linalg.svd(rest.stiffness)
        loose = values <= rest.place.nothing
        held = right[~loose].T @ ((left[:, ~loose].T @ free.T) / values[~loose, np.newaxis])
        moved = free @ held
        is_loose = np.abs(free @ left[:, loose]).max(axis=1, initial=0.0) > ZERO
        moved[np.ix_(is_loose, is_loose)] = np.inf
        return np.asarray(moved)

    def rows(self) -> list[tuple[str, ...]]:
        """Return the times with their stability."""
        least = self.eigenvalues.min(axis=1, initial=np.inf)
        return [
            (f"{t:.6g}", kind or "none", f"{value:.6g}" if kind else "")
            for t, kind, value in zip(self.t, self.stability, least, strict=True)
        ]

    def remarks(self) -> list[str]:
        """Return the outcome, and the critical points."""
        return [self.message]

    def headline(self) -> str:
        """Return the name and what was found."""
        kinds = listed(dict.fromkeys(kind or "none" for kind in self.stability))
        return f"{self.name}: equilibrium at {counted(self.t.size, 'time')}: {kinds}"


def equilibrium(
    module: ModuleType,
    t: ArrayLike = 0.0,
    p: Values = None,
    guess: Values = None,
    *,
    settling: bool = True,
    through: str | None = None,
    throw: bool = False,
) -> Equilibrium:
    """Find where a mechanism is in equilibrium, with its drivers held still.

    Parameters
    ----------
    module
        An emitted module of a mechanism with loads; joints and drivers may leave degrees of freedom
        to them.
    t : float or array_like, shape (N,)
        Times, rising or falling, at which drivers and loads are taken; the equilibrium of the first
        is followed through the others.
    p, guess
        As for `solve`, of one parameter set.
    settling : bool
        Whether it goes from the guess along its forces, to where it comes to rest and is not
        unstable. Otherwise Newton's method goes to a near equilibrium of any kind.
    through : {"snap"}, optional
        Go on past critical points, to where the mechanism comes to rest after it has snapped
        through. Without it a limit point ends the way, and a bifurcation is passed straight on.
    throw : bool
        Raise `SolveError` unless there is an equilibrium at every time.

    Returns
    -------
    Equilibrium
        With positions, stability, reactions, stiffnesses and critical points; `.success` and
        `.message` say where there is none, and why.

    Raises
    ------
    InputError
        When a value has the wrong name, shape or type, or the mechanism has no loads.
    StructuralError
        When a body is free to move and nothing acts on it.
    SolveError
        With `throw`, when there is none; `.solution` holds what was found.

    Notes
    -----
    Dampers and friction, which is smooth here, do nothing at rest. Stability is first that of small
    slow movements, the signs of the eigenvalues of the reduced stiffness. A load that follows its
    body, or pushes along with velocities, may make a mechanism flutter where none is negative: so
    the eigenvalues of small swings are looked at too, with masses and dampers.
    """
    inputs = _inputs(module, t, p, guess, through)
    with np.errstate(all="ignore"):
        balance = Balance(inputs)
        first = settle(balance, inputs.guess, float(inputs.t[0]), climbing=0 if settling else None)
        found: list[Rest] = [] if first is None else [first]
        events: list[Event] = []
        if first is not None and first.is_balanced:
            _require_loads(balance, first)
            found, events = follow(balance, first, inputs.t.tolist(), through)
        result = _equilibrium(inputs, balance, found, events)
    if throw and not result.success:
        raise SolveError(result.message, result.motion)
    return result


def equilibria(module: ModuleType, t: float = 0.0, p: Values = None) -> list[Equilibrium]:
    """Find the distinct equilibria of a mechanism at one time, stable and unstable.

    Parameters
    ----------
    module, p
        As for `equilibrium`.
    t : float
        The time.

    Returns
    -------
    list of Equilibrium
        Nearest to the module's GUESS first, the same on every run. The search is by chance, with a
        fixed seed: what is rarely met may be missed. Neutral ones are one of many each.

    Raises
    ------
    InputError, StructuralError
        As `equilibrium`.
    """
    inputs = _inputs(module, t, p, None, None)
    time = inputs.one_time("equilibria are those of one time", "call it for each")
    found: list[Rest] = []
    with np.errstate(all="ignore"):
        balance = Balance(inputs)
        for number, start in enumerate(spread_starts(balance.equations, inputs.guess)):
            freedoms = len(found[0].stiffness) if found else 0
            if number >= max(STARTS, STARTS_A_FREEDOM * freedoms):
                break
            for rest in _rests_from(balance, start, time):
                known = (other.place.q for other in found)
                if rest.is_balanced and is_new(balance.equations, rest.place.q, known):
                    _require_loads(balance, rest)
                    found.append(rest)
        results = [_equilibrium(inputs, balance, [rest], []) for rest in found]
    scale = balance.scale
    away = [float(np.linalg.norm((item.q[0] - inputs.guess) / scale)) for item in results]
    return [results[k] for k in np.argsort(np.round(away, 6), kind="stable")]


def _rests_from(balance: Balance, start: Array, t: float) -> Iterator[Rest]:
    """Yield where a mechanism goes from a start: downhill, by Newton's method, and climbing.

    Newton's method seldom ends where much is unstable: climbing goes there from as far away as
    downhill goes to what is stable.
    """
    lowest = settle(balance, start, t)
    if lowest is None:
        return
    yield lowest
    for climbing in (None, *range(1, len(lowest.stiffness) + 1)):
        rest = settle(balance, start, t, climbing=climbing, steps=SEARCH_STEPS)
        if rest is not None:
            yield rest


def _inputs(
    module: ModuleType, t: ArrayLike, p: Values, guess: Values, through: str | None
) -> Inputs:
    """Check what was given."""
    inputs = read_inputs(module, t, p, guess, TOLERANCE, MAX_ITERATIONS, may_move=True)
    if through not in (None, "snap"):
        raise InputError(f"through is {through!r}: give 'snap', or nothing.")
    if not inputs.code.has_loads:
        raise InputError(
            f"{inputs.code.name} has no masses and no forces, so that every position is one of "
            "equilibrium: give its bodies masses and m.gravity, or add loads such as kc.Spring."
        )
    return inputs


def _require_loads(balance: Balance, rest: Rest) -> None:
    """Refuse a mechanism with bodies that may go anywhere since nothing acts on them."""
    place = rest.place
    if rest.signs.count(0) == 0:
        return
    values, ways = np.linalg.eigh((rest.stiffness + rest.stiffness.T) / 2)
    loose = np.abs(place.free @ ways[:, np.abs(values) <= place.nothing]).max(axis=1)
    owners = balance.code.owners()
    names = [owners[name] for name in balance.code.coordinates]
    loaded = {name for name, work in zip(names, balance.acting(place), strict=True) if work > 0}
    idle = [name for name, way in zip(names, loose, strict=True) if way > ZERO]
    if free := [name for name in dict.fromkeys(idle) if name not in loaded]:
        raise StructuralError(
            f"{balance.code.name}: nothing acts on {listed(free)}, free to move, so that no "
            "position is the equilibrium: give a mass and m.gravity, a spring or a force, or hold "
            "it with joints or a driver."
        )


def _equilibrium(
    inputs: Inputs, balance: Balance, found: list[Rest], events: list[Event]
) -> Equilibrium:
    """Put names and a verdict to the numbers."""
    code, count = inputs.code, inputs.t.size
    good = [rest for rest in found if rest.is_balanced]
    n, free = len(code.coordinates), good[0].stiffness.shape[0] if good else 0
    q, eigenvalues = np.full((count, n), np.nan), np.full((count, free), np.nan)
    residual = np.full(count, np.nan)
    status = np.full(count, Status.NOT_REACHED, dtype=np.int64)
    for k, rest in enumerate(good):
        q[k], eigenvalues[k] = rest.place.q, rest.eigenvalues
        residual[k] = np.abs(rest.place.point.Phi).max(initial=0.0)
    status[: len(good)] = Status.CONVERGED
    if len(good) < count:
        status[len(good)] = Status.NOT_CONVERGED
    iterations = np.zeros(count, dtype=np.int64)
    iterations[: len(found)] = [rest.steps for rest in found]
    rates = np.where(np.isnan(q), np.nan, 0.0)
    motion = Solution(
        t=inputs.t, q=q, q_dot=rates, q_ddot=rates.copy(), status=status, residual=residual,
        iterations=iterations, success=len(good) == count,
        message=_message(inputs, balance, found, events), statistics={}, events=events,
        **inputs.about(),
    )  # fmt: skip
    kinds = tuple(_kind(balance, rest) for rest in good) + ("",) * (count - len(good))
    return Equilibrium(motion, eigenvalues, kinds, tuple(good), balance)


def _kind(balance: Balance, rest: Rest) -> str:
    """Return the stability of an equilibrium."""
    signs, skew = rest.signs, rest.stiffness - rest.stiffness.T
    if -1 in signs:
        return UNSTABLE
    growth = balance.growth(rest.place, rest.stiffness)
    if growth is None and np.abs(skew).max(initial=0.0) > rest.place.nothing:
        return UNDECIDED
    if growth is not None and growth > SLIGHT:
        return FLUTTER
    return NEUTRAL if 0 in signs else STABLE


def _message(inputs: Inputs, balance: Balance, found: list[Rest], events: list[Event]) -> str:
    """Say in words what was found."""
    name, times, count = inputs.code.name, inputs.t, len(found)
    met = "".join(f" {event.message}" for event in events)
    if count == 0:
        return (
            f"{name} has no equilibrium at t = {times[0]:.10g}: its joints cannot be assembled "
            "near the guess; give a nearer one."
        )
    place = found[-1].place
    if found[-1].is_balanced and count == times.size:
        when = f"t = {times[0]:.10g}" if count == 1 else f"all {count} times"
        return f"{name} is in equilibrium at {when}.{met}"
    if found[-1].is_balanced:
        return (
            f"{name} has no equilibrium at t = {times[count]:.10g} near that of the time before."
            f"{met}"
        )
    if not np.isfinite(Q := balance.loads(place.q, float(place.point.t))).all():
        owners = inputs.code.owners()
        names = [owners[inputs.code.coordinates[k]] for k in np.flatnonzero(~np.isfinite(Q))]
        return no_value(name, names, float(place.point.t))
    bodies = listed(involved(inputs.code, place.free @ place.force / balance.scale))
    return (
        f"{name} has no equilibrium at t = {times[count - 1]:.10g} that is reached from the "
        f"guess: the loads on {bodies} are not balanced there. Add a spring, a stop or a "
        "joint, or give a guess nearer to the equilibrium."
    )
