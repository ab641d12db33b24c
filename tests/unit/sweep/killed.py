"""A program that sweeps on two processes and is killed in the middle: `STORE`."""

import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import kincompile as kc
from tests.unit.sweep.models import crank


def sweep(store, **options):
    """Sweep the crank in 20 chunks."""
    return kc.sweep(
        crank(),
        {"a": np.linspace(0.1, 1.0, 60)},
        columns=["x_tip", "y_tip"],
        target="numpy",
        chunk=3,
        store=store,
        **options,
    )


def end(done: int, total: int) -> None:
    """Kill all processes of this program when a half is done."""
    if done >= total // 2:
        os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    with ProcessPoolExecutor(2) as executor:
        sweep(sys.argv[1], executor=executor, progress=end)
