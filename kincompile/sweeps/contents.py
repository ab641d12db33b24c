"""What a store holds, whatever its format: arrays with dimensions and units, and their origin."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kincompile.errors import InputError, memory_for, package_of_extra
from kincompile.names import escaped, listed
from kincompile.runtime.results.columns import TIME_UNIT, unit_attributes
from kincompile.sweeps.layout import PENDING, STATUS, TIME, Layout
from kincompile.sweeps.worker import digest_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.sweeps.plan import Grid, Plan
    from kincompile.sweeps.worker import Job, Writer


class Store(Protocol):
    """Results as they come."""

    def writer(self) -> Writer | None:
        """Return what a worker writes its chunks with; None where it hands its values back."""

    def take(self, number: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values that a worker has handed back."""

    def done(self) -> NDArray[np.bool_]:
        """Return which chunks are complete."""

    def read(self, number: int, name: str) -> NDArray[Any]:
        """Return the values of a chunk that is complete, of one array."""

    def to_xarray(self) -> xarray.Dataset:
        """Return the results; those of a Zarr folder are read when they are used."""


@dataclass(frozen=True, slots=True)
class Variable:
    """An array of the results: its dimensions, how long a chunk is along each, type and unit."""

    name: str
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    dtype: type
    fill: float
    unit: str


@dataclass(frozen=True)
class Form:
    """The arrays of the results, without values: so much a worker has to know."""

    grid: Grid  # their dimensions without time, in chunks
    layout: Layout  # what is kept
    times: int  # number of times

    @cached_property
    def variables(self) -> dict[str, Variable]:
        """The arrays by name, statuses last: where those are, a chunk is complete."""
        sizes = self.grid.sizes
        still = tuple(sizes), tuple(sizes.values()), self.grid.block
        moving = (*still[0], TIME), (*still[1], self.times), (*still[2], self.times)
        found = [
            Variable(x.name, *(still if x.measure else moving), np.float64, math.nan, x.unit)
            for x in self.layout.kept
        ]
        over = moving if self.layout.over_time else still
        found.append(Variable(STATUS, *over, np.int8, PENDING, ""))
        return {item.name: item for item in found}

    def region(self, number: int, name: str) -> tuple[slice, ...]:
        """Return where a chunk stands in an array."""
        region = self.grid.region(number)
        return (*region, slice(None)) if self.is_over_time(name) else region

    def is_over_time(self, name: str) -> bool:
        """Say whether an array has the dimension t."""
        return self.variables[name].dimensions[-1] == TIME

    def blocks(self, number: int, values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the values of a chunk in the shape of its part of each array, statuses last."""
        shape = self.grid.shape(number)
        return {
            name: values[name].reshape(*shape, *values[name].shape[1:]) for name in self.variables
        }

    @property
    def size(self) -> int:
        """How many bytes all arrays have."""
        arrays = self.variables.values()
        return sum(math.prod(item.shape) * np.dtype(item.dtype).itemsize for item in arrays)

    def empty(self) -> dict[str, NDArray[Any]]:
        """Return the arrays, empty."""
        return {
            item.name: np.full(item.shape, item.fill, item.dtype)
            for item in self.variables.values()
        }


@dataclass(frozen=True, eq=False)
class Contents:
    """What the results of a sweep consist of."""

    name: str  # of the mechanism
    # plan, layout: its variants, and what is kept of each
    plan: Plan
    layout: Layout
    t: Array  # (N,): the times
    units: Mapping[str, str]  # of the parameters, by name
    # What decides the numbers, each by its digest: a store with other ones is of another sweep.
    marks: Mapping[str, str]

    @cached_property
    def form(self) -> Form:
        """The arrays that chunks fill."""
        return Form(self.plan.grid, self.layout, self.t.size)

    @property
    def coordinates(self) -> dict[str, tuple[str, Array, str]]:
        """Of each coordinate of the results its dimension, values and unit."""
        axes = self.plan.axes()
        found = {
            name: (dimension, values, self.units[name])
            for name, (dimension, values) in axes.items()
        }
        return {**found, TIME: (TIME, self.t, TIME_UNIT)} if self.layout.over_time else found

    @property
    def about(self) -> dict[str, Any]:
        """The mechanism, the values of parameters that are not swept, and the marks."""
        fixed = zip(self.plan.parameters, self.plan.common.tolist(), strict=True)
        return {
            "name": self.name,
            "parameters": {name: x for name, x in fixed if name not in self.plan.sweep},
            "sweep": dict(self.marks),
        }

    def filled(self, store: Store) -> xarray.Dataset:
        """Return the results of a store, read into memory."""
        what = f"the results have {self.form.size / 1e9:,.1f} GB"
        with memory_for(what, "read the folder in parts, with Polars or DuckDB for instance"):
            arrays = self.form.empty()
        for number in np.flatnonzero(store.done()).tolist():
            for name, array in arrays.items():
                array[self.form.region(number, name)] = store.read(number, name)
        return self.dataset(arrays)

    def dataset(self, arrays: Mapping[str, Any]) -> xarray.Dataset:
        """Return arrays as a dataset with dimensions, coordinates and units."""
        with package_of_extra("xarray", "tables"):
            import xarray
        variables = {
            name: (item.dimensions, arrays[name], unit_attributes(item.unit))
            for name, item in self.form.variables.items()
        }
        coordinates = {
            name: (dimension, values, unit_attributes(unit))
            for name, (dimension, values, unit) in self.coordinates.items()
        }
        return xarray.Dataset(variables, coords=coordinates, attrs=self.about)


def marks_of(job: Job, plan: Plan, given: Array, assembly: int | None) -> dict[str, str]:
    """Return what decides the numbers of a sweep, each by its digest.

    Of the start that is the guess as it was given, or the number of the assembly: the position that
    is found from it may differ by rounding on another machine, where a sweep may go on.
    """
    sweep = [plan.common.tobytes(), str(plan.is_product).encode()]
    for name, values in plan.sweep.items():
        sweep += [name.encode(), values.tobytes()]
    parts = {
        "model": (digest_of(job.code).encode(),),
        "parameters": tuple(sweep),
        "times": (job.t.tobytes(),),
        "columns and measures": tuple(repr(item).encode() for item in job.layout.kept),
        "start": (
            given.tobytes(),
            str(assembly).encode(),
            *[b"smooth"] * (job.through == "smooth"),
        ),
        "chunk": (str(plan.most).encode(),),
    }
    return {name: _digest(*part) for name, part in parts.items()}


def _digest(*parts: bytes) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(len(part).to_bytes(8) + part)
    return found.hexdigest()[:32]


def require_same(path: Path, found: object, marks: Mapping[str, str], main: Path | None) -> None:
    """Refuse a store that has the results of another sweep, with what is different.

    `main` is the file of a sweep's folder that has the marks; None where no sweep made the folder.
    """
    shown = escaped(path)
    if not isinstance(found, dict):
        if main is not None:
            raise InputError(
                f"{escaped(main)} is damaged, and the rest does not say that {shown} holds "
                "this sweep: give another name, or remove it."
            )
        raise InputError(
            f"{shown} exists and was not written by a sweep. Give another name, or remove it."
        )
    other = [name for name, mark in marks.items() if found.get(name) != mark]
    if other:
        raise InputError(
            f"{shown} holds another sweep: {listed(other)} "
            f"{'differs' if len(other) == 1 else 'differ'}. Give another name for this one, remove "
            "that store, or resume it with the settings it was begun with."
        )
