"""The editor's model in node: kernels, factors, formulas and files against kincompile's own."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.emitters.javascript.kernels import kernels_script
from kincompile.model.catalogue import CONSTRAINTS
from tests.page_modules import in_node

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = sorted(
    path
    for folder in ("examples", "examples/exercises", "examples/synthesis", "examples/transmissions")
    for path in (ROOT / folder).glob("*.toml")
    if "space = 3" not in path.read_text(encoding="utf-8")
)
REFUSED = {
    "cam_by_table": "a cam given by a table",
    "example_3_7_5": "coordinates of free equations",
    "problem_3_5_6": "coordinates of free equations",
}
"""Examples in the plane that the editor does not open, and what it says."""

MODULES = """
import { Bound } from './bound.js';
import { modelOf } from './sketched.js';
import { readToml, writeToml } from './toml.js';
import { Factors } from './sparse.js';
import { driverOf, jetOf } from './formula.js';
import { Editing } from './editing.js';
import { writePython } from './python_text.js';
import * as hand from './edits.js';
const solved = text => {
  const model = modelOf(readToml(text)), bound = new Bound(model);
  const last = Math.max(model.count - 1, 1);
  const t = Float64Array.from({ length: model.count }, (_, k) => model.end * k / last);
  const { q, q_dot, q_ddot, failed } = bound.solver.solve(bound, t);
  const arrays = { q: [...q], q_dot: [...q_dot], q_ddot: [...q_ddot] };
  return { names: bound.COORDINATES, failed: failed?.index ?? null, ...arrays };
};
"""


def run(program, given=None):
    """Return what a program tells that has the modules of the editor's model."""
    return in_node(f"{kernels_script()}globalThis.kernels = kernels;\n{MODULES}{program}", given)


def own_solution(model):
    """Return the motion of a model over its own times."""
    system = model.system()
    return kc.solve(kc.compile(model), np.linspace(0, system.end, system.points))


def require_equal(found, solution, name):
    """Compare a motion of the page with kincompile's, relative to the size of each coordinate."""
    assert found["names"] == list(solution.coordinates), name
    assert (found["failed"] is None) == solution.success, name
    for key in ("q", "q_dot", "q_ddot"):
        wanted = getattr(solution, key)
        numbers = np.array(found[key], dtype=float).reshape(wanted.shape)
        scale = np.nanmax(np.abs(wanted), axis=0, initial=1.0)
        np.testing.assert_allclose(numbers / scale, wanted / scale, rtol=0, atol=1e-9, err_msg=name)


# ---- kernels -----------------------------------------------------------------------------------

BODIES = {"i": "one", "j": "other"}
PROFILE = "0.7 + 0.1*cos(2*alpha) + 0.05*sin(alpha)**2"
DRIVEN = "0.6 + 0.2*sin(2*t)"
TEXTS = {"profile": PROFILE, "value": DRIVEN, "distance": DRIVEN}


def model_of(name):
    """Return a file with one constraint of a type, with numbers that mean nothing."""
    rng = np.random.default_rng(sum(map(ord, name)))
    lines = [f'type = "{name}"', 'name = "k"']
    for key, item in CONSTRAINTS[name].arguments().items():
        kind = item.kind.name.lower()
        size = 2 if kind in ("point", "axis") else None
        number = np.asarray(rng.uniform(0.3, 1, size)).tolist()
        text = BODIES[item.symbol] if kind == "body" else TEXTS.get(kind)
        lines.append(f"{key} = {json.dumps(number if text is None else text)}")
    bodies = 'bodies = [{ name = "one" }, { name = "other" }]'
    return f'kincompile = 1\nname = "m"\n{bodies}\n[[constraints]]\n' + "\n".join(lines) + "\n"


def test_that_every_type_has_the_values_of_the_emitted_module(tmp_path):
    """Off the manifold, at numbers without a pattern."""
    given, wanted = [], []
    for k, name in enumerate(CONSTRAINTS):
        path = tmp_path / f"{name}.toml"
        path.write_text(model_of(name), encoding="utf-8")
        written = path.with_suffix(".py")
        written.write_text(kc.emit(kc.read(path), "numpy").source, encoding="utf-8")
        module = kc.load(written)
        rng = np.random.default_rng(k)
        q, q_dot = rng.normal(size=(2, module.N_COORDINATES))
        given.append([model_of(name), q.tolist(), q_dot.tolist(), 0.3])
        p = np.array(module.DEFAULTS)
        wanted.append(
            [module.Phi(q, 0.3, p), module.Phi_q(q, 0.3, p), module.nu(q, 0.3, p),
             module.gamma(q, q_dot, 0.3, p)]
        )  # fmt: skip
    found = run(
        """tell(given.map(([text, q, q_dot, t]) => {
  const bound = new Bound(modelOf(readToml(text))), at = bound.point();
  at.q.set(q);
  at.q_dot.set(q_dot);
  at.t = t;
  bound.position_at(at);
  bound.nu_at(at);
  bound.gamma_at(at);
  return [at.Phi, bound.rows_of(at), at.nu, at.gamma].map(x => Array.from(x));
}));""",
        given,
    )
    for name, one, other in zip(CONSTRAINTS, found, wanted, strict=True):
        for here, there in zip(one, other, strict=True):
            np.testing.assert_allclose(here, there, rtol=1e-13, atol=1e-13, err_msg=name)


# ---- motions of files --------------------------------------------------------------------------


@pytest.mark.slow
def test_that_examples_move_as_kincompile_solves_them():
    texts = {path.stem: path.read_text(encoding="utf-8") for path in EXAMPLES}
    found = run(
        """tell(given.map(text => {
  try { return solved(text); } catch (error) { return error.message; }
}));""",
        list(texts.values()),
    )
    refused = {}
    for path, item in zip(EXAMPLES, found, strict=True):
        if isinstance(item, str):
            refused[path.stem] = item
        else:
            require_equal(item, own_solution(kc.read(path)), path.stem)
    assert refused.keys() == REFUSED.keys()
    assert all(text in refused[name] for name, text in REFUSED.items())


DRAWN = """
const files = {};
const draw = (name, editing, edit) => {
  editing.edit(edit);
  files[name] = writeToml(editing.file);
  return editing;
};
const joints = (file, places, held) =>
  places.map((place, k) => hand.addJoint(file, place, held.includes(k)));
const bar = draw('four-bar', new Editing(), file => {
  const [A, B, C, D] = joints(file, [[0, 0], [0.3, 0.8], [2, 1.5], [2, 0]], [0, 3]);
  [[A, B], [B, C], [D, C]].forEach(ends => hand.addLink(file, ends));
  hand.extendLink(file, 'link2', hand.addJoint(file, [1.2, 2]));
  hand.addDriver(file, 'link1');
});
draw('pulled', bar, file => hand.moveJoint(file, 'B', [0.35, 0.6]));
draw('slider', bar, file => {
  const [F] = joints(file, [[3.5, 1]], []);
  hand.addLink(file, ['C', F]);
  hand.addSlider(file, F, [1, 0]);
});
draw('gears', new Editing(), file => {
  const [A, B] = joints(file, [[0, 0], [1.5, 0]], [0, 1]);
  hand.addGear(file, A, B);
  hand.addDriver(file, 'wheel1');
});
draw('cylinder', new Editing(), file => {
  const [A, B, C] = joints(file, [[0, 0], [1, 0.4], [0.3, -0.5]], [0, 2]);
  hand.addLink(file, [A, B]);
  hand.addCylinder(file, C, B);
});
draw('slot', new Editing(), file => {
  const [A, B, C, D] = joints(file, [[0, 0], [0.4, 0.1], [-0.5, -0.6], [0.8, 0.7]], [0, 2]);
  hand.addLink(file, [A, B]);
  hand.addLink(file, [C, D]);
  hand.addSlot(file, B, 'C D');
  hand.addDriver(file, 'link1');
  const value = { points: [[0, 0.2], [0.4, 0.8], [0.6, 0.8], [1, 0.2]], law: 'cycloidal' };
  hand.sketchOf(file).parts.at(-1).value = value;
});
"""


@pytest.mark.slow
def test_that_what_is_drawn_and_saved_moves_as_kincompile_solves_it(tmp_path):
    drawn = DRAWN.replace("  hand.addPoint;\n", "").replace("[F] = [[3.5, 1]]", "[F] = [[3.5, 1]]")
    program = f"{drawn}tell(Object.fromEntries(Object.entries(files).map(([name, text]) => "
    program += "[name, { text, python: writePython(readToml(text)), ...solved(text) }])));"
    found = run(program)
    assert len(found) == 6
    for name, item in found.items():
        path = tmp_path / f"{name}.toml"
        path.write_text(item["text"], encoding="utf-8")
        model = kc.read(path)
        require_equal(item, own_solution(model), name)
        names: dict[str, kc.Mechanism] = {}
        exec(item["python"], names)
        require_equal(item, own_solution(names["m"]), f"{name} as Python")


# ---- what is found -----------------------------------------------------------------------------

A_SKETCH = """kincompile = 1
name = "m"
[sketch]
ground = {{ A = [0, 0], D = [2, 0], F = [1, 0] }}
joints = {{ B = [0, 1], C = {C}, E = [1, 1] }}
parts = [
    {{ link = "a", joints = "A B" }},
    {{ link = "b", joints = "B C E" }},
    {{ link = "c", joints = "D C" }},
    {more}
]
"""
DRIVE, THIRD = '{ drive = "a", value = "pi/2 + t" },', '{ link = "d", joints = "F E" },'
STRETCHED = A_SKETCH.format(C="[2, 1]", more=DRIVE).replace("B = [0, 1]", "B = [0.5, 0]")
FOUND = {
    "a four-bar": A_SKETCH.format(C="[2, 1.5]", more=DRIVE),
    "without a driver": A_SKETCH.format(C="[2, 1.5]", more=""),
    "a third crank": A_SKETCH.format(C="[2, 1]", more=THIRD + DRIVE),
    "a truss at a change point": A_SKETCH.format(C="[2, 1]", more=THIRD),
    "two drivers": A_SKETCH.format(C="[2, 1.5]", more=f'{DRIVE}{{ drive = "c", value = "pi/2" }}'),
    "stretched": STRETCHED.replace("C = [2, 1]", "C = [1.2, 0]").replace('"pi/2 + t"', '"t"'),
}


@pytest.mark.slow
def test_that_redundant_joints_move_as_kincompile_solves_them(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(FOUND["a third crank"], encoding="utf-8")
    found = run("tell(solved(given));", FOUND["a third crank"])
    with pytest.warns(kc.RedundantConstraintWarning):
        solution = own_solution(kc.read(path))
    require_equal(found, solution, "a third crank")


def test_that_counts_and_ranks_are_those_of_inspect(tmp_path):
    found = run(
        """tell(given.map(text => {
  const editing = new Editing();
  editing.openText(text);
  const { rank, REDUNDANT, rankAtStart, free } = editing.bound;
  return [rank, REDUNDANT, rankAtStart, editing.owners(free), editing.findings().lines];
}));""",
        list(FOUND.values()),
    )
    for (name, text), item in zip(FOUND.items(), found, strict=True):
        path = tmp_path / "model.toml"
        path.write_text(text, encoding="utf-8")
        wanted = kc.inspect(kc.read(path))
        rank, redundant, rank_at_start, free, lines = item
        assert rank == wanted.rank, name
        assert redundant == [*wanted.redundant, *wanted.conflicting], name
        assert free == ", ".join(wanted.free), name
        assert f"{wanted.mobility.coordinates} coordinates" in lines[0]
        if name != "two drivers":  # inspect leaves the conflict out, and looks at the rest
            assert rank_at_start == wanted.rank_at_start, name
            assert any("Singular at t = 0" in x for x in lines) == (rank_at_start < rank), name


# ---- parts -------------------------------------------------------------------------------------


def test_that_sparse_factors_solve_and_give_the_determinant():
    rng = np.random.default_rng(4)
    given: list[Any] = []
    for n in (1, 3, 12, 40):
        matrix = np.where(rng.uniform(size=(n, n)) < 3 / n, rng.normal(size=(n, n)), 0)
        matrix[rng.permutation(n), np.arange(n)] += 2
        places = np.argwhere(matrix)
        later = [matrix[i, j] * rng.uniform(-1, 1) for i, j in places]
        given.append([places.tolist(), [matrix[i, j] for i, j in places], later, n])
    found = run(
        """tell(given.map(([pattern, first, later, n]) => {
  const factors = new Factors(pattern, [...Array(n).keys()], Array(n).fill(1));
  return [first, later].map(entries => {
    const x = new Float64Array(n);
    factors.factor(Float64Array.from(entries));
    factors.solve(Float64Array.from({ length: n }, (_, k) => k + 1), x);
    return [[...x], factors.determinant];
  });
}));""",
        given,
    )
    for item, results in zip(given, found, strict=True):
        places, first, later, n = item
        for entries, (x, determinant) in zip((first, later), results, strict=True):
            matrix = np.zeros((n, n))
            matrix[tuple(np.array(places).T)] = entries
            np.testing.assert_allclose(matrix @ x, np.arange(1, n + 1), atol=1e-8)
            np.testing.assert_allclose(determinant, np.linalg.det(matrix), rtol=1e-8)


FORMULAS = (
    "a*sin(2*pi*t)**2/(1+t^2) - 3e-1", "exp(-t)*cos(t)", "sqrt(1 + a*t)", "t**3 - 2*t**-2",
    "(1+t)**1.5", "a**t", "-t**2", "tan(t)*atan(t) + asin(t/3)", "2*-t", "cot(t) + sec(t) + ln(t)",
    "cosh(t)*sinh(t)/tanh(t)", "30*deg*t", "t*acosh(1 + t) - atanh(t/4) + asinh(t) + acos(t/5)",
)  # fmt: skip


def test_that_formulas_have_the_derivatives_of_sympy():
    found = run("tell(given.map(text => jetOf(text, new Map([['a', 1.7]]), 't')(0.4)));", FORMULAS)
    t, a = sympy.symbols("t a")
    names = {"t": t, "a": a, "deg": sympy.pi / 180}
    for text, jet in zip(FORMULAS, found, strict=True):
        value = sympy.parse_expr(text.replace("^", "**"), local_dict=names)
        wanted = [float(value.diff(t, k).subs({t: 0.4, a: 1.7})) for k in range(4)]
        np.testing.assert_allclose(jet, wanted, rtol=1e-12, err_msg=text)


ONE_BODY = 'kincompile = 1\nbodies = [{ name = "b" }]\n[[constraints]]\nname = "k"\n'
TURNED = f'{ONE_BODY}type = "AbsoluteAngle"\nbody = "b"\n'
DRAWING = "kincompile = 1\n[sketch]\n"
HOSTILE = [
    ('kincompile = 1\nname = "m"\n[__proto__]\nx = 1\n', ""),
    ("kincompile = 1\n[constructor.prototype]\nx = 1\n", ""),
    (f"x = {'[' * 5000}", "levels"),
    ("a" * 1_100_000, "characters"),
    ("x = " + "[1],\n" * 60_000, "more behind"),
    (f"x = [{'1,' * 60_000}]", "values"),
    ('kincompile = 1\nx = "\\ud8', "text does not end"),
    ('kincompile = 1\nx = "\\q"', "escape"),
    ("kincompile = 2", "no model"),
    ("{", "JSON"),
    ('{"kincompile": 1, "__proto__": {"x": 1}}', ""),
    (f'{DRAWING}ground = {{ A = "1" }}\n', "pair"),
    (f'{DRAWING}parts = [{{ link = "a", joints = "A B" }}]\n', "no joint A"),
    (f'{DRAWING}parts = [{{ constructor = "a" }}]\n', "kind"),
    (f'{ONE_BODY}type = "constructor"\n', "type constructor"),
    ("kincompile = 1\nanalysis = { end = 1, points = 1e9 }\n", "number of times"),
    ("kincompile = 1\nspace = 3\n", "space"),
    (f'{TURNED}angle = "constructor(t)"\n', "no function"),
    (f'{TURNED}angle = "{"(" * 900}"\n', "levels"),
    (f'{TURNED}angle = "{"t+" * 1900}t"\n', "characters"),
    (f'{TURNED}angle = "t**1e300"\n', ""),
]
"""Files, and a part of what refuses each; "" where one may be opened."""


def test_that_hostile_files_are_refused_and_leave_the_model():
    """Within a second together, and without a change of any prototype."""
    found = run(
        """const begin = Date.now(), said = given.map(text => {
  const editing = new Editing();
  try {
    editing.openText(text);
  } catch (error) {
    return [error.message, editing.file.name];
  }
  return ['', editing.problem];
});
tell({ said, time: Date.now() - begin, x: {}.x ?? null });""",
        [text for text, _ in HOSTILE],
    )
    assert found["x"] is None
    assert found["time"] < 5000
    for (text, wanted), (message, name) in zip(HOSTILE, found["said"], strict=True):
        assert wanted in message, (text[:80], message)
        assert not message or name == "drawing"


PYTHON = """kincompile = 1
name = "m\\"); import os; (\\""
parameters = [{ name = "a", default = 1 }]
bodies = [{ name = "a" }]
[[constraints]]
type = "AbsoluteAngle"
name = "k"
body = "a"
angle = "a*t"
"""


def test_that_no_text_of_a_file_becomes_python():
    found = run("tell(writePython(readToml(given)));", PYTHON)
    names: dict[str, kc.Mechanism] = {}
    quoted = r'"m\"); import os; (\""'
    assert quoted in found
    exec(found.replace(quoted, '"m"'), names)
    assert [x.name for x in names["m"].system().constraints] == ["k"]
    changes = [
        ('name = "a"', 'name = "a; import os"'), ("a*t", "__import__(t)"), ("a*t", "sympify(t)"),
        ("AbsoluteAngle", "mechanism"), ("body =", "x_y ="), ("angle =", '"angle=1, x" ='),
    ]  # fmt: skip
    said = run(
        """tell(given.map(text => {
  try { return writePython(readToml(text)); } catch (error) { return error.message; }
}));""",
        [PYTHON.replace(*change) for change in changes],
    )
    for text in said:
        assert "is no name" in text or "is not known" in text, text


def test_that_the_editor_is_one_file_of_at_most_700_kilobytes(tmp_path):
    page = kc.editor().html
    assert len(page.encode()) <= 700_000
    model = kc.Sketch("m")
    model.joints(A=(0, 0), B=(1, 0))
    model.link("a", "A B")
    model.drive("a", kc.t)
    path = tmp_path / "m.toml"
    text = model.mechanism().to_toml()
    path.write_text(f"# </script><script>alert(1)</script>\n{text}", encoding="utf-8")
    assert "alert(1)" in kc.editor(path).html
    assert "<script>alert" not in kc.editor(path).html
    assert "src=" not in page
    assert "://" not in page


WITH_LIMITS = """
kincompile = 1
name = "m"
limits = [
    { joint = "A", greatest = 3 }, { joint = "D", greatest = 2 },
    { joint = "drive_crank", greatest = 9 }, { joint = "drive_rocker", greatest = 9 },
]

[sketch]
ground = { A = [0, 0], D = [4, 0] }
joints = { B = [1, 0.5], C = [3, 2] }
parts = [
    { link = "crank", joints = "A B" }, { link = "rod", joints = "B C" },
    { link = "rocker", joints = "D C" },
    { drive = "crank", value = "t" }, { drive = "rocker", value = "t" },
]
"""


def test_that_what_is_erased_takes_its_limits_with_it(tmp_path):
    (found,) = run(
        """const editing = new Editing();
editing.openText(given);
editing.edit(file => hand.erase(file, 'rocker'));
tell([writeToml(editing.file)]);""",
        WITH_LIMITS,
    )
    path = tmp_path / "m.toml"
    path.write_text(found, encoding="utf-8")
    assert [item.joint for item in kc.read_model(path).system().limits] == ["A", "drive_crank"]
