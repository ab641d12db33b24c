"""A module in grouped form with a march in compiled C.

All other functions stay those of the NumPy module, and so does the careful march, which goes on
where the compiled one reports anything but success.
"""

from __future__ import annotations

from ctypes import Structure, byref, c_double, c_int, c_size_t, c_void_p
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.native.library import library

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from ctypes import CDLL
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Inputs

    Array = NDArray[np.float64]

ARRAYS: Mapping[str, type[np.generic]] = {
    "tiles": np.int32,
    "columns": np.int32,
    "numbers": np.float64,
    "values": np.int32,
}
"""The arrays that the library reads, as the emitted header has them."""


class _Data(Structure):
    """The arrays of a mechanism, as the emitted header has them."""

    _fields_ = (("count", c_size_t), *((name, c_void_p) for name in ARRAYS))


class _Motion(Structure):
    """A motion, as the emitted header has it."""

    _fields_ = (
        ("count", c_size_t),
        ("t", c_void_p),
        ("p", c_void_p),
        ("reach", c_double),
        ("tolerance", c_double),
        ("max_iterations", c_int),
        *((name, c_void_p) for name in ("q", "q_dot", "q_ddot", "residual")),
        *((name, c_void_p) for name in ("iterations", "work")),
    )


def make_native_large(
    module: ModuleType, files: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]
) -> ModuleType:
    """Give an emitted NumPy module in grouped form a compiled march.

    Parameters
    ----------
    module
        The NumPy module of a mechanism, loaded; it is changed.
    files, arrays
        What the C target emitted for the same mechanism.

    Returns
    -------
    module
        The same module, with the function ``march``.

    Raises
    ------
    UnsupportedError
        If there is no C compiler, or it does not do its work.
    """
    loaded = library(module.NAME, files, module.FINGERPRINT)
    vars(module)["march"] = _march(module, loaded, arrays)
    return module


def _march(
    module: ModuleType, loaded: CDLL, arrays: Mapping[str, NDArray[Any]]
) -> Callable[..., int]:
    """Return the march over a time grid."""
    run = getattr(loaded, f"{module.NAME}_march")
    run.restype = c_size_t
    size = c_size_t.in_dll(loaded, f"{module.NAME}_work").value
    kept = {name: np.ascontiguousarray(arrays[name], kind) for name, kind in ARRAYS.items()}
    data = _Data(len(kept["tiles"]), *(array.ctypes.data for array in kept.values()))

    def march(
        inputs: Inputs,
        first: int,
        reach: float,
        states: tuple[Array, Array, Array],
        residual: Array,
        iterations: NDArray[np.int64],
    ) -> int:
        """Follow the motion as long as every step converges, undivided.

        Goes from the good point before `first`. Fills position, velocity and acceleration, (N, n)
        each, and of every point the largest absolute value of Phi and the Newton iterations, (N,)
        each. `reach` is the size of the mechanism. Returns how many points converged, from `first`
        on.
        """
        assert kept  # the library reads these arrays where they are
        times, work = inputs.t[first - 1 :], np.empty(size)
        counts = np.empty(times.size, dtype=np.intc)
        motion = _Motion(times.size, times.ctypes.data, inputs.p.ctypes.data, reach)
        motion.tolerance, motion.max_iterations = inputs.tolerance, inputs.max_iterations
        motion.q, motion.q_dot, motion.q_ddot = (x[first - 1 :].ctypes.data for x in states)
        motion.residual, motion.iterations = residual[first - 1 :].ctypes.data, counts.ctypes.data
        motion.work = work.ctypes.data
        done = max(int(run(byref(data), byref(motion))) - 1, 0)
        iterations[first : first + done] = counts[1 : done + 1]
        return done

    return march
