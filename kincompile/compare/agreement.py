"""When two numbers count as equal, and by what factor one row is a multiple of another.

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


def tolerance(hand: Array, sizes: Array, generated: Array) -> Array:
    """Return the difference that is rounding, entry by entry; arrays are (N, rows, columns)."""
    terms = np.nan_to_num(sizes, nan=0.0, posinf=0.0) + np.abs(np.nan_to_num(generated))
    largest = np.max(np.abs(np.nan_to_num(hand)) + terms, axis=-1, keepdims=True, initial=0.0)
    return np.asarray(OF_TERMS * terms + OF_ROW * largest + ABSOLUTE)


def agrees(hand: Array, sizes: Array, generated: Array) -> Array:
    """Return for every state and entry whether the two are equal; NaN is equal to nothing."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(hand - generated) <= tolerance(hand, sizes, generated))


@dataclass(frozen=True, slots=True)
class Multiple:
    """How one row is a multiple of another.

    Attributes
    ----------
    factor
        By state, shape (N,): hand = factor * generated.
    share
        Share of the entries that are, 1 where the whole row is.
    """

    factor: Array
    share: float


def multiple(hand: Array, sizes: Array, generated: Array, group: Array) -> Multiple:
    """Return the factor between two rows, (N, columns) each, that explains the most entries.

    A factor must be the same at all states with the same parameters. Where several explain as
    many entries, 1 is taken before -1, and these before any other.
    """
    count = len(group)
    shape = (count, 1, -1)
    h, s, g = hand.reshape(shape), sizes.reshape(shape), generated.reshape(shape)
    best = Multiple(np.ones(count), -1.0)
    for factor in (np.ones(count), -np.ones(count), *_ratios(hand, generated, group)):
        equal = np.asarray(agrees(h, s, factor[:, None, None] * g)[:, 0].all(axis=0))
        share = _share(equal, generated)
        if share > best.share:
            best = Multiple(factor, share)
        if best.share == 1.0:
            break
    return best


def _share(equal: Array, generated: Array) -> float:
    """Return the share of entries that agree; zeros agree under any factor and say nothing."""
    telling = np.any(np.abs(generated) > ABSOLUTE, axis=0)
    if equal.all():
        return 1.0
    if not telling.any():
        return 0.0
    return min(float(np.mean(equal[telling])), 0.999)


def _ratios(hand: Array, generated: Array, group: Array) -> list[Array]:
    """Return the ratios of entries that do not vary within a group of states."""
    found: list[Array] = []
    if np.min(np.bincount(group)[group]) < 2:
        return found  # one state says nothing about a factor: any two numbers have one
    for h, g in zip(hand.T, generated.T, strict=True):
        if not (np.all(np.abs(g) > ABSOLUTE) and np.all(np.abs(h) > ABSOLUTE)):
            continue
        ratio = h / g
        first = np.array([ratio[np.argmax(group == k)] for k in group])
        if np.all(np.abs(ratio - first) <= OF_TERMS * np.abs(first)):
            found.append(first)
    return found
