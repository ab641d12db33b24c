"""What the words of the solver's text mean on NumPy, where a lane is an array over points.

`on_numpy` gives the text of a mechanism as a module: a copy of its own, whose sizes, criteria and
kernels are the mechanism's. The values below stand for those until then.
"""

from __future__ import annotations

import functools
import inspect
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import FIRST_DIFFERENCE, SECOND_DIFFERENCE, rounded
from kincompile.solver import reader, vocabulary

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

Array = NDArray[Any]

LINE = "line"
"""Of points that are led: the time, the parameters that all begin at, and their own."""

BASES = {"real": float, "int": np.intc, "bool": bool}


@dataclass(frozen=True, slots=True)
class Mechanism:
    """What the text must know of a mechanism.

    `sizes` are those of `vocabulary.SIZES`, `tables` those of `vocabulary.TABLES`. Of the kernels
    `position` (q, t, p) gives Phi and the entries of Phi_q that vary, whose places are `varying`;
    `nu` (q, t, p) and `gamma` (q, q_dot, t, p) give the right sides, a row each. `factor` gives of
    those entries what `solve` takes, and the determinants. `start` are all entries of Phi_q, of
    which those that vary may be any.
    """

    sizes: Mapping[str, int]
    tables: Mapping[str, Any]
    kernels: Mapping[str, Callable[..., Any]]
    varying: Sequence[int]
    start: Array


def on_numpy(mechanism: Mechanism, *, is_careful: bool = False) -> ModuleType:
    """Return the texts as a module that solves a mechanism: `march`, `position_from`, structs."""
    n, m = (mechanism.sizes[name] for name in ("N", "M"))
    sizes = {**mechanism.sizes, "TALL": m + n, "WIDE": n + 1, "NORMAL": n * (n + 1) // 2}
    kernels, words = _Kernels(mechanism), (*vocabulary.KERNELS, "solve", "missed", "lead")
    own = {name: getattr(kernels, name) for name in words}
    texts = reader.MARCH if is_careful else (*reader.MARCH, reader.SETS)
    chosen = vocabulary.CAREFUL if is_careful else vocabulary.ABREAST
    march = _copy_of(texts, {}, chosen)
    start = _copy_of(reader.START, vars(march), chosen)
    for text in (march, start):
        vars(text).update(**sizes, **mechanism.tables, **own)
    for struct in vars(start).values():
        if inspect.isclass(struct) and issubclass(struct, Struct):
            struct.sizes = sizes
    return start


def _copy_of(parts: Sequence[str], known: Mapping[str, Any], chosen: str) -> ModuleType:
    """Return a module of its own for a text, which has known names besides."""
    module = ModuleType(f"kincompile.solver.{parts[-1]}")
    vars(module).update({name: x for name, x in known.items() if not name.startswith("_")})
    modules = {f"kincompile.solver.{x}" for x in (*reader.MARCH, *reader.START, reader.SETS)}
    for name in parts:
        tree, _ = reader.branches(reader.source_of(name), [chosen])
        # What stands in another module of the texts is there already, for this mechanism.
        tree.body = [x for x in tree.body if getattr(x, "module", None) not in modules]
        exec(compile(tree, str(reader.place_of(name)), "exec"), vars(module))
    return module


class Real:
    """A number that is the same for all lanes; likewise the other types, which annotate."""


class Rows:
    """Rows of numbers, whose last axis is the lane; likewise ``Row``, ``Vector``, ``Matrix``."""

    def __class_getitem__(cls, size: object) -> type:
        """Return the type for a size."""
        return cls


Int = Count = Bool = Lane = LaneInt = LaneBool = Table = Block = Real
Row = Vector = Matrix = Rows


class Struct:
    """A struct: to set one of its arrays is to fill it."""

    sizes: Mapping[str, int] = {}  # of a mechanism, set with the text

    def __init__(self, **given: Any) -> None:
        for name, text in inspect.get_annotations(type(self)).items():
            word, _, size = text.rstrip("]").partition("[")
            kind = vocabulary.TYPES.get(word)
            lanes = self.sizes["LANES"]
            if word in ("Row", "Rows", "Matrix"):
                own = tuple(self.sizes[x] for x in size.split(", "))
                vars(self)[name] = np.zeros((*own, lanes) if word == "Rows" else own)
            elif kind is not None and kind.is_lane:
                vars(self)[name] = np.zeros(lanes, BASES[kind.base])
            else:
                vars(self)[name] = 0.0
        vars(self).update(given)

    def __setattr__(self, name: str, value: Any) -> None:
        """Fill an array, or set a number."""
        here = vars(self).get(name)
        if isinstance(here, np.ndarray):
            here[...] = value
        else:
            vars(self)[name] = value


def _first(value: Any, lanes: int) -> Any:
    """Return the first lanes of a struct or of a lane, not copied."""
    if isinstance(value, Struct):
        cut = object.__new__(type(value))
        vars(cut).update({name: _first(part, lanes) for name, part in vars(value).items()})
        return cut
    return value[..., :lanes] if isinstance(value, np.ndarray) else value


def lanewise(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let a function that works on all lanes alike be called for the first of them."""
    kinds = [str(x) for x in function.__annotations__.values()]

    @functools.wraps(function)
    def called(*arguments: Any, lanes: int | None = None) -> Any:
        if lanes is not None:  # a vector or row that all lanes share is not cut
            given = zip(arguments, kinds, strict=True)
            arguments = tuple(
                x if kind.startswith(("Vector", "Row[")) else _first(x, lanes) for x, kind in given
            )
        return function(*arguments)

    return called


class _Kernels:
    """The kernels of a mechanism, as the text calls them."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.own = mechanism, mechanism.kernels

    def _fill(self, rows: Array, values: Any) -> None:
        for row, value in zip(rows, values, strict=True):
            row[:] = value

    def lead(self, b: Any, ends: Array, first: int, lanes: int) -> None:
        """Lead points from their parameters to those of a table: the part of a line is the time."""
        vars(b)[LINE] = float(b.t[0]), b.p[:, :1].copy(), ends[:, first : first + lanes]
        b.t = 0.0

    def _beside(self, b: Any, part: float, q: Array) -> Any:
        """Evaluate positions a part of their lines beside where points are."""
        t, begin, ends = vars(b)[LINE]
        return self.own["position"](q, np.full_like(b.t, t), begin + (b.t + part) * (ends - begin))

    def _differences(self, b: Any, part: float, q_dot: Array) -> tuple[Array, Array]:
        """Return Phi before and after points that move along lines."""
        found = (self._beside(b, x, b.q + x * q_dot)[: len(b.Phi)] for x in (-part, part))
        before, after = (np.array(np.broadcast_arrays(*rows)) for rows in found)
        return before, after

    def position(self, b: Any, lanes: int | None = None) -> None:
        """Evaluate Phi and Phi_q."""
        b = b if lanes is None else _first(b, lanes)
        is_led = LINE in vars(b)
        values = self._beside(b, 0.0, b.q) if is_led else self.own["position"](b.q, b.t, b.p)
        m = len(b.Phi)
        self._fill(b.Phi, values[:m])
        for place, value in zip(self.mechanism.varying, values[m:], strict=True):
            b.Phi_q[place] = value

    def nu(self, b: Any) -> None:
        """Evaluate nu."""
        if LINE in vars(b):
            before, after = self._differences(b, FIRST_DIFFERENCE, 0.0 * b.q_dot)
            b.nu = (before - after) / (2 * FIRST_DIFFERENCE)
            return
        self._fill(b.nu, self.own["nu"](b.q, b.t, b.p))

    def gamma(self, b: Any) -> None:
        """Evaluate gamma."""
        if LINE in vars(b):
            before, after = self._differences(b, SECOND_DIFFERENCE, b.q_dot)
            b.gamma = (2 * b.Phi - before - after) / SECOND_DIFFERENCE**2
            return
        self._fill(b.gamma, self.own["gamma"](b.q, b.q_dot, b.t, b.p))

    def factor(self, b: Any, lanes: int | None = None) -> None:
        """Factor Phi_q."""
        b = b if lanes is None else _first(b, lanes)
        b.F, found = self.own["factor"]([b.Phi_q[place] for place in self.mechanism.varying])
        self._fill(b.determinants, found)

    def solve(self, b: Any, right: Array) -> Array:
        """Return x of Phi_q x = right."""
        x: Array = np.empty_like(b.q)
        self._fill(x, self.own["solve"](b.F, list(right)))
        return x

    def missed(self, b: Any, weight: Array, by_velocity: Array, by_acceleration: Array) -> None:
        """Find what velocity and acceleration miss of their equations."""
        for right, x, total in ((b.nu, b.q_dot, by_velocity), (b.gamma, b.q_ddot, by_acceleration)):
            rest = right.copy()
            for entry, (i, j) in zip(b.Phi_q, self.mechanism.tables["PATTERN"], strict=True):
                rest[i] -= entry * x[j]
            total[:] = np.sum(weight * rest * rest, axis=0)

    def constants(self, b: Any, lanes: int) -> None:
        """Put the entries of Phi_q that never change in place; no point is led."""
        vars(b).pop(LINE, None)
        b.Phi_q[:, :lanes] = self.mechanism.start[:, np.newaxis]


def take_up(at: Any, b: Any, k: int) -> None:
    """Take up a lane as a good point."""
    for name in vars(at).keys() - {LINE}:
        setattr(at, name, vars(b)[name][..., k].copy())
    if LINE in vars(b):
        *line, ends = vars(b)[LINE]
        vars(at)[LINE] = *line, ends[:, [k]]


def put_at(b: Any, at: Any, first: int, end: int) -> None:
    """Put lanes, from one to before another, at a good point."""
    for name, value in vars(at).items():
        if name == LINE:
            vars(b).setdefault(LINE, value)  # that of lanes which are put back is theirs
            continue
        vars(b)[name][..., first:end] = value[:, np.newaxis] if np.ndim(value) else value


def keep(to: Any, b: Any) -> None:
    """Keep points, with what was computed there."""
    for name, value in vars(b).items():
        setattr(to, name, value)


def store(block: Array, rows: Array, time: int, first: int, count: int) -> None:
    """Write the first lanes of rows into a block, at a time, from a variant on."""
    block[:, time, first : first + count] = rows[:, :count]


def part(vector: Array, first: int) -> Array:
    """Return a vector from a place on, of as many lanes as its user has."""
    return vector[first:]


def any_lane(truth: Any) -> bool:
    """Say whether a truth holds in any lane."""
    return bool(np.any(truth))


def rows(size: int) -> list[Any]:
    """Return rows that are yet to be set."""
    return [None] * size


def single(x: float) -> float:
    """Return a number with 24 bits."""
    return float(rounded(x))


def row(size: int) -> Array:
    """Return a row that is yet to be set."""
    return np.zeros(size)


copied, where, finite, lanes, floor, sqrt = np.copy, np.where, np.isfinite, range, np.floor, np.sqrt
NOTHING, INFINITE, TURN = np.nan, np.inf, 2 * np.pi
CONVERGED, NOT_CONVERGED, SINGULAR, NOT_FINITE, NOT_REACHED, LOCK_UP = vocabulary.STATUSES.values()

IS_CAREFUL = HAS_LANES = False

# Until a mechanism gives its own:
N = M = K = U = X = ONE = LANES = NONZEROS = BLOCKS = NORMAL = TALL = WIDE = 0
ANGULAR = IS_REDUNDANT = PROBE = PATTERN = MAY_TURN = COVER = IS_ANGLE = ()
position = factor = nu = gamma = constants = solve = missed = lead = evaluate = any_lane
