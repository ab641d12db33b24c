"""A new quantity is an entry in the table and the code that computes it: two toys, everywhere."""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import kincompile as kc
from kincompile import quantities
from kincompile.errors import ContractError
from kincompile.ir.grouping import group
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.quantities import AT_POSITION, Quantity
from kincompile.runtime.contract import check
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native
from kincompile.targets.emission import emit_program

TOYS = (
    Quantity("Phi_t", "equations", "none", AT_POSITION, False, "Derivative of Phi by time."),
    Quantity("column_sum", "coordinates", "none", AT_POSITION, True, "Sums of columns of Phi_q."),
    Quantity("Phi_q_twice", "equations", "coordinates", AT_POSITION, False, "Phi_q once more."),
)
"""A vector of the equations, one of the coordinates to which constraints add, and a matrix."""

NAMES = tuple(toy.name for toy in TOYS)


@pytest.fixture
def toys(monkeypatch):
    monkeypatch.setattr(quantities, "QUANTITIES", (*quantities.QUANTITIES, *TOYS))


def with_toys(kernel):
    """Return a kernel that computes the toys: nu for Phi_t, and entries of Phi_q for the others."""
    sums = [(column, 0, node) for _, column, node in kernel.outputs["Phi_q"]]
    own = {
        "Phi_t": kernel.outputs["nu"],
        "column_sum": tuple(sorted(sums)),
        "Phi_q_twice": kernel.outputs["Phi_q"],
    }
    return replace(kernel, outputs={**kernel.outputs, **own})


def program_of(model):
    program = lower(model.system())
    kernels = {id(item.kernel): with_toys(item.kernel) for item in program.instances}
    instances = tuple(replace(item, kernel=kernels[id(item.kernel)]) for item in program.instances)
    return replace(program, instances=instances)


def expected(program, q, t):
    """Return the toys by name, from Phi_q and nu alone."""
    _, Phi_q, nu, _, *_ = interpret(program, q, 0 * q, t)
    return {"Phi_t": nu, "column_sum": Phi_q.sum(axis=-2), "Phi_q_twice": Phi_q}


@pytest.fixture(params=["four_bar", "cam_flat_follower", "gear_train"])
def program(request, toys, example_named):
    return program_of(example_named(request.param).model)


def points(program):
    rng = np.random.default_rng(4)
    return rng.uniform(-1, 1, (40, len(program.coordinates))), rng.uniform(0, 1, 40)


def assert_toys(module, program, names=NAMES):
    q, t = points(program)
    known = expected(program, q, t)
    for name in names:
        found = getattr(module, name)
        np.testing.assert_allclose(found(q, t), known[name], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(found(q[3], float(t[3])), known[name][3], rtol=1e-12, atol=1e-12)


def test_that_the_interpreter_adds_where_a_quantity_adds(program):
    q, t = points(program)
    found = interpret(program, q, 0 * q, t)
    names = [item.name for item in program.quantities]
    for name, known in expected(program, q, t).items():
        np.testing.assert_allclose(found[names.index(name)], known, rtol=1e-13, atol=1e-13)


def test_that_a_numpy_module_has_it(program):
    emitted = emit_program("numpy", inline(program))
    module = from_source(emitted.source, program.name)
    assert_toys(module, program)
    q, t = points(program)
    places = module.PATTERN_Phi_q_twice
    np.testing.assert_array_equal(places, module.PATTERN)
    whole = module.Phi_q_twice(q, t)
    np.testing.assert_array_equal(module.Phi_q_twice_nonzeros(q, t), whole[(..., *places.T)])


def test_that_the_grouped_form_adds_where_a_quantity_adds(program, monkeypatch):
    vectors = tuple(item for item in quantities.QUANTITIES if item is not TOYS[2])
    monkeypatch.setattr(quantities, "QUANTITIES", vectors)
    emitted = emit_program("numpy", group(program))
    module = from_source(emitted.source, program.name, emitted.arrays)
    assert_toys(module, program, ("Phi_t", "column_sum"))


def test_that_the_grouped_form_says_what_it_does_not_have(program):
    with pytest.raises(kc.UnsupportedError, match="no Phi_q_twice; use form='inline'"):
        emit_program("numpy", group(program))


def test_that_compiled_c_has_it(program, quick_compiler):
    code = inline(program)
    module = from_source(emit_program("numpy", code).source, program.name)
    assert_toys(make_native(module, emit_program("c", code).files), program)


def test_that_octave_has_a_function_of_it(program):
    files = emit_program("octave", inline(program)).files
    text = files[f"{program.name}_column_sum.m"]
    n = len(program.coordinates)
    assert f"function column_sum = {program.name}_column_sum(q, t, p)" in text
    assert f"column_sum = zeros({n}, 1);" in text
    assert "% Sums of columns of Phi_q, a column." in text
    assert f"% {program.coordinates[0].name}" in text


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
def test_that_javascript_has_it(program, tmp_path):
    (tmp_path / "module.js").write_text(emit_program("javascript", inline(program)).source)
    q, t = points(program)
    states = json.dumps([[row.tolist(), time] for row, time in zip(q, t, strict=True)])
    script = f"""
    const m = require("./module.js");
    console.log(JSON.stringify({states}.map(([q, t]) =>
        [m.Phi_t(q, t), m.column_sum(q, t), m.Phi_q_twice(q, t)])));
    """
    done = subprocess.run(
        ["node", "-e", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for found, known in zip(
        zip(*json.loads(done.stdout), strict=True), expected(program, q, t).values(), strict=True
    ):
        np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-12)


def test_that_the_contract_asks_for_it(monkeypatch, example_named):
    module = example_named("slider_crank").module
    monkeypatch.setattr(quantities, "QUANTITIES", (*quantities.QUANTITIES, TOYS[0]))
    with pytest.raises(ContractError, match="the function Phi_t is missing"):
        check(module)
