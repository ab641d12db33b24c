"""A new quantity is an entry in the table and the code that computes it: toys, everywhere."""

import json
import runpy
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from kincompile import quantities
from kincompile.emitters.emission import emit_program
from kincompile.errors import ContractError
from kincompile.ir.grouping import group
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.quantities import AT_POSITION, Quantity
from kincompile.runtime.load import check, from_source
from kincompile.runtime.native.module import make_native

TOYS = (
    Quantity("Phi_t", "equations", "none", AT_POSITION, False, "Derivative of Phi by time."),
    Quantity("column_sum", "coordinates", "none", AT_POSITION, True, "Sums of columns of Phi_q."),
    Quantity("Phi_q_twice", "equations", "coordinates", AT_POSITION, False, "Phi_q once more."),
    Quantity("diagonal", "coordinates", "coordinates", AT_POSITION, True, "Sums on a diagonal."),
    Quantity("Phi_p", "equations", "parameters", AT_POSITION, False, "Phi by parameters."),
    Quantity("outputs_p", "outputs", "parameters", AT_POSITION, False, "Outputs by parameters."),
    Quantity("total_p", "outputs", "parameters", AT_POSITION, True, "A sum by parameters."),
)
"""Rows of every kind, columns of every kind; constraints add to some, vectors and matrices."""

NAMES = tuple(toy.name for toy in TOYS)


@pytest.fixture
def toys(monkeypatch):
    monkeypatch.setattr(quantities, "QUANTITIES", (*quantities.QUANTITIES, *TOYS))


def with_toys(kernel):
    """Return a kernel that computes the toys from what it has: Phi, nu, entries of Phi_q, outputs.

    In the columns of parameters stands Phi, of row 0 in column 0 and of others in column 1.
    """
    Phi, Phi_q, nu, y = (kernel.outputs.get(name, ()) for name in ("Phi", "Phi_q", "nu", "outputs"))
    own = {
        "Phi_t": nu,
        "column_sum": sorted((column, 0, node) for _, column, node in Phi_q),
        "Phi_q_twice": Phi_q,
        "diagonal": [(column, column, node) for _, column, node in Phi_q],
        "Phi_p": [(row, int(row > 0), node) for row, _, node in Phi],
        "outputs_p": [(row, 1, node) for row, _, node in y],
        "total_p": [(0, 1, node) for _, _, node in (*Phi, *y)],
    }
    own = {name: tuple(entries) for name, entries in own.items()}
    return replace(kernel, outputs={**kernel.outputs, **own})


def program_of(path):
    """Return the program of an example with outputs; each adds to the row of its own in total_p."""
    model = runpy.run_path(str(path))["mechanism"]
    for body in model.bodies:
        model.output(f"height_{body.name}", body.y**2 + body.x)
    program = lower(model.system())
    made: dict[int, object] = {}

    def changed(instances):
        found = []
        for item in instances:
            kernel = made.setdefault(id(item.kernel), with_toys(item.kernel))
            found.append(replace(item, kernel=kernel))
        return tuple(found)

    parts = changed(program.instances), changed(program.observers)
    return replace(program, instances=parts[0], observers=parts[1])


def expected(program, q, t):
    """Return the toys by name, from Phi, Phi_q, nu and the outputs alone."""
    Phi, Phi_q, nu, _, y, *_ = interpret(program, q, 0 * q, t)
    sums, starts = Phi_q.sum(axis=-2), [item.first_row for item in program.instances]
    Phi_p = np.zeros((*Phi.shape, len(program.parameters)))
    Phi_p[..., 1] = Phi
    Phi_p[..., starts, 0], Phi_p[..., starts, 1] = Phi[..., starts], 0
    y_p = np.zeros((*y.shape, len(program.parameters)))
    y_p[..., 1] = y
    totals = y_p.copy()
    totals[..., 0, 1] += Phi.sum(axis=-1)
    return {
        "Phi_t": nu,
        "column_sum": sums,
        "Phi_q_twice": Phi_q,
        "diagonal": sums[..., np.newaxis] * np.eye(len(program.coordinates)),
        "Phi_p": Phi_p,
        "outputs_p": y_p,
        "total_p": totals,
    }


@pytest.fixture(params=["four_bar", "cam_flat_follower", "gear_train"])
def program(request, toys, example_named):
    return program_of(example_named(request.param).path)


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


def test_that_the_grouped_form_has_it(program):
    emitted = emit_program("numpy", group(program))
    module = from_source(emitted.source, program.name, emitted.arrays)
    assert_toys(module, program)
    named = module.OUTPUTS
    assert named == tuple(item.name for item in program.outputs)
    q, t = points(program)
    whole = module.diagonal(q, t)
    nonzeros = whole[(..., *module.PATTERN_diagonal.T)]
    np.testing.assert_array_equal(module.diagonal_nonzeros(q, t), nonzeros)


def test_that_compiled_c_has_it(program, quick_compiler):
    code = inline(program)
    module = from_source(emit_program("numpy", code).source, program.name)
    assert_toys(make_native(module, emit_program("c", code).files), program)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="octave-cli is not installed")
def test_that_octave_has_it(program, octave, tmp_path):
    emit_program("octave", inline(program)).write(tmp_path)
    q, t = (values[:3] for values in points(program))
    lines = [
        f"show('{name}', {program.name}_{name}({json.dumps(row.tolist())}', {time})');"
        for name in NAMES
        for row, time in zip(q, t.tolist(), strict=True)
    ]
    found = octave(lines)
    for name, known in expected(program, q, t).items():
        values = np.array(found[name]).reshape(known.shape)
        np.testing.assert_allclose(values, known, rtol=1e-12, atol=1e-12)


def test_that_octave_says_what_it_is(program):
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
        {list(NAMES)}.map((name) => m[name](q, t)))));
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
