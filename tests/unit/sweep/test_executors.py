"""Every executor with the interface of concurrent.futures gives the same bytes, for real."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.unit.sweep import executors
from tests.unit.sweep.models import files_of

ROOT = Path(__file__).resolve().parents[3]
MPIEXEC = [str(Path(sys.executable).with_name("mpiexec")), "-n", "2"]
STARTED = {
    "dask": [sys.executable],
    "loky": [sys.executable],
    "mpi": [*MPIEXEC, sys.executable, "-m", "mpi4py.futures"],
}


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if kind == "loky" else [pytest.mark.slow]) for kind in STARTED],
)
def test_an_executor_writes_the_bytes_of_a_sweep_in_turn(kind, tmp_path):
    alone, found = tmp_path / "alone.zarr", tmp_path / "found.zarr"
    executors.main("none", str(alone))
    program = [*STARTED[kind], executors.__file__, kind, str(found)]
    done = subprocess.run(
        program, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "{'CONVERGED': 360}\n"
    assert files_of(found) == files_of(alone)
