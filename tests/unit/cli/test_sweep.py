"""`kincompile sweep`: from TOML alone to a folder, a summary and a page."""

import json
import sys

import numpy as np
import psutil
import pytest
import xarray

import kincompile as kc
from kincompile.files.sweep_table import read_sweep_table
from kincompile.model.tasks import Sweep
from kincompile.sweeps.samples import values_of
from tests.unit.sweep.models import TIMES, crank, folding

TABLE = """
[sweep]
parameters = { a = [0.5, 1.5], omega = { from = 1, to = "60*deg*6/pi", count = 3 } }
product = true
columns = ["tip.x"]
measures = ["tip.y.greatest"]
"""


@pytest.fixture
def model(tmp_path):
    """Return a function that writes the file of the crank with a table."""

    def write(table=TABLE, mechanism=None):
        file = tmp_path / "crank.toml"
        file.write_text((mechanism or crank()).to_toml() + table, encoding="utf-8")
        return file

    return write


def sweep(kincompile, file, *options):
    return kincompile("sweep", file, "--target", "numpy", "--processes", 1, *options)


def test_a_table_gives_a_folder_a_summary_and_a_page(kincompile, model, tmp_path):
    store, page = tmp_path / "a.zarr", tmp_path / "a.html"
    done = sweep(kincompile, model(), "-o", store, "--page", page)
    assert done.exit_code == 0, done.stderr
    assert f"crank: 6 variants x 9 times in {store}; points: 54 CONVERGED" in done.stdout
    assert done.stderr.splitlines() == [f"Wrote {store}", f"Wrote {page}"]
    found = xarray.open_zarr(store, consolidated=False, chunks=None)
    a, omega = np.array([0.5, 1.5])[:, None, None], np.linspace(1, 2, 3)[:, None]
    np.testing.assert_allclose(found["x_tip"], a * np.cos(omega * TIMES), atol=1e-13)
    rows = [line.split() for line in done.stdout.splitlines()[3:]]
    assert rows[0][:2] == ["x_tip", "m"]
    assert float(rows[0][2]) == pytest.approx((a * np.cos(omega * TIMES)).min(), rel=1e-5)
    assert float(rows[0][-1]) == pytest.approx((a * np.cos(omega * TIMES)).mean(), rel=1e-5)
    assert rows[1][0] == "y_tip_greatest"
    assert "a = 1.5" in done.stdout.splitlines()[4]
    html = page.read_text(encoding="utf-8")
    assert "Sweep of <code>crank</code>" in html
    assert (html.count("<img "), html.count("<svg ")) == (
        0,
        1 + html.count("y_tip_greatest [m] over"),
    )
    assert "y_tip_greatest [m] over a" in html


@pytest.mark.filterwarnings("default::kincompile.errors.DamagedStoreWarning")
def test_a_second_run_goes_on(kincompile, model, tmp_path):
    store = tmp_path / "a.parquet"
    options = ("-o", store, "--chunk", 1)
    first = sweep(kincompile, model(), *options)
    assert first.exit_code == 0, first.stderr
    (store / "part-3.parquet").unlink()
    again = sweep(kincompile, model(), *options)
    assert "a.parquet: chunk 3 is damaged; it is solved again." in again.stderr
    assert again.stdout == first.stdout
    other = sweep(kincompile, model(), *options, "--set", "omega=2")
    assert other.exit_code == 2
    assert "--set names omega, which is swept" in other.stderr
    other = sweep(kincompile, model(), *options, "--end", "1")
    assert other.exit_code == 2
    assert "holds another sweep: times differs" in other.stderr


def test_options_take_the_place_of_the_table(kincompile, model):
    options = ("--sweep", "a=1:2:3", "--column", "y_arm", "--measure", "tip.x.rms")
    done = sweep(kincompile, model(""), *options, "--set", "omega=2")
    assert "crank: 3 variants x 9 times; points: 27 CONVERGED" in done.stdout
    assert [line.split()[0] for line in done.stdout.splitlines()[3:]] == ["y_arm", "x_tip_rms"]


def test_angles_are_shown_in_degrees_on_demand(kincompile, model):
    table = '[sweep]\nparameters = { omega = [0.5, 1] }\ncolumns = ["phi_arm"]\n'
    done = sweep(kincompile, model(table), "--deg")
    row = done.stdout.splitlines()[3].split("  ")
    assert [cell.strip() for cell in row if cell] == [
        "phi_arm", "deg", "0", "omega = 28.65, t = 0", "114.592", "omega = 57.3, t = 2", "42.9718",
    ]  # fmt: skip


def test_processes_solve_it_too(kincompile, model):
    done = kincompile("sweep", model(), "--target", "numpy", "--processes", 2, "--chunk", 1)
    assert done.stdout == sweep(kincompile, model()).stdout


@pytest.mark.parametrize(("lengths", "code"), [("[0.1, 1]", 0), ("[0.1, 0.2]", 3)])
def test_what_cannot_be_assembled_is_counted_and_alone_is_exit_code_3(
    kincompile, model, lengths, code, tmp_path
):
    table = f'[sweep]\nparameters = {{ b = {lengths} }}\ncolumns = ["angle"]\n'
    page = tmp_path / "a.html"
    done = sweep(kincompile, model(table, folding()), "--page", page)
    assert done.exit_code == code
    assert "NOT_ASSEMBLED" in done.stdout
    assert ("no set of parameters was solved" in done.stderr) == bool(code)
    assert "NOT_ASSEMBLED: At the first time no position was found" in done.stderr
    assert "the mechanism cannot be assembled there" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_workers_end_with_a_run_that_is_killed(model, tmp_path, start_process):
    store = tmp_path / "a.parquet"
    table = "[sweep]\nparameters = { a = { from = 1, to = 2, count = 100000 } }\n"
    options = ["-o", str(store), "--target", "numpy", "--chunk", "10", "--processes", "2"]
    run = start_process([sys.executable, "-m", "kincompile", "sweep", str(model(table)), *options])
    while len(list(store.glob("*.parquet"))) < 4 and run.poll() is None:
        pass
    workers = psutil.Process(run.pid).children(recursive=True)
    run.kill()
    assert len(workers) >= 2
    assert psutil.wait_procs(workers, timeout=60)[1] == []


def test_samples_fill_a_box_evenly(model):
    spans = "a = { from = 1, to = 3 }, omega = { from = -1, to = 0 }"
    table = f"[sweep]\nsamples = 1000\nparameters = {{ {spans} }}"
    found = read_sweep_table(model(table))
    assert found is not None
    values = values_of(found)
    counts, *_ = np.histogram2d(values["a"], values["omega"], 5, ((1, 3), (-1, 0)))
    assert counts.sum() == 1000
    assert np.abs(counts - 40).max() <= 5


def test_the_table_may_be_json(tmp_path):
    file = tmp_path / "crank.json"
    data = json.loads(crank().to_json()) | {"sweep": {"parameters": {"a": [1, "4/2"]}}}
    file.write_text(json.dumps(data), encoding="utf-8")
    assert read_sweep_table(file) == Sweep({"a": (1.0, 2.0)})
    assert kc.read(file).name == "crank"


def test_a_file_without_a_table_says_nothing(model, tmp_path):
    assert read_sweep_table(model("")) is None
    assert read_sweep_table(tmp_path / "model.py") is None


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("columns = []", "no parameters; fields are: parameters, samples, product"),
        ("parameters = { a = [1] }\nmesures = []", "no such field; did you mean 'measures'"),
        ("parameters = 3", "expected names and values, not 3"),
        ("parameters = { a = 3 }", "a list of values, or { from = 0.2, to = 0.6, count = 5 }"),
        ("parameters = { a = [1, 'b'] }", "sweep, parameters, a, entry 2: column 1 of 'b'"),
        ("parameters = { a = ['1/0'] }", "entry 1"),
        ("parameters = { a = { from = 1, to = 2 } }", "give it a count"),
        ("parameters = { a = { from = 1 } }", "no to; fields are: from, to, count"),
        ("parameters = { a = { from = 1, to = 2, count = 0 } }", "a whole number from 1 to"),
        ("parameters = { a = { from = 1, to = 2 } }\nsamples = true", "a whole number from 1 to"),
        ("parameters = { a = [1] }\nproduct = 1", "expected true or false, not 1"),
        ("parameters = { a = [1] }\ncolumns = 'x_tip'", "expected a list of names in quotes"),
        ("parameters = { a = { from = 1, to = 2 } }\nproduct = true\nsamples = 2", "a would be"),
        ("parameters = { a = { from = 1, to = 2, count = 10000000 }, omega = { from = 1, to = 2, "
         "count = 10 } }", "10,000,010 values are more than the 10,000,000 of a file"),
        ("parameters = { b = [1] }", "there is no parameter 'b'"),
        ("parameters = { a = [] }", "a list of at least 1, not a list of 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_table_is_said_with_its_place(kincompile, model, table, message):
    done = sweep(kincompile, model(f"[sweep]\n{table}"))
    assert done.exit_code == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_folder_of_another_model_is_refused_and_kept(kincompile, model, tmp_path):
    folder = tmp_path / "a.zarr"
    table = "[sweep]\nparameters = { a = [1, 2] }"
    assert sweep(kincompile, model(table), "-o", folder).exit_code == 0
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    other = model(table)
    other.write_text(other.read_text().replace('"omega*t"', '"omega*t + 0.1"'))
    done = sweep(kincompile, other, "-o", folder)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "holds another sweep: model differs" in done.stderr
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_what_cannot_be_written_is_said_before_the_work(kincompile, model, tmp_path):
    done = sweep(kincompile, model(), "--page", tmp_path / "missing" / "a.html")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "does not exist" in done.stderr
    done = sweep(kincompile, model(), "-o", tmp_path / "a.csv")
    assert done.exit_code == 2
    assert "end its name in .zarr, .parquet" in done.stderr
    done = sweep(kincompile, model(""))
    assert "nothing is swept" in done.stderr


OF_MOTIONS = """
[sweep]
parameters = { OC = [1.8, 2.0, 9.0] }
measures = ["P.straightness(0, 0.5)", "P.roundness(0.1, 0.2)", "rocker.phi.dwell(0.01)",
    "rocker.phi.dwell(0.01, min)", "crank.grashof", "gain.least", "gain.greatest"]
"""


@pytest.fixture
def hoeken():
    """Return Hoeken's linkage with its mechanical advantage as an output."""
    found = kc.linkages.hoeken().mechanism()
    crank, _, rocker = found.bodies
    found.output("gain", kc.outputs.mechanical_advantage(rocker.phi, crank.phi))
    found.points = 73
    return found


def test_measures_of_motions_in_a_table(kincompile, model, hoeken, tmp_path):
    """As of each motion alone; of lengths that cannot be assembled there are none."""
    store = tmp_path / "a.zarr"
    done = sweep(kincompile, model(OF_MOTIONS, hoeken), "-o", store)
    assert done.exit_code == 0, done.stderr
    assert "motions: 2 CONVERGED, 1 NOT_ASSEMBLED" in done.stdout
    found = xarray.open_zarr(store, consolidated=False, chunks=None)
    names = [
        "P_straightness_0_0.5", "P_roundness_0.1_0.2", "phi_rocker_dwell_0.01",
        "phi_rocker_dwell_0.01_min", "crank_grashof", "gain_least", "gain_greatest",
    ]  # fmt: skip
    assert all(np.isnan(found[name][2]) for name in names)
    module = kc.compile(hoeken)
    for k, ground in enumerate((1.8, 2.0)):
        alone = kc.solve(module, np.linspace(0, 1, 73), {"OC": ground})
        gain = alone.measures()["gain"]
        expected = [
            alone.straightness("P", (0, 0.5)).deviation,
            alone.roundness("P", (0.1, 0.2)).deviation,
            alone.dwell("rocker.phi", 0.01, "max").time,
            alone.dwell("rocker.phi", 0.01, "min").time,
            ground - 1.0,  # p + q - s - l of 1, 2.5, 2.5 and the ground
            gain.least,
            gain.greatest,
        ]
        np.testing.assert_allclose([found[name][k] for name in names], expected, rtol=1e-9)
    assert {*found.data_vars} == {*names, "status"}
    rows = [line.split()[:2] for line in done.stdout.splitlines()]
    for name, unit in zip(names, ("m", "m", "s", "s", "m"), strict=False):
        assert [name, unit] in rows


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ("P.straightness(0.5, 0)", "from a time to a later one"),
        ("P.straightness(0.5, 0.5)", "from a time to a later one"),
        ("P.straightness(nan, 1)", "'P.straightness(nan, 1)': write it as"),
        ("P.straightness(a, b)", "'P.straightness(a, b)': write it as"),
        ("P.roundness(0.2)", "'P.roundness(0.2)': write it as"),
        ("Q.roundness", "no column 'Q.x'; did you mean 'x_P'?"),
        ("x_P.roundness", "Name the point: 'P'."),
        ("rocker.phi.dwell", "'ram.x.dwell(0.5)'"),
        ("rocker.phi.dwell(-1)", "with a positive number"),
        ("rocker.phi.dwell(inf)", "with a positive number"),
        ("rocker.phi.dwell(max)", "with a positive number"),
        ("rocker.phi.dwell(1, max, 3)", "with a positive number"),
        ("P.dwell(1)", "no column 'P'"),
        ("crank.grashof(1)", "'crank.grashof' of the four-bar with that link"),
        ("handle.grashof", "the links of the four-bars are: ground, crank, coupler, rocker"),
        ("gain.grasshof", "did you mean 'grashof'?"),
    ],
)
def test_wrong_measures_of_motions(kincompile, model, hoeken, tmp_path, measure, message):
    table = f'[sweep]\nparameters = {{ OC = [2.0] }}\nmeasures = ["{measure}"]\n'
    done = sweep(kincompile, model(table, hoeken), "-o", tmp_path / "a.zarr")
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())
    assert not (tmp_path / "a.zarr").exists()
