"""Which generated row each row written by hand is, and by what factor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment  # type: ignore[attr-defined]

from kincompile.compare.agreement import Multiple, agrees, multiple

if TYPE_CHECKING:
    from kincompile.compare.states import Array


class RowTable:
    """Every row of the hand side against every generated row.

    Parameters
    ----------
    written
        Values and sizes of the quantities that tell the rows apart, (N, rows, columns) each.
    expected
        The generated ones.
    group
        The set of parameters of each state, shape (N,).
    may_scale
        Whether a row may be a multiple of the generated one.
    """

    def __init__(
        self,
        written: list[tuple[Array, Array]],
        expected: list[Array],
        group: Array,
        may_scale: bool,
    ) -> None:
        self._written = written
        self._expected = expected
        self._group = group
        self._may_scale = may_scale

    def assigned(self) -> tuple[list[int], list[Multiple]]:
        """Return the generated row of each row, and the factor between them."""
        count = self._expected[0].shape[1]
        found = {(k, k): self._pair(k, k) for k in range(count)}
        open_rows = [k for k in range(count) if found[k, k].share < 1.0]
        cost = np.full((len(open_rows), len(open_rows)), 2.0)
        for a, row in enumerate(open_rows):
            for b, target in enumerate(open_rows):
                pair = found.setdefault((row, target), self._pair(row, target))
                # A row that is only nearly another one stays where it is.
                exact = pair.share == 1.0
                cost[a, b] = (0.0 if exact else 1.0 - 0.1 * pair.share) + 0.2 * (row != target)
        rows = list(range(count))
        for a, b in zip(*linear_sum_assignment(cost), strict=True):
            rows[open_rows[a]] = open_rows[b]
        return rows, [found[k, target] for k, target in enumerate(rows)]

    def _pair(self, row: int, target: int) -> Multiple:
        parts = [
            checked_columns(values[:, row], sizes[:, row], expected[:, target])
            for (values, sizes), expected in zip(self._written, self._expected, strict=True)
        ]
        if not self._may_scale:
            return self._unscaled(parts)
        whole = multiple(*_joined(parts), self._group)
        if whole.share == 1.0 or len(parts) == 1:
            return whole
        # Phi defines the constraint: the factor of a right Phi is the one Phi_q must have.
        of_phi = multiple(*parts[-1], self._group)
        return Multiple(of_phi.factor, whole.share) if of_phi.share == 1.0 else whole

    def _unscaled(self, parts: list[tuple[Array, Array, Array]]) -> Multiple:
        values, sizes, expected = _joined(parts)
        equal = agrees(values[:, None], sizes[:, None], expected[:, None]).all(axis=(0, 1))
        return Multiple(np.ones(len(self._group)), 1.0 if equal.all() else 0.0)


def _joined(parts: list[tuple[Array, Array, Array]]) -> tuple[Array, Array, Array]:
    values, sizes, expected = (np.concatenate(item, axis=-1) for item in zip(*parts, strict=True))
    return values, sizes, expected


def checked_columns(values: Array, sizes: Array, expected: Array) -> tuple[Array, Array, Array]:
    """Leave out the columns of the ground."""
    checked = ~np.isnan(expected).any(axis=0)
    return values[:, checked], sizes[:, checked], expected[:, checked]
