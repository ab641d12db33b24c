"""One behaviour, every target: the numbers, what has none, and what is refused."""

import json
import re

import numpy as np
import pytest

import kincompile as kc
from kincompile.emitters.c import target as c
from kincompile.emitters.javascript import target as javascript
from kincompile.emitters.numpy import target as numpy
from kincompile.emitters.octave import target as octave
from kincompile.emitters.printer import ELEMENTARY, Printer
from kincompile.emitters.registry import TARGETS, load_target
from kincompile.emitters.rust import target as rust
from kincompile.emitters.target import Target
from kincompile.ir import from_sympy

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
TOLERANCE = 1e-13


def assert_same(found, expected):
    """Compare each number with its own size and with that of its vector, or row of Phi_q."""
    for quantity in QUANTITIES:
        here, there = found[quantity], expected[quantity]
        assert here.shape == there.shape, quantity
        size = np.minimum(1 + np.abs(there), np.abs(there).max(axis=-1, keepdims=True))
        assert np.all(np.abs(here - there) <= TOLERANCE * size), quantity


def test_that_every_quantity_is_what_sympy_derives_from_phi(target, name, case_named):
    assert_same(target[name], case_named(name).expected)


def test_that_the_matrices_of_a_system_are_what_sympy_derives_from_phi(example, case_named):
    case = case_named(example.path.stem)
    shown = {item: case.evaluate(getattr(case.model, item)) for item in QUANTITIES}
    assert_same(shown, case.expected)


def test_that_outside_a_domain_there_is_no_number(target):
    np.testing.assert_array_equal(target["domain"]["Phi"], [[np.nan, 0, 0]])


def test_that_constants_are_those_of_the_numpy_module(emitted_module, name, case_named):
    module = case_named(name).module
    found = emitted_module[name]["constants"]
    assert found.keys() >= {"NAME", "COORDINATES", "UNITS", "DEFAULTS", "PATTERN"}
    # a NumPy module has them where there are any
    absent = {"OUTPUTS": (), "CORNERS": False, "REDUNDANT": ()}
    for constant, value in found.items():
        if not constant.isupper():  # functions
            continue
        expected = getattr(module, constant, absent.get(constant))
        assert plain(value) == plain(expected), constant


def plain(value):
    """Return a constant as JSON has it."""
    return json.loads(json.dumps(value.tolist() if isinstance(value, np.ndarray) else value))


def test_that_a_vector_of_another_length_is_refused(refused):
    vector, length, right, message = refused
    shape = rf"shape \({length},\).*must hold {right} numbers"
    numbers = rf"{length} numbers, not {right}$"
    assert re.search(rf"four_bar: {vector} has ({shape}|{numbers})", message)


# ---- what all targets say alike ------------------------------------------------------------------


MODULES: dict[str, Target] = {
    "numpy": numpy, "c": c, "octave": octave, "javascript": javascript, "rust": rust,
}  # fmt: skip
"""The modules of the table; mypy compares them with the protocol."""


def test_that_the_table_loads_the_module_of_each_target():
    assert {name: load_target(name) for name in TARGETS} == MODULES


@pytest.fixture(params=TARGETS)
def language(request) -> Target:
    """Return each target of the table."""
    return load_target(request.param)


def test_that_no_function_of_the_compiler_is_forgotten(language):
    called = {*from_sympy.FUNCTIONS.values(), "sqrt", "pow"}
    assert called <= set(ELEMENTARY) <= language.DIALECT.functions.keys()


def test_that_a_function_which_does_not_exist_is_named(language):
    printer = Printer(language.DIALECT, [("input", "x"), ("call", "erf", 0)], {0: "x"})
    message = f"the {language.DIALECT.language} target has no function 'erf'; use another target"
    with pytest.raises(kc.UnsupportedError, match=message):
        printer.text(1)


@pytest.mark.parametrize("name", [name for name, item in TARGETS.items() if not item.is_loadable])
def test_that_other_files_are_not_loaded_into_python(name, case_named):
    with pytest.raises(kc.UnsupportedError, match=r"only modules of the targets numpy, c can be"):
        kc.compile(case_named("top").model, target=name)
