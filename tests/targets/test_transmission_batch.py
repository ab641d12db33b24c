"""A batch of points in emitted C and NumPy: the same as one by one, and what closed forms give."""

import ctypes
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests import transmission_models as models

GOLDEN = json.loads(
    (Path(__file__).resolve().parents[1] / "data" / "transmission_golden.json").read_text()
)
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC")
ROLL = GOLDEN["T3-SPU"]["singular"][1]["x"][0]  # pitch where both rods lose hold of the roll
ROOM = 1024  # of a state, in doubles


class Library:
    """The functions of a transmission, called from Python."""

    def __init__(self, model, ends, folder, compiler):
        self.name = model.name
        files = kc.emit(model, "c", transmission=ends)
        files.write(folder)
        source, out = f"{self.name}_transmission.c", str(folder / "lib.so")
        command = [compiler, *STRICT, source, "-o", out, "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        self.library = ctypes.CDLL(out)
        self.batch_of = self.of("transmission_batch")
        self.batch_of.restype = ctypes.c_size_t
        self.state = np.zeros(ROOM)
        self.begin()

    def begin(self):
        """Begin at the position of the model."""
        self.state[:] = 0
        assert self.of("start")(at(self.state)) == 0

    def of(self, function):
        """Return a function."""
        return getattr(self.library, f"{self.name}_{function}")

    def batch(self, u, tau):
        """Return x, J, J^T tau and the statuses of a path in one call, and how many were found."""
        (count, n), m = u.shape, tau.shape[1]
        room = np.empty((count, m)), np.empty((count, m, n)), np.empty((count, n))
        status = np.full(count, -1, dtype=np.intc)
        given = [at(a) for a in (u, tau, *room, status)]
        return (*room, status), self.batch_of(at(self.state), ctypes.c_size_t(count), *given)

    def one_by_one(self, u, tau):
        """Return the same from one call for each point."""
        self.begin()
        (count, n), m = u.shape, tau.shape[1]
        x, slopes, efforts = np.empty((count, m)), np.empty((count, m, n)), np.empty((count, n))
        status = np.empty(count, dtype=np.intc)
        for k in range(count):
            given = (at(a) for a in (u[k], x[k], slopes[k]))
            status[k] = self.of("transmission")(at(self.state), *given)
            self.of("effort")(at(slopes[k]), at(tau[k]), at(efforts[k]))
        return x, slopes, efforts, status


def at(array):
    """Return the address of an array."""
    return ctypes.c_void_p(array.ctypes.data)


class Module:
    """The functions of a transmission in NumPy."""

    def __init__(self, model, ends):
        self.module: dict[str, Any] = {}
        exec(kc.emit(model, transmission=ends).source, self.module)
        self.begin()

    def begin(self):
        """Begin at the position of the model."""
        self.state, status = self.module["start"]()
        assert status == 0

    def batch(self, u, tau):
        """Return the same as of a library, of a path in one call."""
        x, slopes, status = self.module["transmission_batch"](self.state, u)
        efforts = self.module["effort"](slopes, tau)
        return (x, slopes, efforts, status), int((status == 0).sum())

    def one_by_one(self, u, tau):
        """Return the same from one call for each point."""
        self.begin()
        found = [self.module["transmission"](self.state, point) for point in u]
        efforts = [self.module["effort"](x[1], own) for x, own in zip(found, tau, strict=True)]
        x, slopes, status = (np.array(x) for x in zip(*found, strict=True))
        return x, slopes, np.array(efforts), status


def follower(target, model, ends, folder, compiler):
    """Return a model as a function, in a target."""
    return Module(model, ends) if target == "numpy" else Library(model, ends, folder, compiler)


@pytest.fixture(params=["c", "numpy"])
def four_bar(request, tmp_path, quick_compiler):
    """T1a."""
    ends = ["motor"], ["phi_rocker"]
    return follower(request.param, models.crank_rocker(), ends, tmp_path, quick_compiler)


@pytest.fixture(params=["c", "numpy"])
def ankle(request, tmp_path, quick_compiler):
    """T3-SPU."""
    ends = ["left", "right"], ["pitch", "roll"]
    return follower(request.param, models.ankle(), ends, tmp_path, quick_compiler)


def same(found, wanted):
    """Compare two results, but for rounding and the last correction."""
    assert found[3].tolist() == wanted[3].tolist()
    for here, there in zip(found[:3], wanted[:3], strict=True):
        size = max(np.nanmax(np.abs(there)), 1)
        np.testing.assert_allclose(here, there, rtol=0, atol=2e-9 * size)


def test_a_turn_of_the_crank_is_that_of_circles(four_bar):
    """From points that go singly to points of which eight go side by side."""
    for count in (1, 7, 8, 12, 37, 400, 5000):
        four_bar.begin()
        check_turn(four_bar, count)


def check_turn(four_bar, count):
    """Compare a turn with closed forms."""
    theta = 1.5 + np.linspace(0, 2 * math.pi, count)
    tau = np.linspace(1, 2, count)[:, np.newaxis]
    (x, slopes, efforts, status), reached = four_bar.batch(theta[:, np.newaxis], tau)
    assert reached == count
    assert not status.any()
    a, b, c, d = (GOLDEN["T1a"]["parameters"][x] for x in "abcd")
    crank, rocker = a * np.exp(1j * theta), c * np.exp(1j * x[:, 0])
    coupler = d + rocker - crank
    np.testing.assert_allclose(np.abs(coupler), b, rtol=0, atol=1e-14)
    assert ((coupler * np.conj(d - crank)).imag > 0).all()  # left of the line from B to D
    # J = a sin(beta - theta) / (c sin(beta - psi)), by the table's source
    cross = (np.conj(crank) * coupler).imag / (np.conj(rocker) * coupler).imag
    np.testing.assert_allclose(slopes[:, 0, 0], cross, rtol=0, atol=2e-10)
    np.testing.assert_array_equal(efforts, slopes[:, 0] * tau)


def test_a_batch_is_what_single_calls_give(ankle):
    rng = np.random.default_rng(1)
    turn = np.linspace(0, 2 * math.pi, 500)
    near = 0.2251 + 0.02 * np.sin(np.outer(turn, (1, 2)))
    u = np.concatenate((near, 0.2251 + rng.uniform(-0.01, 0.01, (100, 2)), near[::7]))
    tau = rng.normal(size=u.shape)
    found, reached = ankle.batch(u, tau)
    assert reached == len(u)
    same(found, ankle.one_by_one(u, tau))


def test_points_beyond_a_singular_position_have_a_status_each(ankle):
    """From the model out of reach and back: no number there, the same branch afterwards."""
    there = *np.linspace(0.2251, 0.2951, 300), *np.linspace(0.2951, 0.2961, 500), 0.33
    out = np.array([*there, *there[::-1]])
    u, tau = np.stack((out, out), axis=1), np.ones((len(out), 2))
    found, reached = ankle.batch(u, tau)
    (end,) = (x["u"][0] for x in GOLDEN["T3-SPU"]["singular"] if x.get("x", [0])[0] == ROLL)
    assert set(found[3][out > end]) == {2}
    assert not found[3][out < end - 1e-5].any()
    lost = found[3] != 0
    assert (np.isnan(found[0]).all(axis=1) == lost).all()
    assert reached == len(out) - lost.sum()
    np.testing.assert_allclose(found[0][-1], 0, atol=2e-3)


def test_what_is_not_wanted_may_be_left_out(tmp_path, quick_compiler):
    ends = ["motor"], ["phi_rocker"]
    four_bar = Library(models.crank_rocker(), ends, tmp_path, quick_compiler)
    u = np.linspace(1.5, 2.5, 50)[:, np.newaxis]
    (x, *_), _ = four_bar.batch(u, np.ones((50, 1)))
    only = np.empty((50, 1))
    four_bar.begin()
    nothing = (None,) * 3
    given = at(four_bar.state), ctypes.c_size_t(50), at(u), None, at(only), *nothing
    assert four_bar.batch_of(*given) == 50
    np.testing.assert_array_equal(only, x)
    assert four_bar.batch_of(at(four_bar.state), ctypes.c_size_t(0), *(None,) * 6) == 0


def test_numpy_goes_side_by_side_and_neighbours_far_apart_go_alone():
    """A smooth path takes about one evaluation a point, in arrays."""
    ends = ["left", "right"], ["pitch", "roll"]
    ankle, counts = Module(models.ankle(), ends), {"ARRAYS": 0, "FLOATS": 0}
    code = ankle.module["_code"]

    def counted(f, p, u, q):
        kind = "ARRAYS" if f is ankle.module["ARRAYS"] else "FLOATS"
        counts[kind] += len(q[0]) if kind == "ARRAYS" else 1
        return code(f, p, u, q)

    ankle.module["_code"] = counted
    turn = np.linspace(0, 2 * math.pi, 5000)
    path = 0.2251 + 0.02 * np.sin(np.outer(turn, (1, 2)))
    tau = np.ones_like(path)
    found, reached = ankle.batch(path, tau)
    assert reached == 5000
    assert counts["ARRAYS"] < 1.2 * 5000
    assert counts["FLOATS"] < 200
    rng = np.random.default_rng(2)
    jumps = 0.2251 + rng.uniform(-0.02, 0.02, (300, 2))
    found, _ = ankle.batch(jumps, tau[:300])
    wanted = ankle.one_by_one(jumps, tau[:300])
    same(found, wanted)


def test_what_has_nothing_to_solve_for_has_a_batch_too():
    motors = Module(models.differential(), (["m_1", "m_2"], ["x_1", "x_2"]))
    u = np.random.default_rng(3).normal(size=(200, 2))
    (x, slopes, _, status), _ = motors.batch(u, np.ones((200, 2)))
    assert not status.any()
    first, second = u[:, 0] / 50, u[:, 1] / -60
    by_hand = (first + second) / 4 + 0.1, (first - second) / 3 - 0.2
    np.testing.assert_allclose(x.T, by_hand, rtol=0, atol=1e-14)
    rows = [[1 / 200, -1 / 240], [1 / 150, 1 / 180]]
    np.testing.assert_allclose(slopes, np.tile(rows, (200, 1, 1)), rtol=1e-14)


def test_a_path_of_another_shape_is_refused():
    ankle = Module(models.ankle(), (["left", "right"], ["pitch", "roll"]))
    with pytest.raises(ValueError, match=r"u has the shape \(3,\), not \(B, 2\): left, right"):
        ankle.batch(np.zeros(3), np.zeros(3))


def test_a_path_never_changes_the_branch():
    """T1b turns back at both sides: beyond is a status, and what follows is as before."""
    lengths = [GOLDEN["T1b"]["parameters"][x] for x in "abcd"]
    model = models.crank_rocker(*lengths, psi=0.99, motor=1.0)
    four_bar = Module(model, (["motor"], ["phi_rocker"]))
    ends = sorted(x["u"][0] for x in GOLDEN["T1b"]["singular"] if x["type"] == 2 and "u" in x)
    u = (1.0 + 1.2 * np.sin(np.linspace(0, 6 * math.pi, 3000)))[:, np.newaxis]
    (x, _, _, status), _ = four_bar.batch(u, np.ones_like(u))
    beyond = (u[:, 0] < ends[0]) | (u[:, 0] > ends[1])
    assert beyond.any()
    assert (status[beyond] != 0).all()
    a, b, c, d = lengths
    crank, rocker = a * np.exp(1j * u[:, 0]), c * np.exp(1j * x[:, 0])
    coupler = d + rocker - crank
    known = status == 0
    assert known.sum() > 0.9 * (~beyond).sum()
    np.testing.assert_allclose(np.abs(coupler[known]), b, rtol=0, atol=1e-13)
    side = (coupler * np.conj(rocker)).imag[known]
    assert (np.sign(side) == np.sign(side[0])).all()
