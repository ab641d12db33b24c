"""Slips in an entry, found by what must stand in the place of one of its products.

An entry is a sum of products, in brackets too, and linear in each of them. So the author's number
says what stands in the place of a product, if all the rest is right. That is looked up: a constant
multiple; another variable, or function of one, in a factor; a factor too much, missing, or of
another power. Two slips at once are two such differences whose sum is the author's.

A sum under a root or a fraction bar is such an entry of its own. Where the right formula is not
known, as of a transmission, the author's is taken apart, and the right number says what belongs.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.checker.agreement import ABSOLUTE, CLOSE
from kincompile.checker.fault import A_TERM, NEAR, Fault, Kind, multiple_fault
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from kincompile.checker.fault import Shown
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States

OF_SLIP = 1e-4
"""Of the difference that is to be explained: how near a slip has to come."""
MOST_WORDS = 240
"""Expressions that may stand where another belongs."""
MOST_PRODUCTS = 200
MOST_PAIRED = 30_000
"""Slips of which two are taken together."""
MOST_SUMS = 100_000
"""Pairs of slips that are tried, of those whose sum is near enough in one weighted sum."""
POWERS = tuple(map(sympy.Rational, ("1", "-1", "2", "-2", "1/2", "-1/2")))
MULTIPLES = tuple(map(Fraction, ("-1", "0", "2", "1/2")))


@dataclass(frozen=True, slots=True, eq=False)
class _Product:
    """A product in an entry, or all terms with a common factor."""

    name: str
    factors: tuple[sympy.Expr, ...]
    value: Array  # what it adds to the entry, (N,)


@dataclass(frozen=True, slots=True, eq=False)
class _Changes:
    """Slips of one kind with the differences that they make, (N, slips)."""

    values: Array
    named: Callable[[int], tuple[str, str]]  # kind and text of one of them


class Slips:
    """What may stand where the products of an entry belong.

    Parameters
    ----------
    forms
        The entry as it is derived, and multiplied out where that is short.
    is_by_hand
        Whether the forms are the author's, and what is given is right.
    """

    def __init__(
        self,
        reference: Reference,
        forms: Sequence[sympy.Expr],
        quantity: str,
        states: States,
        *,
        is_by_hand: bool = False,
    ) -> None:
        self._reference, self._states, self._forms = reference, states, forms
        self._quantity, self._is_by_hand = quantity, is_by_hand

    def one(self, given: Shown) -> Iterator[Fault[Array]]:
        """Yield the slips that give an author's numbers, the simplest that there are."""
        off, allowed = self._difference(given)
        for slips in (self._multiple, self._other_words, self._other_powers):
            found = False
            for item in (item for product in self._products for item in slips(product, off)):
                for k in _fitting(item.values, off, allowed):
                    found = True
                    yield Fault(*item.named(k), given[0])
            if found:
                return
        yield from self._inside(given, off)

    def _inside(self, given: Shown, off: Array) -> Iterator[Fault[Array]]:
        """Yield the slips in a sum that has a power: under a fraction bar or a root."""
        for product in self._products:
            for factor in product.factors:
                base, exponent = factor.as_base_exp()
                if not base.is_Add or not exponent.is_number or exponent == 1:
                    continue
                if base not in self._sums:
                    forms = list(dict.fromkeys((base, sympy.expand(base))))
                    self._sums[base] = Slips(
                        self._reference, forms, self._quantity, self._states,
                        is_by_hand=self._is_by_hand,
                    )  # fmt: skip
                (value,) = self._values([base]).T
                with np.errstate(all="ignore"):
                    ratio = 1 + off / product.value
                    needed = value * ratio ** float(1 / exponent)
                    lost = given[1] * np.abs(value / (product.value * float(exponent)))
                if np.isfinite(needed).all() and np.isfinite(lost).all():
                    yield from (
                        replace(item, result=given[0])
                        for item in self._sums[base].one((needed, lost))
                    )

    @cached_property
    def _sums(self) -> dict[sympy.Expr, Slips]:
        """The sums that were looked into."""
        return {}

    def two(self, given: Shown) -> Iterator[Fault[Array]]:
        """Yield two slips in different products that together give an author's numbers, if any."""
        if (pair := self._pair(*self._difference(given))) is not None:
            yield Fault(Kind.TWO_SLIPS, f"two slips: {'; '.join(pair)}", given[0])

    def _difference(self, given: Shown) -> tuple[Array, Array]:
        """Return how far the author's numbers are off, and how near a slip has to come."""
        (right,) = self._values(self._forms[:1]).T
        off = given[0] - right
        allowed = CLOSE * max(np.max(np.abs(right)), np.max(np.abs(given[0])))
        return off, min(allowed, OF_SLIP * np.max(np.abs(off))) + ABSOLUTE + given[1]

    def _values(self, expressions: Sequence[sympy.Expr]) -> Array:
        """Return values of expressions, (N, count)."""
        with np.errstate(all="ignore"):
            return self._reference.evaluate(expressions, self._states)[0]

    @cached_property
    def _products(self) -> list[_Product]:
        """The products: the entry as a whole, its terms, and those with a common factor."""
        whole, expanded = self._forms[0], self._forms[-1]
        terms = sympy.Add.make_args(expanded)
        named = {frozenset(Counter(item).items()): item for item in _terms(expanded)}
        joined = {term.as_coeff_Mul()[1] for term in terms}
        for item in _terms(whole):
            # Like terms in several brackets are one term, which is there multiplied out.
            if sympy.Mul(*item).as_coeff_Mul()[1] not in joined:
                named.setdefault(frozenset(Counter(item).items()), item)
        common: dict[sympy.Expr, list[sympy.Expr]] = {}
        for term in terms:
            for factor in sympy.Mul.make_args(term):
                if not factor.is_number:
                    common.setdefault(factor, []).append(term)
        groups = [(item, own) for item, own in common.items() if 1 < len(own) < len(terms)]
        own = list(named.values())[:MOST_PRODUCTS]
        values = self._values([whole, *(factor for item in own for factor in item)])
        products = [_Product("the entry", sympy.Mul.make_args(whole), values[:, 0])]
        first = 1
        for item in own:
            value = np.prod(values[:, first : first + len(item)], axis=1)
            products.append(_Product(A_TERM, item, value))
            first += len(item)
        for factor, own_terms in groups:
            value = self._values(own_terms).sum(axis=1)
            products.append(_Product(f"all terms with {factor}", (factor,), value))
        varying = [term for term in terms if not term.is_number]
        if 1 < len(varying) < len(terms):
            value = self._values(varying).sum(axis=1)
            products.append(_Product("the sum of all terms but the constant", (), value))
        return products

    @cached_property
    def _words(self) -> tuple[list[sympy.Expr], Array]:
        """What may stand where another factor belongs, with its values: (N, count)."""
        reference, found = self._reference, dict[sympy.Expr, None]()
        symbols = [sympy.Symbol(name) for name in reference.symbols]
        bases = [
            factor.as_base_exp()[0] for product in self._products for factor in product.factors
        ]
        found |= dict.fromkeys(item for item in bases if not item.is_number)
        functions = sorted(self._forms[0].atoms(sympy.sin, sympy.cos), key=str)
        found |= dict.fromkeys(functions)
        found |= dict.fromkeys(symbols)
        for function in functions:
            for own in sorted(function.free_symbols.intersection(symbols), key=str):
                others = (function.xreplace({own: other}) for other in symbols)
                for other in others:
                    found |= dict.fromkeys((other, partner(other)))
        if self._quantity in ("gamma", "J_dot"):
            known = reference.inputs(self._states)
            rates = (rate(name) for name in reference.symbols)
            found |= dict.fromkeys(sympy.Symbol(name) for name in rates if name in known)
        words = [item for item in found if not item.is_number][:MOST_WORDS]
        return words, self._values(words)

    def _multiple(self, product: _Product, off: Array) -> Iterator[_Changes]:
        square = product.value @ product.value
        if square:
            factor = 1 + off @ product.value / square
            changes = (factor - 1) * product.value[:, None]
            yield _Changes(changes, lambda _: self._multiple_fault(product.name, factor))

    def _fixed_multiples(self, product: _Product) -> _Changes:
        factors = np.array([float(item) for item in MULTIPLES])
        changes = product.value[:, None] * (factors - 1)
        return _Changes(changes, lambda k: self._multiple_fault(product.name, factors[k]))

    def _multiple_fault(self, name: str, factor: float) -> tuple[str, str]:
        """Return kind and text of a product that has to be a multiple of what it is."""
        if not self._is_by_hand:
            return multiple_fault(name, factor)
        if abs(factor) <= NEAR:
            return Kind.EXTRA_TERM, f"{name} is too much"
        return multiple_fault(name, 1 / factor)

    def _other_words(self, product: _Product, off: Array) -> Iterator[_Changes]:
        """Yield the slips with another variable in a factor, or in one of a power's factors."""
        del off
        words, values = self._words
        place = {word: k for k, word in enumerate(words)}
        for factor in product.factors:
            base, exponent = factor.as_base_exp()
            if base not in place or base.is_Add:
                continue
            for power in dict.fromkeys((sympy.S.One, exponent)):
                with np.errstate(all="ignore"):
                    ratio = (values / values[:, place[base], None]) ** float(power)
                    changes = product.value[:, None] * (ratio - 1)

                def named(k: int, base: sympy.Expr = base) -> tuple[str, str]:
                    one, other = (base, words[k]) if self._is_by_hand else (words[k], base)
                    text = f"{one} stands where {other} belongs, in {product.name}"
                    return Kind.OTHER_VARIABLE, text

                yield _Changes(changes, named)

    def _other_powers(self, product: _Product, off: Array) -> Iterator[_Changes]:
        """Yield the slips with a factor too much or missing."""
        del off
        words, values = self._words
        for power in POWERS:
            with np.errstate(all="ignore"):
                changes = product.value[:, None] * (values ** float(power) - 1)

            def named(k: int, power: sympy.Expr = power) -> tuple[str, str]:
                return _of_power(words[k], power, product, self._is_by_hand)

            yield _Changes(changes, named)

    def _pair(self, off: Array, allowed: Array) -> tuple[str, str] | None:
        """Return the texts of two slips in different products that together make the difference."""
        items, size = [], 0
        for product in self._products:
            own = [self._fixed_multiples(product)]
            own += [*self._other_words(product, off), *self._other_powers(product, off)]
            for item in own:
                if size + item.values.shape[1] <= MOST_PAIRED:
                    items.append((item, product))
                    size += item.values.shape[1]
        changes = np.concatenate([item.values for item, _ in items], axis=1)
        owner = np.repeat(np.arange(len(items)), [item.values.shape[1] for item, _ in items])
        usable = np.isfinite(changes).all(axis=0) & np.any(np.abs(changes) > ABSOLUTE, axis=0)
        kept = np.flatnonzero(usable)
        for a, b in _summing(changes[:, kept], off, allowed):
            first, second = kept[a], kept[b]
            if items[owner[first]][1] is not items[owner[second]][1]:
                return self._text(items, owner, first), self._text(items, owner, second)
        return None

    def _text(self, items: Sequence[tuple[_Changes, _Product]], owner: Array, k: int) -> str:
        item, _ = items[owner[k]]
        text: str = item.named(int(k - np.argmax(owner == owner[k])))[1]
        return text


def _terms(
    node: sympy.Expr, others: tuple[sympy.Expr, ...] = ()
) -> Iterator[tuple[sympy.Expr, ...]]:
    """Yield the products in an expression, each as its factors; those in brackets too."""
    for term in sympy.Add.make_args(node):
        factors = sympy.Mul.make_args(term)
        yield (*others, *factors)
        for k, factor in enumerate(factors):
            if factor.is_Add:
                yield from _terms(factor, (*others, *factors[:k], *factors[k + 1 :]))


def partner(formula: sympy.Expr) -> sympy.Expr:
    """Return a formula with a cosine for each sine, and a sine for each cosine."""
    # SymPy may have taken a sign out of it.
    pairs = {sympy.sin: sympy.cos, sympy.cos: sympy.sin}
    own = formula.atoms(sympy.sin, sympy.cos)
    other: sympy.Expr = formula.xreplace({item: pairs[item.func](*item.args) for item in own})
    return other


def _of_power(
    word: sympy.Expr, power: sympy.Expr, product: _Product, is_by_hand: bool
) -> tuple[str, str]:
    """Return kind and text of a product times a power of a word."""
    exponents = dict(factor.as_base_exp() for factor in product.factors)
    own = exponents.get(word, sympy.S.Zero)
    if is_by_hand:  # the product is the author's: what it is too little in, the right one has
        own, power = own + power, -power
    if abs(own + power) < abs(own):
        is_rate = isinstance(word, sympy.Symbol) and word.name.endswith(rate(""))
        kind = Kind.MISSING_RATE if is_rate else Kind.MISSING_FACTOR
        return kind, f"a factor {word**-power} is missing in {product.name}"
    return Kind.EXTRA_FACTOR, f"a factor {word**power} is too much in {product.name}"


def _fitting(changes: Array, off: Array, allowed: Array) -> list[int]:
    """Return the changes that are the difference."""
    with np.errstate(invalid="ignore"):
        fits = np.all(np.abs(changes - off[:, None]) <= allowed[:, None], axis=0)
    return [int(k) for k in np.flatnonzero(fits)]


def _summing(changes: Array, off: Array, allowed: Array) -> Iterator[tuple[int, int]]:
    """Yield the pairs of changes whose sum is the difference."""
    weights = np.random.default_rng(1).uniform(0.5, 1.5, len(off))
    sums, target, reach = weights @ changes, weights @ off, weights @ allowed
    order = np.argsort(sums)
    first = np.searchsorted(sums[order], target - sums - reach)
    last = np.searchsorted(sums[order], target - sums + reach)
    tried = 0
    for a in np.flatnonzero(last > first):
        others = order[first[a] : last[a]]
        others = others[others > a]
        tried += 1 + len(others)
        if tried > MOST_SUMS:  # numbers of few digits: many pairs are near enough
            return
        for k in _fitting(changes[:, [a]] + changes[:, others], off, allowed):
            yield int(a), int(others[k])
