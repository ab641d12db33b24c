"""Damaged folders of a sweep: the same call mends each file of one, or names it."""

import os
import re
import shutil
import warnings
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from threading import Barrier

import numpy as np
import pytest

import kincompile as kc
from kincompile.sweeps.folder import Records, moved
from tests.unit.sweep.models import crank, files_of

DAMAGES = {
    "deleted": None,
    "cut": lambda data: data[: len(data) // 2],
    "emptied": lambda _: b"",
    "flipped": lambda data: data[: len(data) // 3] + bytes([data[len(data) // 3] ^ 16])
    + data[len(data) // 3 + 1 :],
    "other text": lambda _: b"junk",
}  # fmt: skip


def sweep(store, **options):
    """Sweep the crank in four chunks."""
    return kc.sweep(
        crank(), {"a": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]},
        columns=["x_tip"], measures=["tip.x.mean"], target="numpy", chunk=2, store=store, **options,
    )  # fmt: skip


def damage(file, how):
    """Damage a file of a store."""
    change = DAMAGES[how]
    if change is None:
        file.unlink()
    else:
        file.write_bytes(change(file.read_bytes()))


def mended(whole, store, changes):
    """Return how the files of a copy that were damaged were mended: said, silently, named or not.

    `changes` are names of files with what is done to each.
    """
    shutil.rmtree(store, ignore_errors=True)
    shutil.copytree(whole, store)
    for name, how in changes:
        damage(store / name, how)
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found = sweep(store)
    except kc.InputError as error:
        return "named" if any(name in str(error) for name, _ in changes) else str(error)
    if files_of(store) != files_of(whole) or found.statuses() != {"CONVERGED": 63}:
        return "not mended"
    return "said" if said else "silently"


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """Return finished stores of both kinds."""
    place = tmp_path_factory.mktemp("stores")
    for ending in ("zarr", "parquet"):
        sweep(place / f"whole.{ending}")
    return place


def test_every_damage_of_some_files(stores, tmp_path):
    damaged = {
        "parquet": {"part-1.parquet": "flipped", "_about.json": "cut", "_sha256/2": "emptied"},
        "zarr": {"x_tip/c/1/0": "deleted", "status/zarr.json": "emptied", "zarr.json": "cut"},
    }
    for ending, some in damaged.items():
        for name, how in some.items():
            whole, store = stores / f"whole.{ending}", tmp_path / f"a.{ending}"
            assert mended(whole, store, [(name, how)]) == "said", (name, how)


@pytest.mark.slow
def test_every_file_of_a_store_damaged_in_turn(stores, tmp_path, record):
    outcomes = {
        (ending, name, how): mended(
            stores / f"whole.{ending}", tmp_path / f"a.{ending}", [(name, how)]
        )
        for ending in ("zarr", "parquet")
        for name in files_of(stores / f"whole.{ending}")
        for how in DAMAGES
    }
    wrong = {key for key, found in outcomes.items() if found not in ("said", "silently")}
    record(tried=len(outcomes), wrong=len(wrong))
    assert not wrong
    # What is no record is said; a chunk without its record is one that was not finished.
    assert {key[1] for key, found in outcomes.items() if found == "silently"} <= {
        f"{place}/{name}" for place in ("status/sha256", "_sha256") for name in "0123"
    } | {"status/sha256/beginning", "_sha256/beginning"}


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_several_files_damaged_at_once(ending, stores, tmp_path, record):
    rng, whole = np.random.default_rng(5), stores / f"whole.{ending}"
    names, hows = list(files_of(whole)), list(DAMAGES)
    outcomes = []
    for _ in range(60):
        chosen = rng.choice(names, 3, replace=False).tolist()
        changes = [(name, hows[rng.integers(len(hows))]) for name in chosen]
        outcomes.append(mended(whole, tmp_path / f"a.{ending}", changes))
    wrong = [found for found in outcomes if found not in ("said", "silently", "named")]
    record(tried=len(outcomes), wrong=len(wrong))
    assert not wrong


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_a_damaged_chunk_is_named_and_alone_is_solved_again(ending, stores, tmp_path):
    store = tmp_path / f"a.{ending}"
    shutil.copytree(stores / f"whole.{ending}", store)
    damage(store / ("x_tip/c/2/0" if ending == "zarr" else "part-2.parquet"), "flipped")
    solved = []
    with pytest.warns(kc.DamagedStoreWarning, match="chunk 2 is damaged; it is solved again"):
        sweep(store, progress=lambda done, _: solved.append(done))
    assert solved == [5, 7]  # of seven variants the two of chunk 2 were missing
    sweep(store, progress=lambda done, _: solved.append(done))
    assert solved == [5, 7, 7]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_no_device_and_no_pipe_is_read(ending, stores, tmp_path):
    # Either would be read without end.
    whole, store = stores / f"whole.{ending}", tmp_path / f"a.{ending}"
    shutil.copytree(whole, store)
    part, record = (
        ("x_tip/c/1/0", "status/sha256/2") if ending == "zarr" else ("part-1.parquet", "_sha256/2")
    )
    for name in (part, record):
        (store / name).unlink()
    (store / part).symlink_to("/dev/zero")
    os.mkfifo(store / record)
    with pytest.warns(kc.DamagedStoreWarning, match="chunks 1, 2 are damaged"):
        sweep(store)
    assert files_of(store) == files_of(whole)


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_the_main_file_and_its_record_damaged_together_are_named(ending, stores, tmp_path):
    records, main = ("_sha256", "_about.json") if ending == "parquet" else (
        "status/sha256", "zarr.json")  # fmt: skip
    changes = [(f"{records}/beginning", "cut"), (main, "cut")]
    found = mended(stores / f"whole.{ending}", tmp_path / f"a.{ending}", changes)
    assert found == "named"


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_a_store_without_digests_is_solved_again(ending, stores, tmp_path):
    store, whole = tmp_path / f"a.{ending}", stores / f"whole.{ending}"
    shutil.copytree(whole, store)
    shutil.rmtree(store / ("_sha256" if ending == "parquet" else "status/sha256"))
    with pytest.warns(kc.DamagedStoreWarning, match="earlier version, without the digests"):
        sweep(store)
    assert files_of(store) == files_of(whole)


def test_that_what_other_versions_have_made_is_kept_or_named(stores, tmp_path):
    store = tmp_path / "a.zarr"
    shutil.copytree(stores / "whole.zarr", store)
    array = store / "t/zarr.json"
    array.write_bytes(array.read_bytes() + b"\n")
    names = re.findall(r"^\w+  (.+)$", (store / "status/sha256/beginning").read_text(), re.M)
    Records(store, "status/sha256").write("beginning", names)
    before = files_of(store)
    sweep(store)
    assert files_of(store) == before
    damage(store / "x_tip/zarr.json", "cut")
    with pytest.raises(kc.InputError, match=r"x_tip/zarr\.json is damaged, and cannot be written"):
        sweep(store)


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_two_sweeps_that_begin_at_one_moment(ending, stores, tmp_path, monkeypatch):
    store, both = tmp_path / f"a.{ending}", Barrier(2, timeout=60)

    def together(fresh, path):
        both.wait()
        return moved(fresh, path)

    monkeypatch.setattr(import_module("kincompile.sweeps.folder"), "moved", together)
    with ThreadPoolExecutor(2) as pool:
        found = [future.result() for future in [pool.submit(sweep, store) for _ in range(2)]]
    assert [x.statuses() for x in found] == 2 * [{"CONVERGED": 63}]
    assert files_of(store) == files_of(stores / f"whole.{ending}")
    assert [path.name for path in tmp_path.iterdir()] == [store.name]
