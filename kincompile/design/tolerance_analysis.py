"""The result of `kc.tolerance`: bands over time, contributions, tables and plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError, package_of_extra
from kincompile.html import Shown, table_html
from kincompile.names import column_name, listed, unknown
from kincompile.report.plot import Layer, coloured, plot_svg
from kincompile.runtime.results.columns import titled
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

THREE_SIGMA = (0.00135, 0.99865)
"""Parts of a normal distribution below and above which lies what is beyond three sigma."""

TITLES = ("from", "sensitivity", "least", "greatest", "mean shift", "worst %", "RSS %")


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Motions of B samples that were solved exactly."""

    values: Array  # (B, N, columns): of each column over time
    parameters: dict[str, Array]  # value of each parameter in each sample, shape (B,)
    failed: int  # samples whose mechanism did not move through all times; they are left out


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToleranceAnalysis(Shown):
    """Deviations of r columns over N times, caused by k sources: tolerances and clearances.

    Attributes
    ----------
    name
        Name of the mechanism.
    t : ndarray, shape (N,)
        Time.
    columns, units
        Names of the columns, and the unit of each.
    sources
        Names of the parameters, and ``"clearance of B"`` of joints.
    nominal : ndarray, shape (N, r)
        Values without deviations.
    slope : ndarray, shape (N, r, k)
        Derivatives of the columns by the sources; of a clearance the greatest over directions.
    low, high : ndarray, shape (N, r, k)
        Least and greatest effect of each source alone, to first order.
    mean, sigma : ndarray, shape (N, r, k)
        Mean and standard deviation of its effect, to first order.
    shift : ndarray, shape (N, r, k)
        What is added to the mean by second derivatives, which are exact too; those by two sources
        count half for each. NaN where Phi_q is nearly singular.
    drawn : Drawn or None
        What Monte Carlo gave.
    motion : Solution
        The nominal motion.
    """

    name: str
    t: Array
    columns: tuple[str, ...]
    units: dict[str, str]
    sources: tuple[str, ...]
    nominal: Array
    slope: Array
    low: Array
    high: Array
    mean: Array
    sigma: Array
    shift: Array
    drawn: Drawn | None
    motion: Solution

    def worst(self, column: str) -> tuple[Array, Array]:
        """Return the least and the greatest deviation of a column, shape (N,): the worst case."""
        k = self._place(column)
        return self.low[:, k].sum(axis=-1), self.high[:, k].sum(axis=-1)

    def rss(self, column: str) -> tuple[Array, Array]:
        """Return the mean deviation and the standard deviation, shape (N,): root sum of squares."""
        k = self._place(column)
        return self.mean[:, k].sum(axis=-1), np.linalg.norm(self.sigma[:, k], axis=-1)

    def mean_shift(self, column: str) -> Array:
        """Return what second derivatives add to the mean deviation, shape (N,)."""
        found: Array = self.shift[:, self._place(column)].sum(axis=-1)
        return found

    def contributions(self, column: str) -> Array:
        """Return the part of each source in the variance [per cent], shape (N, k)."""
        return _parts(self.sigma[:, self._place(column)] ** 2)

    def samples(self, column: str) -> Array:
        """Return the deviations of the samples, shape (B, N).

        Raises
        ------
        InputError
            If there was no Monte Carlo, or no sample could be solved.
        """
        k = self._place(column)
        if self.drawn is None:
            raise InputError(f"{self.name} was analysed without samples: give samples=1024.")
        if not len(self.drawn.values):
            raise InputError(
                f"none of the {self.drawn.failed} samples of {self.name} moves through all times. "
                "Give smaller tolerances."
            )
        found: Array = self.drawn.values[..., k] - self.nominal[:, k]
        return found

    def quantiles(self, column: str, parts: tuple[float, ...] = THREE_SIGMA) -> Array:
        """Return the deviations below which these parts of the samples lie, shape (parts, N)."""
        found: Array = np.quantile(self.samples(column), parts, axis=0)
        return found

    def widest(self, column: str) -> int:
        """Return the number of the time at which the column deviates most."""
        low, high = self.worst(column)
        return int(np.nanargmax(high - low))

    def _place(self, name: str) -> int:
        wanted = column_name(str(name))
        if wanted in self.columns:
            return self.columns.index(wanted)
        text = f"the tolerances of {self.name} have no column {name!r}"
        raise InputError(unknown(text, wanted, self.columns, "; ask kc.tolerance for others"))

    def headline(self) -> str:
        """Return the name and the sources."""
        return (
            f"{self.name}: tolerances of {listed(self.sources)} at {counted(self.t.size, 'time')}"
        )

    def to_text(self) -> str:
        """Return a table a column, at the time at which it deviates most."""
        lines = [self.headline()]
        if self.drawn is not None and self.drawn.failed:
            lines.append(
                f"{counted(self.drawn.failed, 'sample')} did not move through all times and "
                "were left out."
            )
        for column in self.columns:
            at = self.widest(column)
            lines += ["", *self.summary(column, at)]
            lines += indented(table(TITLES, self.rows(column, at), right=TITLES[1:]))
        return "\n".join(lines)

    def summary(self, column: str, at: int) -> list[str]:
        """Return what all sources together do at a time, in lines."""
        unit = f" {self.units[column]}".rstrip()
        value = self.nominal[at, self._place(column)]
        low, high = (limit[at] for limit in self.worst(column))
        mean, sigma = (part[at] for part in self.rss(column))
        lines = [
            f"{column} = {value:.6g}{unit} at t = {self.t[at]:.6g}",
            f"  worst case {low:+.4g} to {high:+.4g}{unit}",
            f"  RSS {mean - 3 * sigma:+.4g} to {mean + 3 * sigma:+.4g}{unit} (three sigma)",
            f"  mean shifted by {self.mean_shift(column)[at]:+.3g}{unit} (second order)",
        ]
        if self.drawn is not None and len(self.drawn.values):
            least, greatest = self.quantiles(column)[:, at]
            count = len(self.drawn.values)
            own = self.samples(column)[:, at]
            lines.append(
                f"  Monte Carlo {least:+.4g} to {greatest:+.4g}{unit} (99.73 % of {count} "
                f"samples), mean {own.mean():+.3g}, sigma {own.std():.4g}"
            )
        return lines

    def rows(self, column: str, at: int) -> list[tuple[str, ...]]:
        """Return what each source does to a column at a time, the greatest part first."""
        k = self._place(column)
        low, high, slope = self.low[at, k], self.high[at, k], self.slope[at, k]
        shift = self.shift[at, k]
        worst, spread = _parts(high - low), self.contributions(column)[at]
        return [
            (
                self.sources[j], f"{slope[j]:.5g}", f"{low[j]:+.4g}", f"{high[j]:+.4g}",
                f"{shift[j]:+.2g}", f"{worst[j]:.1f}", f"{spread[j]:.1f}",
            )
            for j in np.argsort(-spread, kind="stable").tolist()
        ]  # fmt: skip

    def plot(self, column: str, ax: Axes | None = None) -> Axes:
        """Draw a column over time with its bands: worst case, RSS, and of samples 99.73 %.

        Raises
        ------
        InputError
            When there is no such column.
        UnsupportedError
            If matplotlib is not installed.
        """
        self._place(column)
        ax = ax or _new_axes()
        self._draw_bands(ax, column)
        return ax

    def _draw_bands(self, ax: Axes, column: str) -> None:
        """Draw deviations over time; beside the nominal value they would be thinner than a line."""
        name, (mean, sigma) = column_name(column), self.rss(column)
        ax.fill_between(self.t, *self.worst(column), color="0.88", label="worst case")
        limits = mean - 3 * sigma, mean + 3 * sigma
        ax.fill_between(self.t, *limits, color="C0", alpha=0.35, label="RSS, three sigma")
        if self.drawn is not None and len(self.drawn.values):
            for limit, label in zip(
                self.quantiles(column), ("99.73 % of samples", "_"), strict=True
            ):
                ax.plot(self.t, limit, color="C1", linestyle="--", linewidth=1, label=label)
        ax.axhline(0.0, color="0.3", linewidth=0.8)
        ax.set_xlabel("t [s]")
        ax.set_ylabel(titled(f"deviation of {name}", self.units[name]))
        ax.margins(x=0)
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small")

    def tornado(self, column: str, t: float | None = None, ax: Axes | None = None) -> Axes:
        """Draw the effect of each source on a column as a bar, the greatest on top.

        Parameters
        ----------
        column
            Its name.
        t
            The time, the nearest that was solved; without, that at which it deviates most.
        ax
            Where to draw; without, a new figure.

        Raises
        ------
        InputError
            When there is no such column.
        UnsupportedError
            If matplotlib is not installed.
        """
        self._place(column)
        ax = ax or _new_axes()
        at = self.widest(column) if t is None else int(np.argmin(np.abs(self.t - t)))
        self._draw_tornado(ax, column, at)
        return ax

    def _draw_tornado(self, ax: Axes, column: str, at: int) -> None:
        name, k = column_name(column), self._place(column)
        low, high = self.low[at, k], self.high[at, k]
        order = np.argsort(high - low, kind="stable")
        parts = self.contributions(column)[at]
        for row, j in enumerate(order.tolist()):
            ax.barh(row, high[j], color="C0")
            ax.barh(row, low[j], color="C3")
            text = f" {parts[j]:.1f} %"
            ax.text(high[j], row, text, va="center", fontsize="small")
        ax.axvline(0.0, color="0.3", linewidth=0.8)
        ax.set_yticks(range(len(order)), [self.sources[j] for j in order.tolist()])
        ax.margins(x=0.18)
        ax.locator_params(axis="x", nbins=5)
        ax.set_xlabel(titled(f"deviation of {name}", self.units[name]))
        ax.set_title(f"{name} at t = {self.t[at]:.4g}; per cent of the variance", fontsize="medium")
        ax.grid(axis="x", alpha=0.3)

    def to_html(self) -> str:
        """Return tables and plots, as a part of a page."""
        parts = []
        for column in self.columns:
            at = self.widest(column)
            title = "; ".join(line.strip() for line in self.summary(column, at))
            parts.append(table_html(column, title, TITLES, self.rows(column, at)))
            parts.append(coloured(self.plots_svg(column)))
        return "\n".join(parts)

    def plots_svg(self, column: str) -> str:
        """Return the bands of a column over time, and the bars of its sources, as SVG."""
        return f"{self._bands_svg(column)}\n{self._tornado_svg(column)}"

    def _bands_svg(self, column: str) -> str:
        """Return the plot of deviations over time: worst case, RSS, and of samples 99.73 %."""
        (low, high), (mean, sigma) = self.worst(column), self.rss(column)
        layers = [
            Layer("band", self.t, low, high, "var(--quiet)", "worst case"),
            Layer("band", self.t, mean - 3 * sigma, mean + 3 * sigma, name="RSS"),
        ]
        if self.drawn is not None and len(self.drawn.values):
            least, most = self.quantiles(column)
            colour = "var(--numeric)"
            layers += [Layer("line", self.t, least, None, colour, "samples")]
            layers += [Layer("line", self.t, most, None, colour)]
        title = titled(f"deviation of {column}", self.units[column])
        return plot_svg(f"{title} over time", "t [s]", title, layers)

    def _tornado_svg(self, column: str) -> str:
        """Return the effect of each source as a bar, the greatest on top, when it deviates most."""
        at, k = self.widest(column), self._place(column)
        low, high = self.low[at, k], self.high[at, k]
        order = np.argsort(high - low, kind="stable").tolist()
        layers = [
            Layer("band", np.array([low[j], high[j]]), np.full(2, row - 0.4), np.full(2, row + 0.4))
            for row, j in enumerate(order)
        ]
        parts = self.contributions(column)[at]
        names = [f"{self.sources[j]} {parts[j]:.1f} %" for j in order]
        title = f"{column} at t = {self.t[at]:.4g} s; per cent of the variance"
        across = titled(f"deviation of {column}", self.units[column])
        return plot_svg(title, across, title, layers, rows=names)

    def _repr_html_(self) -> str:
        return self.to_html()


def _new_axes() -> Axes:
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import pyplot as plt
    return plt.figure(layout="constrained").subplots()


def _parts(values: Array) -> Array:
    """Return parts of the sum over the last axis [per cent]; zero where that is zero."""
    total = values.sum(axis=-1, keepdims=True)
    found: Array = 100 * np.divide(values, total, out=np.zeros_like(values), where=total > 0)
    return found
