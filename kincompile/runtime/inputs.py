"""Reading what a caller gives to the solver; all that is wrong is said at once."""

from __future__ import annotations

import math
import operator
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kincompile.criteria import LONGEST_P
from kincompile.errors import InputError, KincompileWarning
from kincompile.names import column_name, listed, suggestion
from kincompile.runtime.engine.code import LIMITS, Compiled, code_of, require_square

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Values: TypeAlias = ArrayLike | Mapping[str, ArrayLike] | None


def names_of(given: Any, what: str) -> tuple[Any, ...]:
    """Return names that are given as one text, or as a list; `what` begins a message of neither."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Iterable):
        raise InputError(f"{what} is {given!r}: give a name, or a list of names.")
    return tuple(given)


def mapping_of(given: Any, what: str) -> Mapping[str, Any]:
    """Return values by name, without any none; `what` begins the message where it is no mapping."""
    if given is not None and not isinstance(given, Mapping):
        raise InputError(f"{what} is {given!r}: give values by name, such as {{'a': 0.1}}.")
    return given or {}


SMALLEST_GRID = 32
"""Points from which on a grid is faster than a march."""


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What the solver works with, checked."""

    code: Compiled  # a module with as many equations as coordinates, or more that agree
    t: NDArray[np.float64]  # (N,): the time grid, finite and monotone
    p: NDArray[np.float64]  # (k,): a value for each parameter; of several sets the first
    guess: NDArray[np.float64]  # (n,): where Newton starts
    tolerance: float  # bound for the last correction, in scales of the coordinates
    max_iterations: int  # Newton iterations after which an attempt is given up
    method: str | None = None  # how a grid is solved: ``"grid"``, ``"march"``, or the faster
    # Whether the points of a grid are solved together, rather than one after the other.
    on_grid: bool = False
    smooth: bool = False  # whether to go on past a bifurcation
    # (B, k), or None: values of the parameters in each of several sets
    sets: NDArray[np.float64] | None = None
    # The arrays that were given of them, by name.
    sweep: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    without_guess: tuple[str, ...] = ()  # bodies that have no guess

    def one_time(self, text: str, remedy: str) -> float:
        """Return the time; refuse several, with a text that says why and what to do."""
        if self.t.size > 1:
            raise InputError(f"{text}, got {self.t.size}: {remedy}.")
        return float(self.t[0])

    def limits_left(self, q: NDArray[np.float64], level: int) -> str:
        """Say which limits of joints positions (N, n) leave, and warn of it; "" of none."""
        if LIMITS not in self.code.makers:
            return ""
        sentences = self.code.request(LIMITS)(q, self.t, self.p)
        said = " ".join(f"{sentence}." for sentence in sentences)
        if said:
            warnings.warn(f"{self.code.name}: {said}", KincompileWarning, stacklevel=level)
        return said

    def about(self) -> dict[str, Any]:
        """Return what a solution says of its mechanism, by field."""
        code, p = self.code, self.p.tolist() if self.sets is None else self.sets.T
        return {
            "name": code.name,
            "coordinates": code.coordinates,
            "equations": code.equations,
            "units": dict(code.units),
            "parameters": dict(zip(code.parameters, p, strict=True)),
            "sweep": dict(self.sweep),
            "module": code.module,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Variants:
    """Parameter sets as they were given."""

    # Parameters of all sets, as `solve` takes those of one; of the first set, where they differ.
    common: Values = None
    # (B, k), or None: the sets, where an array of them was given
    sets: NDArray[np.float64] | None = None
    # Arrays of values by the names of their parameters.
    sweep: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    # Whether every value of one goes with every value of the others; else they go in pairs.
    is_product: bool = False
    problems: tuple[str, ...] = ()  # what is wrong with them

    def parameters(
        self, names: Sequence[str], common: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the parameters of each set, shape (B, k); None where there is one set."""
        if not self.sweep:
            return self.sets
        values = [array.ravel() for array in self._grid()]
        result = np.tile(common, (values[0].size, 1))
        for name, column in zip(self.sweep, values, strict=True):
            result[:, names.index(name)] = column
        return result

    def _grid(self) -> Sequence[NDArray[np.float64]]:
        arrays = tuple(self.sweep.values())
        return np.meshgrid(*arrays, indexing="ij") if self.is_product else arrays


def _read_variants(names: tuple[str, ...], p: Values, product: bool) -> Variants:
    """Read parameters that may be those of several sets: see `solve`."""
    if isinstance(p, Mapping):
        return read_sweep(p, product)
    if not isinstance(p, np.ndarray) or p.ndim != 3:
        return Variants(p)
    count, one, size = p.shape
    if one != 1 or size != len(names) or count == 0 or p.dtype.kind not in "iuf":
        raise InputError(
            f"p has shape {p.shape} and type {p.dtype}: give real numbers of shape "
            f"(B, 1, {len(names)}) for B variants of {listed(names)}."
        )
    sets = np.ascontiguousarray(p[:, 0], dtype=np.float64)
    bad = np.argwhere(~np.isfinite(sets))
    if bad.size:
        variant, which = bad[0].tolist()
        raise InputError(
            f"parameter {names[which]!r} of variant {variant} is "
            f"{sets[variant, which]}: give a finite number."
        )
    return Variants(sets[0], sets)


def read_sweep(p: Mapping[str, Any], product: bool) -> Variants:
    """Read parameters by name, of which some have an array of values; see `solve`."""
    problems: list[str] = []
    common, sweep = dict(p), {}
    for name, given in p.items():
        if isinstance(given, str) or np.ndim(given) != 1:
            continue
        values = np.asarray(given)
        if values.size == 0 or values.dtype.kind not in "iuf":
            problems.append(f"parameter {name!r} has the values {given!r}: give real numbers.")
            common.pop(name)
            continue
        sweep[name] = values.astype(np.float64)
        bad = values[~np.isfinite(values)]
        common[name] = bad[0] if bad.size else values[0]
    sizes = {name: values.size for name, values in sweep.items()}
    if len(set(sizes.values())) > 1 and not product:
        counts = listed(f"{size} of {name!r}" for name, size in sizes.items())
        problems.append(
            f"the parameters have values of different numbers, {counts}: arrays are taken in "
            "pairs, so give them one length, or product=True (--product) to solve every "
            f"combination, {math.prod(sizes.values())} of them."
        )
    return Variants(common, None, sweep, product, tuple(problems))


def read_inputs(
    module: ModuleType,
    t: ArrayLike,
    p: Values,
    guess: Values,
    tolerance: Any,
    max_iterations: Any,
    method: str | None = None,
    through: str | None = None,
    product: bool | None = None,
    *,
    may_move: bool = False,
) -> Inputs:
    """Check all inputs of the solver and bring them into the form in which it uses them.

    There may be several parameter sets unless `product` is None, and degrees of freedom that no
    equation determines with `may_move`. One message lists every wrong value, by name.
    """
    _require_module(module)
    code = code_of(module)
    given = Variants(p) if product is None else _read_variants(code.parameters, p, product)
    problems = list(given.problems)
    values = (
        _times(t, problems),
        _values("parameter", code.parameters, code.defaults, given.common, problems),
        _values("coordinate", code.coordinates, code.guess, guess, problems),
        _tolerance(tolerance, problems),
        _count(max_iterations, problems),
    )
    if method not in (None, "grid", "march"):
        problems.append(f"method is {method!r}: give 'grid', 'march', or nothing.")
    if through not in (None, "smooth"):
        problems.append(f"through is {through!r}: give 'smooth', or nothing.")
    sweep = dict(given.sweep)
    sets = None if problems else given.parameters(code.parameters, values[1])
    if not may_move:
        require_square(code)
    if code.covers.size:
        problems += _without_orientation(code, values[2])
        values = *values[:2], _oriented(code, values[2]), *values[3:]
    if method == "grid" and code.lanes is None:
        problems.append(
            f"{code.name} goes from point to point, as all mechanisms in the grouped form do: use "
            "method='march', or compile it with form='inline'."
        )
    if problems:
        raise InputError(problems)
    on_grid = method == "grid" or (
        method is None and values[0].size >= SMALLEST_GRID and code.lanes is not None
    )
    without = () if guess is not None else code.without_guess
    return Inputs(code, *values, method, on_grid, through == "smooth", sets, sweep, without)


def _require_module(module: object) -> None:
    """Refuse what was not compiled or not loaded, with the step that is missing."""
    if isinstance(module, ModuleType) and vars(module).keys() >= {"N_COORDINATES", "position"}:
        return
    if isinstance(module, str | os.PathLike):
        remedy = "load the file first: module = kc.load(path)"
    else:
        remedy = "compile the mechanism first: module = kc.compile(m)"
    raise InputError(f"expected a compiled module, got a {type(module).__name__}: {remedy}.")


def _times(t: ArrayLike, problems: list[str]) -> NDArray[np.float64]:
    """Read a time or a grid of times."""
    times = real_numbers("t", t, problems)
    if times is None:
        return np.empty(0)
    if times.ndim > 1 or times.size == 0:
        problems.append(
            f"t has shape {times.shape}: give one time, or a 1-D grid of at least one time."
        )
        return times
    times = np.atleast_1d(times)
    if not np.isfinite(times).all():
        index = int(np.argmin(np.isfinite(times)))
        problems.append(f"t[{index}] is {times[index]}: times must be finite numbers.")
    elif not ((times[1:] >= times[:-1]).all() or (times[1:] <= times[:-1]).all()):
        problems.append("t goes back and forth: sort the times, up or down (t = np.sort(t)).")
    return times


def _values(
    what: str,
    names: tuple[str, ...],
    defaults: NDArray[np.float64],
    given: Values,
    problems: list[str],
) -> NDArray[np.float64]:
    """Read a vector, or a mapping from names to values that overrides the defaults."""
    if given is None:
        return defaults
    if isinstance(given, Mapping):
        return _overridden(what, names, defaults, given, problems)
    values = real_numbers(f"the {what} vector", given, problems)
    if values is None:
        return defaults
    if values.shape != defaults.shape:
        problems.append(
            f"the {what} vector has shape {values.shape}, expected {defaults.shape}: a value for "
            f"each of {listed(names)}, or a dict of those that differ."
        )
        return defaults
    for name, value in zip(names, values, strict=True):
        _require_finite(what, name, float(value), problems)
    return values


def _overridden(
    what: str,
    names: tuple[str, ...],
    defaults: NDArray[np.float64],
    given: Mapping[str, Any],
    problems: list[str],
) -> NDArray[np.float64]:
    """Replace the defaults that a mapping names."""
    values = defaults.copy()
    for key, value in given.items():
        name = column_name(str(key)) if what == "coordinate" else key
        if name not in names:
            near = suggestion(str(name), names) or "."
            problems.append(f"there is no {what} {name!r}{near} The {what}s are {listed(names)}.")
            continue
        number = real_numbers(f"{what} {name!r}", value, problems)
        if number is None:
            continue
        if number.ndim:
            problems.append(f"{what} {name!r} has shape {number.shape}: give one number.")
            continue
        _require_finite(what, name, float(number), problems)
        values[names.index(name)] = number
    return values


def real_numbers(what: str, given: object, problems: list[str]) -> NDArray[np.float64] | None:
    """Turn anything into a new array of real numbers, or note why that is impossible."""
    try:
        array = np.asarray(given)
    except (TypeError, ValueError):
        problems.append(f"{what} is not a regular array: its parts have different lengths.")
        return None
    if array.dtype.kind not in "iuf" and array.size:
        kind = type(given).__name__ if array.ndim == 0 else f"an array of {array.dtype}"
        problems.append(f"{what} is {kind}: give real numbers.")
        return None
    return array.astype(np.float64)


def _without_orientation(code: Compiled, guess: NDArray[np.float64]) -> list[str]:
    """Return what is wrong with Euler parameters of length zero."""
    bodies = {first + 3: name for name, first, _ in code.bodies}
    return [
        f"the guess of {bodies[int(p[0])]!r} has Euler parameters of length zero, which is no "
        "orientation: (1, 0, 0, 0) is that of the ground."
        for p in code.covers
        if not guess[p].any()
    ]


def _oriented(code: Compiled, guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a guess with Euler parameters of a length near one: any length is an orientation.

    By their largest first, since the squares of large ones overflow.
    """
    found = guess.copy()
    for p in code.covers:
        most = np.abs(guess[p]).max()
        rest = math.sqrt(sum((guess[p] / most) ** 2)) if most else math.nan
        if most * rest > LONGEST_P or most * rest < 1 / LONGEST_P:
            found[p] = guess[p] / most / rest
    return found


def _require_finite(what: str, name: str, value: float, problems: list[str]) -> None:
    """Note a value that is NaN or infinite."""
    if not math.isfinite(value):
        problems.append(f"{what} {name!r} is {value}: give a finite number.")


def _tolerance(tolerance: object, problems: list[str]) -> float:
    """Read the tolerance: a positive number."""
    if isinstance(tolerance, float | int | np.floating) and 0 < tolerance < math.inf:
        return float(tolerance)
    problems.append(f"tolerance is {tolerance!r}: give a positive number such as 1e-10.")
    return math.nan


def _count(max_iterations: Any, problems: list[str]) -> int:
    """Read the cap on Newton's iterations: a positive integer."""
    try:
        count = operator.index(max_iterations)
    except TypeError:
        count = 0
    if count < 1:
        problems.append(f"max_iterations is {max_iterations!r}: give an integer of at least 1.")
    return count
