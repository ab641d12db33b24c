"""A motion as a table: coordinates and rates over time, by name and with units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError, package_of_extra
from kincompile.names import rate, rate_of, rate_unit
from kincompile.runtime.engine.code import column_meant
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    import pandas as pd
    import xarray
    from numpy.typing import NDArray

    from kincompile.runtime.singular.events import Event

TIME_UNIT = "s"
"""Unit of t, in which every driver and every rate is written."""

ANGLE_UNITS = {"rad": 1.0, "deg": 180 / np.pi}
"""What angles are shown in, with the factor from radians."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A coordinate, its rate or its second rate over time.

    Attributes
    ----------
    name, unit
        As in ``phi_rod_dot`` and ``rad/s``; the unit is "" where there is none.
    values : ndarray, shape (N,)
        The numbers, of variants shape (B, N).
    """

    name: str
    unit: str
    values: NDArray[np.float64]

    def shown(self, angle_unit: str) -> Column:
        """Return the column as it is shown: in degrees, where angles are and it is one."""
        unit, factor = shown_unit(self.unit, angle_unit)
        return self if factor == 1 else Column(self.name, unit, self.values * factor)

    @property
    def title(self) -> str:
        """Name and unit, for instance ``x_rod [m]``."""
        return titled(self.name, self.unit)


def shown_unit(unit: str, angle_unit: str) -> tuple[str, float]:
    """Return the unit in which numbers are shown, and the factor to it from their own.

    Angles and their rates are shown in `angle_unit`, ``"rad"`` or ``"deg"``; all else stays.
    """
    if angle_unit not in ANGLE_UNITS:
        raise InputError(f"angle_unit is {angle_unit!r}: angles are shown in 'rad' or in 'deg'.")
    name, slash, per = unit.partition("/")
    if name != "rad":
        return unit, 1.0
    return f"{angle_unit}{slash}{per}", ANGLE_UNITS[angle_unit]


def titled(name: str, unit: str) -> str:
    """Return a name with its unit in brackets, if there is one."""
    return f"{name} [{unit}]" if unit else name


def largest(values: NDArray[np.float64]) -> float:
    """Return the largest size of finite values; NaN without any."""
    found = np.abs(values[np.isfinite(values)])
    return float(found.max()) if found.size else np.nan


def unit_attributes(unit: str) -> dict[str, str]:
    """Return the attributes of an array with a unit."""
    return {"units": unit} if unit else {}


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """Outputs and their rates over a time grid of N points.

    Attributes
    ----------
    names
        Names of the k outputs.
    units
        Unit of each, by name.
    y, y_dot, y_ddot : ndarray, shape (N, k)
        Values and time derivatives; NaN where the motion was not found, or where a derivative would
        need the third one of q. Of B variants they have a leading axis of length B.
    without_rates
        Names of those of which no rate is shown, as of forces.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    y: NDArray[np.float64]
    y_dot: NDArray[np.float64]
    y_ddot: NDArray[np.float64]
    without_rates: frozenset[str] = frozenset()

    def joined(
        self, names: tuple[str, ...], units: dict[str, str], values: NDArray[np.float64]
    ) -> Observed:
        """Return these outputs and further ones, (..., N, k), which have no rates."""
        nothing = np.broadcast_to(np.nan, values.shape)
        y, y_dot, y_ddot = values, nothing, nothing
        if self.names:
            y = np.concatenate((self.y, values), axis=-1)
            y_dot = np.concatenate((self.y_dot, nothing), axis=-1)
            y_ddot = np.concatenate((self.y_ddot, nothing), axis=-1)
        known, still = {**self.units, **units}, self.without_rates | frozenset(names)
        return Observed((*self.names, *names), known, y, y_dot, y_ddot, still)

    def column(self, name: str, order: int) -> Column:
        """Return an output, its rate or its second rate."""
        values = (self.y, self.y_dot, self.y_ddot)[order][..., self.names.index(name)]
        return Column(rate(name, order), rate_unit(self.units[name], order), values)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MotionTable:
    """The part of a solution that tables, files and plots show; `Solution` has the attributes."""

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    q_dot: NDArray[np.float64]
    q_ddot: NDArray[np.float64]
    status: NDArray[np.int64]
    residual: NDArray[np.float64]
    name: str
    message: str
    coordinates: tuple[str, ...]
    units: dict[str, str]
    events: list[Event]
    parameters: dict[str, Any]
    sweep: dict[str, NDArray[np.float64]]

    @property
    def observed(self) -> Observed:
        """The outputs over the motion."""
        raise NotImplementedError

    @property
    def joints(self) -> Observed:
        """The points of joints over the motion."""
        raise NotImplementedError

    @property
    def p(self) -> NDArray[np.float64]:
        """The parameters in the order of the mechanism, shape (k,), of variants (B, k)."""
        values = np.array(list(self.parameters.values()), dtype=np.float64)
        return values.reshape(len(self.parameters), *self.q.shape[:-2]).T

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all that has a column: the coordinates, then the outputs."""
        return (*self.coordinates, *self.observed.names)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the values of a coordinate or output, its rate or second rate, shape (N,).

        Raises
        ------
        InputError
            When no column has this name; the message lists those that exist.
        """
        return self.column(name).values

    def column(self, name: str) -> Column:
        """Return a coordinate or output, its rate or its second rate: name, unit and values.

        Raises
        ------
        InputError
            When no column has this name; the message lists those that exist.
        """
        outputs = self.observed.names
        try:
            return self._column(*column_meant(self.name, name, self.coordinates, outputs))
        except InputError:
            # Points of joints are compiled on request, so they come last.
            is_asked = str(name).startswith(("x_", "y_", "z_")) or "." in str(name)
            found = rate_of(name, self.joints.names) if is_asked else None
            if found is None:
                raise
        return self.joints.column(*found)

    def columns(self) -> list[Column]:
        """Return the coordinates and outputs, then their rates, then their second rates."""
        names, still = self.names, self.observed.without_rates
        moving = [name for name in names if name not in still]
        return [
            self._column(name, order) for order in range(3) for name in (moving if order else names)
        ]

    def _column(self, name: str, order: int) -> Column:
        if name not in self.coordinates:
            return self.observed.column(name, order)
        values = (self.q, self.q_dot, self.q_ddot)[order][..., self.coordinates.index(name)]
        return Column(rate(name, order), rate_unit(self.units.get(name, ""), order), values)

    @property
    def variants(self) -> dict[str, NDArray[Any]]:
        """What the variants differ in, shape (B,): the parameters by name, or their numbers."""
        apart = [name for name, values in self.parameters.items() if np.ptp(values) > 0]
        names = list(self.sweep) or apart
        return {name: self.parameters[name] for name in names} or {
            "variant": np.arange(len(self.q))
        }

    def to_pandas(self, angle_unit: str = "rad") -> pd.DataFrame:
        """Return the motion as a `pandas.DataFrame`, a row a time; angles in `angle_unit`.

        Returns
        -------
        pandas.DataFrame
            Index t, of variants the parameters in which they differ, and t; a column for each
            coordinate, rate and second rate, then status and residual.
            ``.attrs["units"]`` has the units by column.

        Raises
        ------
        UnsupportedError
            If pandas is not installed.
        """
        with package_of_extra("pandas", "tables"):
            import pandas as pd
        columns = [item.shown(angle_unit) for item in self.columns()]
        data: dict[str, NDArray[Any]] = {item.name: item.values.ravel() for item in columns}
        data |= {"status": self.status.ravel(), "residual": self.residual.ravel()}
        index: Any = pd.Index(self.t, name="t")
        if self.q.ndim > 2:
            axes = {name: np.repeat(axis, self.t.size) for name, axis in self.variants.items()}
            times = np.tile(self.t, len(self.q))
            index = pd.MultiIndex.from_arrays([*axes.values(), times], names=[*axes, "t"])
        frame = pd.DataFrame(data, index=index)
        frame.attrs["units"] = {"t": TIME_UNIT, **{item.name: item.unit for item in columns}}
        return frame

    def to_xarray(self, angle_unit: str = "rad") -> xarray.Dataset:
        """Return the motion as an `xarray.Dataset`; angles in `angle_unit`, ``"rad"`` or ``"deg"``.

        Returns
        -------
        xarray.Dataset
            A variable for each coordinate, rate and second rate, status and residual, over the
            dimension t. Of variants, a parameter with an array of values is a dimension of its
            name; where several were taken in pairs the dimension is variant, and each is a
            coordinate along it. Each has its unit in ``.attrs["units"]``.

        Raises
        ------
        UnsupportedError
            If xarray is not installed.
        """
        with package_of_extra("xarray", "tables"):
            import xarray
        axes = self._axes()
        dimensions = (*dict.fromkeys(dimension for dimension, _ in axes.values()), "t")
        sizes = {dimension: values.size for dimension, values in axes.values()}
        shape = (*sizes.values(), self.t.size)
        variables: dict[str, Any] = {
            item.name: (dimensions, item.values.reshape(shape), unit_attributes(item.unit))
            for item in (column.shown(angle_unit) for column in self.columns())
        }
        for name in ("status", "residual"):
            variables[name] = (dimensions, getattr(self, name).reshape(shape))
        coords: dict[str, Any] = {
            name: (dimension, values, unit_attributes(self.units.get(name, "")))
            for name, (dimension, values) in axes.items()
        }
        coords["t"] = ("t", self.t, unit_attributes(TIME_UNIT))
        about = {"name": self.name, "message": self.message}
        return xarray.Dataset(variables, coords=coords, attrs=about)

    def _axes(self) -> dict[str, tuple[str, NDArray[Any]]]:
        """Return what the variants differ in: by name the dimension, and the values along it."""
        if self.q.ndim == 2:
            return {}
        if self.sweep and len(self.q) == math.prod(values.size for values in self.sweep.values()):
            return {name: (name, values) for name, values in self.sweep.items()}
        return {name: ("variant", values) for name, values in self.variants.items()}

    @property
    def good(self) -> NDArray[np.bool_]:
        """Where position and velocity were found, shape (N,): at corners of drivers too."""
        return np.asarray((self.status == Status.CONVERGED) | (self.status == Status.CORNER))

    def require_one_motion(self, what: str, remedy: str) -> None:
        """Refuse variants, where `what` is asked for, as ``"a table holds"``; say what to do."""
        if self.q.ndim > 2:
            raise InputError(
                f"{self.name}: {what} one motion, and these are {len(self.q)} variants; {remedy}"
            )
