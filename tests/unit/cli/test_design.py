"""`kincompile tolerance` and `kincompile fit`: from TOML alone to tables, a page and a model."""

import re
import tomllib

import numpy as np
import pytest

import kincompile as kc

MODEL = """
kincompile = 1
name = "slider_crank"
analysis = { end = 1.2, points = 25 }
parameters = [
    { name = "r", default = 0.1, unit = "m" },
    { name = "L", default = 0.3, unit = "m" },
    { name = "e", default = 0.02, unit = "m" },
]

[sketch]
ground = { O = [0, 0] }
joints = { A = [0.1, 0], B = [0.4, "e"] }
parts = [
    { link = "crank", joints = "O A", length = "r" },
    { link = "rod", joints = "A B", length = "L" },
    { slider = "ram", joints = "B", along = [1, 0] },
    { drive = "crank", value = "5*t" },
]
"""

TOLERANCE = """
[tolerance]
of = ["ram.x", "ram.x_dot"]
parameters.r = 1e-4
parameters.L = [-1e-4, 2e-4]
parameters.e = { low = -1e-4, high = 1e-4, distribution = "uniform" }
clearances = { B = 2e-5 }
samples = 64
"""

FIT = """
[fit]
parameters = { r = [0.05, 0.2], L = [0.2, 0.5] }
samples = 64
starts = 4
targets = [
    { value = "ram.x", values = [0.39, 0.33], times = [0.1, 0.25] },
    { limit = "L/r", least = 2.5, title = "rod to crank" },
    { moves = true },
]
"""


@pytest.fixture
def file(tmp_path):
    """Return a function that writes the model with tables."""

    def write(tables=TOLERANCE + FIT):
        path = tmp_path / "slider_crank.toml"
        path.write_text(MODEL + tables, encoding="utf-8")
        return path

    return write


def test_tolerances_of_a_file_are_those_of_python(kincompile, file, tmp_path):
    page = tmp_path / "page.html"
    done = kincompile("tolerance", file(), "--page", page)
    assert done.exit_code == 0, done.stderr
    limits = {
        "r": 1e-4,
        "L": (-1e-4, 2e-4),
        "e": kc.Deviation(-1e-4, 1e-4, "uniform"),
    }
    model = kc.read(file())
    of = ["ram.x", "ram.x_dot"]
    found = kc.tolerance(model, limits, of, clearances={"B": 2e-5}, samples=64)
    assert done.stdout == f"{found}\n"
    assert done.stderr == f"Wrote {page}\n"
    text = page.read_text(encoding="utf-8")
    assert "clearance of B" in text
    # Of each column a plot of our own over time, and a bar for each source, the greatest on top.
    assert "<img" not in text
    assert text.count("<svg") == 4
    for column in found.columns:
        svg = next(x for x in text.split("<svg")[1:] if f"{column} at t = " in x)
        named = re.findall(r">([^<>]+) ([\d.]+) %</text>", svg)
        low, high = (
            part[found.widest(column), found.columns.index(column)]
            for part in (found.low, found.high)
        )
        order = np.argsort(high - low, kind="stable")
        assert [name for name, _ in named] == [found.sources[j] for j in order]
        parts = found.contributions(column)[found.widest(column)][order]
        np.testing.assert_allclose([float(part) for _, part in named], parts, atol=0.05)


def test_options_choose_times_values_and_samples(kincompile, file):
    options = ("--points", 3, "--end", 1, "--set", "e=0.01", "--samples", 0)
    done = kincompile("tolerance", file(), *options)
    assert "at 3 times" in done.stdout
    assert "Monte Carlo" not in done.stdout


def test_fit_of_a_file_is_written_as_a_model_and_a_page(kincompile, file, tmp_path):
    written, page = tmp_path / "found.toml", tmp_path / "page.html"
    done = kincompile("fit", file(), "-o", written, "--page", page)
    assert done.exit_code == 0, done.stderr
    assert "slider_crank reaches all targets" in done.stdout
    assert "rod to crank" in done.stdout
    motion = kc.solve(kc.compile(kc.read(written)), [0.1, 0.25])
    np.testing.assert_allclose(motion["ram.x"], [0.39, 0.33], atol=1e-9)
    assert done.stderr.splitlines() == [f"Wrote {written}", f"Wrote {page}"]
    html = page.read_text(encoding="utf-8")
    assert "<iframe srcdoc" in html
    assert "x_ram [m] over time, and what was wanted" in html.replace("ram.x", "x_ram")


def test_target_that_is_not_reached_is_told_and_exits_with_3(kincompile, file, tmp_path):
    written = tmp_path / "found.json"
    far = FIT.replace("0.33]", "0.9]")
    done = kincompile("fit", file(far), "-o", written, "--samples", 16, "--starts", 1)
    assert done.exit_code == 3
    assert "Error: no set of parameters that was found" in done.stderr
    assert "from 0.9" in done.stderr
    assert kc.read(written).name == "slider_crank"


@pytest.mark.slow
def test_files_with_tables_keep_to_the_schema(file):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    data = tomllib.loads(file().read_text(encoding="utf-8"))
    jsonschema.validate(data, kc.model_schema())
    data["fit"]["targets"].append({"path": "B", "points": [[1, 2]], "speed": 3})
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, kc.model_schema())


def test_every_kind_of_target_can_be_written(kincompile, file, tmp_path):
    table = """
[fit]
parameters = { r = [0.05, 0.2] }
samples = 8
starts = 1
targets = [
    { path = "ram", points = [[0.39, 0.02]], times = [0.1], within = 1, weight = 2 },
    { pose = "crank", poses = [[0, 0, "30*deg"]], between = [0, 1], within = 9 },
    { limit = "rod.phi", least = "-80*deg", most = "80*deg" },
    { limit = "r", most = 0.15 },
    { time_ratio = "ram.x", ratio = 1.0, within = 9 },
    { straight = "ram", between = [0, 0.4], within = 9, line = [[0, 0], [1, 0]] },
    { circular = "ram", between = [0, 0.4], within = 9, circle = [0, 0, 0.4] },
    { dwell = "crank.phi", between = [0, 0.1], within = 9, at = "30*deg" },
]
"""
    page = tmp_path / "page.html"
    done = kincompile("fit", file(table), "--page", page)
    assert done.exit_code == 0, done.stderr
    assert "over time, and what was wanted" in page.read_text(encoding="utf-8")
    for word in (
        "x_ram",
        "phi_crank",
        "rod.phi",
        "time ratio of x_ram",
        "straightness of ram",
        "roundness of ram",
        "dwell of crank.phi",
    ):
        assert word in done.stdout


@pytest.mark.parametrize(
    ("command", "tables", "words"),
    [
        ("tolerance", "", "has no table [tolerance]"),
        ("fit", "", "has no table [fit]"),
        ("tolerance", "[tolerance]\nparameters = { q = 1 }", "no parameter 'q'"),
        (
            "tolerance",
            "[tolerance]\nof = ['crank.phi']\nparameters = { r = 1e-4 }",
            "the tolerance of 'r' moves none of phi_crank",
        ),
        ("tolerance", "[tolerance]\nparameters = 3", "expected names and values, not 3"),
        ("tolerance", "[tolerance]\nparameters = { r = 'x' }", "there is no 'x'"),
        ("tolerance", "[tolerance]\nsample = 3", "there is no such field; did you mean 'samples'"),
        ("tolerance", "[tolerance]\nsamples = -3", "expected a whole number from 0"),
        (
            "tolerance",
            "[tolerance]\nparameters.r = { low = 1, high = -1 }",
            "line 21: tolerance, parameters, r: a deviation goes from 1 to -1",
        ),
        (
            "fit",
            "[fit]\nparameters = { r = [2, 1] }\ntargets = [{ path = 'B', points = [[1, 2]] }]",
            "go from 2 to",
        ),
        ("fit", "[fit]\nparameters = { r = [1, 2] }\ntargets = 3", "expected a list of tables"),
        ("fit", "[fit]\nparameters = { r = [1, 2] }", "no targets; fields are"),
        (
            "fit",
            "[fit]\nparameters = { r = [1, 2] }\ntargets = [{ paths = 'B' }]",
            "expected one target: path, value, pose",
        ),
        (
            "fit",
            "[fit]\nparameters = { r = [1, 2] }\ntargets = [{ limit = 'r/q', most = 1 }]",
            "there is no 'q'",
        ),
        (
            "fit",
            "[fit]\nparameters = { r = [1, 2] }\ntargets = [{ limit = '30*deg', most = 1 }]",
            "expected a column or a formula of parameters, not a number",
        ),
        (
            "fit",
            "[fit]\nparameters = { r = [1, 2] }\ntargets = [{ path = 'ram', points = 3 }]",
            "expected a list of lists of numbers",
        ),
        (
            "fit",
            "[fit]\nparameters = { r = [1, 2] }\ntargets = [{ path = 'rm', points = [[1, 2]] }]",
            "has no column 'x_rm'",
        ),
    ],
)
def test_bad_tables_are_told_with_line_and_field(kincompile, file, command, tables, words):
    done = kincompile(command, file(tables))
    assert done.exit_code == 2
    assert words in done.stderr
    assert done.stdout == ""


def test_what_cannot_be_used_is_refused_before_the_work(kincompile, file, pendulum, tmp_path):
    done = kincompile("fit", file(), "-o", tmp_path / "a.csv")
    assert (done.exit_code, "end its name in .toml or .json" in done.stderr) == (2, True)
    done = kincompile("fit", file(), "-o", file())
    assert (done.exit_code, "is the model itself" in done.stderr) == (2, True)
    done = kincompile("fit", file(), "--page", tmp_path / "a.txt")
    assert (done.exit_code, "end its name in .html" in done.stderr) == (2, True)
    done = kincompile("tolerance", pendulum)
    assert (done.exit_code, "has no table [tolerance]" in done.stderr) == (2, True)
