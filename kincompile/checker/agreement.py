"""When two numbers count as equal, and the factor by which one row is a multiple of another.

Formulas are compared in floating point. Their rounding errors are of the size of the terms that
they add, times 1e-16; a slip of the pen differs by the size of a term. The tolerance lies between:
1e-9 of the terms, and 1e-12 of the row for what cancels inside a product.

The terms and the rounded numbers are the author's, and may be made as large as one likes. So what
they add to the tolerance is bounded by the size of the derived entry. Where rounding may have taken
more than that, a difference says nothing: the entry cannot be decided.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kincompile.checker.states import Array

OF_TERMS = 1e-9
OF_ROW = 1e-12
ABSOLUTE = 1e-13
ON_MANIFOLD = 1e-8
"""Relative; the states on the manifold are themselves accurate to 1e-12 only."""
CLOSE = 1e-8
"""Relative; wider than for equality, so that the fault named is not missed by rounding."""
ROUNDING = 1e-14
"""What rounding may take from a sum, of the size of its terms."""
MOST_OF_TERMS = 1e-6
"""Of the scale of an entry: by how much large terms may loosen the tolerance."""
MOST_OF_NUMBERS = 1e-2
"""Of the scale of an entry: by how much printed values may loosen it; more decides nothing."""
MOST_OF_FORMULA = 5e-3
"""Of the entry itself: what rounded numbers in a formula may lose, ten with four digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """Values by hand with what is known of their errors; arrays of one shape, (N, ...).

    Attributes
    ----------
    values, sizes
        The values, and the sizes of their terms.
    typed
        What may be lost where numbers in a formula are rounded.
    printed
        What may be lost where values were printed with few decimals.
    relative
        Accuracy relative to the scale of an entry: of differences and of single precision.
    """

    values: Array
    sizes: Array
    typed: Array
    printed: Array
    relative: Array

    def __getitem__(self, place: Any) -> Given:
        """Return some of the entries."""
        return Given(*(getattr(self, item.name)[place] for item in fields(self)))

    @property
    def exact(self) -> Given:
        """The same values as if nothing were rounded."""
        none = np.zeros_like(self.sizes)
        return replace(self, typed=none, printed=none, relative=none)


@dataclass(frozen=True, slots=True, eq=False)
class Right:
    """The right values, (N, rows, columns); a column that is NaN is the ground's, not compared.

    Attributes
    ----------
    values
        The derived values.
    scale
        What the row of each contributes to it in the mechanism's scales.
    floor
        What rounding may take from both, the more the farther away the mechanism stands.
    """

    values: Array
    scale: Array
    floor: Array

    def __getitem__(self, place: Any) -> Right:
        """Return some of the entries."""
        return self.each(lambda array: array[place])

    def each(self, change: Callable[[Array], Array]) -> Right:
        """Return what a change of the arrays makes of it."""
        return Right(change(self.values), change(self.scale), change(self.floor))

    def rounded(self, rows: Sequence[int], sizes: Array) -> Right:
        """Return it with a floor of rounding for rows that follow from the author's formulas."""
        floor = self.floor.copy()
        floor[:, rows] += np.minimum(ROUNDING * finite(sizes), MOST_OF_TERMS * self.scale[:, rows])
        return replace(self, floor=floor)

    def times(self, factor: Array | float) -> Right:
        """Return multiples."""
        size = np.abs(factor)
        return Right(self.values * factor, self.scale * size, self.floor * size)


Kind = TypeVar("Kind", Given, Right)


def joined(parts: Sequence[Kind]) -> Kind:
    """Return rows that stand side by side."""
    kind = type(parts[0])
    return kind(
        *(
            np.concatenate([getattr(part, item.name) for part in parts], axis=-1)
            for item in fields(kind)
        )
    )


def finite(array: Array) -> Array:
    """Return an array with zeros for what is not finite."""
    return np.asarray(np.where(np.isfinite(array), array, 0.0))


def positive(scale: Array) -> Array:
    """Return scales by row, (N, rows, 1), with the largest in the place of zeros, or 1."""
    scale = np.where(scale > 0, scale, np.max(scale, axis=1, keepdims=True))
    return np.where(scale > 0, scale, 1.0)


def tolerance(given: Given, right: Right) -> Array:
    """Return the difference that is rounding, entry by entry; states are the first axis.

    What is not finite does not enter it: next to infinity every number would be rounding.
    """
    size, scale = np.abs(finite(right.values)), finite(right.scale)
    terms = np.minimum(OF_TERMS * (finite(given.sizes) + size), MOST_OF_TERMS * scale)
    largest = np.max(np.minimum(np.max(size, axis=0, initial=0.0), scale), axis=0, initial=0.0)
    typed = finite(given.typed)
    # Numbers that lose more than that are not the rounded numbers of a formula.
    typed = np.where(np.max(typed, axis=0, initial=0.0) <= MOST_OF_FORMULA * largest, typed, 0.0)
    printed = np.minimum(finite(given.printed), MOST_OF_NUMBERS * scale)
    lost = typed + printed + finite(given.relative) * scale
    return np.asarray(terms + lost + finite(right.floor))


def agrees(given: Given, right: Right) -> Array:
    """Return for every state and entry whether the two are equal; only finite numbers are."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(given.values - right.values) <= tolerance(given, right))


def is_undecided(given: Given, right: Right) -> Array:
    """Return for every state and entry whether rounding may hide a mistake, or be all that differs.

    It does where it may be as large as a share of the entry that a mistake would have.
    """
    lost = ROUNDING * finite(given.sizes) + finite(given.typed) + finite(given.printed)
    with np.errstate(invalid="ignore"):
        is_lost = np.abs(given.values - right.values) <= lost
    return np.asarray(is_lost | (lost > MOST_OF_NUMBERS * finite(right.scale)))


def is_alike(one: Array, other: Array, sizes: Array | float = 0.0) -> Array:
    """Return for every state and entry whether two derived values are equal, (N, ..., columns).

    `sizes` are those of their terms, where they are larger than the values.
    """
    size = finite(np.abs(one)) + 2 * finite(np.abs(other)) + finite(np.asarray(sizes))
    largest = np.max(size, axis=-1, keepdims=True, initial=0.0)
    with np.errstate(invalid="ignore"):
        off = np.abs(one - other)
        return np.asarray(off <= OF_TERMS * size + OF_ROW * largest + ABSOLUTE)


def is_close(one: Array, other: Array, lost: Array | float = 0.0) -> bool:
    """Return whether the numbers of an entry, (N,), are those of a fault."""
    return bool(are_close(one, other, lost))


def are_close(one: Array, other: Array, lost: Array | float = 0.0) -> Array:
    """Return which numbers of entries, (N, ...), are those of a fault."""
    size = np.maximum(np.max(np.abs(one), axis=0), np.max(np.abs(other), axis=0))
    with np.errstate(invalid="ignore"):
        close = np.all(np.abs(one - other) <= CLOSE * size + ABSOLUTE + lost, axis=0)
    return np.asarray(close & np.isfinite(size))


@dataclass(frozen=True, slots=True)
class Multiple:
    """How one row is a multiple of another."""

    factor: Array  # by state, shape (N,): written = factor * generated
    share: float  # share of the entries that are, 1 where the whole row is


def multiple(given: Given, right: Right, group: Array, may_scale: bool = True) -> Multiple:
    """Return the factor between two rows that explains the most entries.

    A factor must be the same at all states with the same parameters. Where several explain as
    many entries, 1 is taken before -1, and these before any other.

    Parameters
    ----------
    given, right
        The two rows, shape (N, columns).
    group
        The set of parameters of each state, shape (N,).
    """
    checked = ~np.isnan(right.values).any(axis=0)
    w, g = given[:, checked], right[:, checked]
    one = np.ones(len(group))
    factors = [one, -one, *_ratios(w.values, g.values, group)] if may_scale else [one]
    best = Multiple(one, -1.0)
    for factor in factors:
        equal = agrees(w, g.times(factor[:, None])).all(axis=0)
        share = _share(np.asarray(equal), g.values)
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
