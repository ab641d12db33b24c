"""Starts in every language, as a table: mechanism, guess, status, assembly, reached.

One set of rules says which assembly a guess means (`kincompile/runtime/newton.py`). What compiled C
and the emitted JavaScript and Octave make of the same guess is compared with what NumPy makes of
it, in the plane and in space: which assembly, which turn of an angle, which sign of Euler
parameters. `tests/data/starts.txt` keeps some of it; ``--update-goldens`` writes it anew.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.criteria import SAME_POSITION
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import problem
from tests.adversary.test_starts import SHARE, in_javascript, in_octave, needs_node
from tests.targets.conftest import OCTAVE

pytestmark = pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")

TABLE = Path(__file__).resolve().parents[1] / "data" / "starts.txt"
HEADER = "mechanism | guess | status | assembly | reached"
KEPT = ("four_bar", "gear_train", "rssr", "spatial_slider_crank")
PLANE = ("four_bar", "gear_train", "klann", "shaper", "slot_follower", "rack_and_pinion")
SPACE = ("rssr", "spatial_slider_crank", "bennett", "double_universal_joint", "screw_jack")

TWO_SIGNS = (
    -0.03, 0.1, 0.14, -0.89, -0.35, 0.01, -0.29, 0.07, 0.05, 0.09, -0.57, 0.02, 0.1, 0.82, 0.18,
    0.02, -0.01, -0.78, -0.53, -0.05, -0.32,
)  # fmt: skip
"""A guess of the spatial slider-crank from which Newton's method ends at x_slider = 0.2, where the
determinants of two blocks have other signs; at -0.2 they have those of the guess."""


@dataclass(frozen=True)
class Row:
    """What a language makes of a guess: the assembly is a number, counted as they are met."""

    mechanism: str
    guess: tuple[float, ...]
    status: str
    assembly: int
    reached: tuple[float, ...]

    def to_text(self) -> str:
        guess, reached = (" ".join(map(repr, x)) for x in (self.guess, self.reached))
        return f"{self.mechanism} | {guess} | {self.status} | {self.assembly} | {reached}"

    @classmethod
    def of_text(cls, text: str) -> Row:
        mechanism, guess, status, assembly, reached = text.split("|")
        numbers = [tuple(map(float, x.split())) for x in (guess, reached)]
        return cls(mechanism.strip(), numbers[0], status.strip(), int(assembly), numbers[1])


def random_guesses(module, random, count):
    """Return guesses near an assembly and far from it, with whole turns and any orientation."""
    exact = kc.newton(module, 0.0, None).q
    equations = problem(code_of(module), module.DEFAULTS, exact, 0.0)
    is_near = np.arange(count)[:, np.newaxis] % 2 == 1
    away = random.uniform(-1, 1, (count, exact.size)) * np.where(is_near, 0.5, np.pi)
    away[:, ~equations.angular] *= equations.size / 5
    is_angle = [module.UNITS[name] == "rad" for name in module.COORDINATES]
    away[::3, is_angle] += 2 * np.pi * random.integers(-1, 2, away[::3, is_angle].shape)
    guesses = exact + away
    for cover in equations.code.covers:
        anyhow = random.normal(size=(count, 4))
        p = np.where(is_near, exact[cover] + 0.3 * anyhow, anyhow)
        guesses[:, cover] = (
            p * random.choice((-1, 1), (count, 1)) / np.linalg.norm(p, axis=1)[:, None]
        )
    return guesses


def rows(name, module, guesses, found):
    """Return what was found, pairs of a status and a position, as rows."""
    equations = problem(code_of(module), module.DEFAULTS, guesses[0], 0.0)
    known: list[np.ndarray] = []
    for guess, (status, q) in zip(guesses, found, strict=True):
        number, reached = 0, ()
        if status == kc.Status.CONVERGED:
            apart = [np.abs(equations.apart(q, x) / equations.reference).max() for x in known]
            if not apart or min(apart) > SAME_POSITION:
                known.append(q)
                apart.append(0.0)
            number, reached = int(np.argmin(apart)) + 1, tuple(np.round(q, 6).tolist())
        yield Row(name, tuple(guess.tolist()), kc.Status(status).name, number, reached)


def is_same(row, other):
    """Say whether two rows have one status and assembly, with the same turns and signs."""
    same = (row.status, row.assembly) == (other.status, other.assembly)
    return same and np.allclose(row.reached, other.reached, rtol=1e-5, atol=1e-5)


def in_numpy(module, guesses):
    """Return what NumPy, or compiled C, makes of guesses."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
        found = [kc.newton(module, 0.0, guess) for guess in guesses]
    return [(result.status, result.q) for result in found]


def in_javascript_too(folder, model, guesses):
    results = in_javascript(folder, model, 0.0, guesses)
    # A motion says NOT_ASSEMBLED where Newton's method says NOT_CONVERGED.
    named = {int(kc.Status.NOT_ASSEMBLED): int(kc.Status.NOT_CONVERGED)}
    return [(named.get(int(status[0]), int(status[0])), q[0]) for status, q, *_ in results]


def stored():
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    assert lines[0] == HEADER
    return [Row.of_text(line) for line in lines[1:]]


def kept_rows(example_named):
    """Return the rows of the table, made anew by NumPy."""
    for number, name in enumerate(KEPT):
        module = example_named(name).module
        guesses = np.round(random_guesses(module, np.random.default_rng(number), 10), 3)
        yield from rows(name, module, guesses, in_numpy(module, guesses))


def test_that_starts_are_those_of_the_table(example_named, request):
    found = list(kept_rows(example_named))
    if request.config.getoption("--update-goldens"):
        text = "\n".join([HEADER, *(row.to_text() for row in found)])
        TABLE.write_text(f"{text}\n", encoding="utf-8")
        pytest.fail("the table was written anew: look at what changed")
    wanted = stored()
    np.testing.assert_allclose(
        np.concatenate([row.guess for row in found]), np.concatenate([row.guess for row in wanted])
    )
    assert [row for row, own in zip(wanted, found, strict=True) if not is_same(row, own)] == []


@needs_node
def test_that_some_starts_in_javascript_are_those_of_the_table(example_named, tmp_path):
    wanted = stored()
    for name in ("four_bar", "spatial_slider_crank"):
        example, own = example_named(name), [row for row in wanted if row.mechanism == name]
        guesses = np.array([row.guess for row in own])
        found = in_javascript_too(tmp_path, example.model, guesses)
        made = rows(name, example.module, guesses, found)
        assert [row for row, other in zip(own, made, strict=True) if not is_same(row, other)] == []


def compare(example_named, names, count, language, record):
    """Compare starts of random guesses in a language with those in NumPy; none may differ."""
    tried, gave_up, wrong = 0, 0, []
    for number, name in enumerate(names):
        model = example_named(name).model
        module = kc.compile(model)
        guesses = random_guesses(module, np.random.default_rng([number, 1]), count)
        known = list(rows(name, module, guesses, in_numpy(module, guesses)))
        found = rows(name, module, guesses, language(model, guesses))
        wrong += [(a, b) for a, b in zip(known, found, strict=True) if not is_same(a, b)]
        tried, gave_up = tried + count, gave_up + sum(row.status != "CONVERGED" for row in known)
    record(tried=tried, wrong=len(wrong), gave_up=gave_up)
    assert not wrong


@pytest.mark.slow
@pytest.mark.parametrize("names", [PLANE, SPACE], ids=["plane", "space"])
def test_many_starts_of_mechanisms_in_c(example_named, names, quick_compiler, record):
    def language(model, guesses):
        return in_numpy(kc.compile(model, target="c"), guesses)

    compare(example_named, names, 200 // SHARE, language, record)


@needs_node
@pytest.mark.slow
@pytest.mark.parametrize("names", [PLANE, SPACE], ids=["plane", "space"])
def test_many_starts_of_mechanisms_in_javascript(example_named, names, tmp_path, record):
    def language(model, guesses):
        return in_javascript_too(tmp_path, model, guesses)

    compare(example_named, names, 400 // SHARE, language, record)


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed (Debian: octave)")
@pytest.mark.parametrize("names", [PLANE, SPACE], ids=["plane", "space"])
def test_many_starts_of_mechanisms_in_octave(example_named, names, tmp_path, record):
    def language(model, guesses):
        (folder := tmp_path / model.name).mkdir()
        found = in_octave(folder, model, guesses)
        return [(kc.Status.CONVERGED if good else kc.Status.NOT_CONVERGED, q) for good, q in found]

    compare(example_named, names, 200 // SHARE, language, record)


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed (Debian: octave)")
def test_that_two_signs_that_change_together_are_seen_in_octave(example_named, tmp_path):
    """Two blocks of the spatial slider-crank, of one larger block whose determinant stays."""
    example = example_named("spatial_slider_crank")
    guesses = np.array([TWO_SIGNS])
    ((_, known),) = in_numpy(example.module, guesses)
    ((is_found, q),) = in_octave(tmp_path, example.model, guesses)
    assert is_found
    np.testing.assert_allclose(q, known, rtol=0, atol=1e-8)
    assert q[14] == pytest.approx(-0.2)
