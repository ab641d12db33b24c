"""The arguments of compiled code, and one point evaluated with as little around as can be.

What is around the code takes ten times as long as the code itself: arguments are looked at once,
and nothing is called that need not be.
"""

from __future__ import annotations

import ctypes
from ctypes import Structure, addressof, byref, c_double, c_int, c_size_t, c_ssize_t, c_void_p
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.runtime.engine.code import Array, Compiled

    Function = Callable[..., Any]

REAL = np.dtype(np.float64)
NUMBER = REAL.itemsize

STATES = ("q", "q_dot", "q_ddot")


class Numbers(Structure):
    """Numbers of many points: entry i of point k is ``first[i * entry + k * point]``."""

    _fields_ = (("first", c_void_p), ("entry", c_ssize_t), ("point", c_ssize_t))


@cache
def batch_type(results: tuple[str, ...]) -> type[Any]:
    """Return the structure of what is to be evaluated, as the emitted header has it."""
    fields = (
        ("count", c_size_t),
        *((name, Numbers) for name in ("q", "q_dot", "t", "p")),
        *((name, Numbers) for name in (*(("q_ddot",) if "outputs" in results else ()), *results)),
        ("varying_only", c_int),
    )
    return type("Batch", (Structure,), {"_fields_": fields})


class System(Structure):
    """Linear systems, as the emitted header has them."""

    _fields_ = (("count", c_size_t), *((name, Numbers) for name in ("nonzeros", "b", "x")))


class Motion(Structure):
    """A motion, as the emitted header has it."""

    _fields_ = (
        ("count", c_size_t),
        *((name, c_void_p) for name in ("t", "p", "guess")),
        ("size", c_double),
        ("tolerance", c_double),
        ("max_iterations", c_int),
        *((name, Numbers) for name in ("q", "q_dot", "q_ddot")),
        *((name, c_void_p) for name in ("residual", "status", "iterations")),
    )


class Variants(Structure):
    """Motions of many variants, as the emitted header has them."""

    _fields_ = (
        ("count", c_size_t),
        ("variants", c_size_t),
        ("t", c_void_p),
        ("p", Numbers),
        ("guess", Numbers),
        ("size", c_double),
        ("tolerance", c_double),
        ("max_iterations", c_int),
        *((name, Numbers) for name in ("q", "q_dot", "q_ddot")),
        ("time", c_ssize_t),
        *((name, c_void_p) for name in ("residual", "status", "iterations")),
    )


def numbers_of_point(array: Array) -> Numbers:
    """Return the numbers of one point."""
    return Numbers(array.ctypes.data, 1, 0)


def numbers_of_batch(array: Array) -> Numbers:
    """Return an array whose last axis is the batch; one without it is shared by all points."""
    if array.ndim == 2:
        entry, point = array.strides
        return Numbers(array.ctypes.data, entry // NUMBER, point // NUMBER)
    return Numbers(array.ctypes.data, 1, 0)


def numbers_of_times(array: Array) -> Numbers:
    """Return one time a point, or one for all."""
    return Numbers(array.ctypes.data, 0, array.strides[-1] // NUMBER if array.ndim else 0)


COPIED: Mapping[int, Function] = {
    1: lambda a: a.copy(),
    2: lambda a, b: (a.copy(), b.copy()),
    4: lambda a, b, c, d: (a.copy(), b.copy(), c.copy(), d.copy()),
}
"""Copies of one, two or four arrays. A loop takes longer."""


class Places:
    """Numbers of one point at addresses that stay, so that a call of C needs no new ones.

    A call takes a place and puts it back. Threads that call at the same time have different ones.
    """

    def __init__(
        self,
        code: Compiled,
        loaded: Callable[[], ctypes.CDLL],
        quantities: Sequence[str],
        shapes: Mapping[str, tuple[int, ...]],
        batch_type: type[Any],
    ) -> None:
        self.shape, self.defaults = code.guess.shape, code.defaults
        self.quantities, self.copied = quantities, COPIED[len(quantities)]
        self._batch_type = batch_type
        self._shapes = [shapes[quantity] for quantity in quantities]
        self._name, self._library = f"{code.name}_evaluate", loaded
        self.free: list[Any] = []

    def new(self) -> tuple[Array, Array, c_double, Array, list[Array], Function, Function]:
        """Return the arrays of q, q_dot, t, p, the results, and the two calls of C.

        That is: with the default parameters, or those that are written.
        """
        # To give up the interpreter's lock for a point would take longer than the point.
        run = ctypes.PYFUNCTYPE(c_int, c_void_p)((self._name, self._library()))
        q, q_dot = np.zeros((2, *self.shape))
        time, parameters = c_double(), self.defaults.copy()
        results = [np.zeros(shape) for shape in self._shapes]
        calls = []
        for p in (self.defaults, parameters):
            batch = self._batch_type(
                1,
                numbers_of_point(q),
                numbers_of_point(q_dot),
                Numbers(addressof(time)),
                numbers_of_point(p),
            )
            for quantity, result in zip(self.quantities, results, strict=True):
                setattr(batch, quantity, numbers_of_point(result))
            run(byref(batch))
            batch.varying_only = 1  # from now on the constants are in place
            calls.append(partial(run, byref(batch)))
        return q, q_dot, time, parameters, results, calls[0], calls[1]


def function_of_states(places: Places, evaluate: Function, original: Function) -> Function:
    """Return a function of q, q_dot, t and p."""
    defaults, quantities, copied = places.defaults, places.quantities, places.copied
    ndarray, shape, p_shape, real = np.ndarray, places.shape, defaults.shape, REAL
    new, take, put_back = places.new, places.free.pop, places.free.append

    def of_states(q: Any, q_dot: Any, t: Any, p: Any = defaults) -> Any:
        if (
            isinstance(t, float)
            and type(q) is ndarray and q.shape == shape and q.dtype is real
            and type(q_dot) is ndarray and q_dot.shape == shape and q_dot.dtype is real
            and (p is defaults
                 or (type(p) is ndarray and p.shape == p_shape and p.dtype is real))
        ):  # fmt: skip
            try:
                place = take()
            except IndexError:  # the first call, or other threads have all
                place = new()
            q_place, q_dot_place, time, parameters, results, own, given = place
            q_place[...] = q
            q_dot_place[...] = q_dot
            time.value = t
            if p is defaults:
                failed = own()
            else:
                parameters[...] = p
                failed = given()
            found = copied(*results)
            put_back(place)
            if not failed:
                return found
        found = evaluate(quantities, (q, q_dot), t, p)
        return original(q, q_dot, t, p) if found is None else found

    return of_states


def function_of_positions(places: Places, evaluate: Function, original: Function) -> Function:
    """Return a function of q, t and p; the same without rates, of which C then reads none."""
    defaults, quantities, copied = places.defaults, places.quantities, places.copied
    ndarray, shape, p_shape, real = np.ndarray, places.shape, defaults.shape, REAL
    new, take, put_back = places.new, places.free.pop, places.free.append

    def of_positions(q: Any, t: Any, p: Any = defaults) -> Any:
        if (
            isinstance(t, float)
            and type(q) is ndarray and q.shape == shape and q.dtype is real
            and (p is defaults
                 or (type(p) is ndarray and p.shape == p_shape and p.dtype is real))
        ):  # fmt: skip
            try:
                place = take()
            except IndexError:
                place = new()
            q_place, _, time, parameters, results, own, given = place
            q_place[...] = q
            time.value = t
            if p is defaults:
                failed = own()
            else:
                parameters[...] = p
                failed = given()
            found = copied(*results)
            put_back(place)
            if not failed:
                return found
        found = evaluate(quantities, (q,), t, p)
        return original(q, t, p) if found is None else found

    return of_positions
