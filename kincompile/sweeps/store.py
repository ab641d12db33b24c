"""Where the results of a sweep are kept: in memory, or in a folder that grows chunk by chunk."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError, memory_for
from kincompile.names import escaped, listed
from kincompile.sweeps.parquet_store import ParquetStore
from kincompile.sweeps.zarr_store import ZarrStore

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray
    from numpy.typing import NDArray

    from kincompile.sweeps.contents import Contents, Store


class Memory:
    """Results that are kept in this process."""

    def __init__(self, contents: Contents) -> None:
        self._contents, self._form = contents, contents.form
        self._done = np.zeros(len(self._form.grid), dtype=bool)
        self._arrays = self._form.empty()

    def writer(self) -> None:
        """Return nothing: workers hand their values back."""

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a chunk, by name."""
        for name, block in self._form.blocks(number, values).items():
            self._arrays[name][self._form.region(number, name)] = block
        self._done[number] = True

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks are complete."""
        return self._done

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        found: NDArray[Any] = self._arrays[name][self._form.region(number, name)]
        return found

    def to_xarray(self) -> xarray.Dataset:
        """Return the results."""
        return self._contents.dataset(self._arrays)


MOST_BYTES = 8_000_000_000
"""Largest results that are kept in memory, where the machine has twice as much."""

MOST_CHUNKS = 10_000_000
"""Largest number of chunks, of which each is a file or more."""

STORES: dict[str, type[ZarrStore | ParquetStore]] = {".zarr": ZarrStore, ".parquet": ParquetStore}
"""Kinds of folders, by ending."""


def open_store(path: str | os.PathLike[str] | None, contents: Contents) -> Store:
    """Return the store of a sweep: begun now, or as an earlier run has left it."""
    form = contents.form
    if len(form.grid) > MOST_CHUNKS:
        raise InputError(
            f"{form.grid.variants:,} variants are {len(form.grid):,} chunks, more than "
            f"{MOST_CHUNKS:,}: give fewer values, or a larger chunk."
        )
    if path is None:
        what = f"the results of {form.grid.variants:,} variants have {form.size / 1e9:,.1f} GB"
        with memory_for(what, "give a store, such as store='NAME.zarr', or keep less"):
            if form.size > min(MOST_BYTES, _memory() / 2):
                raise MemoryError
            return Memory(contents)
    given: Any = path  # whatever its type says
    kind = STORES.get(Path(path).suffix) if isinstance(given, str | os.PathLike) else None
    if kind is None:
        raise InputError(
            f"cannot keep a sweep in {escaped(str(path))}: end its name in {listed(STORES)}."
        )
    return kind.opened(Path(path).absolute(), contents)


def _memory() -> float:
    """Return the memory of this machine [bytes]; of one that does not say, infinity."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return math.inf
