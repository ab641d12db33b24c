"""The tables of a model's file that commands read: ``[sweep]``, ``[fit]`` and others.

To a model they belong as data, `Mechanism.tasks`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from kincompile.model import declared as kind
from kincompile.model.declared import declared, given
from kincompile.names import LARGEST_SEED, ROLES, TRIPLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MOST_VARIANTS = 10_000_000
"""Largest number of values of all parameters together that a file may ask for."""

PART = 1e-3
"""Part of how far wanted values are apart, or of their size, up to which they count as reached."""


@declared
class Span:
    """Equally spaced values from one to another, `count` or as many as there are samples."""

    first: float = given(kind.CONSTANT, "The first value.", key="from")
    last: float = given(kind.CONSTANT, "The last value.", key="to")
    count: int | None = given(
        kind.whole(1, MOST_VARIANTS), "How many; `samples` without.", default=None
    )


_SWEPT = kind.any_of(kind.array(kind.CONSTANT, 1), kind.ref("span")) | {
    "description": "a list of values, or { from = 0.2, to = 0.6, count = 5 }"
}


@declared
class Sweep:
    """What a file says of a sweep."""

    parameters: Mapping[str, tuple[float, ...] | Span] = given(
        kind.named(_SWEPT), "Values of each parameter that is swept: a list, or a span."
    )
    samples: int | None = given(
        kind.whole(1, MOST_VARIANTS),
        "How many points fill the spans without a count.",
        default=None,
    )
    product: bool = given(
        kind.FLAG, "Whether every value goes with every other one.", default=False
    )
    columns: tuple[str, ...] | None = given(
        kind.NAMES, "Columns that are kept over time.", default=None
    )
    measures: tuple[str, ...] = given(
        kind.NAMES, "Measures that are kept, as `foot.x.stroke`.", default=()
    )


@declared
class Transmission:
    """What a file says of a mechanism as a function of its inputs."""

    inputs: tuple[str, ...] = given(kind.NAMES, "Drivers and coordinates.")
    outputs: tuple[str, ...] = given(kind.NAMES, "Coordinates, outputs and points.")
    grid: Mapping[str, tuple[float, ...] | Span] | None = given(
        kind.named(_SWEPT), "Values of each input that is not at its first pose.", default=None
    )
    efforts: Mapping[str, float] | None = given(
        kind.named(kind.CONSTANT), "What each output delivers.", default=None
    )


@declared
class Limits:
    """Limits of a dimension's deviation from its nominal value, and how it is distributed."""

    low: float = given(kind.CONSTANT, "The lower limit deviation, in the unit of the parameter.")
    high: float = given(kind.CONSTANT, "The upper limit deviation.")
    distribution: Any = given(
        kind.one_of(("normal", "uniform", "truncated")), "How it is distributed.", default="normal"
    )
    sigmas: float = given(
        kind.CONSTANT, "Standard deviations from the middle to a limit.", default=3.0
    )


_DEVIATION = kind.any_of(kind.CONSTANT, kind.PAIR, kind.ref("deviation")) | {
    "description": "a number, two limits, or { low = -1e-4, high = 2e-4 }"
}


@declared
class Tolerance:
    """What a file says of an analysis of tolerances."""

    of: tuple[str, ...] | None = given(kind.NAMES, "The columns that are looked at.", default=None)
    parameters: Mapping[str, float | tuple[float, float] | Limits] | None = given(
        kind.named(_DEVIATION), "The tolerance of each parameter that has one.", default=None
    )
    clearances: Mapping[str, float] | None = given(
        kind.named(kind.CONSTANT), "Radial clearances of joints.", default=None, unit="length"
    )
    samples: int = given(kind.whole(0, 2**24), "Samples of Monte Carlo.", default=0)
    seed: int = given(kind.whole(0, LARGEST_SEED), "Seed of the sequence.", default=0)


@declared
class Fit:
    """What a file says of a fit."""

    parameters: Mapping[str, tuple[float, float]] = given(
        kind.named(kind.PAIR), "The least and the greatest value of each parameter that may change."
    )
    targets: Sequence[Any] = given(kind.tables("target"), "What the mechanism is to do.")
    samples: int = given(
        kind.whole(1, 2**20), "Sets of parameters that are searched.", default=4096
    )
    starts: int = given(
        kind.whole(1, 10_000), "How many of them are followed to the end.", default=64
    )
    search: str = given(
        kind.one_of(("sobol", "differential evolution")),
        "How the sets are chosen.",
        default="sobol",
    )
    minimizer: str = given(
        kind.one_of(("SLSQP", "trust-constr")), "The solver of a fit with limits.", default="SLSQP"
    )
    seed: int = given(kind.whole(0, LARGEST_SEED), "Seed of the search.", default=0)
    norm: str = given(
        kind.one_of(("squares", "maximum")),
        "What is least in the end: the sum of squares, or the largest deviation.",
        default="squares",
    )
    seconds: int | None = given(
        kind.whole(1, 10**9), "Time that the search may take [s].", default=None
    )
    evaluations: int | None = given(
        kind.whole(1, 10**12), "Motions that the search may follow.", default=None
    )


_ROWS = kind.array(kind.array(kind.CONSTANT) | {"description": "a list of numbers"}) | {
    "description": "a list of lists of numbers"
}


@declared
class Reached:
    """Fields of each target that is reached."""

    weight: float = given(
        kind.CONSTANT, "Factor of its deviations, among other targets.", default=1.0, kw_only=True
    )


@declared
class Passing(Reached):
    """Fields of targets with values of columns, at times or in an order."""

    times: Any = given(
        kind.array(kind.CONSTANT),
        "When; without, the times are found as well.",
        default=None,
        kw_only=True,
    )
    within: float | None = given(
        kind.CONSTANT, "Deviation along an axis that counts as reached.", default=None, kw_only=True
    )
    between: Any = given(
        kind.PAIR, "The first and the last time that may be found.", default=None, kw_only=True
    )


@declared
class Path(Passing):
    """A point goes through points, in their order."""

    path: str = given(kind.TEXT, "Name of a point, or of a body, whose origin is meant.")
    points: Any = given(_ROWS, "Where it is to be.", unit="length")


@declared
class Value(Passing):
    """A column has values: function generation, velocities."""

    value: str = given(kind.TEXT, "A coordinate, an output, or a rate.")
    values: Any = given(kind.array(kind.CONSTANT), "What is wanted, in the unit of the column.")


@declared
class Pose(Passing):
    """A body of the plane goes through poses, in their order."""

    pose: str = given(kind.TEXT, "Name of a body.")
    poses: Any = given(_ROWS, "Rows of x, y and phi.")
    angle_weight: float = given(
        kind.CONSTANT,
        "Factor of deviations of the angle beside lengths.",
        default=1.0,
        kw_only=True,
    )


@declared
class TimeRatio(Reached):
    """A column rises for `ratio` times the time in which it falls."""

    time_ratio: str = given(kind.TEXT, "The column.")
    ratio: float = given(kind.CONSTANT, "A positive number.")
    within: float = given(
        kind.CONSTANT, "Deviation that counts as reached.", default=PART, kw_only=True
    )


@declared
class Shaped(Reached):
    """Fields of targets over a part of the motion."""

    between: Any = given(kind.PAIR, "The first and the last time.", kw_only=True)
    within: float = given(kind.CONSTANT, "Deviation that counts as reached.", kw_only=True)


@declared
class Straight(Shaped):
    """The path of a point is straight."""

    straight: str = given(kind.TEXT, "Name of a point, or of a body, whose origin is meant.")
    line: Any = given(
        _ROWS, "Two places on the line; any line without.", default=None, unit="length",
        kw_only=True,
    )  # fmt: skip


@declared
class Circular(Shaped):
    """The path of a point is a part of a circle."""

    circular: str = given(kind.TEXT, "Name of a point, or of a body, whose origin is meant.")
    circle: Any = given(
        kind.array(kind.CONSTANT), "x, y of its centre and its radius; any circle without.",
        default=None, unit="length", kw_only=True,
    )  # fmt: skip


@declared
class Dwell(Shaped):
    """A column rests."""

    dwell: str = given(kind.TEXT, "A coordinate, an output, or a rate.")
    at: float | None = given(kind.CONSTANT, "Where; anywhere without.", default=None, kw_only=True)


@declared
class Limit:
    """A column, or a formula of parameters, stays between two values."""

    limit: str = given(kind.TEXT, "A column, or a formula of parameters.")
    least: float = given(kind.CONSTANT, "The least value.", default=-math.inf)
    most: float = given(kind.CONSTANT, "The greatest value.", default=math.inf)
    title: str = given(kind.TEXT, "What it is called in reports.", default="", kw_only=True)


@declared
class Grashof:
    """A four-bar is of a type, by Grashof's rule."""

    grashof: Any = given(
        kind.one_of((*ROLES, TRIPLE)),
        "The type.",
    )
    link: str | None = given(
        kind.TEXT, "A link that it has, where there are several.", default=None, kw_only=True
    )
    margin: float = given(
        kind.CONSTANT, "The least p + q - s - l.", default=0.0, unit="length", kw_only=True
    )


@declared
class Moves:
    """The mechanism moves through all times of the model."""

    moves: bool = given({"const": True}, "Always true.")


TARGETS: Mapping[str, type] = {
    "path": Path, "value": Value, "pose": Pose, "straight": Straight, "circular": Circular,
    "dwell": Dwell, "time_ratio": TimeRatio, "limit": Limit, "grashof": Grashof,
    "moves": Moves,
}  # fmt: skip
"""Targets of a fit: functions of `kc.targets`, and what a file says of each."""
