"""An emitted module as the runtime sees it: what every module has, and what some have, typed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import SPATIAL_COORDINATES, covers, may_turn, turning
from kincompile.errors import InputError, StructuralError, UnsupportedError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from types import ModuleType

Array = NDArray[np.float64]

PLACE = "_code"
"""Where a module keeps its `Code`."""

JOINT_POINTS = "_joint_points"
"""Where a module keeps the function that compiles the points of its joints, on request."""

WRITTEN = "_written_position"
"""Where a compiled module keeps the `position` that was emitted in Python."""

SENSITIVITIES = "_sensitivities"
"""Where a module keeps its `SensitiveModules`."""

FORCES = "_forces"
"""Where a module of a mechanism with loads keeps what compiles its forces, on request."""

DYNAMICS = "_dynamics"
"""Where a module of a mechanism with loads keeps what compiles its equations of motion."""

UNDRIVEN = "_undriven"
"""Where a module keeps the function that says which drivers are missing, "" if none are."""

DRIVERS = "_drivers"
"""Where a module keeps the function that describes its drivers at a time and parameters."""


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


@dataclass(frozen=True, slots=True)
class SensitiveModules:
    """What compiles a mechanism's sensitivities to parameters on request, and keeps them."""

    # Takes names of parameters and of columns, and whether second derivatives are wanted, to a
    # module without equations whose outputs are by what part of their terms solves miss their
    # equations, the determinants of the blocks of Phi_q, then by parameter, and by pair of them,
    # the derivatives of the columns; None where there is no planned elimination.
    observing: Callable[[tuple[str, ...], tuple[str, ...], bool], ModuleType | None]
    # Takes names of parameters to the module of the mechanism with its sensitivities.
    larger: Callable[[tuple[str, ...]], ModuleType]


@dataclass(frozen=True, slots=True, eq=False)
class ForceModules:
    """What compiles the forces of a mechanism on request, and keeps them."""

    # Takes whether multipliers are to be solved for to a module without equations whose outputs are
    # by what part of its terms the solve misses its equations, the determinants of the blocks of
    # Phi_q and the multipliers, then the forces, without rates; None where there is no planned
    # elimination. Else it gives the forces alone, and multipliers are its last parameters.
    compiled: Callable[[bool], ModuleType | None]
    # The bodies of each constraint, by name; none of a free equation.
    joints: Mapping[str, tuple[str, ...]]


Place = tuple[int, int]
"""Row and column."""


@dataclass(frozen=True, slots=True, eq=False)
class DynamicModules:
    """The equations of motion of a mechanism, compiled."""

    # A module without equations whose outputs are the accelerations, then the power of loads and
    # drivers.
    accelerations: ModuleType
    # The same, of changes of the coordinates and then of the rates that lead a state back to its
    # constraints, and by what part of their terms the accelerations there miss their equations.
    corrections: ModuleType
    # Compiles on request, and keeps, a module whose outputs are entries of the linear system of the
    # derivatives of accelerations and power by q and q_dot, with their rows and columns, and the
    # entries that are plain numbers.
    slopes: Callable[[], tuple[ModuleType, Sequence[Place], Mapping[Place, float]]]
    redundant: tuple[str, ...]  # names of equations that repeat others and are left out
    free: tuple[str, ...]  # coordinates that may be given, as many as there are degrees of freedom


@dataclass(frozen=True, slots=True, eq=False)
class Code:
    """An emitted module."""

    module: ModuleType  # the module itself, for messages and for users
    # name, coordinates, equations, parameters, units: names and units, as in the contract
    name: str
    coordinates: tuple[str, ...]
    equations: tuple[str, ...]
    parameters: tuple[str, ...]
    units: Mapping[str, str]
    guess: Array  # (n,): where Newton starts
    pattern: NDArray[np.signedinteger[Any]]  # (nnz, 2): rows and columns of Phi_q's entries
    # Of each body its name, the number of its first coordinate, and how many it has.
    bodies: tuple[tuple[str, int, int], ...]
    # Row, column and, where it never changes, the number of each entry of Phi_q.
    entries: tuple[tuple[int, int, float | None], ...]
    # (m, n): those that never change, in a matrix
    constant: Array
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
    # position, nu, gamma, Phi_q, nonzeros: functions of the contract; `nonzeros` is
    # ``Phi_q_nonzeros``
    position: Callable[..., tuple[Array, Array]]
    nu: Callable[..., Array]
    gamma: Callable[..., Array]
    Phi_q: Callable[..., Array]
    nonzeros: Callable[..., Array]
    # `position` as it was emitted in Python, where compiled code has taken its place.
    written: Callable[..., tuple[Array, Array]]
    redundant: tuple[str, ...]  # names of the equations that repeat others, and agree with them
    # Why the equations cannot determine the coordinates; "" where they can, or nobody says.
    unsolvable: str
    corners: bool  # whether its drivers may have corners
    lanes: LaneFunctions | None  # with the planned solve, where the module has one
    # Of a module in grouped form with a solve its equations and coordinates in the order of blocks,
    # sizes of blocks, and which entries of Phi_q vary.
    blocks: tuple[NDArray[Any], ...]
    # Of a module in grouped form: Phi and the entries of Phi_q at one point.
    evaluate: Callable[..., tuple[Array, Array]] | None
    # march, march_variants: of a compiled module: its own march over times, and of many parameter
    # sets
    march: Callable[..., int] | None
    march_variants: Callable[..., int] | None
    # Of a module with outputs: puts them and their rates at states (n, N) into (3, r, N).
    observe_into: Callable[..., None] | None

    def undriven(self) -> str:
        """Return which drivers are missing, where equations depend on others everywhere; or ""."""
        describe = vars(self.module).get(UNDRIVEN)
        return str(describe()) if describe else ""

    def owners(self) -> dict[str, str]:
        """Return the body of each coordinate; one that belongs to none stands for itself."""
        owners = {name: name for name in self.coordinates}
        for body, first, count in self.bodies:
            owners.update(dict.fromkeys(self.coordinates[first : first + count], body))
        return owners


def code_of(module: ModuleType) -> Code:
    """Return a module's `Code`, which the loader has put there; made now for any other module."""
    found = vars(module).get(PLACE)
    return found if isinstance(found, Code) else attach(module)


def on_request(module: ModuleType, place: str, grouped: str, then: str) -> Any:
    """Return what compiles more of a mechanism, from its place in the module; or say why not."""
    found = vars(module).get(place)
    if found is not None:
        return found
    if code_of(module).evaluate is not None:
        raise UnsupportedError(
            f"{module.NAME} is in grouped form, as large mechanisms are, {grouped} use "
            "form='inline'."
        )
    raise InputError(
        f"the module of {module.NAME} was loaded from a file, which knows no more than its own "
        f"functions: compile the model, {then}."
    )


def attach(module: ModuleType) -> Code:
    """Read what a module has, and keep it there. To be called again when its functions change."""
    names = vars(module)
    lanes = names.get("LANES", {})
    coordinates = names["COORDINATES"]
    places = [range(first, first + count) for _, first, count in names.get("BODIES", ())]
    entries = _entries(names)
    units = [names["UNITS"][name] for name in coordinates]
    code = Code(
        module=module,
        name=names["NAME"],
        coordinates=coordinates,
        equations=names["EQUATIONS"],
        parameters=names["PARAMETERS"],
        units=names["UNITS"],
        guess=names["GUESS"],
        pattern=names["PATTERN"],
        bodies=names.get("BODIES", ()),
        entries=entries,
        constant=_constant(entries, len(names["EQUATIONS"]), len(coordinates)),
        varying=_varying(entries),
        without_guess=_without_guess(names),
        angular=np.array(turning(units, places), dtype=bool),
        covers=np.array(covers(places), dtype=int).reshape(-1, SPATIAL_COORDINATES - 3),
        may_turn=np.array(may_turn(units, places), dtype=bool),
        position=names["position"],
        nu=names["nu"],
        gamma=names["gamma"],
        Phi_q=names["Phi_q"],
        nonzeros=names["Phi_q_nonzeros"],
        written=names.get(WRITTEN, names["position"]),
        redundant=names.get("REDUNDANT", ()),
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
        march=names.get("march"),
        march_variants=names.get("march_variants"),
        observe_into=_observing(names, lanes),
    )
    names[PLACE] = code
    return code


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


def _constant(
    entries: Sequence[tuple[int, int, float | None]], equations: int, coordinates: int
) -> Array:
    """Return the entries of Phi_q that never change as a matrix."""
    matrix = np.zeros((equations, coordinates) if entries else (0, 0))
    for row, column, number in entries:
        matrix[row, column] = number or 0.0
    return matrix


def _varying(
    entries: Iterable[tuple[int, int, float | None]],
) -> tuple[tuple[int, tuple[tuple[int, int], ...]], ...]:
    """Return the row and the number of the entries of Phi_q that vary, by column."""
    columns: dict[int, list[tuple[int, int]]] = {}
    places = ((row, column) for row, column, number in entries if number is None)
    for place, (row, column) in enumerate(places):
        columns.setdefault(column, []).append((row, place))
    return tuple((column, tuple(rows)) for column, rows in columns.items())


def _without_guess(names: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the bodies whose guess is zero throughout."""
    given = np.concatenate(((0,), np.cumsum(names["GUESS"] != 0))).tolist()
    bodies = names.get("BODIES", ())
    return tuple(body for body, first, size in bodies if given[first] == given[first + size])


def require_square(code: Code) -> None:
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
