"""An emitted module as the runtime sees it: what every module has, and what some have, typed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from kincompile import quantities
from kincompile.errors import InputError, StructuralError, UnsupportedError
from kincompile.names import column_name, listed, rate, rate_of, suggestion

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Hashable, Iterable, Mapping, Sequence
    from types import ModuleType

    from kincompile.quantities import Part, Quantity

Array = NDArray[np.float64]

PLACE = "_code"
"""Where a module keeps its `Compiled`."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Kind(Generic[T]):
    """What of a mechanism is compiled when it is first asked for."""

    name: str
    # Of a module in grouped form, what it lacks; of one from a file, what to do with the model.
    grouped: str = ""
    then: str = ""


ORIGIN = "_origin"
"""Where it keeps what it was made from."""

Place = tuple[int, int]
"""Row and column."""

Origin = tuple[str, str, "Mapping[str, NDArray[Any]]", "Mapping[str, str]"]
"""Name and text of a NumPy module, its arrays, and the files of C that replace its functions."""


@dataclass(frozen=True, slots=True, eq=False)
class LaneFunctions:
    """The code of a module itself, on numbers of any kind; see docs/contract.md."""

    # position, nu, gamma, factor, solve: the functions of ``LANES``, of ``(f, q, [q_dot,] t, p)``
    # and of ``(f, ...)``
    position: Callable[..., Sequence[Any]]
    nu: Callable[..., Sequence[Any]]
    gamma: Callable[..., Sequence[Any]]
    factor: Callable[..., tuple[Sequence[Any], Sequence[Any]]]
    solve: Callable[..., Sequence[Any]]
    # floats, arrays: what serves as `f`: elementary functions of floats, and of arrays
    floats: Any
    arrays: Any


@dataclass(frozen=True, slots=True, eq=False)
class Compiled:
    """An emitted module, read once: what the package works with instead of the module."""

    module: ModuleType  # the module itself, for messages and for users
    # name, coordinates, equations, parameters, outputs, units: as in the contract
    name: str
    coordinates: tuple[str, ...]
    equations: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    defaults: Array  # (k,): parameters where none are given
    guess: Array  # (n,): where Newton starts
    pattern: NDArray[np.signedinteger[Any]]  # (nnz, 2): rows and columns of Phi_q's entries
    # Of each body its name, the number of its first coordinate, and how many it has.
    bodies: tuple[tuple[str, int, int], ...]
    # Row, column and, where it never changes, the number of each entry of Phi_q.
    entries: tuple[tuple[int, int, float | None], ...]
    # (nnz,): those that never change, NaN for the others
    numbers: Array
    # By column, the others: the row of each, and its number among all that vary.
    varying: tuple[tuple[int, tuple[tuple[int, int], ...]], ...]
    # Bodies whose guess is zero throughout, as it is where none is given.
    without_guess: tuple[str, ...]
    # (n,), bool: which coordinates have the scale of angles: these, and Euler parameters
    angular: NDArray[np.bool_]
    # (bodies, 4): places of the Euler parameters of bodies in space: p and -p are one orientation
    covers: NDArray[np.signedinteger[Any]]
    # (n,), bool: which are angles, or may be: a free coordinate has no unit that says so
    may_turn: NDArray[np.bool_]
    # position, nu, gamma, Phi_q, nonzeros: functions of the contract; the last is Phi_q_nonzeros
    position: Callable[..., tuple[Array, Array]]
    nu: Callable[..., Array]
    gamma: Callable[..., Array]
    Phi_q: Callable[..., Array]
    nonzeros: Callable[..., Array]
    # `position` as it was emitted in Python, where compiled code has taken its place.
    written: Callable[..., tuple[Array, Array]]
    functions: Mapping[str, Callable[..., Any]]  # all of the contract that it has, by name
    # M, Q, Q_q, Q_q_dot, observe, outputs_q: functions of a module with loads, or with outputs
    M: Callable[..., Array]
    Q: Callable[..., Array]
    Q_q: Callable[..., Array]
    Q_q_dot: Callable[..., Array]
    observe: Callable[..., tuple[Array, Array, Array]]
    outputs_q: Callable[..., Array]
    quantities: tuple[Quantity, ...]  # what it has functions of
    patterns: Mapping[str, NDArray[np.signedinteger[Any]]]  # as `pattern`, of each matrix
    has_loads: bool  # whether it has M, Q and their derivatives
    redundant: tuple[str, ...]  # names of the equations that repeat others, and agree with them
    held: Mapping[str, str]  # freedoms in words that nothing sees, by what holds them
    # Why the equations cannot determine the coordinates; "" if they can, or if unknown.
    unsolvable: str
    corners: bool  # whether its drivers may have corners
    lanes: LaneFunctions | None  # with the planned solve, where the module has one
    # Of a module in grouped form with a solve its equations and coordinates in the order of blocks,
    # sizes of blocks, and which entries of Phi_q vary.
    blocks: tuple[NDArray[Any], ...]
    # Of a module in grouped form: Phi and the entries of Phi_q at one point.
    evaluate: Callable[..., tuple[Array, Array]] | None
    # Of a compiled module: its own march over times, of one motion or of many parameter sets.
    march: Callable[..., int] | None
    # Of a compiled module: its own safeguarded attempts by many parameter sets, what goes beyond
    # singular positions of many, and what leads a position along lines to many.
    attempts: Callable[..., NDArray[np.bool_]] | None
    mirror: Callable[..., Array] | None
    lead: Callable[..., tuple[Array, NDArray[np.intc]]] | None
    # Of a compiled module, or one whose file ends with a march: takes a motion from one time to the
    # next.
    stepper: Callable[..., Callable[..., tuple[Array, int]]] | None
    # Of a module with outputs: puts them and their rates at states (n, N) into (3, r, N).
    observe_into: Callable[..., None] | None
    # Of a module with outputs: gives them at one state of plain floats, (q, q_dot, q_ddot, t, p);
    # None where its functions are compiled.
    observe_floats: Callable[..., Sequence[float]] | None
    # What another process makes it from; None of a module from a file.
    origin: Origin | None
    # What compiles more of the mechanism, and what it has compiled, by kind and key.
    makers: dict[Kind[Any], Callable[..., Any]]
    made: dict[tuple[Kind[Any], Hashable], Any]

    def request(self, kind: Kind[T], *key: Hashable) -> T:
        """Return what is compiled on request, once for each key; or say why it cannot be."""
        if (kind, key) not in self.made:
            self.made[kind, key] = self._maker(kind)(*key)
        found: T = self.made[kind, key]
        return found

    def has(self, kind: Kind[Any]) -> bool:
        """Say whether a request is, or was, for something that there is."""
        return kind in self.makers or any(kind == made for made, _ in tuple(self.made))

    def _maker(self, kind: Kind[Any]) -> Callable[..., Any]:
        if kind in self.makers:
            return self.makers[kind]
        if self.evaluate is not None:
            raise UnsupportedError(
                f"{self.name} is in grouped form, as large mechanisms are, {kind.grouped} use "
                "form='inline'."
            )
        raise InputError(
            f"the module of {self.name} was loaded from a file and contains only its own "
            f"functions. Compile the model, {kind.then}."
        )

    def points(self) -> Compiled:
        """Return the code with the points of the joints as outputs; of a file the file's own."""
        return self.request(POINTS) if self.has(POINTS) else self

    def undriven(self) -> str:
        """Return which drivers are missing, where equations depend on others everywhere; or ""."""
        return self.request(UNDRIVEN) if self.has(UNDRIVEN) else ""

    def columns(
        self,
        names: Iterable[str],
        advice: str = "m.output(...) makes any expression an output, m.point(...) that of a body",
        asked: str = "",
    ) -> list[int]:
        """Return the numbers of columns among coordinates and outputs; rates are refused.

        A message begins with what is `asked` for, and ends with the advice.
        """
        known = self.coordinates, self.outputs
        owner, numbers = f"{asked}{self.name}", {x: k for k, x in enumerate(chain(*known))}
        found = (column_meant(owner, x, *known, orders=VALUES, advice=advice) for x in names)
        return [numbers[name] for name, _ in found]

    def owners(self) -> dict[str, str]:
        """Return the body of each coordinate; one that belongs to none stands for itself."""
        owners = {name: name for name in self.coordinates}
        for body, first, count in self.bodies:
            owners.update(dict.fromkeys(self.coordinates[first : first + count], body))
        return owners


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """The equations of motion of a mechanism, compiled."""

    # Without equations; its outputs are the accelerations, then the power of loads and drivers.
    accelerations: Compiled
    # The same, of changes of the coordinates and then of the rates that lead a state back to its
    # constraints, and by what part of their terms the accelerations there miss their equations.
    corrections: Compiled
    redundant: tuple[str, ...]  # names of equations that repeat others and are left out
    free: tuple[str, ...]  # coordinates that may be given, as many as there are degrees of freedom


POINTS: Kind[Compiled] = Kind("points")
"""Without equations; its outputs are the points of the joints."""

STEPPER: Kind[Callable[..., Callable[..., tuple[Array, int]]]] = Kind("stepper")
"""Of a module that has none: takes a motion from one time to the next."""

UNDRIVEN: Kind[str] = Kind("undriven")
"""Which drivers are missing, "" if none are."""

DRIVERS: Kind[Callable[[float, Array], Sequence[tuple[Any, ...]]]] = Kind("drivers")
"""What describes the drivers at a time and parameters."""

FOUR_BARS: Kind[Callable[[Array], Sequence[tuple[Any, ...]]]] = Kind("four-bars")
"""What describes the four-bars with parameters."""

LIMITS: Kind[Callable[[Array, Array, Array], Sequence[str]]] = Kind("limits")
"""What says which limits of joints positions leave at times, with parameters."""

SENSITIVITIES: Kind[Compiled | None] = Kind(
    "sensitivities",
    "and that has no sensitivities: differentiate a part of it, or",
    "solve with that, then ask for sensitivities",
)
"""By names of parameters, of columns, whether second derivatives are wanted, and whether pivots are
those of the position at the start in place of those of a generic state; without equations.
Its outputs are by what part of their terms solves miss their equations, the determinants of the
blocks of Phi_q, then by parameter, and by pair of them, the derivatives of the columns; None where
there is no planned elimination."""

SENSITIVE: Kind[Compiled] = Kind("sensitive", SENSITIVITIES.grouped, SENSITIVITIES.then)
"""By names of parameters, the mechanism with its sensitivities."""

FORCES: Kind[Compiled | None] = Kind(
    "forces", "whose forces are not compiled:", "solve with that, then ask for forces"
)
"""By whether multipliers are to be solved for; without equations. Its outputs are by what part of
its terms the solve misses its equations, the determinants of the blocks of Phi_q and the
multipliers, then the forces, without rates; None where there is no planned elimination. Else it
gives the forces alone, and multipliers are its last parameters."""

JOINTS: Kind[Mapping[str, tuple[str, ...]]] = Kind("joints", FORCES.grouped, FORCES.then)
"""The bodies of each constraint, by name; none of a free equation."""

DYNAMICS: Kind[Dynamics] = Kind(
    "dynamics", "whose equations of motion are not compiled:", "and simulate that"
)

SLOPES: Kind[tuple[Compiled, Sequence[Place], Mapping[Place, float]]] = Kind("slopes")
"""Without equations; its outputs are entries of the linear system of the derivatives of
accelerations and power by q and q_dot. With their rows and columns, and the entries that are plain
numbers."""


MORE = ("kinematics_batch_last", "solve")
"""Functions that are those of no quantity; only some modules have a solve."""

CONSTANTS = (
    "NAME", "COORDINATES", "EQUATIONS", "PARAMETERS", "UNITS", "DEFAULTS", "GUESS", "PATTERN"
)  # fmt: skip
"""Those that every module has, in small letters attributes."""

TYPED = "position", "nu", "gamma", "Phi_q", "M", "Q", "Q_q", "Q_q_dot", "observe", "outputs_q"
"""Functions that are attributes: None where a module without loads or outputs has none."""


MARKS: Mapping[Part, str] = {
    "outputs": "OUTPUTS",
    "loads": "LOADS",
    "motion": "forward_dynamics",
}
"""By which name a module shows that it has the quantities of a part."""


def present_in(names: Container[str]) -> tuple[Quantity, ...]:
    """Return the quantities of a module with these names: of outputs, loads, motion if it can."""
    return quantities.quantities_of([part for part, mark in MARKS.items() if mark in names])


def functions(names: Container[str]) -> tuple[str, ...]:
    """Return the functions of an emitted module with these names."""
    present = present_in(names)
    matrices = (item.name for item in present if item.is_matrix)
    return (*quantities.functions(present), *(f"{name}_nonzeros" for name in matrices))


def code_of(module: ModuleType) -> Compiled:
    """Return a module as it was read, by the loader; read now for any other module."""
    found = vars(module).get(PLACE)
    return found if isinstance(found, Compiled) and found.module is module else attach(module)


def attach(module: ModuleType, written: Callable[..., Any] | None = None) -> Compiled:
    """Read a module, and keep that in it. To be called again when its functions change."""
    code = read(module, written)
    if (found := vars(module).get(PLACE)) is not None:
        code.makers.update(found.makers)
    vars(module)[PLACE] = code
    return code


def read(module: ModuleType, written: Callable[..., Any] | None = None) -> Compiled:
    """Return what a module has, typed; with the `position` that compiled code has replaced."""
    names = vars(module)
    present, lanes = present_in(names), names.get("LANES", {})
    coordinates, bodies = names["COORDINATES"], names.get("BODIES", ())
    places = [range(first, first + count) for _, first, count in bodies]
    units = [names["UNITS"][name] for name in coordinates]
    given, entries = (names["GUESS"] != 0).tolist(), _entries(names)
    known = {name: names[name] for name in (*functions(names), *MORE) if name in names}
    typed: dict[str, Any] = {name: known.get(name) for name in TYPED}
    patterns = {item.name: quantities.pattern_of(item) for item in present if item.is_matrix}
    observe = lanes.get("observe") if "observe_into" not in names else None
    return Compiled(
        module=module,
        **{name.lower(): names[name] for name in CONSTANTS},
        outputs=names.get("OUTPUTS", ()),
        bodies=bodies,
        entries=entries,
        numbers=np.array([number for *_, number in entries], dtype=np.float64),
        varying=_varying(entries),
        without_guess=tuple(body for body, k, n in bodies if not any(given[k : k + n])),
        angular=np.array(quantities.turning(units, places), dtype=bool),
        covers=np.array(quantities.covers(places), dtype=int).reshape(-1, 4),
        may_turn=np.array(quantities.may_turn(units, places), dtype=bool),
        nonzeros=names["Phi_q_nonzeros"],
        written=written or names["position"],
        functions=known,
        quantities=present,
        patterns={name: names[place] for name, place in patterns.items() if place in names},
        has_loads="LOADS" in names,
        **typed,
        redundant=names.get("REDUNDANT", ()),
        held=names.get("HELD", {}),
        unsolvable=names.get("UNSOLVABLE", ""),
        corners=names.get("CORNERS", False),
        lanes=LaneFunctions(
            **{name: lanes[name] for name in ("position", "nu", "gamma", "factor", "solve")},
            floats=names["FLOATS"],
            arrays=names["ARRAYS"],
        )
        if "solve" in lanes
        else None,
        blocks=names.get("BLOCKS", ()),
        evaluate=names.get("evaluate"),
        march=names.get("compiled_march"),
        attempts=names.get("compiled_attempts"),
        mirror=names.get("compiled_mirror"),
        lead=names.get("compiled_lead"),
        stepper=names.get("compiled_stepper", names.get("stepper")),
        observe_into=_observing(names, lanes),
        observe_floats=observe and partial(observe, names["FLOATS"]),
        origin=names.get(ORIGIN),
        makers={},
        made={},
    )


STRIP = 5000
"""Points at a time at most, so that intermediate arrays stay in the cache."""


def _observing(
    names: Mapping[str, Any], lanes: Mapping[str, Callable[..., Sequence[Any]]]
) -> Callable[..., None] | None:
    """Return what puts outputs into an array: compiled, or the code of the module in strips."""
    if "observe" not in lanes:
        return None

    def observe_into(states: Sequence[Array], t: Array, p: Array, found: Array) -> None:
        places = found.reshape(-1, t.size)
        strips = max(1, -(-t.size // STRIP))  # of one size, since short arrays cost as much
        for k in range(strips):
            own = slice(k * t.size // strips, (k + 1) * t.size // strips)
            parts = (state[:, own] for state in states)
            sets = p[:, own] if p.ndim > 1 else p
            values = lanes["observe"](names["ARRAYS"], *parts, t[own], sets)
            for place, value in zip(places[:, own], values, strict=True):
                place[:] = value

    found: Callable[..., None] = names.get("observe_into", observe_into)
    return found


def _entries(names: Mapping[str, Any]) -> tuple[tuple[int, int, float | None], ...]:
    """Return row, column and number of the entries of Phi_q."""
    numbers = names.get("_CONSTANTS", {})
    if "_FIXED" in names:  # of format 1
        numbers = dict(zip(names["_FIXED"].tolist(), numbers.tolist(), strict=True))
    places = names["PATTERN"].tolist() if "LANES" in names else ()
    return tuple((row, column, numbers.get(k)) for k, (row, column) in enumerate(places))


def _varying(
    entries: Iterable[tuple[int, int, float | None]],
) -> tuple[tuple[int, tuple[tuple[int, int], ...]], ...]:
    """Return the row and the number of the entries of Phi_q that vary, by column."""
    columns: dict[int, list[tuple[int, int]]] = {}
    places = ((row, column) for row, column, number in entries if number is None)
    for place, (row, column) in enumerate(places):
        columns.setdefault(column, []).append((row, place))
    return tuple((column, tuple(rows)) for column, rows in columns.items())


def require_square(code: Compiled) -> None:
    """Refuse a module whose equations cannot determine its coordinates.

    What the compiler has written into the module says why; else they are counted.
    """
    if code.unsolvable:
        raise StructuralError(code.unsolvable)
    m, n = len(code.equations), len(code.coordinates)
    if m == n or (m > n and code.redundant):
        return
    if m < n:
        remedy = f"add {n - m} more (joints or drivers), or hold coordinates that are free"
    else:
        remedy = f"remove {m - n} of them: {listed(code.equations)}"
    raise StructuralError(
        f"{code.name} has {m} equations for {n} coordinates ({listed(code.coordinates)}), "
        f"and the motion needs as many equations as coordinates: {remedy}."
    )


RATES = range(3)
"""Orders of columns: values, rates and second rates."""

VALUES = range(1)
"""Orders of columns of which no rate is asked for."""

ADVICE = "add _dot or _ddot for the rates"


def column_meant(
    owner: str,
    given: object,
    coordinates: Sequence[str],
    outputs: Sequence[str] = (),
    *,
    orders: Sequence[int] = RATES,
    advice: str = ADVICE,
) -> tuple[str, int]:
    """Return the coordinate or output of which a column is the rate, and the order of the rate.

    Parameters
    ----------
    owner
        Who has the columns, for the message.
    given
        The name of the column, as ``"phi_rod_dot"`` or ``"rod.phi_dot"``.
    coordinates, outputs
        Names of those that have columns.
    orders
        Orders of rates that may be asked for.
    advice
        How further columns are had, for the message.

    Raises
    ------
    InputError
        When no column has this name; the message lists those that exist.
    """
    names = (*coordinates, *outputs)
    if found := rate_of(str(given), names, orders):
        return found
    every = (rate(name, order) for order in orders for name in names)
    near = suggestion(column_name(str(given)), every) or "."
    others = f", the outputs {listed(outputs)}" if outputs else ""
    raise InputError(
        f"{owner} has no column {given!r}{near} The coordinates are {listed(coordinates)}{others}; "
        f"{advice}."
    )
