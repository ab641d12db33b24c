"""What a sweep gives: labelled arrays, and how many of its points were found."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.html import Shown
from kincompile.names import column_name, escaped, listed, unknown
from kincompile.runtime.status import Status
from kincompile.sweeps.layout import PENDING, STATUS

if TYPE_CHECKING:
    from collections.abc import Collection

    import xarray

    from kincompile.sweeps.contents import Contents, Store


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sweep(Shown):
    """The results of a sweep; `str` says in a sentence how it went.

    Attributes
    ----------
    contents
        What there is of each variant: dimensions, units, parameters.
    store
        Where it is kept.
    where
        The folder; "" if it is in memory.
    """

    contents: Contents
    store: Store
    where: str

    def to_xarray(self) -> xarray.Dataset:
        """Return the results as an `xarray.Dataset`.

        Returns
        -------
        xarray.Dataset
            Columns over the dimensions of the sweep and t, measures over those of the sweep, and
            ``status``: over time where there are columns, else one for each motion, 0 where it was
            found throughout, -1 where it has not been solved yet. Each has its unit in
            ``.attrs["units"]``. That of a Zarr folder is read when it is used.

        Raises
        ------
        UnsupportedError
            If xarray is not installed.
        """
        return self.store.to_xarray()

    def __getitem__(self, name: str) -> Any:
        """Return a column or a measure: ``sweep["foot.x"]``, ``sweep["foot.x.stroke"]``.

        Raises
        ------
        InputError
            If nothing of this name is kept.
        """
        data = self.to_xarray()
        column, _, measure = str(name).rpartition(".")
        of_output = f"{column_name(column)}_{measure}"
        found = next((own for own in (column_name(name), of_output) if own in data), None)
        if found is None:
            text = f"the sweep of {self.contents.name} has no column {name!r}"
            raise InputError(unknown(text, str(name), [*data], "; name others to kc.sweep"))
        return data[found]

    def statuses(self) -> dict[str, int]:
        """Return how many points, or motions where no columns are kept, have each status."""
        contents, found = self.contents, Counter[int]()
        per_variant = contents.t.size if contents.layout.over_time else 1
        for number, is_done in enumerate(self.store.done().tolist()):
            if is_done:
                values, counts = np.unique(self.store.read(number, STATUS), return_counts=True)
                found.update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
            else:
                found[PENDING] += contents.plan.grid.count(number) * per_variant
        return {status_name(number): found[number] for number in sorted(found)}

    def to_text(self) -> str:
        """Return how many variants there are and how they ended."""
        plan, what = self.contents.plan, "points" if self.contents.layout.over_time else "motions"
        counts = ", ".join(f"{count:,} {name}" for name, count in self.statuses().items())
        place = f" in {escaped(self.where)}" if self.where else ""
        return (
            f"{self.contents.name}: {plan.grid.variants:,} variants x {self.contents.t.size} times"
            f"{place}; {what}: {counts}"
        )

    def headline(self) -> str:
        """Return one line, for which nothing is read."""
        names = listed(item.name for item in self.contents.layout.kept)
        return f"{self.contents.name}: {self.contents.plan.grid.sizes}, {names}"


def status_name(number: int) -> str:
    """Return the name of a status, ``PENDING`` of what has not been solved yet."""
    return "PENDING" if number == PENDING else next(x.name for x in Status if x == number)


def explained(names: Collection[str]) -> dict[str, str]:
    """Return what statuses of these names mean and what to do, of those that are no success."""
    return {x.name: x.sentence for x in Status if x.name in names and x != Status.CONVERGED}
