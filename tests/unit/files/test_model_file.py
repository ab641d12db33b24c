"""Models as data: what is read, what is refused and where, and that writing and reading agree."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.files.file_format import model_schema
from kincompile.files.model_file import read_data_model
from kincompile.files.safe_expressions import parse_expression
from kincompile.files.write_model import value
from kincompile.model.expressions import alpha

FILE = Path("model.toml")

ARM = """\
kincompile = 1
name = "arm"
parameters = [
    { name = "length", default = 1.0, unit = "m" },
]
bodies = [{ name = "arm", guess = [1, 0, "pi/4"] }]

[analysis]
end = 2.0
points = 5

[[constraints]]
type = "Revolute"
name = "pin"
i = "arm"
point_i = ["-length", 0]
j = "ground"
point_j = [0, 0]

[[constraints]]
type = "AbsoluteAngle"
name = "motor"
body = "arm"
angle = "2*t"
"""


def toml(text):
    return read_data_model(FILE, text.encode())


def problems(text):
    with pytest.raises(kc.ModelError) as caught:
        toml(text)
    return caught.value.problems


def test_that_a_file_describes_a_mechanism():
    m = toml(ARM)
    assert (m.name, m.end, m.points, m.length_unit) == ("arm", 2.0, 5, "m")
    assert [body.guess for body in m.bodies] == [(1, 0, sympy.pi / 4)]
    solution = kc.solve(kc.compile(m), [0.5])
    np.testing.assert_allclose(solution.q[0], [np.cos(1), np.sin(1), 1], atol=1e-12)


def test_that_the_range_of_a_parameter_is_read_and_written():
    text = ARM.replace('unit = "m" }', 'unit = "m", range = [0.5, "3/2"] }')
    (parameter,) = toml(text).system().parameters
    assert parameter.range == (0.5, 1.5)
    assert "range = [0.5, 1.5]" in toml(text).to_toml()
    assert "range" not in toml(ARM).to_toml()
    (problem,) = problems(text.replace('"3/2"', '"length"'))
    assert problem.startswith("model.toml, line 4: parameter 'length', range, entry 2: ")
    (problem,) = problems(text.replace('[0.5, "3/2"]', "2"))
    assert "expected [least, greatest], not 2" in problem
    (problem,) = problems(text.replace('"3/2"', "0.75"))
    assert problem.endswith("its default 1 is outside its range from 0.5 to 0.75")


def test_that_a_range_changes_no_code():
    with_range = ARM.replace('unit = "m" }', 'unit = "m", range = [0.5, 1.5] }')
    texts = [kc.emit(toml(text)).source for text in (ARM, with_range)]
    assert texts[0] == texts[1]


def test_that_a_whole_number_beyond_exact_doubles_compiles():
    emitted = kc.emit(toml(ARM.replace('"-length"', '"asin(sin(9**64))"')))
    assert "3752932311025852488225131751057700648533240507401574081000934 * pi" in emitted.source


@pytest.mark.parametrize("form", ["toml", "json"])
def test_that_an_example_reads_back_to_the_same_code(example, form):
    text = example.model.to_toml() if form == "toml" else example.model.to_json()
    file = FILE.with_suffix(f".{form}")
    model = read_data_model(file, text.encode())
    assert kc.emit(model).source == example.source
    assert (model.end, model.points) == (example.model.end, example.model.points)


def test_that_each_example_has_its_data_file(example):
    model = kc.read(example.path.with_suffix(".toml"))
    assert kc.emit(model).source == example.source


def test_that_a_table_reads_back():
    m = kc.Mechanism("table")
    cam, pin = m.body("cam"), m.body("pin", guess=(1, 0, 0))
    angles = [k * 0.7 for k in range(9)]
    profile = (angles, [1 + 0.1 * np.cos(x) for x in angles])
    m.add(kc.Revolute("shaft", cam, (0, 0), m.ground, (0, 0)))
    m.add(kc.PointFollower("slot", pin, (0, 0), cam, (0, 0), profile, guess=0.1))
    m.add(kc.AbsoluteAngle("still", pin, 0))
    m.add(kc.AbsoluteY("level", pin, (0, 0), 0))
    m.add(kc.AbsoluteAngle("motor", cam, kc.t))
    text = m.to_toml()
    assert "smoothness = 4" in text
    assert kc.emit(toml(text)).source == kc.emit(m).source
    assert "write smoothness = 4" in problems(text.replace("smoothness = 4", "smoothness = 2"))[0]


def test_that_every_constraint_can_be_written_and_read():
    m = kc.Mechanism("all")
    a, b = m.body("a", guess=(1, 2, 3)), m.body("b", guess=(4, 5, 6))
    rho = 1 + sympy.cos(kc.alpha) / 3
    point, axis = (0.5, sympy.Rational(1, 3)), (1, 0)
    for item in (
        kc.AbsoluteX("c1", a, point, kc.t), kc.AbsoluteY("c2", a, point, 1),
        kc.AbsoluteAngle("c3", a, sympy.exp(1)), kc.AbsoluteDistance("c4", a, point, axis, 2),
        kc.RelativeX("c5", a, point, b, point, 1), kc.RelativeY("c6", a, point, b, point, 1),
        kc.RelativeAngle("c7", a, b, 1), kc.Distance("c8", a, point, b, point, 2 + kc.t),
        kc.Revolute("c9", a, point, b, axis),
        kc.Translational("d1", a, point, axis, b, point, axis),
        kc.RevoluteTranslational("d2", a, point, axis, b, point, 1),
        kc.TranslationalDistance("d3", a, point, axis, b, point, 1),
        kc.Gear("d4", a, point, 1, 0, b, point, 2, kc.pi),
        kc.RackAndPinion("d5", a, point, axis, 0, b, point, 2, kc.pi),
        kc.CamFollower("d6", a, point, rho, b, point, rho, guess=(1, kc.pi / 2)),
        kc.CamFlatFollower("d7", a, point, rho, b, point, axis, guess=1),
        kc.PointFollower("d8", a, point, b, point, rho),
        kc.Equation("d9", a.x + b.x - 1, a.y * sympy.sqrt(2) - kc.t),
    ):  # fmt: skip
        m.add(item)
    written = m.to_toml()
    assert toml(written).to_toml() == written
    assert read_data_model(FILE.with_suffix(".json"), m.to_json().encode()).to_toml() == written


x, y = sympy.symbols("x y")
LEAVES = st.sampled_from([x, y, sympy.pi, sympy.E, sympy.Rational(2, 3), sympy.Float(0.1)])
TREES = st.recursive(
    LEAVES | st.integers(-9, 9).map(sympy.Integer),
    lambda inner: st.one_of(
        st.tuples(inner, inner).map(lambda pair: pair[0] + pair[1]),
        st.tuples(inner, inner, inner).map(lambda three: sympy.Mul(*three)),
        inner.map(sympy.sin),
        inner.map(lambda item: -(item**2)),
        inner.map(lambda item: sympy.sqrt(1 + item**2)),
        inner.map(lambda item: sympy.Piecewise((item, (x > 1) & (y < 2)), (x, True))),
    ),
    max_leaves=8,
)


@settings(max_examples=150)
@given(TREES)
def test_that_an_expression_reads_back_as_it_was_written(expression):
    text = value(expression)
    read = parse_expression(text, {"x": x, "y": y}) if isinstance(text, str) else text
    assert sympy.sympify(read) == expression


def test_that_what_a_file_cannot_hold_is_refused():
    m = kc.Mechanism("late")
    arm = m.body("arm")
    m.add(kc.AbsoluteAngle("c", arm, sympy.Piecewise((kc.t, kc.t < 1), (2 * kc.t - 1, True))))
    with pytest.raises(kc.ModelError, match="corner"):
        m.to_toml()


# text in ARM, what replaces it, line and beginning of the message
LOCATED = {
    "version": ("kincompile = 1\n", "kincompile = 2\n", 1, "kincompile: format 1 is read here"),
    "no model": ("kincompile = 1\n", "", 1, "this is not a model for kincompile"),
    "name": ('name = "arm"\np', 'name = "1"\np', 2, "name: the model is named '1'"),
    "unknown field": ("unit =", "units =", 4, "parameter 'length', units: there is no such field"),
    "number as text": ("1.0,", '"1.0",', 4, "parameter 'length', default: expected a number, not"),
    "nan": ("1.0,", "nan,", 4, "parameter 'length', default: nan is not a finite number"),
    "infinity": ("end = 2.0", "end = inf", 9, "analysis, end: inf is not a finite number"),
    "text as end": ("end = 2.0", 'end = "2"', 9, "analysis, end: expected a number, not '2'; wr"),
    "points": ("points = 5", "points = 0", 10, "analysis, points: expected a whole number"),
    "guess": ('[1, 0, "pi/4"]', "[1, 0]", 6, "body 'arm', guess: expected [x, y, phi], not a list"),
    "beyond": ('"pi/4"', '"exp(exp(exp(exp(9))))"', 6, "guess of phi_arm: exp(exp(exp(exp(9))"),
    "no type": ('type = "Revolute"', 'type = "Revolut"', 13, "constraint 'pin', type: there is no"),
    "missing": ('j = "ground"\n', "", 12, "constraint 'pin': no j; fields are: type, name, i"),
    "body": ('i = "arm"', 'i = "amr"', 15, "constraint 'pin', i: there is no body 'amr'; did you"),
    "unknown name": ('"-length"', '"-lenght"', 16, "constraint 'pin', point_i, entry 1: column 2"),
    "function": ('"2*t"', '"open(t)"', 24, "constraint 'motor', angle: column 1 of 'open(t)'"),
    "assignment": ('"2*t"', '"t=2"', 24, "constraint 'motor', angle: column 1 of 't=2'"),
    "point": ("[0, 0]", "[0]", 18, "constraint 'pin', point_j: expected [xi, eta], not a list o"),
    "truth": ("[0, 0]", "[0, true]", 18, "constraint 'pin', point_j, entry 2: expected a number"),
    "date": ("[0, 0]", "[0, 1979-05-27]", 18, "constraint 'pin', point_j, entry 2: expected a nu"),
    "driver": ('"2*t"', '"x_arm"', 24, "AbsoluteAngle 'motor', angle: the value x_arm depends on"),
    "name twice": ('"motor"', '"pin"', 22, "constraint 'pin', name: 'pin' is the name in line 12"),
    "no value": ("2.0", "", 9, "this is not TOML: Invalid value"),
    "key twice": ("points = 5", "end = 3", 10, "this is not TOML: Cannot overwrite a value"),
    "cut short": (ARM[ARM.index('"2*t"') :], '"2*', 24, "this is not TOML"),
}  # fmt: skip


@pytest.mark.parametrize("name", LOCATED)
def test_that_a_problem_has_line_and_field(name):
    old, new, line, message = LOCATED[name]
    assert ARM.count(old) >= 1
    (problem,) = problems(ARM.replace(old, new, 1))
    assert problem.startswith(f"model.toml, line {line}: {message}"), problem


def test_that_all_problems_are_told_at_once():
    text = ARM.replace('"-length"', '"-lenght"').replace("1.0,", '"1",').replace('"2*t"', '"x_arm"')
    found = problems(text)
    assert [problem.split(":")[0] for problem in found] == [
        f"model.toml, line {line}" for line in (4, 16, 24)
    ]


MOTIONS = {
    "sequence": '{ points = [[0, 0], ["1", "60*deg"], [2, "pi/3"]], law = "cycloidal" }',
    "laws": '{ points = [[0, 0], [1, "60*deg"], [2, "pi/3"]], law = ["cycloidal", "linear"] }',
    "formula": '"60*deg*modified_sine(t)"',
    "table": '{ times = [0, 1, 2], values = [0, "60*deg", "pi/3"], velocities = [0, 0] }',
}


@pytest.mark.parametrize("name", MOTIONS)
def test_that_a_motion_is_data_and_is_written_back(name, tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(ARM.replace('"2*t"', MOTIONS[name]), encoding="utf-8")
    module = kc.compile(kc.read(path))
    angles = kc.solve(module, [0.0, 1.0, 2.0])["phi_arm"]
    assert angles == pytest.approx(np.array([0, np.pi / 3, np.pi / 3]), abs=1e-14)
    again = tmp_path / "again.toml"
    again.write_text(kc.read(path).to_toml(), encoding="utf-8")
    assert kc.compile(kc.read(again)).FINGERPRINT == module.FINGERPRINT


NO_MOTIONS = {
    "{ points = [[0, 0], [1, 1]], law = 3 }": "law: expected a law of motion, or a list",
    "{ points = [[0, 0], [2, 1], [1, 0]] }": "motion sequence: times must rise, but 1 follows 2",
    "{ points = [[0, 0], [1]] }": "points, entry 2: expected [time, value], not a list of 1",
    '{ points = [[0, 0], [1, 1]], law = "cyclodial" }': "not 'cyclodial'; did you mean 'cycloidal'",
    "{ points = 3 }": "points: expected a list of points [time, value], 2 or more, not 3",
    "{ points = [[0, 0], [1, 1]], laws = 3 }": "laws: there is no such field; did you mean 'law'",
    "{ times = [0, 1], values = [0, 1, 2] }": "times: expected a list of three numbers or more",
    "{ times = [0, 1, 2] }": "no values; fields are: times, values, velocities",
    '{ times = [0, 1, 2], values = [0, 1, "t"] }': "values, entry 3: t is not a number",
    "{ }": "no points; fields are: points, law, ramp",
}


@pytest.mark.parametrize("given", NO_MOTIONS)
def test_that_a_motion_that_is_none_is_said(given):
    (problem,) = problems(ARM.replace('"2*t"', given))
    assert problem.startswith("model.toml, line 24: constraint 'motor', angle")
    assert NO_MOTIONS[given] in problem


def test_that_degrees_of_lengths_are_told_with_their_lines():
    text = ARM.replace('[1, 0, "pi/4"]', '["20*deg", 0, "20*deg"]').replace("1.0,", '"3*deg",')
    found = problems(text.replace('"-length"', '"-length*deg"'))
    assert [problem.split(":")[0] for problem in found] == [
        f"model.toml, line {line}" for line in (4, 6, 16)
    ]
    assert all("is in degrees, and this is no angle" in problem for problem in found)


def test_that_very_many_problems_are_cut():
    rows = ", ".join('{ name = "1" }' for _ in range(200))
    found = problems(f"kincompile = 1\nname = 'a'\nconstraints = []\nbodies = [{rows}]\n")
    assert len(found) <= 51


JSON = json.dumps(
    {
        "kincompile": 1,
        "name": "arm",
        "bodies": [{"name": "arm"}],
        "constraints": [{"type": "AbsoluteAngle", "name": "motor", "body": "arm", "angle": "t"}],
    },
    indent=1,
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"t"', "NaN", "line 14: constraint 'motor', angle: nan is not a finite number"),
        ('"t"', "-Infinity", "line 14: constraint 'motor', angle: -inf is not a finite number"),
        ('"t"', "1" * 5000, "line 14: a number has thousands of digits"),
        ('"t"', "null", "line 14: constraint 'motor', angle: expected a number or a formula"),
        ('"body"', '"name"', "line 13: the key 'name' is given a second time, after line 12"),
        (
            '   "name": "arm"',
            '   "name": "arm",\n   "name": "rod"',
            "line 7: the key 'name' is given a second time, after line 6; keep one of them",
        ),
        ('"t"', '"t', "line 14: this is not JSON: Invalid control character"),
        (JSON, "[" * 100_000, "line 1: the file is nested too deeply"),
        (JSON, "7", "line 1: expected names and values, not 7"),
        (JSON, "", "line 1: this is not JSON: Expecting value"),
    ],
)
def test_that_json_is_refused_with_line_and_field(old, new, message):
    with pytest.raises(kc.ModelError) as caught:
        read_data_model(Path("model.json"), JSON.replace(old, new).encode())
    assert caught.value.problems[0].startswith(f"model.json, {message}"), caught.value.problems[0]


def test_that_another_encoding_is_refused_with_its_line():
    with pytest.raises(kc.ModelError, match=r"line 2: this is not text in UTF-8 \(byte 0xe9\)"):
        read_data_model(FILE, b"kincompile = 1\nname = '\xe9'\n")


def test_that_a_huge_file_is_refused(tmp_path):
    path = tmp_path / "huge.toml"
    with path.open("wb") as stream:
        stream.truncate(50_000_000)
    with pytest.raises(kc.ModelError, match=r"huge\.toml: the file has more than 8,000,000 bytes"):
        kc.read(path)


def test_that_read_does_not_run_python(tmp_path):
    path = tmp_path / "model.py"
    path.write_text("raise SystemExit", encoding="utf-8")
    with pytest.raises(kc.InputError, match=r"a model is a data file, ending in \.toml or \.json"):
        kc.read(path)


@pytest.mark.slow
def test_that_the_schema_agrees_with_the_reader(example):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    data = json.loads(example.model.to_json())
    jsonschema.validate(data, model_schema())
    data["constraints"][0]["type"] = "Revolut"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, model_schema())


def test_that_alpha_stands_in_profiles_alone():
    assert alpha.name not in toml(ARM).to_toml()
    assert "there is no 'alpha'" in problems(ARM.replace('"2*t"', '"alpha"'))[0]


TASKS = """
[tolerance]
of = ["tip.x"]
parameters = { a = { low = "-1/3", high = 1e-4, distribution = "uniform" } }
clearances = { "no name" = 2e-5 }

[fit]
parameters = { a = [0.1, "2*pi"] }
targets = [{ path = "tip", points = [[1, 2], [3, 4]], weight = 2.0 }, { moves = true }]
seed = 3

[sweep]
parameters = { a = { from = 0.2, to = 0.6, count = 5 } }
product = true
"""


@pytest.mark.parametrize("form", ["toml", "json"])
def test_tables_of_commands_come_back(form):
    given = tomllib.loads(TASKS)
    model = toml(ARM + TASKS)
    assert model.tasks == given
    text = model.to_toml() if form == "toml" else model.to_json()
    again = read_data_model(FILE.with_suffix(f".{form}"), text.encode())
    assert again.tasks == given
    assert again.system().tasks == given
    assert toml(ARM).tasks == {}
    assert text == (again.to_toml() if form == "toml" else again.to_json())


# What stands in a table of a command, and whether it may.
FIT = "[fit]\nparameters = { length = [0.1, 2] }\ntargets = [{ moves = true }]\n"
TABLES = {
    "samples at the limit": (FIT + "samples = 1_048_576", ""),
    "samples beyond it": (FIT + "samples = 1_048_577", "a whole number from 1 to 1,048,576"),
    "starts at the limit": (FIT + "starts = 10_000", ""),
    "starts beyond it": (FIT + "starts = 10_001", "a whole number from 1 to 10,000"),
    "seed at the limit": (FIT + "seed = 4_294_967_295", ""),
    "seed beyond it": (FIT + "seed = 4_294_967_296", "a whole number from 0 to 4,294,967,295"),
    "no samples of a tolerance": ("[tolerance]\nsamples = 0", ""),
    "most samples of a tolerance": ("[tolerance]\nsamples = 16_777_216", ""),
    "too many samples of a tolerance": ("[tolerance]\nsamples = 16_777_217", "to 16,777,216"),
    "misspelt field": (FIT + "sample = 3", "did you mean 'samples'"),
    "misspelt field of a target": (FIT.replace("moves", "move"), "expected one target"),
    "no targets": ("[fit]\nparameters = { length = [0.1, 2] }", "no targets; fields are"),
    "date": ("[sweep]\nparameters = { length = [2026-01-01] }", "entry 1: expected a number, not"),
    "number in quotes": ("[tolerance]\nparameters = { length = '1e-4' }", "without quotes"),
    "date of a tolerance": (
        "[tolerance]\nparameters = { length = 2026-01-01 }",
        "a number, two limits, or {",
    ),
    "table as a list": ("[tolerance]\nof = 3", "expected a list of names in quotes, not 3"),
    "search": (FIT + "search = 'ant'", "expected 'sobol', 'differential evolution', not 'ant'"),
    "true for a number": (FIT + "seed = true", "a whole number from 0 to"),
}


@pytest.mark.parametrize(("table", "message"), TABLES.values(), ids=TABLES)
def test_that_schema_and_reader_agree_on_tables_of_commands(table, message):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    data = tomllib.loads(f"{ARM}\n{table}")
    found = list(jsonschema.Draft202012Validator(model_schema()).iter_errors(data))
    if message:
        assert message in problems(f"{ARM}\n{table}")[0]
        assert found
    else:
        toml(f"{ARM}\n{table}")


def test_that_a_number_that_is_not_finite_is_no_value_of_a_command():
    assert "inf is not a finite number" in problems(ARM + "[sweep]\nparameters = { a = [inf] }")[0]


@pytest.mark.parametrize("text", ["10", " 1e5", "-.5", "2.", "+3_0"])
def test_that_a_number_in_quotes_is_no_constant(text):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    document = ARM.replace("1.0,", f'"{text}",')
    assert "write the number itself" in problems(document)[0]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(document), model_schema())


@pytest.mark.parametrize("text", ["2*pi", "1/2", "-(3)"])
def test_that_a_formula_is_a_constant(text):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    document = ARM.replace("1.0,", f'"{text}",')
    assert toml(document).system().parameters[0].default > -4
    jsonschema.validate(tomllib.loads(document), model_schema())


@pytest.mark.parametrize(("name", "most"), [("samples", 2**20), ("starts", 10_000)])
def test_that_a_fit_takes_as_many_as_a_file(name, most):
    target = kc.targets.value("arm.phi", [1.0], [0.5])
    with pytest.raises(kc.InputError, match=f"{name} is {most + 1}: .* from 1 to {most:,}"):
        kc.fit(toml(ARM), target, bounds={"length": (0.1, 2)}, **{name: most + 1})


def test_that_a_seed_is_one_that_every_generator_takes():
    target = kc.targets.value("arm.phi", [1.0], [0.5])
    with pytest.raises(kc.InputError, match="a whole number from 0 to 4,294,967,295"):
        kc.fit(toml(ARM), target, bounds={"length": (0.1, 2)}, seed=2**32)


def test_that_a_model_without_its_version_says_all_that_is_wrong(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(
        'name = "arm"\nbodies = [{ name = "lower arm" }]\n'
        'constraints = [{ type = "Revolut", name = "A", i = "ground", j = "arm" }]\n'
    )
    with pytest.raises(kc.ModelError) as error:
        kc.read_model(path)
    first, *others = error.value.problems
    assert "line 1: this is not a model for kincompile: one says kincompile = 1" in first
    assert "line 2: body 'lower arm'" in others[0]
    assert "line 3: constraint 'A'" in others[1]
