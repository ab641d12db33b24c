"""The table `sweep` of a model file: which parameters are swept, and what is kept.

[sweep]
parameters = { a = [0.2, 0.3], b = { from = 0.4, to = 0.6, count = 100 } }
product = true
columns = ["rocker.phi"]
measures = ["foot.x.stroke"]
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.files.content import file_content
from kincompile.files.data_text import listed_problems, read_json, read_toml
from kincompile.files.file_fields import FieldReader
from kincompile.files.file_format import FIELDS, MOST_VARIANTS

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class Span:
    """Equally spaced values from one to another, `count` or as many as there are samples."""

    first: float
    last: float
    count: int | None


@dataclass(frozen=True, slots=True)
class SweepTable:
    """What a file says of a sweep."""

    # Lists of values, or spans, by the names of parameters.
    parameters: Mapping[str, tuple[float, ...] | Span]
    # How many points fill the spans that have no count; None where there are none.
    samples: int | None = None
    product: bool = False  # whether every value goes with every other one
    # columns, measures: what is kept; None where the file does not say.
    columns: tuple[str, ...] | None = None
    measures: tuple[str, ...] = ()


def read_sweep_table(path: str | os.PathLike[str]) -> SweepTable | None:
    """Read the table of a sweep in a model file; None where it has none, or is no TOML or JSON.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    ModelError
        If the table cannot be used; every problem with line and field.
    """
    file = Path(path)
    read = {".toml": read_toml, ".json": read_json}.get(file.suffix.lower())
    if read is None:
        return None
    reader = _TableReader(read(file, file_content(file)))
    table = reader.read()
    if reader.problems:
        raise listed_problems(reader.problems)
    return table


class _TableReader(FieldReader):
    """Reads the fields of the table one after the other."""

    def read(self) -> SweepTable | None:
        """Return the table as far as it could be read."""
        data = self.document.data
        row = data.get("sweep") if isinstance(data, dict) else None
        if row is None:
            return None
        self.fits(row, FIELDS["model"]["sweep"].schema, ("sweep",))
        if self.problems:
            return None
        samples = row.get("samples")
        parameters = {name: self._values(name, value) for name, value in row["parameters"].items()}
        self._require_samples(parameters, samples)
        self._require_few(parameters, samples or 1)
        columns = tuple(row["columns"]) if "columns" in row else None
        measures = tuple(row.get("measures", ()))
        return SweepTable(parameters, samples, row.get("product", False), columns, measures)

    def _values(self, name: str, given: Any) -> tuple[float, ...] | Span:
        """Return the values of a parameter, or from where to where they go."""
        address = ("sweep", "parameters", name)
        if isinstance(given, list):
            return tuple(self.finite(item, (*address, k)) for k, item in enumerate(given))
        first, last = (self.finite(given[key], (*address, key)) for key in ("from", "to"))
        return Span(first, last, given.get("count"))

    def _require_samples(
        self, parameters: Mapping[str, tuple[float, ...] | Span], samples: int | None
    ) -> None:
        """Report spans without a number of values."""
        for name, value in parameters.items():
            if isinstance(value, Span) and value.count is None and samples is None:
                text = "give it a count of equally spaced values, or the sweep a number of samples"
                self.problem(("sweep", "parameters", name), text)

    def _require_few(
        self, parameters: Mapping[str, tuple[float, ...] | Span], samples: int
    ) -> None:
        """Report more values than a file may ask for, before they are made."""
        spans = [item for item in parameters.values() if isinstance(item, Span)]
        total = sum(samples if item.count is None else item.count for item in spans)
        if total > MOST_VARIANTS:
            text = (
                f"{total:,} values are more than the {MOST_VARIANTS:,} of a file; sweep in Python"
            )
            self.problem(("sweep", "parameters"), text)
