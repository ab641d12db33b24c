"""A batch of points in emitted C: the same as one by one, and what closed forms give."""

import ctypes
import json
import math
import subprocess
from pathlib import Path

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


@pytest.fixture
def four_bar(tmp_path, quick_compiler):
    """T1a."""
    return Library(models.crank_rocker(), (["motor"], ["phi_rocker"]), tmp_path, quick_compiler)


@pytest.fixture
def ankle(tmp_path, quick_compiler):
    """T3-SPU."""
    ends = ["left", "right"], ["pitch", "roll"]
    return Library(models.ankle(), ends, tmp_path, quick_compiler)


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


def test_what_is_not_wanted_may_be_left_out(four_bar):
    u = np.linspace(1.5, 2.5, 50)[:, np.newaxis]
    (x, *_), _ = four_bar.batch(u, np.ones((50, 1)))
    only = np.empty((50, 1))
    four_bar.begin()
    nothing = (None,) * 3
    given = at(four_bar.state), ctypes.c_size_t(50), at(u), None, at(only), *nothing
    assert four_bar.batch_of(*given) == 50
    np.testing.assert_array_equal(only, x)
    assert four_bar.batch_of(at(four_bar.state), ctypes.c_size_t(0), *(None,) * 6) == 0
