"""Every single sign of the emitted code of a module, turned: `kc.verify` says so.

A mutant that passes must be equivalent: all that the module computes is the same number, at states
and parameters that the verification has not seen.
"""

import ast
import io
import os
import re
import tokenize
from dataclasses import dataclass

import numpy as np
import pytest

import kincompile as kc
from kincompile.model.system import remember_model
from kincompile.quantities import functions, quantities_of, states_of
from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Planned

MACHINERY = {"inline": "class _Quantity", "grouped": "class Group"}
"""From here on all modules are alike: shapes, batches and messages."""

MOST_EQUIVALENT = 8
"""The grouped form has functions that not every mechanism calls, with so many signs."""


@dataclass(frozen=True)
class Mutant:
    """A module with one sign turned: the function, the line as it was, and the text."""

    function: str
    line: str
    source: str


def mutants(source, form):
    """Yield the mutants of a module; of its constants those that are entries of Phi_q."""
    source_of_code = source[: source.index(MACHINERY[form])]
    first = np.cumsum([0, *(len(line) for line in source.splitlines(keepends=True))])
    code = {node.name for node in ast.parse(source).body if hasattr(node, "name")}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        row, column = token.start
        at = int(first[row - 1]) + column
        if token.type != tokenize.OP or token.string not in "+-" or at >= len(source_of_code):
            continue
        *_, (name, constant) = re.findall(r"^(?:(?:def|class) (\w+)|(\w+) = )", source[:at], re.M)
        if name in code or constant == "_CONSTANTS":
            turned = "-" if token.string == "+" else "+"
            yield Mutant(name or constant, token.line, source[:at] + turned + source[at + 1 :])


def coupled_four_bars(count=3):
    """Return four-bars of which each is driven by the rocker of the one before."""
    m = kc.Mechanism("coupled")
    a = m.parameter("a", 1.0)
    before = None
    for k in range(count):
        phis = 0.9 - 0.1 * k, 0.2, 1.1
        crank = m.body(f"crank{k}", guess=(5 * k + 0.3, 0.4, phis[0]))
        coupler = m.body(f"coupler{k}", guess=(5 * k + 2.0, 1.2, phis[1]))
        rocker = m.body(f"rocker{k}", guess=(5 * k + 3.5, 0.9, phis[2]))
        m.add(kc.Revolute(f"A{k}", m.ground, (5 * k, 0), crank, (-a / 2, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (a / 2, 0), coupler, (-1.5, 0.1)))
        m.add(kc.Revolute(f"C{k}", coupler, (1.5, -0.2), rocker, (1, 0)))
        m.add(kc.Revolute(f"D{k}", rocker, (-1, 0), m.ground, (5 * k + 3, 0)))
        if before is None:
            m.add(kc.AbsoluteAngle("motor", crank, 0.9 + kc.t))
        else:
            m.add(kc.RelativeAngle(f"shaft{k}", before, crank, -0.2))
        before = rocker
    return m


def stephenson():
    """Return a six-bar whose loops must be solved together: a block that LAPACK solves."""
    m = kc.Mechanism("stephenson")
    crank, rod, plate, left, right = (
        m.body(name, guess=guess)
        for name, guess in (
            ("crank", (0.2, 0.3, 1.0)), ("rod", (0.9, 0.9, 0.3)), ("plate", (1.9, 1.4, 0.1)),
            ("left", (1.4, 0.7, 1.3)), ("right", (2.6, 0.7, 1.5)),
        )
    )  # fmt: skip
    offset = m.parameter("offset", 0.0)
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-0.35, 0)))
    m.add(kc.Revolute("B", crank, (0.35, 0), rod, (-0.6, offset)))
    m.add(kc.Revolute("C", rod, (0.6, 0), plate, (-0.5, 0.4)))
    m.add(kc.Revolute("D", plate, (-0.5, -0.2), left, (0.6, 0)))
    m.add(kc.Revolute("E", left, (-0.6, 0), m.ground, (1.2, 0)))
    m.add(kc.Revolute("F", plate, (0.6, -0.1), right, (0.7, 0)))
    m.add(kc.Revolute("G", right, (-0.7, 0), m.ground, (2.5, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1 + kc.t))
    return m


def press(*, driven=True):
    """Return a slider-crank with masses, a spring and an output; without a motor it is free."""
    m = kc.Mechanism("press")
    m.gravity = (0, -9.81)
    a = m.parameter("a", 0.1)
    crank = m.body("crank", (0, 0, 0.3), mass=1.2, inertia=0.002, centre=(0.04, 0.01))
    rod = m.body("rod", (0.25, 0.02, 0), mass=0.8, inertia=0.006, centre=(0.02, 0.01))
    ram = m.body("ram", (0.4, 0, 0), mass=1.5, inertia=0.001)
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (a, 0), rod, (-0.15, 0)))
    m.add(kc.Revolute("B", rod, (0.15, 0), ram, (0, 0)))
    m.add(kc.Translational("C", m.ground, (0, 0), (1, 0), ram, (0, 0), (1, 0)))
    m.output("far", kc.outputs.distance(m.point("P", rod, (0.1, 0.1)), (1, 2)), "m")
    given = {"stiffness": 150, "free_length": 0.15, "damping": 2}
    m.add(kc.Spring("s", m.ground, (0.6, 0.1), ram, (0, 0), **given))
    if driven:
        m.add(kc.AbsoluteAngle("motor", crank, 0.3 + 10 * kc.t))
    return m


MODELS = {"coupled": coupled_four_bars, "stephenson": stephenson, "press": press}


@pytest.fixture
def model_named(example_named):
    """Return a model by name: one of the examples, or of this file."""
    return lambda name: MODELS[name]() if name in MODELS else example_named(name).model


def numbers(module):
    """Return all that a module computes at 40 states, and at one alone, with other parameters."""
    random = np.random.default_rng(7)
    size = 1 + np.max(np.abs(module.GUESS))
    q, q_dot = random.uniform(-1, 1, (2, 40, module.N_COORDINATES)) * size + module.GUESS
    t, b = random.uniform(0, 2, 40), random.uniform(-1, 1, (40, module.N_EQUATIONS))
    p = module.DEFAULTS + random.uniform(0.1, 0.5, (40, module.DEFAULTS.size))
    nonzeros = module.Phi_q_nonzeros(q, t, p)
    found = [nonzeros]
    if hasattr(module, "solve"):
        found += [module.solve(nonzeros, b), module.solve(nonzeros[3], b[3])]
    found += module.kinematics_batch_last(q.T, q_dot.T, t, p.T)
    given_of = functions(quantities_of(("loads", "motion") if hasattr(module, "LOADS") else ()))
    if hasattr(module, "OUTPUTS"):
        found += module.observe(q, q_dot, q_dot[::-1], t, p)
        found.append(module.outputs_q(q, q_dot, q_dot[::-1], t, p))
    for name, given in given_of.items():
        function = getattr(module, name)
        for at in (np.arange(40), 3):
            states = (q[at], q_dot[at])[: len(states_of(given))]
            values = function(*states, t[at] if np.ndim(at) else float(t[at]), p[at])
            found += [values] if len(given) == 1 else values
    return [np.asarray(value) for value in (*found, *numbers_of_plan(module, q, t, p, nonzeros, b))]


def numbers_of_plan(module, q, t, p, nonzeros, b):
    """Yield what the planned solve gives to the runtime: solutions and determinants."""
    code = code_of(module)
    if code.lanes is not None and hasattr(module, "solve"):
        engine = Planned(code, p.T)
        point = engine.evaluate(q.T, t)
        yield from np.broadcast_arrays(*engine.solve(point, b.T), *engine.determinants(point))
    if code.blocks:
        solver = BlockSolver(code)
        for entries, right in zip(nonzeros[:5], b, strict=False):
            factors = solver.factor(entries)
            yield solver.solve(factors, right)
            yield solver.determinants(factors)


def is_equivalent(module, known, *, may_refuse=False):
    """Say whether a module computes the numbers that are known, or NaN if it may refuse."""
    with np.errstate(all="ignore"):
        pairs = zip(numbers(module), known, strict=True)
        return all(
            np.all(
                np.isclose(ours, theirs, 1e-9, 1e-11, equal_nan=True) | may_refuse & np.isnan(ours)
            )
            for ours, theirs in pairs
        )


def verdict(path, mutant, system):
    """Return whether a mutant is found; one that does not even load or run is."""
    path.write_text(mutant.source, encoding="utf-8")
    try:
        module = kc.load(path)
        known = module if system is None else remember_model(module, system)
        return not kc.verify(known).passed, module
    except (ArithmeticError, ValueError, TypeError, IndexError):
        return True, None


IS_WHOLE = "ADVERSARY_REPORT" in os.environ
SHARE = 1 if IS_WHOLE else 6
"""Part of the turned signs of dynamics in the slow suite, where every second one of the others is
turned; `python -m tests.adversary` turns all."""

CASES = [("four_bar", "inline", 8), ("slider_crank", "inline", 8), ("four_bar", "grouped", 12)]
EVERY = [
    *((name, "inline", 1) for name in ("four_bar", "slider_crank", "inverted_slider_crank")),
    *(("stephenson", "inline", 2), ("cam_flat_follower", "inline", 4)),
    *(("four_bar", "grouped", 1), ("coupled", "grouped", 2)),
]

UNSEEN_OF_A_FILE = 3
"""Turned signs of a module from a file that no oracle sees: values of outputs are believed, and so
is M where it is multiplied by nothing, since an evenly driven crank has no acceleration."""


def check_mutants(model, form, every, folder, record):
    """Verify every so manieth mutant of a model."""
    emitted = kc.emit(model, form=form)
    emitted.write(folder)
    path, system = folder / f"{model.name}.py", model.system()
    original = kc.load(path)
    assert kc.verify(remember_model(original, system)).passed
    known, equivalent = numbers(original), []
    chosen = list(mutants(path.read_text(encoding="utf-8"), form))[::every]
    for mutant in chosen:
        is_found, module = verdict(path, mutant, system)
        if not is_found:
            assert is_equivalent(module, known), f"{mutant.function}: {mutant.line}"
            equivalent.append(mutant)
    record(tried=len(chosen), wrong=0, gave_up=len(equivalent))
    assert len(equivalent) <= MOST_EQUIVALENT


@pytest.mark.parametrize(("name", "form", "every"), CASES)
def test_that_a_turned_sign_is_found(model_named, name, form, every, tmp_path, record):
    check_mutants(model_named(name), form, every, tmp_path, record)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "form", "every"), EVERY)
def test_that_every_turned_sign_is_found(model_named, name, form, every, tmp_path, record):
    every = every if IS_WHOLE else 2 * every
    check_mutants(model_named(name), form, every, tmp_path, record)


def test_that_the_plan_is_looked_at(example_named, tmp_path):
    """The mutant of the first report: the solution of the coupler missed its equations by 18.9."""
    source = example_named("four_bar").source
    right = "y_coupler = -(b_4 - B_y_phi_coupler * phi_coupler)"
    assert right in source
    path = tmp_path / "four_bar.py"
    path.write_text(source.replace(right, right.replace("(b_4 -", "(b_4 +")), encoding="utf-8")
    found = kc.verify(kc.load(path))
    wrong = [check.entry for check in found.table if not check.passed]
    assert wrong == ["solve of B.y", "solve of C.y"]  # where y_coupler occurs
    assert f"DIFFERS: {', '.join(wrong)}" in found.to_text()


@pytest.mark.parametrize(
    ("driven", "is_known", "every"),
    [
        pytest.param(driven, is_known, every, marks=[pytest.mark.slow] * (every == 1 or driven))
        for driven, is_known in ((True, True), (False, True), (True, False), (False, False))
        for every in (1, 120)
    ],
)
def test_that_a_turned_sign_of_dynamics_is_found(driven, is_known, every, tmp_path, record):
    """With the model at hand all are found; M and Q of a file may be wrong together with them.

    A sign in the look at a solve may make it refuse what is right: then the numbers are NaN.
    """
    model = press(driven=driven)
    kc.emit(model, dynamics=True).write(tmp_path)
    path, system = tmp_path / "press.py", model.system() if is_known else None
    original = kc.load(path)
    assert kc.verify(remember_model(original, model.system())).passed
    known, unseen, equivalent = numbers(original), [], 0
    chosen = list(mutants(path.read_text(encoding="utf-8"), "inline"))
    chosen = chosen[:: every if every > 1 else SHARE]
    for mutant in chosen:
        is_found, module = verdict(path, mutant, system)
        if not is_found and is_equivalent(module, known, may_refuse=True):
            equivalent += 1
        elif not is_found:
            unseen.append(f"{mutant.function}: {mutant.line}")
    record(tried=len(chosen), wrong=0, gave_up=equivalent + len(unseen))
    assert len(unseen) <= (0 if is_known else UNSEEN_OF_A_FILE), unseen
