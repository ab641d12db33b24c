"""Memory of large results is used again when nobody holds them, and never before."""

import gc
import math
import threading
import weakref

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime import memory

SHAPE = (3000, 1000)


@pytest.fixture(autouse=True)
def no_memory(monkeypatch):
    """Begin without memory of earlier results."""
    monkeypatch.setattr(memory, "free", type(memory.free)())


def address(array):
    return array.__array_interface__["data"][0]


def test_memory_of_an_array_that_is_gone_is_used_again():
    first = memory.empty(SHAPE)
    place = address(first)
    del first
    again = memory.empty(SHAPE)
    assert address(again) == place
    assert address(memory.empty(SHAPE)) != place


@pytest.mark.parametrize(
    "view",
    [
        lambda a: a,
        lambda a: a[3:],
        lambda a: a.T[::2],
        lambda a: a[1:][2:][0],
        lambda a: a.reshape(-1)[5:],
        lambda a: a.view(np.uint8),
        lambda a: np.broadcast_to(a, (3, *a.shape)),
        lambda a: np.lib.stride_tricks.as_strided(a, (3,), (8,)),
        lambda a: np.split(a, 2)[1],
        memoryview,
        lambda a: np.asarray(memoryview(a)[:2]),
        lambda a: a.ctypes,
        lambda a: a.flat,
    ],
)
def test_any_view_keeps_the_memory(view):
    kept = view(memory.empty(SHAPE))
    assert not memory.free
    del kept
    assert len(memory.free) == 1


@pytest.mark.parametrize("kind", [float, complex, np.intc])
def test_arrays_are_like_those_of_numpy(kind):
    found, expected = memory.empty(SHAPE, kind), np.empty(SHAPE, kind)
    assert type(found) is np.ndarray
    assert (found.shape, found.dtype, found.strides) == (SHAPE, expected.dtype, expected.strides)
    assert found.flags.writeable
    assert found.flags.c_contiguous
    found[...] = 1
    assert found.sum() == found.size


def test_small_and_very_large_arrays_are_left_to_numpy():
    for shape in ((10, 10), (memory.SMALLEST // 8 - 1,), (memory.LARGEST // 8 + 1, 1), (0, 9)):
        array = memory.empty(shape)
        assert array.base is None
        assert array.shape == shape
    assert not memory.free


def test_only_so_much_memory_is_kept_and_none_is_used_for_far_less():
    most = memory.KEPT // (8 * math.prod(SHAPE))
    arrays = [memory.empty(SHAPE) for _ in range(most + 3)]
    arrays.clear()
    assert len(memory.free) == most
    small = memory.empty((1400, 1000))
    assert len(memory.free) == most
    nearly = memory.empty((1600, 1000))
    assert len(memory.free) == most - 1
    assert small.size < nearly.size


def test_threads_never_share_memory():
    clashes = []

    def work(number):
        for _ in range(200):
            arrays = [memory.empty((1300, 1000)) for _ in range(2)]
            for k, array in enumerate(arrays):
                array[0, ::100] = 2 * number + k
            if any((array[0, ::100] != 2 * number + k).any() for k, array in enumerate(arrays)):
                clashes.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not clashes
    assert sum(piece.size for piece in memory.free) <= memory.KEPT


@pytest.fixture(params=["numpy", "c"])
def four_bar(request, example_named, quick_compiler):
    example = example_named("four_bar")
    return example.module if request.param == "numpy" else example.native


def test_what_a_user_wrote_into_results_does_not_come_back(four_bar):
    rng = np.random.default_rng(3)
    q, q_dot = rng.uniform(-1, 1, (2, 20_000, 9))
    expected = [x.copy() for x in four_bar.kinematics(q, q_dot, 0.2)]
    expected_last = [x.copy() for x in four_bar.kinematics_batch_last(q.T, q_dot.T, 0.2)]
    for _ in range(2):
        found = four_bar.kinematics(q, q_dot, 0.2)
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
            one[...] = np.nan
        del found, one
        found = four_bar.kinematics_batch_last(q.T, q_dot.T, 0.2)
        for one, other in zip(found, expected_last, strict=True):
            np.testing.assert_array_equal(one, other)
            one[...] = np.nan
        del found, one
    assert memory.free


def test_results_that_are_held_are_not_overwritten(four_bar):
    q = np.random.default_rng(4).uniform(-1, 1, (20_000, 9))
    held = four_bar.Phi_q(q, 0.0)[100]
    before = held.copy()
    for k in range(3):
        four_bar.Phi_q(q + k, 0.0)
    np.testing.assert_array_equal(held, before)


def test_a_file_that_is_loaded_uses_memory_again(tmp_path):
    m = kc.Mechanism("rod")
    rod = m.body("rod")
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    kc.emit(m).write(tmp_path)
    module = kc.load(tmp_path / "rod.py")
    module.Phi_q(np.zeros((150_000, 3)), 0.0)
    assert memory.free


def test_a_solution_that_is_gone_gives_its_memory_back_at_once(four_bar):
    collects = gc.isenabled()
    gc.disable()  # a cycle of references would keep the memory until garbage is collected
    try:
        q = kc.solve(four_bar, np.linspace(0, 1, 50)).q
        memory_of_q = weakref.ref(q if q.base is None else q.base)
        del q
        assert memory_of_q() is None
    finally:
        if collects:
            gc.enable()
