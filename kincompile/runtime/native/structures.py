"""The arguments of emitted C code: the structures of its header, and the layout of numbers."""

from __future__ import annotations

from ctypes import Structure, c_double, c_int, c_size_t, c_ssize_t, c_void_p
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

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
