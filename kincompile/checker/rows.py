"""The generated row that each row written by hand is, and the factor between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment  # type: ignore[attr-defined]

from kincompile.checker.agreement import Multiple, joined, multiple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.checker.agreement import Given, Right
    from kincompile.checker.states import Array


def match_rows(
    written: Sequence[Given],
    expected: Sequence[Right],
    group: Array,
    may_scale: bool,
) -> tuple[list[int], list[Multiple]]:
    """Return the generated row of each row, and the factor between them.

    Parameters
    ----------
    written
        The quantities that distinguish the rows, (N, rows, columns) each.
    expected
        The generated ones; Phi last.
    group
        The set of parameters of each state, shape (N,).
    """

    def pair(row: int, target: int) -> Multiple:
        """Return the factor between two rows."""
        given = [item[:, row] for item in written]
        right = [item[:, target] for item in expected]
        whole = multiple(joined(given), joined(right), group, may_scale)
        if whole.share == 1.0 or len(given) == 1:
            return whole
        # Phi defines the constraint: the factor of a right Phi is the one Phi_q must have.
        of_phi = multiple(given[-1], right[-1], group, may_scale)
        return Multiple(of_phi.factor, whole.share) if of_phi.share == 1.0 else whole

    rows = list(range(expected[0].values.shape[1]))
    found = {(k, k): pair(k, k) for k in rows}
    unmatched = [k for k in rows if found[k, k].share < 1.0]
    cost = np.full((len(unmatched), len(unmatched)), 2.0)
    for a, row in enumerate(unmatched):
        for b, target in enumerate(unmatched):
            share = found.setdefault((row, target), pair(row, target)).share
            # A row that is only nearly another one stays in its place.
            cost[a, b] = (0.0 if share == 1.0 else 1.0 - 0.1 * share) + 0.2 * (row != target)
    for a, b in zip(*linear_sum_assignment(cost), strict=True):
        rows[unmatched[a]] = unmatched[b]
    return rows, [found[k, target] for k, target in enumerate(rows)]
