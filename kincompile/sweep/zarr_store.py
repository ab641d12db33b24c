"""Results as a Zarr group: an array for each column, whose chunks are those of the sweep.

A chunk is a file, written beside its place and moved there. The statuses are written last: where
their file is, the chunk is complete, and no other record is needed.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.runtime.results.columns import unit_attributes
from kincompile.sweep.contents import require_same
from kincompile.sweep.folder import kept_in, made_whole, remove_unfinished
from kincompile.sweep.layout import STATUS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray
    import zarr
    from numpy.typing import NDArray

    from kincompile.sweep.contents import Contents, Form


class ZarrWriter:
    """Writes chunks into a Zarr group, in the process of a worker too."""

    def __init__(self, path: Path, form: Form) -> None:
        self.path, self.form = path, form
        self._arrays: dict[str, zarr.Array[Any]] = {}

    def __reduce__(self) -> tuple[type[ZarrWriter], tuple[Path, Form]]:
        """Return what makes the copy of a worker, which opens the group itself."""
        return ZarrWriter, (self.path, self.form)

    def write(self, number: int, sets: NDArray[Any], values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: the file of each array, statuses last."""
        del sets  # they are coordinates of the group
        with kept_in(self.path):
            for name, block in self.form.blocks(number, values).items():
                self.array(name)[self.form.region(number, name)] = block

    def array(self, name: str) -> zarr.Array[Any]:
        """Return an array of the group; it is opened once, which takes milliseconds."""
        if name not in self._arrays:
            import zarr

            self._arrays[name] = zarr.open_array(self.path / name, mode="r+")
        return self._arrays[name]


class ZarrStore:
    """A folder with a Zarr group, format 3."""

    def __init__(self, path: Path, form: Form) -> None:
        self._form, self._writer = form, ZarrWriter(path, form)

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
        return cls(path, contents.form)

    def writer(self) -> ZarrWriter:
        """Return what a worker writes its chunks with."""
        return self._writer

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Do nothing: workers write."""

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks have statuses."""
        grid, folder = self._form.grid, self._writer.path / STATUS / "c"
        ending = ("0",) if self._form.layout.over_time else ()
        files = (
            folder.joinpath(*map(str, grid.place(number)), *ending) for number in range(len(grid))
        )
        return np.fromiter((file.is_file() for file in files), dtype=bool, count=len(grid))

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        return np.asarray(self._writer.array(name)[self._form.region(number, name)])

    def to_xarray(self) -> xarray.Dataset:
        """Return the results, which are read when they are used."""
        with package_of_extra("xarray", "tables"):
            import xarray
        found: xarray.Dataset
        found = xarray.open_zarr(self._writer.path, chunks=None, consolidated=False)
        return found


def _make(group: zarr.Group, contents: Contents) -> None:
    """Make the arrays, empty but for the coordinates."""
    swept = " ".join(name for name in contents.coordinates if name not in contents.form.grid.sizes)
    group.attrs.update({**contents.about, "coordinates": swept})
    for item in contents.form.variables.values():
        group.create_array(
            item.name,
            shape=item.shape,
            chunks=item.chunk,
            dtype=item.dtype,
            fill_value=item.fill,
            dimension_names=item.dimensions,
            attributes={**unit_attributes(item.unit)},
        )
    for name, (dimension, values, unit) in contents.coordinates.items():
        array = group.create_array(
            name,
            shape=values.shape,
            dtype=values.dtype,
            fill_value=np.nan,
            dimension_names=(dimension,),
            attributes={**unit_attributes(unit)},
        )
        array[:] = values
