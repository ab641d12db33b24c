"""What a user writes is declared once: schema, reader, writer and functions take the same."""

import inspect
import json
import tomllib
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

import kincompile as kc
from kincompile import spatial
from kincompile.cli import fit, tolerance
from kincompile.files.data_text import Document
from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.files.file_fields import FieldReader
from kincompile.files.file_format import DECLARED, model_schema, object_schema
from kincompile.files.model_file import read_data_model
from kincompile.files.write_model import row as written
from kincompile.files.write_model import toml_text
from kincompile.model import sections, tasks
from kincompile.model.declared import declared_fields, require
from kincompile.model.mechanism import changed as copied

COMMANDS = ("sweep", "tolerance", "fit", "transmission")
FIELDS = {name: declared_fields(cls) for name, cls in DECLARED.items()}
JUNK: tuple[object, ...] = (
    True,
    False,
    0,
    -3,
    2.5,
    10**9,
    "10",
    "2*pi",
    "sobol",
    [],
    [1, 2, 3],
    {},
    {"low": 1},
    None,
)


def values(schema, depth=3):
    """Return what makes values of a kind."""
    if "anyOf" in schema:
        return st.one_of([values(item, depth) for item in schema["anyOf"]])
    if "enum" in schema or "const" in schema:
        return st.sampled_from(schema.get("enum", [schema.get("const")]))
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        if name == "target":
            return st.one_of(
                [rows(declared_fields(item), depth) for item in tasks.TARGETS.values()]
            )
        numbers = st.floats(-1e6, 1e6) | st.integers(-9, 9) | st.sampled_from(["2*pi", "pi/9"])
        return numbers if name in ("constant", "expression") else rows(FIELDS[name], depth)
    match schema["type"]:
        case "integer":
            return st.integers(schema["minimum"], schema["maximum"])
        case "boolean":
            return st.booleans()
        case "number":
            return st.floats(-1e6, 1e6) | st.integers(-9, 9)
        case "string":
            if "pattern" in schema:
                return st.sampled_from(["a1", "B_2"])
            return st.sampled_from(["m", "a/b", "rad/s"])
        case "object":
            items = values(schema["additionalProperties"], depth - 1)
            return st.dictionaries(st.sampled_from("abc"), items, max_size=2)
    least = schema.get("minItems", 0)
    most = schema.get("maxItems", least + 2)
    return st.lists(values(schema["items"], depth - 1), min_size=least, max_size=most)


def rows(fields, depth=3):
    """Return what makes tables with these fields."""
    need = {key: values(item.schema, depth) for key, item in fields.items() if item.is_required}
    may = {key: values(item.schema, depth) for key, item in fields.items() if not item.is_required}
    return st.fixed_dictionaries(need, optional=may)


def changed(draw, value):
    """Return a value with one place in it, or itself, replaced by what may not stand there."""
    if isinstance(value, dict) and value and draw(st.booleans()):
        key = draw(st.sampled_from(sorted(value)))
        if draw(st.integers(0, 5)) == 0:
            return {other: item for other, item in value.items() if other != key}
        return {**value, key: changed(draw, value[key])}
    if isinstance(value, list) and value and draw(st.booleans()):
        k = draw(st.integers(0, len(value) - 1))
        return [*value[:k], changed(draw, value[k]), *value[k + 1 :]]
    return draw(st.sampled_from(JUNK))


def of_type(problems):
    """Return the problems but those that no schema sees: unknown names, times that do not rise."""
    unseen = ("there is no 'sobol'; the names are", ": motion ")
    return [text for text in problems if not any(words in text for words in unseen)]


def refused(name, row):
    """Return what the reader has against a table."""
    reader = FieldReader(Document("x.json", json.dumps({name: row}), {name: row}, is_toml=False))
    return of_type(reader.problems) if reader.table(row, name, (name,)) is None else []


@pytest.fixture(scope="module")
def whole():
    """Return the library of schemas, and the schema of a file."""
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    return jsonschema, model_schema()


@pytest.fixture(scope="module")
def schema():
    """Return what says whether the schema takes a table."""
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    whole = model_schema()
    return {
        name: jsonschema.Draft202012Validator({**whole["$defs"][name], "$defs": whole["$defs"]})
        for name in DECLARED
    }


@pytest.mark.parametrize("name", COMMANDS)
@given(data=st.data())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_that_schema_and_reader_take_the_same(schema, name, data):
    row = data.draw(rows(FIELDS[name]))
    assert schema[name].is_valid(row)
    assert refused(name, row) == []
    other = changed(data.draw, row)
    assert schema[name].is_valid(other) == (refused(name, other) == []), other


PARTS: dict[str, type] = {
    f"{prefix}{name}": cls
    for prefix, count in (("", PLANE), ("spatial_", SPACE))
    for name, cls in {**dimensions(count).parts(), **dimensions(count).tables()}.items()
    if name != "sketch"  # read by its parts, in their order
}
WRITTEN = PARTS | {name: DECLARED[name] for name in DECLARED if name not in ("sketch", *COMMANDS)}
"""All that a user writes, but tables of commands, which are tested above."""


def read(cls, row, names=None):
    """Return a table as its declared class, and what the reader has against it."""
    reader = FieldReader(Document("x.json", "", {"parts": [row]}, is_toml=False))
    return reader.made(cls, row, ("parts", 0), names or {}), reader.problems


@pytest.mark.every(5)
@pytest.mark.parametrize("name", WRITTEN)
@given(data=st.data())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_that_schema_and_reader_take_the_same_of_all_that_is_written(whole, name, data):
    jsonschema, (cls, defs) = whole[0], (WRITTEN[name], whole[1]["$defs"])
    schema = jsonschema.Draft202012Validator({**object_schema(declared_fields(cls)), "$defs": defs})
    row = data.draw(rows(declared_fields(cls)))
    for given_row in (row, changed(data.draw, row)):
        if isinstance(given_row, dict):
            found = of_type(read(cls, given_row)[1])
            assert schema.is_valid(given_row) == (found == []), (given_row, found)


DRAWN = ("drive", "spatial_drive", "spatial_rod", "span", "deviation", "sequence", "table")
"""What is not written as it was read: a motion is its formula, a drawing its bodies."""


@pytest.mark.every(5)
@pytest.mark.parametrize("name", sorted(WRITTEN.keys() - DRAWN))
@given(data=st.data())
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_that_all_that_is_written_reads_back(name, data):
    cls = WRITTEN[name]
    made, problems = read(cls, data.draw(rows(declared_fields(cls))))
    assert problems == []
    again, problems = read(cls, json.loads(json.dumps(written(made))))
    assert problems == []
    assert again == made


@given(data=st.data())
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_that_a_model_reads_back(data):
    """What is written of a body, a parameter, an output is read to the same."""
    made = {}
    for section, name in (("parameters", "parameter"), ("bodies", "body"), ("outputs", "output")):
        fields = {key: item for key, item in FIELDS[name].items() if key != "name"}
        made[section] = [{"name": f"{name}1"} | data.draw(rows(fields))]
    made["parameters"][0].pop("range", None)
    for key in ("mass", "inertia", "density", "thickness", "centre"):  # not any goes with any
        made["bodies"][0].pop(key, None)
    pin: dict[str, object] = {"type": "Revolute", "name": "A", "i": "body1", "j": "ground"}
    pin |= {"point_i": [0, 0], "point_j": [0, 0]}
    given_model = {"kincompile": 1, "name": "m", **made, "constraints": [pin]}
    first = read_data_model(Path("m.json"), json.dumps(given_model).encode())
    again = read_data_model(Path("m.toml"), first.to_toml().encode())
    for part in ("parameters", "bodies"):
        assert getattr(again.system(), part) == getattr(first.system(), part)
    assert again.to_toml() == first.to_toml()


def test_that_a_changed_copy_keeps_the_rest():
    m = kc.Mechanism("m", length_unit="mm", end=3, points=7)
    m.parameter("a", 1.0)
    m.body("rod", mass=1, inertia=2)
    m.gravity, m.tasks = (0, -9.81), {"fit": {}}
    kept = dict(vars(m))
    made = copied(m, bodies=[], end=5)
    assert vars(m) == kept
    assert vars(made) == kept | {"bodies": [], "end_given": 5}


@pytest.mark.parametrize("name", COMMANDS)
@given(data=st.data())
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_that_a_table_reads_back(name, data):
    row = data.draw(rows(FIELDS[name]))
    assert tomllib.loads(toml_text({name: row})) == {name: row}


@pytest.mark.parametrize("name", COMMANDS)
def test_that_functions_take_what_a_file_may_say(name):
    cls, simple = DECLARED[name], ("integer", "boolean")
    for key, item in declared_fields(cls).items():
        if "enum" not in item.schema and item.schema.get("type") not in simple:
            continue
        ends = [item.schema[end] for end in ("minimum", "maximum") if end in item.schema]
        for value in (*JUNK, *ends, *(end + step for end in ends for step in (-1, 1))):
            row = {"parameters": {"a": [0.1, 2]}, key: value}
            row |= {"targets": [{"moves": True}]} if name == "fit" else {}
            try:
                require(cls, **{item.attribute: value})
            except kc.InputError:
                assert refused(name, row), (key, value)
            else:
                assert not refused(name, row), (key, value)


def of_parts(sketch, count):
    """Return the methods of a drawing with what they draw; without `on` it is the ground."""
    others = {"on": None, "length": None} if count == PLANE else {"on": None}
    return [
        (getattr(sketch, kind), cls, {kind: "joint" if kind == "point" else None, **others})
        for kind, cls in dimensions(count).parts().items()
    ]


FUNCTIONS = [
    (kc.fit, tasks.Fit, {"parameters": "bounds"}),
    (kc.tolerance, tasks.Tolerance, {"parameters": "tolerances"}),
    (kc.Deviation, tasks.Limits, {}),
    *(
        (getattr(kc.targets, kind), cls, {kind: None})
        for kind, cls in tasks.TARGETS.items()
    ),
    (kc.Mechanism, sections.Analysis, {}),
    (kc.Mechanism.parameter, DECLARED["parameter"], {"default": None}),
    (kc.Mechanism.body, DECLARED["body"], {}),
    (kc.Mechanism.point, DECLARED["point"], {}),
    (kc.Mechanism.output, DECLARED["output"], {}),
    (spatial.Mechanism.body, PARTS["spatial_body"], {}),
    (spatial.Mechanism.point, dimensions(SPACE).tables()["point"], {}),
    (kc.motion.sequence, sections.MotionSteps, {"ramp": None}),  # a quarter, exactly
    (kc.motion.table, sections.MotionRows, {"over": None}),
    *of_parts(kc.Sketch, PLANE),
    *of_parts(spatial.Sketch, SPACE),
]  # fmt: skip


@pytest.mark.parametrize(("function", "cls", "names"), FUNCTIONS)
def test_that_functions_have_the_declared_defaults(function, cls, names):
    """Each field is an argument with its default; the one named as the kind is the first."""
    arguments = inspect.signature(function).parameters
    for name, item in declared_fields(cls).items():
        if (called := names.get(name, name)) is None:
            continue
        argument = arguments[called]
        if item.is_required:
            assert called == "bounds" or argument.default is inspect.Parameter.empty
        elif called != "tolerances":
            assert argument.default == item.default


@pytest.mark.parametrize(("command", "cls"), [(fit, tasks.Fit), (tolerance, tasks.Tolerance)])
def test_that_a_command_has_the_whole_numbers_of_its_table(command, cls):
    options = {item.name: item for item in command.command.params}
    wanted = {
        name: item
        for name, item in declared_fields(cls).items()
        if item.schema.get("type") == "integer"
    }
    assert {"samples", "seed"} <= set(wanted) <= set(options)
    for name, item in wanted.items():
        limits = options[name].type.min, options[name].type.max
        assert limits == (item.schema["minimum"], item.schema["maximum"])
        assert options[name].help == item.words
