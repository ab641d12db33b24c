"""Four-bars from two dyads: whether they go through the poses, and their cognates."""

from __future__ import annotations

import cmath
import math
import warnings
from dataclasses import dataclass, replace
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.classical.dyads import Dyad, Found, dyads, read
from kincompile.compiler import compile as compiled
from kincompile.criteria import SLIGHT
from kincompile.errors import InputError
from kincompile.model.expressions import t
from kincompile.model.sketch import Sketch
from kincompile.names import listed
from kincompile.runtime.results.grashof import margin_of
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Place = tuple[float, float]

SAMPLES = 181
"""Times at which a motion through poses is solved, besides those of the poses."""

LEFT = {"crank": "coupler", "coupler": "crank", "rocker": "rocker"}
RIGHT = {"crank": "crank", "coupler": "rocker", "rocker": "coupler"}
"""Which link of a cognate turns with a link of the four-bar."""


@dataclass(frozen=True, slots=True)
class Passage:
    """How a four-bar goes through poses while its driven link turns one way.

    Attributes
    ----------
    times : ndarray, shape (K,)
        When, as parts of the motion of `FourBar.sketch`, which ends at 1; rising if in order.
    in_order : bool
        Whether the driven link turns one way, by less than a turn, from pose to pose.
    one_branch, one_circuit : bool
        Whether coupler and rocker are folded to one side in all poses, which one driven link can
        do; whether the linkage can get from each pose to the others without being taken apart.
    deviation : float
        How far B is from its places in the poses, at most, when the motion is solved [length]; nan
        where it ends before, or is not tried, as the poses are out of order or on two branches.
    works : bool
        Whether the motion goes through all poses, in order.
    message : str
        That it goes through the poses, or what is in the way.
    """

    times: Array
    in_order: bool
    one_branch: bool
    one_circuit: bool
    deviation: float
    works: bool
    message: str


@dataclass(frozen=True, slots=True)
class FourBar:
    """A four-bar in its first position: crank O A, coupler A B P, rocker C B, ground O C.

    Attributes
    ----------
    O, A, B, C, P : tuple of float
        Places (x, y) of the joints and of the coupler point.
    driven : str
        The link that is driven: ``"crank"``, ``"coupler"`` or ``"rocker"``.
    turn : float
        Angle by which it turns [rad].
    passage : Passage, optional
        How it goes through the poses for which it was made.
    """

    O: Place  # noqa: E741
    A: Place
    B: Place
    C: Place
    P: Place
    driven: str = "crank"
    turn: float = math.tau
    passage: Passage | None = None

    def __post_init__(self) -> None:
        """Refuse what is no linkage."""
        if read([self.O, self.A, self.B, self.C, self.P], "the joints").shape != (5, 2):
            raise InputError("The joints have another shape than (5, 2). Give (x, y) of each.")
        if min(self.lengths) == 0:
            raise InputError("Two joints of a link are in one place. Give it a length.")
        if self.driven not in LEFT:
            raise InputError(f"driven is {self.driven!r}. Give one of: {listed(LEFT)}.")

    @property
    def places(self) -> Complex:
        """O, A, B, C and P as complex numbers."""
        return np.array([self.O, self.A, self.B, self.C, self.P]) @ (1, 1j)

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Lengths of ground, crank, coupler and rocker."""
        ground, crank, coupler, rocker = np.abs(
            self.places[[3, 1, 2, 2]] - self.places[[0, 0, 1, 3]]
        )
        return float(ground), float(crank), float(coupler), float(rocker)

    def sketch(self, name: str = "four_bar", *, length_unit: str = "m") -> Sketch:
        """Return its drawing, driven from time 0 to 1, with lengths as parameters."""
        s = Sketch(name, length_unit=length_unit, end=1.0, points=SAMPLES)
        s.ground(O=self.O, C=self.C)
        s.joints(A=self.A, B=self.B, P=self.P)
        O, A, B, C, P = self.places.tolist()  # noqa: N806, E741
        links = {"crank": A - O, "coupler": B - A, "rocker": B - C}
        crank, coupler, rocker = map(abs, links.values())
        place = (P - A) * (B - A).conjugate() / coupler
        s.link("crank", "O A", s.length("OA", crank))
        point = (s.length("P_xi", place.real), s.length("P_eta", place.imag))
        s.link("coupler", "A B P", AB=s.length("AB", coupler), P=point)
        s.link("rocker", "C B", s.length("CB", rocker))
        s.drive(self.driven, cmath.phase(links[self.driven]) + self.turn * t)
        return s


def four_bar(first: Dyad, second: Dyad, poses: ArrayLike) -> FourBar:
    """Join two dyads to a four-bar, and try its motion through the poses.

    Parameters
    ----------
    first, second
        The dyads: the first is driven, as the crank.
    poses : array_like, shape (K, 3)
        The poses that both lead through; P is the origin of the body.

    Returns
    -------
    FourBar
        With the way of its crank from the first to the last pose, and its `passage`.

    Raises
    ------
    InputError
        If the dyads have a pivot in common, or do not lead through the poses.
    """
    given = read(poses, "poses")
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 2:
        raise InputError(f"The poses have the shape {given.shape}. Give some of (x, y, angle).")
    P, R = given[:, 0] + 1j * given[:, 1], np.exp(1j * given[:, 2])  # noqa: N806
    O, C = complex(*first.centre), complex(*second.centre)  # noqa: N806, E741
    A, B = (P + R * complex(*item.circle) for item in (first, second))  # noqa: N806
    size = float(max(np.abs(A - B)[0], abs(O - C), first.length, second.length))
    for base, ends, dyad in ((O, A, first), (C, B, second)):
        off = float(np.max(np.abs(np.abs(ends - base) - dyad.length)))
        if off > SLIGHT * size:
            raise InputError(
                f"A dyad does not lead through the poses: its length changes by {off:.3g}. Give "
                "the poses for which the dyads were found."
            )
    if min(abs(A[0] - B[0]), abs(O - C), first.length, second.length) < SLIGHT * size:
        raise InputError("Two pivots are one. Give two dyads that have no pivot in common.")
    tried = _tried((O, A, B, C, P[0]), 1, size)
    if _merit(tried)[0]:
        return tried
    return max(tried, _tried((O, A, B, C, P[0]), -1, size), key=_merit)


def four_bars(poses: ArrayLike) -> Found[FourBar]:
    """Return the four-bars of all pairs of dyads of five poses, those that go through them first.

    Each pair counts twice, with the one or the other dyad as the crank.

    Parameters
    ----------
    poses : array_like, shape (5, 3)
        The poses (x, y, angle [rad]), in order.

    Returns
    -------
    Found of FourBar
        A tuple, `reason` as that of `dyads`.

    Raises
    ------
    InputError
        As `dyads` does.
    """
    found = dyads(poses)
    made = [four_bar(*pair, poses) for pair in permutations(found, 2)]
    return by_merit(made, found.reason)


def cognates(linkage: FourBar) -> tuple[FourBar, FourBar]:
    """Return the two other four-bars whose point P goes along the same path.

    The link is driven that keeps the time, too: of the first, which has the pivot O, the coupler
    turns with the crank of `linkage`, of the second, which has C, the crank.

    Parameters
    ----------
    linkage
        The four-bar.

    Raises
    ------
    InputError
        If P is in A or B: its path is an arc, and the cognates have links without length.

    Notes
    -----
    S. Roberts, 1875; P. L. Chebyshev, 1878.
    """
    O, A, B, C, P = linkage.places.tolist()  # noqa: N806, E741
    if min(abs(P - A), abs(P - B)) < SLIGHT * abs(B - A):
        raise InputError("P is in A or B, so that its path is an arc. Take another point.")
    ratio = (P - A) / (B - A)
    third = O + ratio * (C - O)
    left = (O, O + P - A, O + P - A + ratio * (A - O), third, P)
    right = (third, third + (1 - ratio) * (A - O), C + P - B, C, P)
    driven, turn = linkage.driven, linkage.turn
    return _made(left, LEFT[driven], turn), _made(right, RIGHT[driven], turn)


def _tried(
    joints: tuple[complex, Complex, Complex, complex, complex], way: int, size: float
) -> FourBar:
    """Return the four-bar with its passage, A (K,) and B (K,) in the poses, turning one way."""
    O, A, B, C, P = joints  # noqa: N806, E741
    turns = way * np.angle((A - O) / (A[0] - O)) % math.tau
    turns[math.tau - turns < SLIGHT] = 0
    turn = way * (float(turns.max()) or math.tau)
    times = turns / abs(turn)
    made = _made((O, A[0], B[0], C, P), "crank", turn)
    folded = np.sign((np.conj(B - A) * (C - B)).imag)
    circuit = _circuit(made.lengths, folded, np.sign((np.conj(A - O) * (C - O)).imag))
    in_order = bool(np.all(np.diff(times) > SLIGHT))
    checks = in_order, bool((folded == folded[0]).all()), bool((circuit == circuit[0]).all())
    deviation, message = math.nan, _defects(times, folded, circuit)
    if not message:
        deviation, message = _motion(made, times, B, size)
    works = deviation < SLIGHT * size
    return replace(made, passage=Passage(times, *checks, deviation, works, message))


def _motion(made: FourBar, times: Array, places: Complex, size: float) -> tuple[float, str]:
    """Return how far B is from its places (K,) at times, by the solver, and what to say of it."""
    grid = np.unique([*np.linspace(0, 1, SAMPLES), *times])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the message has it
        solution = solve(compiled(made.sketch().mechanism()), grid)
    if not solution.success:
        return math.nan, f"The crank cannot turn so: {solution.message.partition('. ')[0]}."
    angles = solution["rocker.phi"][np.searchsorted(grid, times)]
    found = made.places[3] + made.lengths[3] * np.exp(1j * angles)
    off, turn = float(np.abs(found - places).max()), math.degrees(made.turn)
    if off < SLIGHT * size:
        return off, f"The crank turns by {turn:.4g} deg through the poses in their order."
    return off, f"The motion leaves its branch: it is off the poses by up to {off:.3g}."


def _circuit(lengths: Sequence[float], at_b: Array, at_o: Array) -> Array:
    """Return numbers of circuits: the side of a joint that cannot fold, away from the least link.

    A linkage with no link that can turn wholly, by Grashof's condition, has one circuit.
    """
    if margin_of(lengths) <= 0:
        return np.zeros_like(at_b)
    return at_b if lengths.index(min(lengths)) < 2 else at_o


def _defects(times: Array, folded: Array, circuit: Array) -> str:
    """Say what is in the way of a motion through the poses, "" where nothing is."""
    words = []
    if (np.diff(times) <= SLIGHT).any():
        order = listed(np.argsort(times, kind="stable") + 1)
        words.append(f"The order in which the crank meets the poses is {order}.")
    others = listed(np.flatnonzero(circuit != circuit[0]) + 1)
    if (circuit != circuit[0]).any():
        words.append(f"Poses on another circuit than the first: {others}; take another pair.")
    elif (folded != folded[0]).any():
        others = listed(np.flatnonzero(folded != folded[0]) + 1)
        words.append(f"Poses on another branch than the first: {others}; drive another link.")
    return " ".join(words)


def by_merit(made: Iterable[FourBar], reason: str) -> Found[FourBar]:
    """Return four-bars in order, those that go through their poses first."""
    return Found(sorted(made, key=_merit, reverse=True), reason)


def _merit(made: FourBar) -> tuple[bool, bool, bool, float]:
    """Return what four-bars are ordered by, the best last."""
    found = made.passage
    if found is None:
        return False, False, False, -abs(made.turn)
    return found.works, found.in_order, found.one_branch, -abs(made.turn)


def _made(joints: Sequence[complex], driven: str, turn: float) -> FourBar:
    O, A, B, C, P = ((float(item.real), float(item.imag)) for item in joints)  # noqa: N806, E741
    return FourBar(O, A, B, C, P, driven, turn)
