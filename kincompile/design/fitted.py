"""The result of `kc.fit`: the mechanism with its new dimensions, and what it reaches."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.design.demands import Extremes, compared, deviation, orders_of, sides
from kincompile.design.variation import with_values
from kincompile.errors import KincompileWarning
from kincompile.html import Shown, table_html
from kincompile.names import listed
from kincompile.runtime.solve import solve
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.design.demands import Demands
    from kincompile.design.trial import Trial
    from kincompile.model.mechanism import Mechanism
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

FINELY = 4
"""Parts of each step of the grid at which limits are judged in the end."""

REACHED = ("target", "t", "wanted", "got", "off")
DESIGNS = ("design", "error", "size")
KEPT = ("limit", "from", "to", "least", "greatest")
DIMENSIONS = ("parameter", "value", "unit", "before")


@dataclass(frozen=True, slots=True)
class Counts:
    """Evaluation counts of a fit."""

    sampled: int  # sets of parameters that the search tried
    starts: int  # of them, those that were followed
    # motions, gradients: motions and derivatives that were evaluated one by one
    motions: int
    gradients: int
    seconds: float
    is_cut: bool = False  # whether the budget was spent before the end of the search


@dataclass(frozen=True, slots=True)
class Reached:
    """One wanted value and what became of it.

    Attributes
    ----------
    title
        Of the target.
    t
        When.
    column, unit
        Of what.
    wanted, got, off
        What was wanted, what is, and the difference, of angles modulo whole turns.
    is_near
        Whether it is as near as the target asks.
    """

    title: str
    t: float
    column: str
    unit: str
    wanted: float
    got: float
    off: float
    is_near: bool


@dataclass(frozen=True, slots=True)
class Kept:
    """A limit, and the least and greatest value along the motion."""

    title: str
    low: float
    high: float
    least: float
    greatest: float
    holds: bool


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Fit(Shown):
    """A mechanism with dimensions that were found, and what it reaches.

    Attributes
    ----------
    model : Mechanism
        The mechanism with these dimensions as defaults, and a guess on the branch that was found.
    parameters : dict
        The dimensions by name.
    before : dict
        What they were.
    error : float
        The sum of squares of the weighted deviations.
    others : tuple of Fit
        The next best designs, each unlike the others.
    dropped : dict
        How many ends were dropped for a defect: of ``"order"``, where the points do not come within
        one cycle; of ``"circuit"``, where the motion stops between them; of ``"branch"``, where it
        arrives at another position.
    drawn : dict, optional
        Where the values before do not get through the times of the targets: values with which the
        mechanism does, to which the search has moved them. Empty if it found none near them.
    reached : tuple of Reached
        Every wanted value.
    limits : tuple of Kept
        Every limit.
    motion : Solution
        The motion through all times of the targets, on one branch.
    counts : Counts
        Evaluations and time.
    success : bool
        Whether all is as near as was asked, within all limits.
    message : str
        One sentence; else how near it comes, and where.
    """

    model: Mechanism
    parameters: dict[str, float]
    before: dict[str, float]
    units: dict[str, str]
    error: float
    reached: tuple[Reached, ...]
    limits: tuple[Kept, ...]
    motion: Solution
    counts: Counts
    others: tuple[Fit, ...] = ()
    dropped: dict[str, int] = field(default_factory=dict)
    drawn: dict[str, float] | None = None

    @property
    def errors(self) -> tuple[float, ...]:
        """The errors of this design and of the others that keep the limits, the least first."""
        return tuple(sorted(item.error for item in self._designs if item.keeps_limits))

    @property
    def outside(self) -> tuple[float, ...]:
        """The errors of those that exceed limits, the least first."""
        return tuple(sorted(item.error for item in self._designs if not item.keeps_limits))

    @property
    def _designs(self) -> tuple[Fit, ...]:
        return (self, *self.others)

    @property
    def keeps_limits(self) -> bool:
        """Whether all limits hold."""
        return all(item.holds for item in self.limits)

    @property
    def success(self) -> bool:
        """Whether all is as near as was asked, within all limits."""
        return all(item.is_near for item in self.reached) and self.keeps_limits

    @property
    def message(self) -> str:
        """One sentence on what was reached; else how near it comes, and where."""
        name = self.model.name
        broken = [item for item in self.limits if not item.holds]
        if broken:
            item = broken[0]
            return (
                f"{name} cannot keep {item.title} between {item.low:g} and {item.high:g} within "
                f"the bounds: it goes from {item.least:.6g} to {item.greatest:.6g}."
            )
        if self.success:
            return f"{name} reaches all targets; {self._farthest()}"
        return (
            f"no set of parameters that was found within the bounds reaches all targets; "
            f"{self._farthest()}"
        )

    def _farthest(self) -> str:
        item = max(self.reached, key=lambda item: abs(item.off))
        unit = f" {item.unit}".rstrip()
        return (
            f"the farthest is {item.column} at t = {item.t:.6g}: {item.got:.6g}{unit}, which is "
            f"{abs(item.off):.3g} from {item.wanted:.6g}."
        )

    def headline(self) -> str:
        """Return what was reached."""
        return self.message.rstrip(".")

    def dimensions(self) -> list[tuple[str, ...]]:
        """Return the rows of a table of the dimensions."""
        return [
            (name, f"{value:.9g}", self.units.get(name, ""), f"{self.before[name]:.6g}")
            for name, value in self.parameters.items()
        ]

    def targets(self) -> list[tuple[str, ...]]:
        """Return the rows of a table of what is reached."""
        return [
            (
                item.column, f"{item.t:.6g}", f"{item.wanted:.6g}", f"{item.got:.6g}",
                f"{item.off:+.2e}{'' if item.is_near else ' (far)'}",
            )
            for item in self.reached
        ]  # fmt: skip

    def kept(self) -> list[tuple[str, ...]]:
        """Return the rows of a table of limits."""
        return [
            (
                item.title, f"{item.low:.6g}", f"{item.high:.6g}", f"{item.least:.6g}",
                f"{item.greatest:.6g}{'' if item.holds else ' (exceeded)'}",
            )
            for item in self.limits
        ]  # fmt: skip

    @property
    def size(self) -> float:
        """The diagonal of the box that all origins and points move in, over the motion [length]."""
        names = (*self.motion.coordinates, *self.motion.observed.names)
        axes = (
            [self.motion[name] for name in names if name.startswith(axis)]
            for axis in ("x_", "y_", "z_")
        )
        spans = [np.ptp(np.concatenate(places)) for places in axes if places]
        return float(np.linalg.norm(spans))

    @property
    def front(self) -> tuple[Fit, ...]:
        """The designs, this one first, that no other surpasses in all: Pareto's front.

        Criteria are the error, the size, and how far each limit is kept, as a transmission angle.
        """
        return tuple(
            one
            for one in self._designs
            if not any((other.criteria <= one.criteria).all() for other in self._surpassing(one))
        )

    def _surpassing(self, one: Fit) -> list[Fit]:
        return [x for x in self._designs if x is not one and (x.criteria < one.criteria).any()]

    @property
    def criteria(self) -> NDArray[np.float64]:
        """Error, size, and the negative of what is left to each limit: the less, the better."""
        left = [min(x.least - x.low, x.high - x.greatest) for x in self.limits]
        return np.array([self.error, self.size, *(-x for x in left)])

    def designs_titles(self) -> tuple[str, ...]:
        """Return the titles of the table of designs."""
        limits = (f"{item.title}, least to greatest" for item in self.limits)
        return (*DESIGNS, *limits, *self.parameters, "front")

    def designs(self) -> list[tuple[str, ...]]:
        """Return the rows of a table of this design and the others."""
        front = {id(item) for item in self.front}
        return [
            (
                str(number), f"{item.error:.6g}", f"{item.size:.4g}",
                *(f"{x.least:.4g} to {x.greatest:.4g}" for x in item.limits),
                *(f"{value:.5g}" for value in item.parameters.values()),
                "yes" if id(item) in front else "",
            )
            for number, item in enumerate(self._designs, 1)
        ]  # fmt: skip

    def effort(self) -> str:
        """Return what it took, in a sentence."""
        counts = self.counts
        dropped = [f"{count} of {kind}" for kind, count in self.dropped.items() if count]
        parts = [
            f"Sum of squares {self.error:.6g}; {counts.sampled} sets searched, {counts.starts} "
            f"followed to the end, {counted(counts.motions, 'motion')} in {counts.seconds:.2f} s."
        ]
        if self.drawn is not None:
            parts.append(self._moved())
        if counts.is_cut:
            parts.append("The search ended with its budget.")
        if dropped:
            parts.append(f"Dropped for defects: {listed(dropped)}.")
        return " ".join(parts)

    def _moved(self) -> str:
        """Say which of the values before were moved, and how far."""
        moved = [
            f"{name} from {self.before[name]:.4g} to {value:.4g}"
            for name, value in (self.drawn or {}).items()
            if f"{value:.4g}" != f"{self.before[name]:.4g}"
        ]
        what = f"moved {listed(moved)}, and began there" if moved else "began with others"
        return (
            "With the values before it does not get through the times of the targets; the search "
            f"{what}."
        )

    def to_text(self) -> str:
        """Return dimensions, targets and limits as tables."""
        lines = [self.message, self.effort(), ""]
        lines += indented(table(DIMENSIONS, self.dimensions(), right=("value", "before")))
        lines += ["", *indented(table(REACHED, self.targets(), right=REACHED[1:]))]
        if self.limits:
            lines += ["", *indented(table(KEPT, self.kept(), right=KEPT[1:]))]
        if self.others:
            titles = self.designs_titles()
            lines += ["", *indented(table(titles, self.designs(), right=titles[:-1]))]
        return "\n".join(lines)

    def to_html(self) -> str:
        """Return the tables as a part of a page."""
        name = self.model.name
        parts = [
            table_html(name, f"{self.message} {self.effort()}", DIMENSIONS, self.dimensions()),
            table_html("targets", "what is reached", REACHED, self.targets()),
        ]
        if self.limits:
            parts.append(table_html("limits", "over the motion", KEPT, self.kept()))
        if self.others:
            said = "and others; on the front no other is better in all"
            parts.append(table_html("designs", said, self.designs_titles(), self.designs()))
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        return self.to_html()


def fitted(
    model: Mechanism,
    demands: Demands,
    best: Trial,
    names: Sequence[str],
    counts: Counts,
    allowed: float,
) -> Fit:
    """Return the result of a fit from a trial."""
    values = dict(zip(names, best.x.tolist(), strict=False))
    before = {item.name: item.default for item in model.system().parameters}
    changed = _on_branch(model, values, best.motion)
    return Fit(
        changed,
        values,
        {name: float(before[name] or 0.0) for name in names},
        {item.name: item.unit for item in model.parameters},
        best.error,
        tuple(_reached(demands, best, len(names))),
        tuple(_kept(demands, best, allowed)),
        best.motion,
        counts,
    )


def _on_branch(model: Mechanism, values: dict[str, float], motion: Solution) -> Mechanism:
    """Return the model with these values, guessed so that it starts where the motion belongs.

    A model starts at t = 0, its targets may begin elsewhere: the motion is followed back to there,
    as far as that goes.
    """
    own = values | {
        name: float(value) for name, value in motion.parameters.items() if name not in values
    }
    guess = motion.q[0]
    if motion.t[0] != 0.0:
        back = np.linspace(motion.t[0], 0.0, 73)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)
            found = solve(compile_model(model), back, own, guess)
        guess = found.q[-1] if found.success else guess
    named = dict(zip(motion.coordinates, guess.tolist(), strict=True))
    return with_values(model, own, named)


def _reached(demands: Demands, best: Trial, count: int) -> list[Reached]:
    """Return every wanted value and what became of it."""
    rows, motion = [], best.motion
    for (target, columns), at in zip(
        demands.passing, demands.instants(best.x[count:]), strict=True
    ):
        places = np.searchsorted(motion.t, at)
        for j, place in enumerate(places.tolist()):
            for k, column in enumerate(columns):
                wanted, got = float(target.values[j, k]), float(motion[column.name][place])
                off = float(deviation(np.array(wanted), column, np.array(got)))
                near = abs(off) * float(target.weights[k]) <= target.within
                rows.append(
                    Reached(
                        target.title, float(at[j]), column.name, column.unit, wanted, got, off, near
                    )
                )
    for shape, columns in demands.shaped:
        places = np.searchsorted(motion.t, shape.times)
        values = np.column_stack([motion[item.name][places] for item in columns])
        sizes = np.abs(compared(shape, values)[0]) / shape.weight
        far, when = float(sizes.max()), float(shape.times[np.argmax(sizes)])
        title, unit = shape.title, columns[0].unit
        rows.append(Reached(title, when, title, unit, 0.0, far, far, far <= shape.within))
    first = best.residuals.size - len(demands.ratios)
    for (ratio, _), residual in zip(demands.ratios, best.residuals[first:].tolist(), strict=True):
        off = residual / ratio.weight
        near = abs(off) <= ratio.within
        rows.append(
            Reached(
                ratio.title, float(motion.t[-1]), ratio.title, "", ratio.ratio, ratio.ratio + off,
                off, near,
            )
        )  # fmt: skip
    return rows


def _kept(demands: Demands, best: Trial, allowed: float) -> list[Kept]:
    """Return every limit with what is along the motion."""
    if not demands.limits:
        return []
    motion, rows = _finely(best.motion, demands.grid), []
    for item, column, is_constant in demands.limits:
        places = slice(0, 1) if is_constant else slice(None)
        orders = orders_of(motion, column)[:, places]
        low, high = (Extremes(motion.t[places], orders, sign).of(orders) for sign in (1.0, -1.0))
        ends = np.array([low.min(), high.max()])
        holds = all((side.left(ends) >= -allowed).all() for side in sides(item))
        least, greatest = ends.tolist()
        rows.append(Kept(item.title, item.least, item.most, least, greatest, holds))
    return rows


def _finely(motion: Solution, grid: Array) -> Solution:
    """Return a motion at the times of a grid and between them, as limits are judged."""
    if not grid.size or motion.module is None:  # limits of dimensions alone
        return motion
    t = np.linspace(grid[0], grid[-1], FINELY * (grid.size - 1) + 1)
    start = int(np.searchsorted(motion.t, grid[0]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)
        return solve(motion.module, t, motion.parameters, motion.q[start])
