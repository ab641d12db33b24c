"""Compiled code that takes a motion from one time to the next, with as little around as can be."""

from __future__ import annotations

import ctypes
from ctypes import byref, c_double, c_int, c_size_t, c_void_p
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.runtime.native.points import NUMBER, Motion

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.engine.code import Array, Compiled

    Step = tuple[Array, int]

LINE = 8
"""Numbers of a line of the cache."""


def stepper_of(code: Compiled, loaded: ctypes.CDLL) -> Callable[..., Callable[..., Step]]:
    """Return `stepper`, as the march of an emitted NumPy module has it, of a library."""
    name, n = code.name, code.guess.size
    size_of = getattr(loaded, f"{name}_stepper_size")
    size_of.restype = c_size_t
    count = -(-size_of() // NUMBER)
    set_out = getattr(loaded, f"{name}_set_out")
    set_out.argtypes = c_void_p, c_void_p
    # To give up the interpreter's lock for a step would take longer than the step. Types of
    # arguments would have each converted at every call.
    run: Callable[..., int] = ctypes.PYFUNCTYPE(c_int)((f"{name}_go_on", loaded))

    def stepper(q: Array, t: float, p: Array, size: float) -> Callable[[float, Array], Step]:
        """Return a function of one time and parameters that goes on from a position."""
        # The function keeps the arrays whose places C is given.
        memory, found, parameters = _zeros(count), np.empty((3, n)), p.copy()
        guess, time = np.ascontiguousarray(q), c_double(t)
        motion = Motion(1, ctypes.addressof(time), parameters.ctypes.data, guess.ctypes.data)
        motion.size, motion.tolerance, motion.max_iterations = size, TOLERANCE, MAX_ITERATIONS
        begun = set_out(memory.ctypes.data, byref(motion))
        at, given, result = map(_place, (memory, parameters, found))
        known: Any = p

        def go(t: float, p: Array, kept: Array = memory) -> Step:
            nonlocal known
            if p is not known:
                parameters[...] = known = p
            time.value = t
            status = begun or run(at, time, given, result)
            return found.copy(), status

        return go

    return stepper


def _zeros(count: int) -> Array:
    """Return zeros that begin with a line of the cache: no register then lies across two."""
    found = np.zeros(count + LINE)
    first = -found.ctypes.data // NUMBER % LINE
    return found[first : first + count]


def _place(array: Array) -> Any:
    """Return a reference to the first number of an array, as C takes it."""
    return byref(c_double.from_address(array.ctypes.data))
