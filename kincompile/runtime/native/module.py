"""An emitted module whose functions run as compiled C.

The NumPy module of the same mechanism stays below: its constants, its checks and its messages are
the module's, complex numbers (for complex steps) run on it, and so does the careful march that
takes over where the compiled one reports anything but success.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import byref, c_double, c_size_t, c_void_p
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import quantities
from kincompile.criteria import FAR
from kincompile.errors import InputError
from kincompile.runtime.engine.code import ORIGIN, attach, code_of
from kincompile.runtime.memory import empty
from kincompile.runtime.native.library import KINEMATICS, ONE, SETS, library
from kincompile.runtime.native.points import (
    NUMBER,
    REAL,
    STATES,
    Motion,
    Numbers,
    Places,
    System,
    Variants,
    batch_type,
    function_of_positions,
    function_of_states,
    numbers_of_batch,
    numbers_of_times,
)
from kincompile.runtime.native.stepper import stepper_of
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.quantities import Quantity
    from kincompile.runtime.engine.code import Compiled
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.native.library import Part

    Array = NDArray[np.float64]
    Function = Callable[..., Any]

BATCH_LAST = ("Phi", "nonzeros", "nu", "gamma")
"""What `kinematics_batch_last` returns."""

LINE = 64 // NUMBER
"""Numbers of a cache line: C writes whole lines past the caches, in a third of the time."""


def make_native(module: ModuleType, files: Mapping[str, str]) -> ModuleType:
    """Replace the functions of an emitted NumPy module by compiled ones, from what C emitted.

    Where the mechanism has a planned solve the module gets one more, ``compiled_march``. An
    `UnsupportedError` says what is wrong with the compiler. What many parameter sets need, and
    all quantities of points in one go, are built when they are first called.
    """
    code, names = code_of(module), vars(module)
    present = code.quantities
    parts = cache(partial(library, code.name, files, names["FINGERPRINT"]))
    functions = _Functions(code, names["_batch"], parts)
    given = {**quantities.functions(present), **_nonzeros(present)}
    compiled = {name: functions.evaluator(name, results) for name, results in given.items()}
    compiled["kinematics_batch_last"] = functions.batch_last()
    if "solve" in names:
        compiled["solve"] = functions.solve(names["_system"])
        compiled["compiled_march"] = functions.march()
        compiled["compiled_attempts"] = functions.attempts()
        compiled["compiled_mirror"] = functions.mirror()
        compiled["compiled_lead"] = functions.lead()
        compiled["compiled_stepper"] = stepper_of(code, parts(ONE))
        lanes = names["LANES"]
        names["LANES"] = {**lanes, "position": functions.position_of_lanes(lanes["position"])}
    if "observe" in names:
        compiled["observe_into"] = functions.observe_into()
    for name, function in compiled.items():
        function.__name__, function.__module__ = name, module.__name__
        function.__doc__ = function.__doc__ or names[name].__doc__
    names.update(compiled)
    if code.origin is not None:
        names[ORIGIN] = *code.origin[:3], files
    attach(module, code.position)
    return module


def _states(name: str) -> tuple[str, ...]:
    """Return what a function reads of q, q_dot and q_ddot."""
    given = quantities.TOGETHER.get(name, (name.removesuffix("_nonzeros"),))
    return quantities.states_of(given)


def _nonzeros(present: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return the functions that give the entries of a matrix, and what C calls their result."""
    matrices = [item for item in present if item.is_matrix]
    return {f"{item.name}_nonzeros": (quantities.nonzeros_of(item),) for item in matrices}


def _part_of(results: Sequence[str]) -> Part:
    """Return which library gives results."""
    return KINEMATICS if tuple(results) == quantities.TOGETHER["kinematics"] else ONE


class _Functions:
    """Makes the functions of a module from those of its library."""

    def __init__(
        self, code: Compiled, checked: Function, parts: Callable[[Part], ctypes.CDLL]
    ) -> None:
        self._code, self._checked_batch = code, checked
        self._library, self._parts, self._name = parts(ONE), parts, code.name
        self._n, self._m = len(code.coordinates), len(code.equations)
        self._shapes = _shapes(code)
        self._batch_type = batch_type(tuple(self._shapes))
        self._evaluate: Function = cache(lambda part: getattr(parts(part), f"{code.name}_evaluate"))
        self._sets = cache(self._function_of_sets)

    def _run(self, batch: Any, part: Part = ONE) -> Any:
        """Evaluate a batch; not 0 where a number is not finite."""
        return self._evaluate(part)(byref(batch))

    def _function_of_sets(self, name: str, *arguments: Any, result: Any = None) -> Function:
        """Return a function of many parameter sets, whose library is built if need be."""
        run: Any = getattr(self._parts(SETS), f"{self._name}_{name}_variants")
        run.argtypes, run.restype = (c_void_p, *arguments), result
        found: Function = run
        return found

    def evaluator(self, name: str, results: tuple[str, ...]) -> Function:
        """Return a function of points (..., n) that gives some results."""
        original, states = self._code.functions[name], _states(name)
        if len(states) == len(STATES):
            return self._of_second_rates(results, original)
        loaded = partial(self._parts, _part_of(results))
        places = Places(self._code, loaded, results, self._shapes, self._batch_type)
        make = function_of_positions if len(states) == 1 else function_of_states
        return make(places, self._batch, original)

    def _of_second_rates(self, results: tuple[str, ...], original: Function) -> Function:
        """Return a function of q, q_dot, q_ddot, t and p: outputs, asked for in batches."""
        defaults, batch = self._code.defaults, self._batch

        def of_second_rates(q: Any, q_dot: Any, q_ddot: Any, t: Any, p: Any = defaults) -> Any:
            found = batch(results, (q, q_dot, q_ddot), t, p)
            return original(q, q_dot, q_ddot, t, p) if found is None else found

        return of_second_rates

    def _batch(self, wanted: Sequence[str], states: tuple[Any, ...], t: Any, p: Any) -> Any:
        """Evaluate a batch whose axes are the first ones; None where numbers are complex."""
        batch = self._plain(states, t, p)
        if batch is not None:
            results = self._fill(batch, wanted, states[0].shape[:-1])
            if results is not None:
                return results
        # Broadcasting, conversion and error messages are delegated to the NumPy module.
        rows, t, p, shape = self._checked_batch(t, p, states)
        if rows[0].dtype != REAL:
            return None
        batch = self._batch_type(
            count=math.prod(shape), t=numbers_of_times(t), p=numbers_of_batch(p)
        )
        for name, state in zip(STATES, rows, strict=False):
            setattr(batch, name, numbers_of_batch(state))
        return self._fill(batch, wanted, shape)

    def _plain(self, states: tuple[Any, ...], t: Any, p: Any) -> Any:
        """Return a batch of arrays that need no conversion; that they are finite C will see."""
        shape = getattr(states[0], "shape", ())
        if not (
            all(_is_plain(state, (*shape[:-1], self._n)) for state in states)
            and _is_plain(p, self._code.defaults.shape)
            and (isinstance(t, float) or _is_plain(t, shape[:-1]))
        ):
            return None
        time = np.asarray(t)
        batch = self._batch_type(
            count=math.prod(shape[:-1]), t=numbers_of_times(time), p=numbers_of_batch(p)
        )
        batch.kept = time  # C reads through an address: the array must live as long as the batch
        for name, state in zip(STATES, states, strict=False):
            setattr(batch, name, Numbers(state.ctypes.data, 1, self._n))
        return batch if batch.count else None

    def _fill(self, batch: Any, wanted: Sequence[str], shape: tuple[int, ...]) -> Any:
        """Run a batch into new arrays; None where a number is not finite."""
        results = []
        for quantity in wanted:
            result = empty((*shape, *self._shapes[quantity]))
            size = math.prod(self._shapes[quantity])
            setattr(batch, quantity, Numbers(result.ctypes.data, 1, size))
            results.append(result)
        if self._run(batch, _part_of(wanted)):
            return None
        return results[0] if len(results) == 1 else tuple(results)

    def batch_last(self) -> Function:
        """Return `kinematics_batch_last`."""
        defaults, original = self._code.defaults, self._code.functions["kinematics_batch_last"]
        sizes = [math.prod(self._shapes[quantity]) for quantity in BATCH_LAST]

        def kinematics_batch_last(
            q: Any, q_dot: Any, t: Any, p: Any = defaults, out: Any = None
        ) -> Any:
            shape: tuple[int, ...] = getattr(q, "shape", ())
            if not (
                len(shape) == 2
                and all(_is_real(state, (self._n, shape[1])) for state in (q, q_dot))
                and (isinstance(t, float) or _is_real(t, shape[1:]))
                and (_is_real(p, defaults.shape) or _is_real(p, (defaults.size, shape[1])))
            ):
                return _copied(original(q, q_dot, t, p), self._checked(out, sizes))
            results = self._checked(out, sizes, shape[1])
            if results is None:
                results = tuple([_in_lines(size, shape[1]) for size in sizes])
            time = np.asarray(t)
            batch = self._batch_type(
                shape[1],
                numbers_of_batch(q),
                numbers_of_batch(q_dot),
                numbers_of_times(time),
                numbers_of_batch(p),
            )
            batch.varying_only = out is not None
            for quantity, result in zip(BATCH_LAST, results, strict=True):
                setattr(batch, quantity, numbers_of_batch(result))
            failed = self._run(batch, KINEMATICS)
            return original(q, q_dot, t, p) if failed else results

        kinematics_batch_last.__doc__ = f"""{original.__doc__}
    out, if given, is what an earlier call for as many points returned: the arrays are filled again,
    which saves the time to fetch memory and to write the entries that never change.
    """
        return kinematics_batch_last

    def position_of_lanes(self, original: Function) -> Function:
        """Return `position` of the code itself: compiled, for arrays of positions (n, N)."""
        m, entries = self._m, self._code.entries
        varying = [m + k for k, (*_, number) in enumerate(entries) if number is None]
        rows = [*range(m), *varying]

        def position(f: Any, q: Any, t: Any, p: Any) -> Sequence[Any]:
            shape: tuple[int, ...] = getattr(q, "shape", ())
            if not (
                len(shape) == 2
                and _is_real(q, shape)
                and isinstance(p, np.ndarray)
                and (_is_real(p, (len(p),)) or _is_real(p, (len(p), shape[1])))
                and (isinstance(t, float) or _is_real(t, shape[1:]))
            ):
                written: Sequence[Any] = original(f, q, t, p)
                return written
            values, time = np.empty((m + len(entries), shape[1])), np.asarray(t)
            batch = self._batch_type(shape[1], numbers_of_batch(q))
            batch.t, batch.p = numbers_of_times(time), numbers_of_batch(p)
            batch.Phi, batch.nonzeros = map(numbers_of_batch, (values[:m], values[m:]))
            self._run(batch)
            return [values[row] for row in rows]

        return position

    def _checked(self, out: Any, sizes: Sequence[int], points: int | None = None) -> Any:
        """Return the arrays of an earlier call, or None where none are given."""
        if out is None:
            return None
        given = out if isinstance(out, tuple) and len(out) == len(sizes) else ()
        points = getattr(given[0], "size", 0) // sizes[0] if given and points is None else points
        if not given or not all(
            _is_real(array, (size, points or 0)) and array.flags.writeable
            for array, size in zip(given, sizes, strict=True)
        ):
            raise InputError(
                f"{self._name}: out is not what an earlier call returned for as many points: give "
                "the same tuple of arrays again, or nothing"
            )
        return out

    def solve(self, check: Function) -> Function:
        """Return the planned solve."""
        original = self._code.functions["solve"]
        run = getattr(self._library, f"{self._name}_solve")

        def solve(nonzeros: Any, b: Any) -> Any:
            nonzeros, b = check(nonzeros, b)
            if "c" in (nonzeros.dtype.kind, b.dtype.kind):
                return original(nonzeros, b)
            shape = np.broadcast_shapes(nonzeros.shape[:-1], b.shape[:-1])
            x = empty((*shape, self._n))
            system = System(math.prod(shape), x=Numbers(x.ctypes.data, 1, self._n))
            system.nonzeros = numbers_of_batch(
                matrix := _rows(nonzeros, shape, self._shapes["nonzeros"])
            )
            system.b = numbers_of_batch(right := _rows(b, shape, (self._m,)))
            run(byref(system))
            del matrix, right  # until here their memory is read
            return x

        return solve

    def observe_into(self) -> Function:
        """Return what puts outputs of a batch into an array."""

        def observe_into(
            states: Sequence[Array], t: Array, p: Array, found: Sequence[Array]
        ) -> None:
            """Put outputs, and their rates, at states (n, N) into arrays (3, r, N) or (1, r, N)."""
            batch = self._batch_type(
                count=states[0].shape[1], t=numbers_of_times(t), p=numbers_of_batch(p)
            )
            for name, state in zip(STATES, states, strict=True):
                setattr(batch, name, numbers_of_batch(state))
            for name, part in zip(quantities.TOGETHER["observe"], found, strict=False):
                setattr(batch, name, numbers_of_batch(part))
            self._run(batch)

        return observe_into

    def march(self) -> Function:
        """Return the march over a time grid."""
        one = getattr(self._library, f"{self._name}_march")
        one.restype = c_size_t

        def march(
            inputs: Inputs,
            guess: Array,
            size: float,
            tolerance: float,
            sets: Array | None,
            states: Array,
            residual: Array,
            status: NDArray[np.intc],
            iterations: NDArray[np.intc],
        ) -> int:
            """Follow the motion from a guess, for a size of the mechanism, while points converge.

            Fills `states` (3, n, N) with position, velocity and acceleration, and of every point
            the largest absolute value of Phi, the `Status` and the Newton iterations, (N,) each.
            Given sets of parameters (B, k), it does so for each, from one guess (n,) or from one
            of each (n, B); all that is filled has B as its last axis. One that is assembled with
            an angle far from its guess is on another branch, and is not followed. Returns how many
            points converged, from the first one on, or how many of the sets did at all times.
            """
            motion: Any
            t = inputs.t
            if sets is None:
                motion = Motion(t.size, t.ctypes.data, inputs.p.ctypes.data, guess.ctypes.data)
                first = states
            else:
                motion, first = _variants(t, sets, guess), states[:, :, 0]
                motion.time = states.strides[2] // NUMBER
            motion.size, motion.tolerance = size, tolerance
            motion.max_iterations = inputs.max_iterations
            motion.q, motion.q_dot, motion.q_ddot = map(numbers_of_batch, first)
            said = (residual, status, iterations)
            motion.residual, motion.status, motion.iterations = (x.ctypes.data for x in said)
            if sets is None:
                return int(one(byref(motion)))
            return int(self._sets("follow", c_double, result=c_size_t)(byref(motion), FAR))

        return march

    def attempts(self) -> Function:
        """Return safeguarded attempts of many parameter sets."""

        def attempts(
            sets: Array, t: float, q: Array, size: float, max_iterations: int
        ) -> NDArray[np.bool_]:
            """Say which of sets (B, k) come near to a position at a time, from positions (n, B).

            The positions become those that were reached.
            """
            status = np.empty(len(sets), dtype=np.intc)
            motion = _variants(np.array([t]), sets, q)
            motion.size, motion.max_iterations = size, max_iterations
            motion.q, motion.status = numbers_of_batch(q), status.ctypes.data
            self._sets("attempt")(byref(motion))
            found: NDArray[np.bool_] = status == Status.CONVERGED
            return found

        return attempts

    def mirror(self) -> Function:
        """Return what goes beyond the nearest singular positions of many parameter sets."""

        def mirror(sets: Array, t: float, q: Array, size: float, magnitude: Array) -> Array:
            """Return about where sets (B, k) can be assembled there, (n, B), of positions (n, B).

            Equations are measured by magnitudes (m,).
            """
            found = np.empty_like(q, order="C")
            motion = _variants(np.array([t]), sets, q)
            motion.size, motion.q = size, numbers_of_batch(found)
            self._sets("mirror", c_void_p)(byref(motion), magnitude.ctypes.data)
            found[:, ~np.isfinite(found).all(axis=0)] = np.nan
            return found

        return mirror

    def lead(self) -> Function:
        """Return what leads a position along lines of parameters."""

        def lead(
            p: Array, t: float, guess: Array, sets: Array, size: float, tolerance: float, most: int
        ) -> tuple[Array, NDArray[np.intc]]:
            """Lead a position with parameters p (k,) at a time to sets (B, k).

            Return where it came to, (n, B), and the `Status` of each.
            """
            found = np.empty((3, guess.size, len(sets)))
            residual, (status, iterations) = np.empty(len(sets)), np.empty((2, len(sets)), np.intc)
            motion = _variants(np.array([t]), np.broadcast_to(p, sets.shape), guess)
            motion.size, motion.tolerance, motion.max_iterations = size, tolerance, most
            motion.q, motion.q_dot, motion.q_ddot = map(numbers_of_batch, found)
            said = (residual, status, iterations)
            motion.residual, motion.status, motion.iterations = (x.ctypes.data for x in said)
            self._sets("lead", Numbers)(byref(motion), numbers_of_batch(sets.T))
            return found[0], status

        return lead


def _variants(t: Array, sets: Array, guess: Array) -> Variants:
    """Return motions of parameter sets (B, k) from guesses; what they read is kept with them."""
    given = [numbers_of_batch(x) for x in (sets.T, guess)]
    motion = Variants(t.size, len(sets), t.ctypes.data, *given)
    motion.kept = t, sets, guess  # C reads through addresses: the arrays must live as long
    return motion


def _shapes(code: Compiled) -> dict[str, tuple[int, ...]]:
    """Return the shape of each result of compiled code, in the order of its header."""
    sizes = {
        "equations": len(code.equations),
        "coordinates": len(code.coordinates),
        "outputs": len(code.outputs),
        "parameters": len(code.parameters),
    }
    shapes: dict[str, tuple[int, ...]] = {}
    for item in code.quantities:
        shapes[item.name] = (sizes[item.rows],)
        if item.is_matrix:
            shapes[item.name] += (sizes[item.columns],)
            shapes[quantities.nonzeros_of(item)] = (len(code.patterns[item.name]),)
    return shapes


def _is_real(value: Any, shape: tuple[int, ...]) -> bool:
    """Return whether something is an array of real numbers that C can read where it lies."""
    return (
        type(value) is np.ndarray
        and value.shape == shape
        and value.dtype is REAL
        and value.flags.aligned
        and all(stride % NUMBER == 0 for stride in value.strides)
    )


def _is_plain(value: Any, shape: tuple[int, ...]) -> bool:
    return _is_real(value, shape) and value.flags.c_contiguous


def _rows(array: Any, shape: tuple[int, ...], entries: tuple[int, ...]) -> Array:
    """Return an array (..., n), broadcast to a batch's shape, as (n, N)."""
    spread = np.broadcast_to(array.astype(np.float64, copy=False), (*shape, *entries))
    rows: Array = spread.reshape(math.prod(shape), *entries).T
    return rows


def _copied(results: tuple[Array, ...], out: tuple[Array, ...] | None) -> tuple[Array, ...]:
    """Return results, in the arrays given for them if there are any."""
    if out is None:
        return results
    for place, result in zip(out, results, strict=True):
        place[...] = result
    return out


def _in_lines(size: int, points: int) -> Array:
    """Return a new array (size, N) whose rows each begin where a cache line does.

    The rows are an odd number of lines apart: at powers of two they would get in each other's way.
    """
    width = (-(-points // LINE) | 1) * LINE
    numbers = empty((size * width + LINE,))
    start = -numbers.ctypes.data // NUMBER % LINE
    rows: Array = numbers[start : start + size * width].reshape(size, width)[:, :points]
    return rows
