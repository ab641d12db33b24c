"""The table `sweep` of a model file: which parameters are swept, and what is kept.

[sweep]
parameters = { a = [0.2, 0.3], b = { from = 0.4, to = 0.6, count = 100 } }
product = true
columns = ["rocker.phi"]
measures = ["foot.x.stroke"]
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.files.content import file_content
from kincompile.files.data_text import listed_problems, read_json, read_toml
from kincompile.files.file_fields import FieldReader
from kincompile.model.tasks import MOST_VARIANTS, Span, Sweep

if TYPE_CHECKING:
    import os


def task_reader(path: str | os.PathLike[str], section: str) -> tuple[FieldReader, Any] | None:
    """Return what reads a model file, and its table of a command; None where it has none."""
    file = Path(path)
    read = {".toml": read_toml, ".json": read_json}.get(file.suffix.lower())
    if read is None:
        return None
    document = read(file, file_content(file))
    row = document.data.get(section) if isinstance(document.data, dict) else None
    return None if row is None else (FieldReader(document), row)


def read_sweep_table(path: str | os.PathLike[str]) -> Sweep | None:
    """Read the table of a sweep in a model file; None where it has none, or is no TOML or JSON.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    ModelError
        If the table cannot be used; every problem with line and field.
    """
    found = task_reader(path, "sweep")
    if found is None:
        return None
    reader, row = found
    table: Sweep | None = reader.table(row, "sweep", ("sweep",))
    if table is not None:
        _require_counts(reader, table)
    if reader.problems:
        raise listed_problems(reader.problems)
    return table


def _require_counts(reader: FieldReader, table: Sweep) -> None:
    """Report spans without a number of values, and more values than a file may ask for."""
    spans = {name: item for name, item in table.parameters.items() if isinstance(item, Span)}
    for name, item in spans.items():
        if item.count is None and table.samples is None:
            text = "give it a count of equally spaced values, or the sweep a number of samples"
            reader.problem(("sweep", "parameters", name), text)
    total = sum(item.count or table.samples or 1 for item in spans.values())
    if total > MOST_VARIANTS:
        text = f"{total:,} values are more than the {MOST_VARIANTS:,} of a file; sweep in Python"
        reader.problem(("sweep", "parameters"), text)
