"""A solution as a table of pandas, and as labelled arrays of xarray, where those are installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.errors import InputError, missing_package
from kincompile.names import column_name, listed, rate, suggestion

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from kincompile.runtime.singular.events import Event

TIME_UNIT = "s"
"""Unit of t, which every driver and every rate is written in."""


def rate_unit(unit: str, order: int) -> str:
    """Return the unit of a time derivative: of m, m/s and m/s^2; of none, none."""
    return f"{unit}{('', '/s', '/s^2')[order]}" if unit else ""


class LabelledViews:
    """Columns of a solution by name, with units, for other tools."""

    __slots__ = ()

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

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Give the column of a coordinate, its rate or its second rate, shape (N,).

        Raises
        ------
        InputError
            When no column has this name; the message lists those that exist.
        """
        wanted = column_name(str(column))
        for order, values in enumerate((self.q, self.q_dot, self.q_ddot)):
            names = columns(self.coordinates, order)
            if wanted in names:
                return values[..., names.index(wanted)]
        known = [name for order in range(3) for name in columns(self.coordinates, order)]
        near = suggestion(wanted, known) or "."
        raise InputError(
            f"{self.name} has no column {column!r}{near} The coordinates are "
            f"{listed(self.coordinates)}; add _dot or _ddot for the rates."
        )

    def labelled_columns(self) -> dict[str, tuple[str, NDArray[np.float64]]]:
        """Return unit and values of each coordinate, then of the rates, then of the second rates.

        Returns
        -------
        dict
            ``(unit, values)`` by name, values of shape (N,), of variants (B, N).
        """
        found = {}
        for order, values in enumerate((self.q, self.q_dot, self.q_ddot)):
            for k, name in enumerate(self.coordinates):
                unit = rate_unit(self.units.get(name, ""), order)
                found[rate(name, order) if order else name] = unit, values[..., k]
        return found

    def to_pandas(self) -> Any:
        """Return the motion as a `pandas.DataFrame`, a row a time.

        Returns
        -------
        pandas.DataFrame
            Index t; a column for each coordinate, rate and second rate, then status and residual.
            ``.attrs["units"]`` has the units by column.

        Raises
        ------
        UnsupportedError
            If pandas is not installed.
        InputError
            If the solution is one of variants, which a table cannot hold.
        """
        try:
            import pandas as pd
        except ImportError:
            raise missing_package("pandas", "tables") from None
        if self.q.ndim > 2:
            raise InputError(
                f"{self.name}: a table holds one motion, and these are {len(self.q)} variants; use "
                "to_xarray()"
            )
        columns = self.labelled_columns()
        data: Mapping[str, Any] = {
            **{name: values for name, (_, values) in columns.items()},
            "status": self.status,
            "residual": self.residual,
        }
        frame = pd.DataFrame(data, index=pd.Index(self.t, name="t"))
        frame.attrs["units"] = {
            "t": TIME_UNIT,
            **{name: unit for name, (unit, _) in columns.items()},
        }
        return frame

    def to_xarray(self) -> Any:
        """Return the motion as an `xarray.Dataset`.

        Returns
        -------
        xarray.Dataset
            A variable for each coordinate, rate and second rate, status and residual, over the
            dimension t, of variants over variant and t. Each has its unit in ``.attrs["units"]``.

        Raises
        ------
        UnsupportedError
            If xarray is not installed.
        """
        try:
            import xarray
        except ImportError:
            raise missing_package("xarray", "tables") from None
        dimensions = ("variant", "t") if self.q.ndim > 2 else ("t",)
        variables: dict[str, Any] = {
            name: (dimensions, values, {"units": unit} if unit else {})
            for name, (unit, values) in self.labelled_columns().items()
        }
        variables["status"] = dimensions, self.status
        variables["residual"] = dimensions, self.residual
        times = {"t": ("t", self.t, {"units": TIME_UNIT})}
        about = {"name": self.name, "message": self.message}
        return xarray.Dataset(variables, coords=times, attrs=about)


def columns(coordinates: tuple[str, ...], order: int) -> tuple[str, ...]:
    """Give the names of q, q_dot or q_ddot, for `order` 0, 1 or 2."""
    return coordinates if order == 0 else tuple(rate(name, order) for name in coordinates)
