"""Derivations in Haug's r-omega form, and the identities of Euler parameters that pages show."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.calculus.expand import Expansion
from kincompile.calculus.space import TurnedFrame
from kincompile.cli import cli
from kincompile.derivations.assembled import IDENTITIES
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.space.catalogue import CONSTRAINTS
from tests.unit.spatial.test_checking import Numbers, pendulum


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_that_the_blocks_of_the_book_are_the_columns_of_the_code(name: str) -> None:
    plain = CONSTRAINTS[name].template()
    frames = tuple(TurnedFrame(frame.index) for frame in plain.frames)
    template = replace(plain, frames=frames)
    expansion = Expansion(Numbers(), template.dimension)
    for block, row in zip(derive(template), partials(template), strict=True):
        columns = [column for item in row for column in item.columns(item.entry)]
        assert len(columns) == 6 * len(frames) + len(template.contacts)
        for read_off, column in zip(columns, block.Phi_q, strict=True):
            found, expected = expansion.components(read_off), expansion.components(column)
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.fixture(scope="module")
def page() -> Any:
    return kc.derivation(pendulum(), form="r-omega")


def test_that_the_page_has_the_matrices_of_the_book(page: Any) -> None:
    text = page.to_markdown()
    point = r"{\tilde{\mathbf{s}}}_{j}^{\prime}"
    spin = r"{\tilde{\boldsymbol{\omega}}}_{j}^{\prime}"
    assert rf"- {{\mathbf{{A}}}}_{{j}} {point}" in text
    assert rf"{{\mathbf{{A}}}}_{{j}} {spin} {spin} {{\mathbf{{s}}}}_{{j}}^{{\prime}}" in text
    assert "norm_rod" not in [item.anchor for item in page.sections[1].sections]
    assert "Phi_pi' = Phi_p G^T/2" in text


def test_that_its_numbers_are_those_of_the_module(page: Any) -> None:
    d = kc.derivation(pendulum())
    state: dict[str, Any] = {}
    exec(d.state, {"np": np}, state)  # the page's own lines: t, q, q_dot, p
    module = kc.compile(pendulum())
    Phi_q = module.Phi_q(state["q"], state["t"])
    expected = np.hstack([Phi_q[:5, :3], Phi_q[:5, 3:] @ matrix(state["q"][3:], -1).T / 2])
    steps = page.sections[1].sections[0].sections[-1]
    shown = [item.formula.parts[-1] for item in steps.blocks if hasattr(item, "formula")]
    printed = next(item for item in shown if len(item.rows) == 5 and len(item.rows[0]) > 1)
    found = np.array([[cell.value for cell in row] for row in printed.rows])
    np.testing.assert_allclose(found, expected[:, np.abs(expected).max(axis=0) > 0], atol=1e-12)


@pytest.mark.parametrize("form", ["to_html", "to_latex", "to_notebook", "to_slides"])
def test_that_every_format_prints_it(page: Any, form: str) -> None:
    text = getattr(page, form)()
    letter = ord("\N{MATHEMATICAL BOLD SMALL OMEGA}")
    assert "omega" in text or f"&#{letter};" in text


def test_forms_that_do_not_exist() -> None:
    with pytest.raises(kc.InputError, match="there is no form 'omega'; forms are: r-p"):
        kc.derivation(pendulum(), form="omega")
    with pytest.raises(kc.InputError, match="norm row, which the r-omega form does not have"):
        kc.derivation(pendulum(), form="r-omega", constraint="norm_rod")
    m = kc.Mechanism("plane")
    m.add(kc.AbsoluteAngle("motor", m.body("crank"), kc.t))
    with pytest.raises(kc.InputError, match="plane is no mechanism of bodies in space"):
        kc.derivation(m, form="r-omega")


def test_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "rod.toml").write_text(pendulum().to_toml(), encoding="utf-8")
    given = ["derive", str(tmp_path / "rod.toml"), "--form", "r-omega"]
    result = CliRunner().invoke(cli, [*given, "-o", str(tmp_path / "rod.md")])
    assert result.exit_code == 0, result.output
    assert "small rotations" in (tmp_path / "rod.md").read_text(encoding="utf-8")


def skew(v: Any) -> Any:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def matrix(p: Any, sign: int) -> Any:
    """Return E, or G with the sign -1."""
    return np.hstack([-p[1:, None], p[0] * np.eye(3) + sign * skew(p[1:])])


def quantities(random: np.random.Generator) -> dict[str, Any]:
    """Return the symbols of the identities at a random state of a body, by quaternions alone."""
    p, s, omega, alpha = (random.normal(size=k) for k in (4, 3, 3, 3))
    p /= np.linalg.norm(p)
    quarter = np.vstack([[0, *-omega], np.hstack([omega[:, None], -skew(omega)])]) / 2
    p_dot = quarter @ p  # p' = p o (0, omega'/2): the rows of G^T omega'/2 by another way
    turn = np.vstack([[0, *-alpha], np.hstack([alpha[:, None], -skew(alpha)])]) / 2
    p_ddot = turn @ p + quarter @ p_dot
    A = np.array([turned(p, unit) for unit in np.eye(3)]).T  # noqa: N806 - of the textbook
    step = 1e-30j
    A_dot = np.array([turned(p + step * p_dot, unit) for unit in np.eye(3)]).T.imag / 1e-30
    slopes = {
        name: np.array([turned(q + step * unit, s) for unit in np.eye(4)]).T.imag / 1e-30
        for name, q in (("B(p,s)", p), ("B(p_dot,s)", p_dot))
    }
    return {
        "p": p, "p_dot": p_dot, "p_ddot": p_ddot, "s": s, "A": A, "A_dot": A_dot, **slopes,
        "E": matrix(p, 1), "G": matrix(p, -1), "E_dot": matrix(p_dot, 1),
        "G_dot": matrix(p_dot, -1), "omega'": omega, "omega": A @ omega,
        "omega'_dot": alpha, "omega_dot": A @ alpha,
    }  # fmt: skip


def turned(p: Any, v: Any) -> Any:
    """Return the vector part of p v p*, which needs no matrix."""
    w, e = p[0], p[1:]
    first, rest = -(e @ v), w * v + np.cross(e, v)
    return -first * e + w * rest - np.cross(rest, e)


def value(side: str, known: dict[str, Any]) -> Any:
    """Return a side of an identity: sums of products, factors with a space between them."""
    total: Any = 0
    sign = 1
    product: Any = None
    for word in [*side.split(), "+"]:
        if word in ("+", "-"):
            total = total if product is None else total + sign * product
            sign, product = (1 if word == "+" else -1), None
            continue
        factor = known_factor(word, known)
        if product is None or np.ndim(product) == 0 or np.ndim(factor) == 0:
            product = factor if product is None else product * factor
        else:
            product = np.asarray(product) @ np.asarray(factor)
    return total


def known_factor(word: str, known: dict[str, Any]) -> Any:
    name = re.sub(r"(\^T|~)$", "", word)
    if re.fullmatch(r"[\d/]+", word):
        over, _, under = word.partition("/")
        return float(over) / float(under or 1)
    if word == "I":
        return known["I"]
    found = np.asarray(known[name], dtype=float)
    if word.endswith("~"):
        return skew(found)
    is_column = found.ndim == 1
    if word.endswith("^T"):
        return found[None, :] if is_column else found.T
    return found[:, None] if is_column else found


@pytest.mark.parametrize("identity", IDENTITIES)
def test_identities_of_euler_parameters(identity: str) -> None:
    left, right = identity.split(" = ")
    random = np.random.default_rng(9)
    for _ in range(5):
        known = quantities(random)
        found = np.squeeze(value(left, known))
        known["I"] = np.eye(found.shape[0]) if found.ndim else 1.0
        expected = np.squeeze(value(right, known))
        assert found.shape == expected.shape or not expected.any()
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-13)
        assert math.isfinite(np.abs(found).max())
