"""Results as a folder of Parquet files, one for each chunk: a row for each variant and time.

A file is written beside its place and moved there: where it is, the chunk is complete.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.sweep.contents import require_same, units
from kincompile.sweep.folder import kept_in, made_whole, remove_unfinished
from kincompile.sweep.layout import TIME

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pyarrow as pa
    import xarray
    from numpy.typing import NDArray

    from kincompile.sweep.contents import Contents

ABOUT = "_about.json"
"""The mechanism, its fixed parameters and what decides the numbers; readers of Parquet skip it."""


class ParquetStore:
    """A folder of Parquet files."""

    IS_SHARED = True

    def __init__(self, path: Path, contents: Contents) -> None:
        self._path, self._contents = path, contents

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

    def write(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk: its file."""
        import pyarrow.parquet as pq

        file = self._file(number)
        partial = file.with_name(f".{file.name}.{os.urandom(4).hex()}.partial")
        with kept_in(self._path):
            try:
                pq.write_table(self._table(number, values), partial, compression="zstd")
                partial.replace(file)
            finally:
                partial.unlink(missing_ok=True)

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks have a file."""
        count = len(self._contents.plan)
        there = {file.name for file in self._path.iterdir()}
        found = (self._file(number).name in there for number in range(count))
        return np.fromiter(found, dtype=bool, count=count)

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk, of one array."""
        import pyarrow.parquet as pq

        values = pq.read_table(self._file(number), columns=[name])[name].to_numpy()
        shape, variable = self._contents.plan.shape(number), self._contents.variable(name)
        parts: NDArray[Any] = values.reshape(*shape, -1)
        return parts if variable.dimensions[-1] == TIME else parts[..., 0]

    def to_xarray(self) -> xarray.Dataset:
        """Return the results, read into memory."""
        return self._contents.filled(self)

    def _file(self, number: int) -> Path:
        digits = len(str(len(self._contents.plan) - 1))
        return self._path / f"part-{number:0{digits}}.parquet"

    def _table(self, number: int, values: Mapping[str, NDArray[Any]]) -> pa.Table:
        """Return a chunk as a table: swept parameters, time, what is kept, status."""
        import pyarrow as pa

        contents = self._contents
        times = contents.t.size if contents.layout.over_time else 1
        swept = zip(contents.plan.sweep, contents.plan.swept(number), strict=True)
        columns = {name: np.repeat(given, times) for name, given in swept}
        count = len(values[contents.variables[-1].name])
        if contents.layout.over_time:
            columns[TIME] = np.tile(contents.t, count)
        for item in contents.variables:
            given = values[item.name]
            columns[item.name] = given.ravel() if given.ndim > 1 else np.repeat(given, times)
        unit_of = {name: unit for name, (_, _, unit) in contents.coordinates.items()}
        unit_of |= {item.name: item.unit for item in contents.variables}
        fields = [
            pa.field(name, pa.from_numpy_dtype(column.dtype), metadata=units(unit_of[name]))
            for name, column in columns.items()
        ]
        return pa.table([pa.array(column) for column in columns.values()], schema=pa.schema(fields))
