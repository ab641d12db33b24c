"""Results as a folder of Parquet files, one for each chunk: a row for each variant and time.

A file is written beside its place and moved there: where it is, the chunk is complete.
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
from kincompile.sweep.contents import require_same
from kincompile.sweep.folder import kept_in, made_whole, remove_unfinished
from kincompile.sweep.layout import TIME

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pyarrow as pa
    import xarray
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.sweep.contents import Contents, Form

ABOUT = "_about.json"
"""The mechanism, its fixed parameters and what decides the numbers; readers of Parquet skip it."""


@dataclass(frozen=True, slots=True, eq=False)
class ParquetWriter:
    """Writes chunks as files of a folder, in the process of a worker too."""

    # path, form: the folder, and the arrays of the results
    path: Path
    form: Form
    swept: Mapping[str, int]  # the places of the swept parameters in a set, by name
    t: Array  # (N,): the times
    unit_of: Mapping[str, str]  # units by the names of columns

    def file(self, number: int) -> Path:
        """Return the file of a chunk."""
        digits = len(str(len(self.form.grid) - 1))
        return self.path / f"part-{number:0{digits}}.parquet"

    def write(self, number: int, sets: Array, values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: its file."""
        import pyarrow.parquet as pq

        file = self.file(number)
        partial = file.with_name(f".{file.name}.{os.urandom(4).hex()}.partial")
        with kept_in(self.path):
            try:
                pq.write_table(self._table(sets, values), partial, compression="zstd")
                partial.replace(file)
            finally:
                partial.unlink(missing_ok=True)

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
        if path.exists():
            found: object = None
            with suppress(OSError, ValueError, AttributeError):  # it is no folder of a sweep
                found = json.loads((path / ABOUT).read_text(encoding="utf-8")).get("sweep")
            require_same(path, found, contents.marks)
            remove_unfinished(path, ".*.partial")
        else:
            with made_whole(path) as folder:
                text = json.dumps(contents.about, indent=1)
                (folder / ABOUT).write_text(text, encoding="utf-8")
        return cls(path, contents)

    def writer(self) -> ParquetWriter:
        """Return what a worker writes its chunks with."""
        return self._writer

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Do nothing: workers write."""

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks have a file."""
        there = {file.name for file in self._writer.path.iterdir()}
        count = len(self._contents.form.grid)
        found = (self._writer.file(number).name in there for number in range(count))
        return np.fromiter(found, dtype=bool, count=count)

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        import pyarrow.parquet as pq

        values = pq.read_table(self._writer.file(number), columns=[name])[name].to_numpy()
        form = self._contents.form
        parts: NDArray[Any] = values.reshape(*form.grid.shape(number), -1)
        return parts if form.is_over_time(name) else parts[..., 0]

    def to_xarray(self) -> xarray.Dataset:
        """Return the results, read into memory."""
        return self._contents.filled(self)
