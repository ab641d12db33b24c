"""Units for co-simulation: what they give beside the runtime, and what they say of wrong calls.

FMPy reads the archives, loads their libraries and steps them; it shares no code with kincompile.
"""

import math
import os
import re
import subprocess
import sys
import warnings
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import sympy
from click.testing import CliRunner
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu

import kincompile as kc
from kincompile.cli import cli
from kincompile.errors import KincompileWarning
from tests import transmission_models
from tests.fmi_units import Units, instance_of, slider_crank, written

pytestmark = pytest.mark.usefixtures("quick_compiler")

ROOT = Path(__file__).resolve().parents[2]
MODELS = [
    x for folder in ("", "space") for x in sorted((ROOT / "examples" / folder).glob("*.toml"))
]
CALLS = ROOT / "tests" / "data" / "fmi_calls.c"
HEADERS = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
WARNINGS = ("-Wall", "-Wextra", "-Werror", "-O0")
DERIVATIVES = 'providesDirectionalDerivatives="true" providesAdjointDerivatives="true"'
RATES = ("{}", "der({})", "der({},2)")


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    return Units(tmp_path_factory.mktemp("units"))


def description(path):
    """Return the text of a unit's modelDescription.xml."""
    with zipfile.ZipFile(path) as archive:
        return archive.read("modelDescription.xml").decode()


def columns(solution, module, names) -> dict[str, np.ndarray]:
    """Return the columns of a solution by what a unit calls them."""
    found: dict[str, np.ndarray] = {}
    for own, values in (
        (module.COORDINATES, (solution.q, solution.q_dot, solution.q_ddot)),
        (
            module.OUTPUTS if hasattr(module, "OUTPUTS") else (),
            (solution.observed.y, solution.observed.y_dot, solution.observed.y_ddot),
        ),
    ):
        for form, of in zip(RATES, values, strict=True):
            found |= {form.format(names.get(x, x)): of[:, k] for k, x in enumerate(own)}
    return found


def names_of(model):
    """Return what a unit calls columns: of bodies and points by those, as ``rod.phi``."""
    system = model.system()
    found: dict[str, str] = {}
    for body, own in zip(system.bodies, system.body_columns, strict=True):
        names = [x.name for x in system.coordinates[own.start : own.stop]]
        found |= {x: f"{body.name}.{x[: -len(body.name) - 1]}" for x in names}
    for point in system.observers:
        if hasattr(point, "local"):
            found |= {x.name: f"{point.name}.{x.name[0]}" for x in point.rows}
    return found


def assert_motion_is_solved(path, model, values=None):
    """A unit is valid, and gives the motion of the runtime to 1e-12 of each column's size."""
    assert validate_fmu(str(path)) == []
    about = fmpy.read_model_description(str(path))
    step = float(about.defaultExperiment.stepSize)
    found = fmpy.simulate_fmu(str(path), output_interval=step, start_values=values or {})
    module = kc.compile(model)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)
        solution = kc.solve(module, found["time"], p=values)
    assert solution.success
    expected = columns(solution, module, names_of(model))
    outputs = [x.name for x in about.modelVariables if x.causality == "output"]
    assert set(expected) - set(outputs) == {x for x in expected if np.isnan(expected[x]).all()}
    for name in outputs:
        size = max(1.0, np.abs(expected[name]).max())
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=1e-12 * size)


def test_a_motion_is_that_of_the_runtime(units):
    assert_motion_is_solved(units["slider"], slider_crank())


def test_a_motion_with_other_parameters_is_that_of_the_runtime(units):
    assert_motion_is_solved(units["slider"], slider_crank(), {"r": 0.2, "L": 0.9})


def test_sensitivities_are_outputs(tmp_path):
    path = written(tmp_path, "x", slider_crank(), sensitivities=["r"])
    assert validate_fmu(str(path)) == []
    found = fmpy.simulate_fmu(str(path), output_interval=0.05)
    expected = -np.sin(2 * np.pi * found["time"]) / (0.3 * np.cos(found["rod.phi"]))
    np.testing.assert_allclose(found["phi_rod_by_r"], expected, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_motions_of_all_examples_are_those_of_the_runtime(path, tmp_path):
    model = kc.read_model(path)
    assert_motion_is_solved(written(tmp_path, "example", model), model)


def test_variables_have_names_units_starts_and_rates(units):
    about = fmpy.read_model_description(str(units["slider"]))
    variables = {x.name: x for x in about.modelVariables}
    rest = [x for x in variables if variables[x].causality == "output"]
    assert rest[:4] == ["crank.x", "crank.y", "crank.phi", "rod.x"]
    assert rest[9] == "der(crank.x)"
    assert {"P.x", "der(P.y)", "stroke", "der(stroke,2)", "der(speed)"} <= set(rest)
    assert "der(speed,2)" not in variables  # it would need a third rate, and is not known
    assert [(x, variables[x].start, variables[x].unit) for x in ("r", "L")] == [
        ("r", "0.1", "m"), ("L", "0.3", "m"),
    ]  # fmt: skip
    assert variables["der(rod.phi,2)"].unit == "rad/s^2"
    assert variables["der(rod.phi,2)"].derivative is variables["der(rod.phi)"]
    shown = {x.name: [y.name for y in x.displayUnits] for x in about.unitDefinitions}
    assert shown["rad/s"] == ["deg/s"]
    assert (about.defaultExperiment.stopTime, about.defaultExperiment.stepSize) == ("2.0", "0.05")
    assert DERIVATIVES not in description(units["slider"])


@pytest.mark.parametrize(
    ("unit", "factor", "powers"),
    [
        ("mm", 1e-3, {"m": 1}), ("deg/s", math.pi / 180, {"rad": 1, "s": -1}),
        ("kg*mm^2", 1e-6, {"kg": 1, "m": 2}), ("m/s^2", 1.0, {"m": 1, "s": -2}), ("rpm", 1.0, {}),
        ("in/rad", 0.0254, {"m": 1, "rad": -1}),
    ],
)  # fmt: skip
def test_units_are_written_in_those_of_the_si(unit, factor, powers):
    m = kc.Mechanism("pendulum")
    m.parameter("a", 1.0, unit)
    m.add(kc.AbsoluteAngle("motor", m.body("rod"), kc.t))
    m.add(kc.Revolute("A", m.ground, (0, 0), m.bodies[0], (0, 0)))
    text = kc.emit(m, "fmi").files["modelDescription.xml"]
    (line,) = text.split(f'<Unit name="{unit}">\n')[1:]
    first = line.split("\n", 1)[0].strip()
    expected = [f'{x}="{n}"' for x, n in powers.items()]
    expected += [f'factor="{factor!r}"'] if factor != 1 else []
    assert sorted(first.strip("</>").split()[1:] if "BaseUnit" in first else []) == sorted(expected)


def test_the_same_model_gives_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/nothing/there")
    with pytest.warns(KincompileWarning, match="its sources alone.*no C compiler was found"):
        first, second = (written(tmp_path, name, slider_crank()) for name in ("one", "two"))
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        assert {x.date_time for x in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def assert_outputs_are_those(path, f, amplitude):
    """A unit is valid, and gives x(u) and J(u) of a transmission along a path of its inputs."""
    assert validate_fmu(str(path)) == []
    times, inputs = np.linspace(0, 1, 21), len(f.inputs)
    u = f.home.u + amplitude * np.sin(np.outer(times, 1 + np.arange(inputs)))
    with instance_of(path) as unit:
        about = unit.about.modelVariables
        given, found = ([x.name for x in about if x.causality == y] for y in ("input", "output"))
        assert DERIVATIVES in description(path)
        starts = [float(x.start) for x in about if x.causality == "input"]
        assert starts == pytest.approx(f.home.u.tolist(), rel=1e-15)
        unit.begin()
        outputs, slopes = [], []
        for k, now in enumerate(u):
            unit.put(**dict(zip(given, now, strict=True)))
            unit.step(0.05 * k, 0.05)
            outputs.append(unit.get(*found))
            places = [[unit.place[x] for x in names] for names in (found, given)]
            slope, seed = unit.fmu.getDirectionalDerivative, [0.5, -2.0, 3.0][:inputs]
            slopes.append([slope(places[0], [x], [1.0]) for x in places[1]])
            along = slope(*places, seed)
            terms = np.transpose(slopes[-1]) * seed
            off = np.abs(along - terms.sum(axis=1))
            assert (off <= 1e-14 * np.abs(terms).sum(axis=1)).all()
            adjoint = [
                unit.fmu.getAdjointDerivative([x], places[1], [1.0], inputs) for x in places[0]
            ]
            np.testing.assert_array_equal(np.transpose(slopes[-1]), adjoint)
    np.testing.assert_allclose(outputs, f(u), rtol=0, atol=1e-12)
    expected = f.J(u)
    J = np.transpose(slopes, (0, 2, 1))  # noqa: N806 - its name in the field
    np.testing.assert_allclose(J, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_a_transmission_is_that_of_the_runtime(units):
    f = kc.transmission(transmission_models.five_bar(), ["motor_1", "motor_2"], "end")
    assert_outputs_are_those(units["five_bar"], f, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ankle", "crank_rocker", "delta", "five_bar"])
def test_transmissions_of_all_examples_are_those_of_the_runtime(name, tmp_path):
    model = kc.read_model(ROOT / "examples" / "transmissions" / f"{name}.toml")
    ends = [model.system().tasks["transmission"][x] for x in ("inputs", "outputs")]
    path = written(tmp_path, name, model, transmission=ends)
    assert_outputs_are_those(path, kc.transmission(model, *ends), 0.01 if name == "ankle" else 0.1)


def test_a_transmission_with_other_parameters_is_on_the_branch_of_the_first(units):
    f = kc.transmission(transmission_models.crank_rocker(), "motor", "rocker.phi")
    for p in ({"a": 0.05}, {"a": 0.08, "b": 0.24, "c": 0.16, "d": 0.26}, {"d": 0.115}):
        with instance_of(units["crank"]) as unit:
            unit.put(**p)
            unit.begin()
            unit.put(motor=2.0)
            assert unit.get("rocker.phi") == pytest.approx(f([2.0], p=p), abs=1e-12)


def test_parameters_lead_along_a_line_to_the_branch_of_the_model(tmp_path):
    """Newton from the first position ends on another of the many: it is near a singular one."""
    m = kc.Mechanism("comb")
    c, wheel = m.parameter("c", 0.99), m.body("wheel", (0, 0, math.asin(0.99) / 20))
    slide = m.body("slide")
    m.add(kc.Revolute("O", m.ground, (0, 0), wheel, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), slide, (0, 0), (1, 0)))
    m.add(kc.Equation("teeth", sympy.sin(20 * wheel.phi) - slide.x - c))
    path = written(tmp_path, "comb", m, transmission=(["slide.x"], ["wheel.phi"]))
    for value in (0.0, 0.5, -0.9, 0.999):
        with instance_of(path) as unit:
            unit.put(c=value)
            unit.begin()
            assert unit.get("wheel.phi") == [pytest.approx(math.asin(value) / 20, abs=1e-14)]


def heavy():
    m = kc.Mechanism("pendulum")
    rod = m.body("rod", mass=1.0, inertia=0.1)
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (-0.5, 0)))
    return m


CRANK = transmission_models.crank_rocker
REFUSED: dict[str, tuple[Any, dict[str, Any], type[Exception], str]] = {
    "unassembled": (
        lambda: CRANK(d=1.0), {}, kc.InputError,
        "no position of four_bar was found at t = 0, where a unit of FMI begins: change lengths",
    ),
    "undriven": (
        lambda: CRANK(motor=None), {}, kc.StructuralError,
        "a unit of FMI has a motion: 'four_bar' has 8 equations for 9 coordinates",
    ),
    "grouped": (
        slider_crank, {"form": "grouped"}, kc.UnsupportedError,
        "the target 'fmi' has no grouped form; use target='numpy', or form='inline'",
    ),
    "dynamics": (
        heavy, {"dynamics": True}, kc.UnsupportedError,
        "without equations of motion; leave out what is asked for beside it",
    ),
    "names": (
        lambda: CRANK(motor=None), {"transmission": (["phi_crank"], ["phi_crank"])}, kc.InputError,
        "two variables would be called crank.phi: parameters, inputs and outputs need names of",
    ),
    "velocity": (
        transmission_models.ankle, {"transmission": (["left", "right"], ["omega_x_foot"])},
        kc.InputError, "a unit of ankle has no value of omega_x_foot: a function of positions g",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_a_unit_is_refused_before_anything_is_written(name, tmp_path):
    model, how, kind, sentence = REFUSED[name]
    with pytest.raises(kind, match=re.escape(sentence)):
        written(tmp_path, "x", model(), **how)
    assert not list(tmp_path.iterdir())


def test_a_compiler_that_fails_leaves_the_old_archive(tmp_path, monkeypatch):
    old = tmp_path / "old.fmu"
    old.write_text("old")
    monkeypatch.setenv("CC", "false")
    with pytest.raises(kc.UnsupportedError, match="the C compiler failed"):
        kc.emit(slider_crank(), "fmi").write(old)
    assert old.read_text() == "old"
    assert list(tmp_path.iterdir()) == [old]


def test_the_command_line_writes_what_emit_gives(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/nothing/there")
    (tmp_path / "model.toml").write_text(slider_crank().to_toml())
    folder, own = tmp_path / "folder", tmp_path / "own.fmu"
    folder.mkdir()
    for output, path in ((own, own), (folder, folder / "slider_crank.fmu")):
        given = ["compile", str(tmp_path / "model.toml"), "--target", "fmi", "-o", str(output)]
        with warnings.catch_warnings():
            warnings.simplefilter("always", KincompileWarning)
            done = CliRunner().invoke(cli, given)
        assert (done.exit_code, done.stdout) == (0, "")
        assert done.stderr.startswith("Warning: the archive has its sources alone")
        assert done.stderr.endswith(f"Wrote {path}\n")
        with zipfile.ZipFile(path) as archive:
            texts = {x: archive.read(x).decode() for x in archive.namelist()}
        assert texts == kc.emit(slider_crank(), "fmi").files
    refused = CliRunner().invoke(cli, [*given[:-1], "-"])
    assert refused.exit_code == 2
    assert "slider_crank.fmu is an archive, which is not text: give -o a file" in refused.stderr


@pytest.fixture(scope="module")
def sources(units):
    """The folders of the sources of a motion and of a transmission."""
    return [Path(fmpy.extract(str(units[name]))) / "sources" for name in ("slider", "five_bar")]


@pytest.mark.parametrize("how", [("-std=c99", "-pedantic"), ("-std=c11", "-include", str(HEADERS))])
def test_sources_compile_without_a_warning_and_have_the_signatures_of_fmi(
    sources, how, quick_compiler, tmp_path
):
    """With FMI's own headers before it, a function with another signature is an error."""
    for folder in sources:
        (source,) = folder.glob("*_fmi.c")
        command = [quick_compiler, *how, *WARNINGS, "-c", source, "-o", tmp_path / "unit.o"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_unit_of_sources_alone_is_built_by_its_build_description(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/nothing/there")
    with pytest.warns(KincompileWarning, match="its sources alone"):
        path = written(tmp_path, "sources", slider_crank())
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    folder = fmpy.extract(str(path))
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build", configuration="Debug", all_warnings=True)
    found = fmpy.simulate_fmu(folder, output_interval=0.05)
    solution = kc.solve(kc.compile(slider_crank()), found["time"])
    np.testing.assert_allclose(found["stroke"], solution["stroke"], rtol=0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 1], ids=["motion", "transmission"])
def test_calls_from_c_under_sanitizers(sources, place, quick_compiler, tmp_path):
    """Also wrong ones: none reads or writes beside what is given, or loses memory."""
    folder = sources[place]
    about = fmpy.read_model_description(str(folder.parent))
    how = ["-std=c11", "-fsanitize=address,undefined", "-fno-sanitize-recover", *WARNINGS]
    given = [CALLS, *folder.glob("*.c"), "-I", HEADERS.parent, "-o", tmp_path / "calls", "-lm"]
    subprocess.run([quick_compiler, *how, *given], check=True)
    last = max(x.valueReference for x in about.modelVariables)
    command = [tmp_path / "calls", about.guid, str(last + 1), "ny"[place]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_units_are_linked_into_one_program(sources, quick_compiler, tmp_path):
    """A program can have several, whose functions have prefixes then."""
    objects = []
    for prefix, folder in zip(("first_", "second_"), sources, strict=True):
        for source in folder.glob("*.c"):
            objects.append(tmp_path / f"{source.stem}.o")
            how = [f"-DFMI3_FUNCTION_PREFIX={prefix}", "-std=c99", "-O0", "-c", source]
            subprocess.run([quick_compiler, *how, "-o", objects[-1]], check=True)
    main = tmp_path / "main.c"
    names = [f"{prefix}fmi3GetVersion" for prefix in ("first_", "second_")]
    main.write_text(
        "#include <stdio.h>\n"
        + "".join(f"const char *{name}(void);\n" for name in names)
        + f"int main(void) {{ return {' + '.join(f'puts({name}())' for name in names)} < 0; }}\n"
    )
    subprocess.run([quick_compiler, main, *objects, "-o", tmp_path / "both", "-lm"], check=True)
    done = subprocess.run([tmp_path / "both"], capture_output=True, text=True, check=True)
    assert done.stdout == "3.0\n3.0\n"
