"""Gamma with like terms joined is gamma, in the form in which the book prints it."""

import math
import random
from fractions import Fraction
from typing import Any

import pytest

import kincompile as kc
from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Number, Product, Symbol
from kincompile.derivations.joint_terms import abbreviations
from kincompile.derive import collected as collecting
from kincompile.derive.collected import collected
from kincompile.derive.derivation import derive
from kincompile.errors import InternalError
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.report.formulas import size
from kincompile.report.tex import TexPrinter


class Numbers:
    """Leaves as random numbers, by another rule than that of the code that is tested."""

    def __init__(self) -> None:
        self._known: dict[Any, float] = {}
        self._random = random.Random(7)

    def _value(self, key: Any) -> float:
        return self._known.setdefault(key, self._random.uniform(-2, 2))

    def number(self, value: Any) -> float:
        return float(value)

    def pi(self) -> float:
        return 3.141592653589793

    def symbol(self, symbol: Any) -> float:
        return self._value(symbol)

    def vector(self, symbol: Any) -> tuple[float, float]:
        return self._value((symbol, 0)), self._value((symbol, 1))

    def time_function(self, function: Any) -> float:
        return self._value(function)

    def profile(self, profile: Any) -> float:
        return self._value(profile)

    def entries(self, rotation: Any, expand: Any) -> Any:
        return expand.entries(rotation)

    def call(self, function: str, value: float) -> float:
        return float(getattr(math, function)(value))


def written(name: str, k: int = 0) -> str:
    """Return the collected gamma of a type in LaTeX, without what shows nothing."""
    template = CONSTRAINTS[name].template()
    names = abbreviations(template)
    text = TexPrinter(names).math(collected(derive(template)[k].gamma, names))
    for mark in ("\\mathbf", "\\,", "{", "}", "\\dot", "\\"):
        text = text.replace(mark, "w" if mark == "\\dot" else "")
    return " ".join(text.replace("^prime", "'").split())


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_that_the_collected_gamma_is_the_derived_one(name: str) -> None:
    template = CONSTRAINTS[name].template()
    names = abbreviations(template)
    for block in derive(template):
        expand = Expansion(Numbers())
        found = collected(block.gamma, names)
        expected = expand.components(block.gamma)
        assert expand.components(found) == pytest.approx(expected, rel=1e-10, abs=1e-12)
        again = size(collected(found, names))
        assert again == pytest.approx(size(found), abs=2)  # nothing is left to join


@pytest.mark.parametrize(
    ("name", "row", "expected"),
    [
        ("Translational", 1, "( B_i v_i' )^T A_j v_j' ( wphi_j - wphi_i )^2"),
        ("Distance", 0, "- 2 wd^T wd + 2 d^T A_j s_j' wphi_j^2 - 2 d^T A_i s_i' wphi_i^2 "
         "+ 2 wC^2 + 2 C ddotC"),
        ("Translational", 0, "( B_i v_i' )^T d wphi_i^2 + 2 ( A_i v_i' )^T wd wphi_i "
         "+ ( B_i v_i' )^T A_j s_j' wphi_j^2 - ( B_i v_i' )^T A_i s_i' wphi_i^2"),
    ],
)  # fmt: skip
def test_that_gamma_reads_as_in_the_book(name: str, row: int, expected: str) -> None:
    assert written(name, row) == expected


def test_that_a_gear_is_written_with_the_rate_of_its_angle() -> None:
    assert "2 wvartheta wd^T u ( vartheta ) + wvartheta^2 d^T R u ( vartheta )" in written("Gear")


def test_that_the_difference_of_two_points_of_a_body_stays_together() -> None:
    text = written("RackAndPinion")
    assert text.count("A_i ( s_Q' - s_P' )") == 3
    assert "s_P' - s_Q'" not in text


def test_that_a_cam_has_the_square_of_the_sum_of_its_rates() -> None:
    assert "- rho_j ( wphi_j + walpha_j )^2 ) A_j u ( alpha_j )" in written("PointFollower")


def test_that_a_wrong_form_is_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    doubled = Product((Number(Fraction(2)), Symbol("x_dot")))
    monkeypatch.setattr(collecting, "_part", lambda *_: doubled)
    template = kc.Distance.template()
    with pytest.raises(InternalError, match="gamma collected is not gamma"):
        collected(derive(template)[0].gamma, abbreviations(template))
