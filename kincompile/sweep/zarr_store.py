"""Results as a Zarr group: an array for each column, whose chunks are those of the sweep.

A chunk is a file, written beside its place and moved there. The statuses are written last: where
their file is, the chunk is complete, and no other record is needed.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.sweep.contents import require_same, units
from kincompile.sweep.folder import kept_in, made_whole, remove_unfinished
from kincompile.sweep.layout import STATUS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray
    import zarr
    from numpy.typing import NDArray

    from kincompile.sweep.contents import Contents


class ZarrStore:
    """A folder with a Zarr group, format 3."""

    IS_SHARED = True

    def __init__(self, path: Path, contents: Contents) -> None:
        self._path, self._contents = path, contents
        self._arrays: dict[str, Any] = {}

    @classmethod
    def opened(cls, path: Path, contents: Contents) -> ZarrStore:
        """Return the store of a sweep in a folder, which is made if it is missing."""
        with package_of_extra("zarr", "sweep"):
            import zarr
        if path.exists():
            found: object = None
            with suppress(Exception):  # whatever it is, it is no group of a sweep
                found = zarr.open_group(path, mode="r").attrs.get("sweep")
            require_same(path, found, contents.marks)
            remove_unfinished(path, "*.partial")
        else:
            with made_whole(path) as folder:
                _make(zarr.open_group(folder, mode="w-"), contents)
        return cls(path, contents)

    def __getstate__(self) -> tuple[Path, Contents]:
        """Return what a worker needs; it opens the group itself."""
        return self._path, self._contents

    def __setstate__(self, state: tuple[Path, Contents]) -> None:
        """Restore the store."""
        self.__init__(*state)  # type: ignore[misc]

    def write(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: the file of each array, statuses last."""
        with kept_in(self._path):
            for name, block in self._contents.blocks(number, values).items():
                self._array(name)[self._contents.region(number, name)] = block

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        return np.asarray(self._array(name)[self._contents.region(number, name)])

    def _array(self, name: str) -> Any:
        """Return an array of the group; it is opened once, which takes milliseconds."""
        if name not in self._arrays:
            import zarr

            self._arrays[name] = zarr.open_array(self._path / name, mode="r+")
        return self._arrays[name]

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks have statuses."""
        plan, folder = self._contents.plan, self._path / STATUS / "c"
        ending = ("0",) if self._contents.layout.over_time else ()
        files = (
            folder.joinpath(*map(str, plan.place(number)), *ending) for number in range(len(plan))
        )
        return np.fromiter((file.is_file() for file in files), dtype=bool, count=len(plan))

    def to_xarray(self) -> xarray.Dataset:
        """Return the results, which are read when they are used."""
        with package_of_extra("xarray", "tables"):
            import xarray
        found: xarray.Dataset
        found = xarray.open_zarr(self._path, chunks=None, consolidated=False)
        return found


def _make(group: zarr.Group, contents: Contents) -> None:
    """Make the arrays, empty but for the coordinates."""
    swept = " ".join(name for name in contents.coordinates if name not in contents.plan.sizes)
    group.attrs.update({**contents.about, "coordinates": swept})
    for item in contents.variables:
        group.create_array(
            item.name,
            shape=item.shape,
            chunks=item.chunk,
            dtype=item.dtype,
            fill_value=item.fill,
            dimension_names=item.dimensions,
            attributes={**units(item.unit)},
        )
    for name, (dimension, values, unit) in contents.coordinates.items():
        array = group.create_array(
            name,
            shape=values.shape,
            dtype=values.dtype,
            fill_value=np.nan,
            dimension_names=(dimension,),
            attributes={**units(unit)},
        )
        array[:] = values
