"""When two numbers count as equal, and the factor by which one row is a multiple of another.

Formulas are compared in floating point. Their rounding errors are of the size of the terms that
they add, times 1e-16; a slip of the pen differs by the size of a term. The tolerance lies between:
1e-9 of the terms, and 1e-12 of the largest number in the row for what cancels inside a product.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from kincompile.compare.states import Array

OF_TERMS = 1e-9
OF_ROW = 1e-12
ABSOLUTE = 1e-13
ON_MANIFOLD = 1e-8
"""Relative; the states on the manifold are themselves accurate to 1e-12 only."""


def finite(array: Array) -> Array:
    """Return an array with zeros for what is not finite."""
    return np.asarray(np.where(np.isfinite(array), array, 0.0))


def tolerance(written: Array, sizes: Array, generated: Array) -> Array:
    """Return the difference that is rounding, entry by entry; arrays are (N, rows, columns).

    What is not finite does not enter it: next to infinity every number would be rounding.
    """
    terms = finite(sizes) + np.abs(finite(generated))
    largest = np.max(np.abs(finite(written)) + terms, axis=-1, keepdims=True, initial=0.0)
    return np.asarray(OF_TERMS * terms + OF_ROW * largest + ABSOLUTE)


def agrees(written: Array, sizes: Array, generated: Array) -> Array:
    """Return for every state and entry whether the two are equal; only finite numbers are."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(written - generated) <= tolerance(written, sizes, generated))


@dataclass(frozen=True, slots=True)
class Multiple:
    """How one row is a multiple of another."""

    factor: Array  # by state, shape (N,): written = factor * generated
    share: float  # share of the entries that are, 1 where the whole row is


def multiple(
    written: Array, sizes: Array, generated: Array, group: Array, may_scale: bool = True
) -> Multiple:
    """Return the factor between two rows that explains the most entries.

    A factor must be the same at all states with the same parameters. Where several explain as
    many entries, 1 is taken before -1, and these before any other.

    Parameters
    ----------
    written, sizes, generated
        Values by hand, the sizes of their terms, and generated values, shape (N, columns) each.
        A column that is NaN in `generated` belongs to the ground and is not compared.
    group
        The set of parameters of each state, shape (N,).
    """
    checked = ~np.isnan(generated).any(axis=0)
    w, s, g = (array[:, None, checked] for array in (written, sizes, generated))
    one = np.ones(len(group))
    factors = [one, -one, *_ratios(w[:, 0], g[:, 0], group)] if may_scale else [one]
    best = Multiple(one, -1.0)
    for factor in factors:
        equal = agrees(w, s, factor[:, None, None] * g)[:, 0].all(axis=0)
        share = _share(np.asarray(equal), g[:, 0])
        if share > best.share:
            best = Multiple(factor, share)
        if share == 1.0:
            break
    return best


def _share(equal: Array, generated: Array) -> float:
    """Return the share of entries that agree; zeros agree under any factor and do not count."""
    nonzero = np.any(np.abs(generated) > ABSOLUTE, axis=0)
    if equal.all():
        return 1.0
    return min(float(np.mean(equal[nonzero])), 0.999) if nonzero.any() else 0.0


def _ratios(written: Array, generated: Array, group: Array) -> list[Array]:
    if np.min(np.bincount(group)[group]) < 2:
        return []  # one state says nothing about a factor: any two numbers have one
    usable = (np.abs(generated) > ABSOLUTE) & (np.abs(written) > ABSOLUTE) & np.isfinite(written)
    columns = usable.all(axis=0)
    ratios = written[:, columns] / generated[:, columns]
    first = ratios[np.argmax(group[:, None] == group, axis=0)]
    is_one = (np.abs(ratios - first) <= OF_TERMS * np.abs(first)).all(axis=0)
    return list(first.T[is_one])
