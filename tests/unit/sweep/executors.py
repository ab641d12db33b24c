"""A program that sweeps on an executor: `KIND STORE`; with MPI it is run by mpi4py.futures."""

import sys
from contextlib import ExitStack
from typing import Any

import numpy as np

import kincompile as kc
from tests.unit.sweep.models import crank


def executor(kind: str, stack: ExitStack) -> Any:
    """Return an executor with two workers, of MPI with one beside the program's own rank."""
    if kind == "mpi":
        from mpi4py.futures import MPIPoolExecutor

        return stack.enter_context(MPIPoolExecutor())
    if kind == "dask":
        from distributed import Client, LocalCluster

        cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
        client = stack.enter_context(Client(stack.enter_context(cluster)))
        return client.get_executor()
    from loky import get_reusable_executor

    return stack.enter_context(get_reusable_executor(2))


def main(kind: str, store: str) -> None:
    """Sweep, and print how it went."""
    with ExitStack() as stack:
        found = kc.sweep(
            crank(),
            {"a": np.linspace(0.1, 1.0, 20), "omega": [1.0, 2.0]},
            product=True,
            columns=["x_tip"],
            target="numpy",
            chunk=3,
            store=store,
            executor=executor(kind, stack) if kind != "none" else None,
        )
    print(found.statuses())  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
