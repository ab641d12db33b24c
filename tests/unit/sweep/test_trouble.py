"""A sweep that is stopped loses nothing, and what is wrong is said in names."""

import multiprocessing
import os
import re
import resource
import signal
import subprocess
import sys
from concurrent.futures import Future
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.sweeps.folder import written
from tests.unit.sweep import killed
from tests.unit.sweep.models import crank, files_of, folding, processes

ROOT = Path(__file__).resolve().parents[3]
P = {"a": np.linspace(0.1, 1.0, 6)}


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_a_sweep_that_is_killed_goes_on_to_identical_bytes(ending, tmp_path):
    store, whole = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    done = subprocess.run(
        [sys.executable, killed.__file__, str(store)],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, start_new_session=True, check=False,
    )  # fmt: skip
    assert done.returncode == -signal.SIGKILL
    seen = []
    killed.sweep(store, progress=lambda done, _: seen.append(done))
    assert 30 <= seen[0] < 60  # what was there
    assert seen[1:] == list(range(seen[0] + 3, 61, 3))
    killed.sweep(whole)
    assert files_of(store) == files_of(whole)


@pytest.mark.parametrize("store", ["a.zarr", None])
def test_a_worker_that_dies_is_an_error_and_what_was_solved_is_kept(store, tmp_path):
    place = store and tmp_path / store

    def kill(done, total):
        for worker in multiprocessing.active_children():
            worker.kill()

    with (
        processes(2) as executor,
        pytest.raises(kc.SweepError, match=r"crank: the sweep stopped after \d+ of 20 ch") as e,
    ):
        killed.sweep(place, executor=executor, progress=kill)
    assert "the same call" in str(e.value)
    statuses = e.value.sweep.statuses()
    assert statuses["CONVERGED"] > 0
    assert statuses["PENDING"] > 0
    assert sum(statuses.values()) == 60 * 9
    if place:
        assert killed.sweep(place).statuses() == {"CONVERGED": 540}


def test_an_executor_that_is_closed_or_fails_is_an_error():
    executor = processes(1)
    executor.shutdown()
    with pytest.raises(kc.SweepError, match=r"after 0 of 20 chunks .*cannot schedule new futures"):
        killed.sweep(None, executor=executor)

    class Failing:
        def submit(self, *_):
            future: Future[None] = Future()
            future.set_exception(TimeoutError())
            return future

    with pytest.raises(kc.SweepError, match=r"\(TimeoutError\)\. \.sweep has them"):
        killed.sweep(None, executor=Failing())


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
@pytest.mark.parametrize("workers", [0, 1])
def test_a_full_disk_is_an_error_and_the_sweep_goes_on_when_there_is_space(
    ending, workers, tmp_path
):
    store, before = tmp_path / f"a.{ending}", resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(done, total):
        children = [process.pid or 0 for process in multiprocessing.active_children()]
        for pid in children if workers else [0]:
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (10, before[1]))

    executor = processes(workers) if workers else None
    try:
        with pytest.raises(kc.InputError, match=r"cannot write to .*File too large.*is kept"):
            killed.sweep(store, progress=fill, executor=executor, pending=1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        if executor:
            executor.shutdown()
    seen = []
    killed.sweep(store, progress=lambda done, _: seen.append(done))
    assert seen == list(range(3, 61, 3))  # one chunk was there
    killed.sweep(tmp_path / f"b.{ending}")
    assert files_of(store) == files_of(tmp_path / f"b.{ending}")


def sweep(model=None, p=P, t=None, **options):
    return kc.sweep(model or crank(), p, t, **{"target": "numpy", "columns": ["x_tip"]} | options)


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
@pytest.mark.parametrize(
    ("change", "differs"),
    [
        ({"p": {"a": np.linspace(0.1, 1.1, 6)}}, "parameters differs"),
        ({"p": {**P, "omega": 2.0}}, "parameters differs"),
        ({"guess": {"arm.phi": 0.1}, "t": [0.0]}, "times, start differ"),
        ({"t": [0.0, 0.1]}, "times differs"),
        ({"columns": ["y_tip"]}, "columns and measures differs"),
        ({"chunk": 2}, "chunk differs"),
        ({"model": crank("other")}, "model differs"),
    ],
)
def test_a_store_of_another_sweep_is_refused_and_kept(ending, change, differs, tmp_path):
    store = tmp_path / f"a.{ending}"
    sweep(store=store, t=[0.0, 0.2])
    before = files_of(store)
    with pytest.raises(kc.InputError, match=f"holds another sweep: {differs}"):
        sweep(**{"store": store, "t": [0.0, 0.2]} | change)
    assert files_of(store) == before


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_a_place_that_no_sweep_wrote_is_refused(ending, tmp_path):
    file, folder = tmp_path / f"file.{ending}", tmp_path / f"folder.{ending}"
    file.write_text("mine")
    folder.mkdir()
    for place in (file, folder):
        with pytest.raises(kc.InputError, match="exists and was not written by a sweep"):
            sweep(store=place)
    assert file.read_text() == "mine"
    with pytest.raises(kc.InputError, match=r"cannot write to .*No such file"):
        sweep(store=tmp_path / "missing" / f"a.{ending}")
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"p": {"b": [1, 2]}}, "there is no parameter 'b'. The parameters are a, omega"),
        ({"p": {"a": [1, np.nan]}}, "parameter 'a' is nan: give a finite number"),
        ({"p": {"a": [1, 2], "omega": [1, 2, 3]}}, "2 of 'a', 3 of 'omega'"),
        ({"p": {"a": 1.0}}, "nothing is swept"),
        ({"p": {"a": []}}, "parameter 'a' has the values"),
        ({"columns": ["x_tp"]}, "no column 'x_tp'; did you mean 'x_tip'"),
        ({"columns": [], "measures": []}, "nothing is kept"),
        ({"measures": ["tip.x.strok"]}, "no measure 'tip.x.strok'; did you mean 'stroke'"),
        ({"measures": ["x_arm.stroke"]}, "x_arm is a coordinate; measures are defined for outputs"),
        ({"measures": ["tip.x.dwell"]}, "'tip.x.dwell': write it as"),
        ({"measures": ["tip.straightness(1)"]}, "write it as 'P.straightness'"),
        ({"measures": ["tip.x.roundness"]}, "Name the point: 'tip'"),
        ({"measures": ["arm.grashof"]}, "There are 0 four-bars with the link 'arm'"),
        ({"columns": ["a.b"], "measures": ["x.y"]}, "2 problems"),
        ({"chunk": 0}, "chunk is 0"),
        (
            {"p": dict.fromkeys(("a", "omega"), np.ones(100_000)), "product": True},
            "have 810.0 GB, more than this machine has memory: give a store",
        ),
        (
            {"p": dict.fromkeys(("a", "omega"), np.ones(100_000)), "product": True, "chunk": 1},
            "10,000,000,000 variants are 10,000,000,000 chunks, more than 10,000,000",
        ),
        ({"pending": 0}, "pending is 0"),
        ({"store": "results.csv"}, "end its name in .zarr, .parquet"),
        ({"target": "octave"}, "only modules of the targets numpy, c can be loaded"),
    ],
)
def test_what_is_wrong_is_said_in_names(options, message):
    with pytest.raises(kc.KincompileError, match=message.replace(".", r"\.")):
        sweep(**options)


def test_a_file_that_another_run_has_taken_for_a_leftover_is_written_again(tmp_path):
    missing = [FileNotFoundError("half"), FileNotFoundError("half")]

    def write():
        if missing:
            raise missing.pop()

    written(tmp_path, write)
    missing += 3 * [FileNotFoundError("half")]
    with pytest.raises(kc.InputError, match=r"cannot write to .*half"):
        written(tmp_path, write)


@pytest.mark.filterwarnings("ignore::kincompile.DamagedStoreWarning")
@pytest.mark.parametrize(
    "name", ["a.parquet/part-0.parquet", "a.parquet/_sha256/0", "a.zarr/x_tip/c/0/0"]
)
def test_a_folder_in_the_place_of_a_file_is_named(name, tmp_path):
    store = tmp_path / name.split("/")[0]
    sweep(store=store)
    place = tmp_path / name
    place.unlink()
    place.mkdir()
    with pytest.raises(kc.InputError, match=f"cannot write to {re.escape(str(place))}: "):
        sweep(store=store)


def test_too_little_memory_is_said_with_the_way_out(monkeypatch):
    monkeypatch.setattr(import_module("kincompile.sweeps.store"), "_memory", lambda: 1e9)
    grid = {"product": True, "p": {"a": np.ones(10_000), "omega": np.ones(900)}}
    with pytest.raises(kc.InputError, match=r"9,000,000 variants have 0\.7 GB, more than this mac"):
        sweep(**grid)
    status = Path("/proc/self/statm").read_text(encoding="ascii").split()
    used = int(status[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + 400_000_000, before[1]))
    try:
        monkeypatch.setattr(import_module("kincompile.sweeps.store"), "_memory", lambda: 1e12)
        with pytest.raises(
            kc.InputError, match=r"have 0\.7 GB, more than .* give a store, such as"
        ):
            sweep(**grid)
        many = {"a": np.ones(1_000_000)}
        with pytest.raises(kc.InputError, match=r"1,000,000 variants at 9 times have 0\.6 GB"):
            sweep(p=many, chunk=1_000_000)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)

    def run(*_):
        raise MemoryError

    monkeypatch.setattr(import_module("kincompile.sweeps.chunks"), "run", run)
    with pytest.raises(kc.SweepError, match=r"stopped after 0 of 1 chunks \(MemoryError\)"):
        sweep()


def test_a_first_set_that_cannot_be_assembled_does_not_stop_the_others():
    found = kc.sweep(folding(), {"b": [0.1, 1.0, 1.1]}, columns=["angle"], target="numpy", chunk=1)
    assert found.statuses() == {"CONVERGED": 10, "NOT_REACHED": 4, "NOT_ASSEMBLED": 1}
