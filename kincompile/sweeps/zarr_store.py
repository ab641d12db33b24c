"""Results as a Zarr group: an array for each column, whose chunks are those of the sweep.

A chunk is a file of each array, written beside its place and moved there, and a record of them.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.runtime.results.columns import unit_attributes
from kincompile.sweeps.folder import Records, drop_damaged, opened, whole, written
from kincompile.sweeps.layout import STATUS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray
    import zarr
    from numpy.typing import NDArray

    from kincompile.sweeps.contents import Contents, Form


RECORDS = f"{STATUS}/sha256"
"""Where records are: in the folder of an array, since the members of a group are arrays alone."""

MAIN = "zarr.json"
"""The file of the group."""


class ZarrWriter:
    """Writes chunks into a Zarr group, in the process of a worker too."""

    def __init__(self, path: Path, form: Form) -> None:
        self.path, self.form = path, form
        self.records = Records(path, RECORDS)
        self._arrays: dict[str, zarr.Array[Any]] = {}

    def __reduce__(self) -> tuple[type[ZarrWriter], tuple[Path, Form]]:
        """Return what makes the copy of a worker, which opens the group itself."""
        return ZarrWriter, (self.path, self.form)

    def write(self, number: int, sets: NDArray[Any], values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: the file of each array, then its record."""
        del sets  # they are coordinates of the group

        def write() -> None:
            for name, block in self.form.blocks(number, values).items():
                self.array(name)[self.form.region(number, name)] = block
            self.records.write(number, self.files(number))

        written(self.path, write)

    def files(self, number: int) -> list[str]:
        """Return the file of each array of a chunk, by name."""
        place = [str(k) for k in self.form.grid.place(number)]
        return [
            "/".join([name, "c", *place, *["0"] * self.form.is_over_time(name)])
            for name in self.form.variables
        ]

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
            import zarr  # noqa: F401
        store = cls(path, contents.form)
        records = store.writer().records
        opened(records, lambda folder: _make(folder, contents), _marks, contents.marks, MAIN)
        drop_damaged(store.writer(), len(contents.form.grid))
        return store

    def writer(self) -> ZarrWriter:
        """Return what a worker writes its chunks with."""
        return self._writer

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Do nothing: workers write."""

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks are complete."""
        return whole(self._writer, len(self._form.grid))

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


def _marks(path: Path) -> object:
    """Return the marks of a group; None where it has none."""
    import zarr

    with suppress(Exception):  # whatever it is, it is no group of a sweep
        return zarr.open_group(path, mode="r").attrs.get("sweep")
    return None


def _make(folder: Path, contents: Contents) -> None:
    """Make the group and its arrays, empty but for the coordinates."""
    import zarr

    group = zarr.open_group(folder, mode="a")
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
