"""Memory for large results: the buffers of garbage-collected results are used again.

The system hands out memory page by page and clears each page first. For the results of a large
batch that takes longer than to compute them, and the allocator gives them back with every call.
"""

from __future__ import annotations

import math
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

    Bytes = NDArray[np.uint8]

SMALLEST, LARGEST = 10_000_000, 1 << 27
"""Bytes of an array whose memory is kept: smaller ones gain nothing. Without, Phi_q of 100,000
points of a four-bar, nearly 64 MiB, takes 1.4 times as long in NumPy, and 2.4 times in C."""

KEPT = 1 << 28
"""Bytes that are kept at most: the matrices of four calls, or the motions of three chunks."""

# glibc raises its threshold for mmap to the size of the largest freed block. Freeing one of 32 MB,
# its limit, at import keeps later results on the heap; no page of it is touched. Without this
# `kinematics` of 100,000 points takes 1.2 times as long in NumPy, and 1.3 times in C.
np.empty(4_000_000)

free: deque[Bytes] = deque()


class _Loan:
    """Memory that an array has been given; it is free again when the array and all views are gone.

    NumPy keeps it alive for them as it does any object that offers its memory in this way.
    """

    def __init__(self, memory: Bytes, shape: tuple[int, ...], kind: np.dtype[Any]) -> None:
        self._memory, self._free, self._keep = memory, free, _keep  # to the interpreter's end
        self.__array_interface__ = {
            "version": 3,
            "data": (memory.ctypes.data, False),
            "shape": shape,
            "typestr": kind.str,
        }

    def __del__(self) -> None:
        self._keep(self._free, self._memory)


def _keep(free: deque[Bytes], memory: Bytes) -> None:
    """Keep memory for a later call; of too much the oldest goes."""
    free.append(memory)
    with suppress(IndexError):  # another thread was quicker
        while sum(piece.size for piece in tuple(free)) > KEPT:
            free.popleft()


def empty(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return a new array of unknown content, as `numpy.empty` does; its memory may be used."""
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    if not SMALLEST <= size <= LARGEST:
        return np.empty(shape, kind)
    return np.asarray(_Loan(_taken(size), shape, kind))


def _taken(size: int) -> Bytes:
    """Return a block of at least this size: a free one of up to twice the size, or a new one."""
    # Every operation on the deque is atomic: threads may miss a piece and never share one.
    for _ in range(len(free)):
        try:
            memory = free.popleft()
        except IndexError:
            break
        if size <= memory.size <= 2 * size:
            return memory
        free.append(memory)
    return np.empty(size, np.uint8)
