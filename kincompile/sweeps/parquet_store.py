"""Results as a folder of Parquet files, one for each chunk: a row for each variant and time.

A file is written beside its place and moved there, and then its record.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.runtime.results.columns import unit_attributes
from kincompile.sweeps.folder import Records, drop_damaged, opened, whole, written
from kincompile.sweeps.layout import TIME

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pyarrow as pa
    import xarray
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.sweeps.contents import Contents, Form

ABOUT = "_about.json"
"""The mechanism, its fixed parameters and what decides the numbers; readers of Parquet skip it."""

RECORDS = "_sha256"
"""Where records are; readers of Parquet skip it too."""


@dataclass(frozen=True, slots=True, eq=False)
class ParquetWriter:
    """Writes chunks as files of a folder, in the process of a worker too."""

    # path, form: the folder, and the arrays of the results
    path: Path
    form: Form
    swept: Mapping[str, int]  # the places of the swept parameters in a set, by name
    t: Array  # (N,): the times
    unit_of: Mapping[str, str]  # units by the names of columns

    @property
    def records(self) -> Records:
        """The records of the chunks."""
        return Records(self.path, RECORDS)

    def files(self, number: int) -> list[str]:
        """Return the one file of a chunk, by name."""
        digits = len(str(len(self.form.grid) - 1))
        return [f"part-{number:0{digits}}.parquet"]

    def write(self, number: int, sets: Array, values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: its file, then its record."""
        import pyarrow.parquet as pq

        (name,) = self.files(number)
        partial = self.path / f".{name}.{os.urandom(4).hex()}.partial"

        def write() -> None:
            try:
                pq.write_table(self._table(sets, values), partial, compression="zstd")
                partial.replace(self.path / name)
            finally:
                partial.unlink(missing_ok=True)
            self.records.write(number, [name])

        written(self.path, write)

    def _table(self, sets: Array, values: Mapping[str, NDArray[Any]]) -> pa.Table:
        """Return a chunk as a table: swept parameters, time, what is kept, status."""
        import pyarrow as pa

        times = self.t.size if self.form.layout.over_time else 1
        columns = {name: np.repeat(sets[:, place], times) for name, place in self.swept.items()}
        if self.form.layout.over_time:
            columns[TIME] = np.tile(self.t, len(sets))
        for name in self.form.variables:
            given = values[name]
            columns[name] = given.ravel() if given.ndim > 1 else np.repeat(given, times)
        fields = [
            pa.field(
                name,
                pa.from_numpy_dtype(column.dtype),
                metadata=unit_attributes(self.unit_of[name]),
            )
            for name, column in columns.items()
        ]
        return pa.table([pa.array(column) for column in columns.values()], schema=pa.schema(fields))


class ParquetStore:
    """A folder of Parquet files."""

    def __init__(self, path: Path, contents: Contents) -> None:
        plan, form = contents.plan, contents.form
        units_of = {name: unit for name, (_, _, unit) in contents.coordinates.items()}
        units_of |= {name: item.unit for name, item in form.variables.items()}
        swept = {name: plan.parameters.index(name) for name in plan.sweep}
        self._contents = contents
        self._writer = ParquetWriter(path, form, swept, contents.t, units_of)

    @classmethod
    def opened(cls, path: Path, contents: Contents) -> ParquetStore:
        """Return the store of a sweep in a folder, which is made if it is missing."""
        with package_of_extra("pyarrow", "sweep"):
            import pyarrow.parquet  # noqa: F401
        store = cls(path, contents)

        def make(folder: Path) -> None:
            text = json.dumps(contents.about, indent=1)
            (folder / ABOUT).write_text(text, encoding="utf-8")

        opened(store.writer().records, make, _marks, contents.marks, ABOUT)
        drop_damaged(store.writer(), len(contents.form.grid))
        return store

    def writer(self) -> ParquetWriter:
        """Return what a worker writes its chunks with."""
        return self._writer

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Do nothing: workers write."""

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks are complete."""
        return whole(self._writer, len(self._contents.form.grid))

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        import pyarrow.parquet as pq

        values = pq.read_table(self._file(number), columns=[name])[name].to_numpy()
        form = self._contents.form
        parts: NDArray[Any] = values.reshape(*form.grid.shape(number), -1)
        return parts if form.is_over_time(name) else parts[..., 0]

    def to_xarray(self) -> xarray.Dataset:
        """Return the results, read into memory."""
        return self._contents.filled(self)

    def _file(self, number: int) -> Path:
        (name,) = self._writer.files(number)
        return self._writer.path / name


def _marks(path: Path) -> object:
    """Return the marks of a folder; None where it has none."""
    with suppress(OSError, ValueError, AttributeError):  # it is no folder of a sweep
        return json.loads((path / ABOUT).read_text(encoding="utf-8")).get("sweep")
    return None
