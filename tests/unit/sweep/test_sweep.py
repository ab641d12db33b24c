"""Sweeps give the numbers of the closed form, with dimensions, units and statuses."""

import dataclasses
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest

import kincompile as kc
from kincompile.runtime.engine.code import code_of
from kincompile.sweeps.plan import Plan
from tests.unit.sweep.models import TIMES, crank, files_of, folding, processes

LENGTHS = np.array([0.2, 0.5, 0.9, 1.1, 1.7])
SPEEDS = np.array([0.5, 1.0, 2.5])


def sweep(model=None, p=None, **options):
    """Sweep the crank over the grid of lengths and speeds, by NumPy, unless told otherwise."""
    p = {"a": LENGTHS, "omega": SPEEDS} if p is None else p
    options = {"product": True, "target": "numpy"} | options
    return kc.sweep(model or crank(), p, **options)


@pytest.mark.parametrize("chunk", [1, 2, 4, 15, 100])
def test_a_grid_has_an_axis_for_each_parameter_and_the_numbers_of_the_closed_form(chunk):
    found = sweep(columns=["tip.x", "tip.y_dot"], chunk=chunk).to_xarray()
    assert dict(found.sizes) == {"a": 5, "omega": 3, "t": 9}
    a, omega, t = LENGTHS[:, None, None], SPEEDS[:, None], TIMES
    np.testing.assert_allclose(found["x_tip"], a * np.cos(omega * t), atol=1e-13)
    np.testing.assert_allclose(found["y_tip_dot"], a * omega * np.cos(omega * t), atol=1e-13)
    assert found["x_tip"].attrs["units"] == "m"
    assert found["y_tip_dot"].attrs["units"] == "m/s"
    assert (found["status"] == 0).all()


def test_samples_go_in_pairs_and_are_coordinates():
    found = sweep(p={"a": LENGTHS, "omega": LENGTHS}, product=False, columns=["x_tip"]).to_xarray()
    assert found["x_tip"].dims == ("variant", "t")
    expected = LENGTHS[:, None] * np.cos(LENGTHS[:, None] * TIMES)
    np.testing.assert_allclose(found["x_tip"], expected, atol=1e-13)
    np.testing.assert_array_equal(found.coords["omega"], LENGTHS)


def test_measures_are_those_of_a_solution():
    found = sweep(measures=["tip.x.stroke", "tip.y.t_greatest", "tip.x.mean"]).to_xarray()
    assert dict(found.sizes) == {"a": 5, "omega": 3}
    module = kc.compile(crank())
    one = kc.solve(module, TIMES, {"a": 0.9, "omega": 2.5}).measures()
    at = found.sel(a=0.9, omega=2.5)
    assert float(at["x_tip_stroke"]) == one["tip.x"].stroke
    assert float(at["y_tip_t_greatest"]) == pytest.approx(np.pi / 5)
    assert float(at["x_tip_mean"]) == pytest.approx(0.9 * np.sin(5) / 5)
    assert found["y_tip_t_greatest"].attrs["units"] == "s"


def test_measures_of_whole_motions():
    """Dwells of a crank by arccosine, distances of a path as of each motion, Grashof's rule."""
    t = np.linspace(0, 2, 81)
    names = ["tip.x.dwell(0.05)", "tip.roundness", "tip.straightness(0.25, 1)"]
    found = sweep(measures=names, t=t).to_xarray()
    near = np.arccos(1 - 0.05 / LENGTHS)[:, None] / SPEEDS
    np.testing.assert_allclose(found["x_tip_dwell_0.05"], near, rtol=1e-6)
    assert found["x_tip_dwell_0.05"].attrs["units"] == "s"
    np.testing.assert_allclose(found["tip_roundness"], 0, atol=1e-6)
    one = kc.solve(kc.compile(crank()), t, {"a": 0.9, "omega": 1.0}).straightness("tip", (0.25, 1))
    at = found["tip_straightness_0.25_1"]
    assert float(at.sel(a=0.9, omega=1.0)) == pytest.approx(one.deviation, rel=1e-12)
    assert at.attrs["units"] == "m"


def test_that_a_sweep_keeps_grashofs_margin():
    hoeken = kc.linkages.hoeken().mechanism()
    margins = sweep(hoeken, {"OC": [1.5, 2.0, 3.0]}, measures=["rocker.grashof"], t=[0, 0.01])
    # s = 1 and l = 2.5, or 3, with p + q the other two
    np.testing.assert_allclose(margins["rocker.grashof"], [0.5, 1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
def test_forces_are_kept_as_columns_and_measures(target):
    m = crank()
    m.bodies[0] = dataclasses.replace(m.bodies[0], mass=2.0, inertia=0.1)
    m.gravity = (0, -9.81)
    with processes(1) as executor:
        found = sweep(
            m, target=target, executor=executor, columns=["motor.drive", "tip.x"],
            measures=["motor.drive.peak", "A.F.peak", "A.F_x.t_greatest", "tip.x.stroke"],
        ).to_xarray()  # fmt: skip
    a, omega, t = LENGTHS[:, None, None], SPEEDS[:, None], TIMES
    drive = 2 * 9.81 * a * np.cos(omega * t)
    np.testing.assert_allclose(found["drive_motor"], drive, atol=1e-12)
    np.testing.assert_allclose(found["x_tip"], a * np.cos(omega * t), atol=1e-13)
    np.testing.assert_allclose(found["drive_motor_peak"], np.abs(drive).max(axis=-1), rtol=1e-12)
    pull = 2 * a * omega**2
    size = np.hypot(pull * np.cos(omega * t), 2 * 9.81 - pull * np.sin(omega * t))
    np.testing.assert_allclose(found["F_A_peak"], size.max(axis=-1), rtol=1e-12)
    assert found["F_A_peak"].attrs["units"] == "N"
    assert found["F_x_A_t_greatest"].attrs["units"] == "s"
    with pytest.raises(kc.InputError, match="no such measure of drive_motor"):
        sweep(m, measures=["motor.drive.stroke"])
    with pytest.raises(kc.InputError, match=r"did you mean 'drive_motor'"):
        sweep(m, columns=["motor.drve"])
    with pytest.raises(kc.InputError, match="no such measure of x_tip"):
        sweep(m, measures=["tip.x.peak"])


def test_what_cannot_be_assembled_is_a_status_and_disturbs_nobody():
    b = np.array([1.0, 0.1, 1.2])
    found = sweep(folding(), {"b": b}, columns=["angle"], measures=["angle.mean"])
    status, data = found.to_xarray()["status"].values, found.to_xarray()
    assert (status[[0, 2]] == 0).all()
    assert status[1].tolist() == [6, 4, 4, 4, 4]
    assert np.isfinite(data["angle"].values[[0, 2]]).all()
    assert np.isnan(data["angle_mean"].values).tolist() == [False, True, False]
    assert found.statuses() == {"CONVERGED": 10, "NOT_REACHED": 4, "NOT_ASSEMBLED": 1}
    assert "3 variants x 5 times; points: 10 CONVERGED, 4 NOT_REACHED, 1 NOT_ASSEMBLED" in str(
        found
    )
    assert str(found) in found._repr_html_()
    assert repr(found).startswith("<Sweep: ")


def test_of_measures_alone_the_status_is_that_of_the_motion():
    found = sweep(folding(), {"b": [1.0, 0.1]}, measures=["angle.mean"])
    assert found.to_xarray()["status"].values.tolist() == [0, 6]


def test_all_chunks_start_in_the_assembly_of_the_first_set():
    b = np.linspace(0.8, 1.2, 9)
    short = -np.arcsin(np.sin(0.3 + np.linspace(0, 0.1, 5)) / b[:, None])
    options = {"model": folding(), "p": {"b": b}, "columns": ["angle"]}
    ways: dict[int, list[float]] = {1: [], 2: []}
    for assembly, signs in ways.items():
        for chunk in (1, 2, 9):
            angle = sweep(**options, assembly=assembly, chunk=chunk)["angle"].values
            np.testing.assert_allclose(np.sin(angle), np.sin(short), atol=1e-12)
            signs += np.unique(np.sign(np.cos(angle))).tolist()
    assert sorted(ways.values()) == [[-1, -1, -1], [1, 1, 1]]
    far = sweep(**options, guess={"two.phi": 3.4, "two.x": 1})["angle"].values
    np.testing.assert_allclose(far, np.pi - short, atol=1e-12)


def test_the_outputs_are_kept_where_nothing_is_named():
    assert list(sweep().to_xarray().data_vars) == ["x_tip", "y_tip", "status"]


@pytest.mark.parametrize("kind", [processes, ThreadPoolExecutor])
def test_an_executor_changes_no_bit(kind):
    alone = sweep(columns=["x_tip"], chunk=2)
    with kind(2) as executor:
        found = sweep(columns=["x_tip"], chunk=2, executor=executor)
    assert found.to_xarray().identical(alone.to_xarray())


def test_c_gives_the_numbers_too(quick_compiler):
    found = sweep(columns=["tip.x"], target="c")
    expected = LENGTHS[:, None, None] * np.cos(SPEEDS[:, None] * TIMES)
    np.testing.assert_allclose(found["tip.x"], expected, atol=1e-13)


def test_that_workers_find_what_c_compiles_for_sets(monkeypatch, tmp_path, quick_compiler):
    """The libraries of one motion and of many sets are built before a chunk is sent."""
    monkeypatch.setenv("CC", quick_compiler)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    libraries = []

    with ThreadPoolExecutor(2) as executor:
        submit = executor.submit

        def watched(*args):
            libraries.append(len(list(tmp_path.rglob("*.so"))))
            return submit(*args)

        monkeypatch.setattr(executor, "submit", watched)
        sweep(columns=["tip.x"], target="c", chunk=5, executor=executor)
    assert set(libraries) == {2}


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
@pytest.mark.parametrize("product", [True, False])
def test_a_folder_has_the_results_and_their_units(ending, product, tmp_path):
    store = tmp_path / f"a.{ending}"
    p = {"a": LENGTHS, "omega": SPEEDS if product else LENGTHS}
    kept = {"p": p, "columns": ["x_tip"], "measures": ["tip.x.rms"], "chunk": 2}
    found = sweep(**kept, product=product, store=store)
    memory = sweep(**kept, product=product).to_xarray()
    data = found.to_xarray().load()
    assert data.equals(memory)
    assert set(data.coords) == set(memory.coords)
    assert data["x_tip_rms"].attrs["units"] == "m"
    assert found.statuses() == {"CONVERGED": memory["x_tip"].size}


def test_a_parquet_folder_is_a_table_for_others(tmp_path):
    store = tmp_path / "a.parquet"
    found = sweep(columns=["x_tip"], measures=["tip.x.rms"], chunk=2, store=store).to_xarray()
    table = pd.read_parquet(store)
    assert list(table) == ["a", "omega", "t", "x_tip", "x_tip_rms", "status"]
    again = table.set_index(["a", "omega", "t"]).to_xarray()
    np.testing.assert_array_equal(again["x_tip"], found["x_tip"])
    only = sweep(measures=["tip.x.rms"], store=tmp_path / "b.parquet").to_xarray()
    assert list(pd.read_parquet(tmp_path / "b.parquet")) == ["a", "omega", "x_tip_rms", "status"]
    np.testing.assert_array_equal(only["x_tip_rms"], found["x_tip_rms"])


@pytest.mark.parametrize("ending", ["zarr", "parquet"])
def test_what_is_done_is_not_done_again(ending, tmp_path):
    store, calls = tmp_path / f"a.{ending}", []
    options = {"columns": ["x_tip"], "chunk": 2, "store": store}

    class StopError(Exception):
        pass

    def stop(done, total):
        if done >= 6:
            raise StopError

    with pytest.raises(StopError):
        sweep(**options, progress=stop)
    before = files_of(store)
    place = store / "x_tip" / "c" / "0" / "0" if ending == "zarr" else store
    (place / (".part" * (ending == "parquet") + "0.123.partial")).write_bytes(b"half")
    sweep(**options, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(done, 15) for done in (6, 8, 9, 11, 12, 14, 15)]
    after = files_of(store)
    assert after.items() >= before.items()
    sweep(columns=["x_tip"], chunk=2, store=tmp_path / f"b.{ending}")
    assert files_of(tmp_path / f"b.{ending}") == after


@pytest.mark.parametrize(
    ("sizes", "most"), [((7,), 3), ((5, 4), 6), ((5, 4), 3), ((2, 3, 4), 24), ((3, 1, 5), 1)]
)
def test_chunks_cover_every_variant_once_in_order(sizes, most):
    names = "abc"[: len(sizes)]
    sweep = {n: np.arange(float(size)) for n, size in zip(names, sizes, strict=True)}
    plan = Plan(tuple(names), np.zeros(len(sizes)), sweep, True, most)
    sets = np.concatenate([plan.sets(number) for number in range(len(plan.grid))])
    assert all(len(plan.sets(number)) <= most for number in range(len(plan.grid)))
    grid = np.meshgrid(*sweep.values(), indexing="ij")
    assert sets.tolist() == np.column_stack([x.ravel() for x in grid]).tolist()


@pytest.mark.parametrize("ending", [".zarr", ".parquet", None])
def test_what_is_sent_with_a_chunk_does_not_grow_with_the_sweep(ending, tmp_path):
    sizes = []
    for count in (10, 100_000):

        class Noting:
            def submit(self, *given):
                sizes.append(len(pickle.dumps(given)))
                raise RuntimeError("enough")

        store = ending and tmp_path / f"{count}{ending}"
        with pytest.raises(kc.SweepError, match="enough"):
            sweep(p={"a": np.linspace(1, 2, count)}, chunk=5, store=store, executor=Noting())
    assert abs(sizes[1] - sizes[0]) < 200


def test_a_sweep_goes_through_bifurcations_where_it_is_told():
    m = kc.Mechanism("parallelogram", end=0.7, points=15)
    length = m.parameter("L", 1.0)
    a, b, c = (
        m.body("a", guess=(0, 0, 0.6)),
        m.body("b", guess=(0.8, 0.6, 0)),
        m.body("c", guess=(2, 0, 0.6)),
    )
    m.add(kc.Revolute("O", m.ground, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("A", a, (length, 0), b, (0, 0)))
    m.add(kc.Revolute("B", b, (2, 0), c, (length, 0)))
    m.add(kc.Revolute("C", c, (0, 0), m.ground, (2, 0)))
    m.add(kc.AbsoluteAngle("motor", a, 0.6 + 2 * kc.pi * kc.t))
    options = {"p": {"L": [0.8, 1.0]}, "columns": ["phi_b"], "product": False}
    assert set(sweep(m, **options).statuses()) == {"CONVERGED", "SINGULAR", "NOT_REACHED"}
    found = sweep(m, **options, through="smooth")
    assert found.statuses() == {"CONVERGED": 30}
    np.testing.assert_allclose(found["phi_b"], 0, atol=1e-9)
    with pytest.raises(kc.InputError, match="through is 'straight'"):
        sweep(m, **options, through="straight")


def test_a_mechanism_is_sent_as_its_source_and_made_again_once():
    code = code_of(kc.compile(crank()))
    first, again = (pickle.loads(pickle.dumps(code)) for _ in range(2))
    assert first is again
    assert first.module is not code.module
    here, there = (kc.solve(x.module, TIMES, {"a": 0.9}) for x in (code, first))
    np.testing.assert_array_equal(here.q_ddot, there.q_ddot)


def test_workers_know_the_points_of_joints():
    with processes(1) as pool:
        found = sweep(columns=["A.x_dot", "tip.x"], executor=pool, chunk=8).to_xarray()
    assert (found["status"] == 0).all()
    np.testing.assert_allclose(found["x_A_dot"], 0, atol=1e-13)


def test_that_what_all_chunks_share_is_packed_once():
    sent = []

    class Recorded(ThreadPoolExecutor):
        def submit(self, function, /, *given, **named):
            sent.append(given[0])
            return super().submit(function, *given, **named)

    sets = {"a": np.linspace(0.1, 1.0, 12)}
    with Recorded(1) as executor:
        found = kc.sweep(crank(), sets, TIMES, target="numpy", chunk=3, executor=executor)
    alone = kc.sweep(crank(), sets, TIMES, target="numpy", chunk=3)
    assert len(sent) == 4
    assert all(job is sent[0] and type(job) is bytes for job in sent)
    np.testing.assert_array_equal(found.to_xarray()["x_tip"], alone.to_xarray()["x_tip"])
