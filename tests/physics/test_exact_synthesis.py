"""`kc.synthesis`: linkages that are known, by circles that meet, come back from what they do."""

# ruff: noqa: N806 - joints have the capital letters of the drawings

import math
import warnings

import numpy as np
import pytest
import sympy
from numpy.polynomial import chebyshev

import kincompile as kc
from tests.physics.test_sketched_mechanisms import meet

CRANK, COUPLER, ROCKER, GROUND = 2.0, 4.0, 2.7, 3.7
POINT = 1.7 + 1.5j  # in the frame of the coupler, which has its origin in A
AROUND = np.radians([0.0, 72, 144, 216, 288])


def places(angles, side=1, sizes=(CRANK, COUPLER, ROCKER, GROUND)):
    """Return A, B and the direction of the coupler of a four-bar at angles of its crank."""
    crank, coupler, rocker, ground = sizes
    A = crank * np.exp(1j * np.asarray(angles))
    B = meet(A, coupler, np.full_like(A, ground), rocker, side)
    return A, B, (B - A) / coupler


def poses_at(angles, side=1, sizes=(CRANK, COUPLER, ROCKER, GROUND)):
    """Return the poses of the coupler at angles of the crank."""
    A, _, direction = places(angles, side, sizes)
    P = A + direction * POINT
    return np.column_stack((P.real, P.imag, np.angle(direction)))


def swing(dyad, poses):
    """Return how much the length of a dyad differs between poses."""
    P, R = poses[:, 0] + 1j * poses[:, 1], np.exp(1j * poses[:, 2])
    ends = np.abs(P + R * complex(*dyad.circle) - complex(*dyad.centre))
    return max(np.ptp(ends), abs(ends[0] - dyad.length))


def four_numbers(found):
    """Return centres and circles in order."""
    return np.array(sorted((*item.centre, *item.circle) for item in found))


def known():
    """Return the dyads of the crank and of the rocker, as numbers."""
    B = COUPLER - POINT
    return np.array([[0, 0, -POINT.real, -POINT.imag], [GROUND, 0, B.real, B.imag]])


def nearest(found, wanted):
    """Return how far the nearest dyad is from one that is wanted."""
    return min(np.abs(np.subtract((*item.centre, *item.circle), wanted)).max() for item in found)


@pytest.mark.parametrize("degrees", [[0, 72, 144, 216, 288], [10, 40, 80, 120, 150]])
def test_that_five_poses_of_a_four_bar_give_its_dyads_and_two_more(degrees):
    poses = poses_at(np.radians(degrees))
    found = kc.synthesis.dyads(poses)
    assert (len(found), found.reason) == (4, "")
    for dyad in found:
        assert swing(dyad, poses) < 1e-11 * (1 + dyad.length)
    for wanted in known():
        assert nearest(found, wanted) < 1e-10


def test_that_the_four_dyads_are_all_that_free_equations_have():
    poses = poses_at(AROUND)
    u, v, x, y = names = sympy.symbols("u v x y")
    lengths = []
    for X, Y, phi in poses.tolist():
        c, s = math.cos(phi), math.sin(phi)
        lengths.append((X + c * u - s * v - x) ** 2 + (Y + s * u + c * v - y) ** 2)
    equations = [sympy.expand(length - lengths[0]) for length in lengths[1:]]
    system = kc.ConstraintSystem("burmester", names, equations, guess=[10, 10, 10, 10])
    positions = kc.assemblies(kc.compile(system))
    expected = np.array(sorted(positions[:, [2, 3, 0, 1]].tolist()))
    np.testing.assert_allclose(four_numbers(kc.synthesis.dyads(poses)), expected, rtol=0, atol=1e-7)


def test_that_dyads_move_turn_and_grow_with_the_poses():
    poses = poses_at(AROUND)
    P, turned = 50 * (poses[:, 0] + 1j * poses[:, 1]) * np.exp(0.7j) + (300 - 20j), 0.7
    moved = np.column_stack((P.real, P.imag, poses[:, 2] + turned))
    first, second = kc.synthesis.dyads(poses), kc.synthesis.dyads(moved)
    centres = [50 * complex(*item.centre) * np.exp(0.7j) + (300 - 20j) for item in first]
    lengths = {
        round(50 * item.length, 6): centre for item, centre in zip(first, centres, strict=True)
    }
    for item in second:
        centre = lengths[round(item.length, 6)]
        np.testing.assert_allclose(complex(*item.centre), centre, rtol=0, atol=1e-8)


def test_that_five_poses_without_a_real_dyad_say_so():
    random = np.random.default_rng(3)
    counts = []
    for _ in range(40):
        poses = random.uniform(-1, 1, (5, 3)) * (1, 1, math.pi)
        found = kc.synthesis.dyads(poses)
        counts.append(len(found))
        missing = 4 - len(found)
        assert found.reason.startswith(f"{missing} of the four dyads" if missing else "")
        assert all(swing(item, poses) < 1e-9 * (1 + item.length) for item in found)
    assert set(counts) == {0, 2, 4}


def test_that_the_curves_of_four_poses_go_through_the_dyads_of_a_fifth():
    five = poses_at(AROUND)
    found = kc.synthesis.dyads(five)
    for item in found:
        curve = kc.synthesis.dyads(five[:4], turn=item.turn)
        assert nearest(curve, (*item.centre, *item.circle)) < 1e-9


def test_that_the_curves_of_four_poses_are_sampled_by_the_turn_of_the_link():
    poses = poses_at(np.radians([0.0, 60, 150, 250]))
    curve = kc.synthesis.dyads(poses)
    assert len(curve) == 324
    assert curve.reason == "there are no two real dyads at 197 of the turns"
    assert max(swing(item, poses) / (1 + item.length) for item in curve) < 1e-9
    turn = np.radians(60)
    P, R = poses[:, 0] + 1j * poses[:, 1], np.exp(1j * poses[:, 2])
    both = kc.synthesis.dyads(poses, turn=turn)
    for item in both:
        arms = P + R * complex(*item.circle) - complex(*item.centre)
        assert np.angle(arms[1] / arms[0]) == pytest.approx(turn, abs=1e-12)
        assert item.turn == pytest.approx(turn, abs=1e-12)
    assert nearest(both, known()[0]) < 1e-12


@pytest.mark.parametrize("count", [2, 3])
def test_that_one_pivot_of_two_or_three_poses_gives_the_other(count):
    poses = poses_at(AROUND[:count])
    turn = {"turn": np.radians(72)} if count == 2 else {}
    (crank,) = kc.synthesis.dyads(poses, circle=(-POINT.real, -POINT.imag), **turn)
    np.testing.assert_allclose((*crank.centre, crank.length), (0, 0, CRANK), atol=1e-12)
    wanted = [(0.0, 0.0), (5.0, 1.0)]
    found = kc.synthesis.dyads(poses, centre=wanted, **turn)
    np.testing.assert_allclose([item.centre for item in found], wanted, rtol=0, atol=1e-12)
    assert all(swing(item, poses) < 1e-12 for item in found)
    np.testing.assert_allclose(found[0].circle, (-POINT.real, -POINT.imag), atol=1e-12)


def test_that_three_places_on_a_line_have_no_centre():
    found = kc.synthesis.dyads([(0, 0, 1), (0.1, 0.3, 1), (0.3, 0.9, 1)], circle=[(0, 0), (1, 0)])
    assert not found
    assert found.reason == "2 dyads have a pivot at infinity, as where the places lie on a line"


FIVE = poses_at(AROUND).tolist()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.dyads([(0, 0, 0)]), r"have the shape \(1, 3\). Give two to five"),
        (lambda s: s.dyads([(0, 0), (1, 1)]), r"have the shape \(2, 2\)"),
        (lambda s: s.dyads([(0, 0, 0), (1, "x", 0)]), "poses: these are not numbers"),
        (lambda s: s.dyads([(0, 0, 0), (1, np.nan, 0)]), "poses: a number is not finite"),
        (lambda s: s.dyads([*FIVE[:4], FIVE[1]]), "Poses 2 and 5 are equal. Leave one"),
        (lambda s: s.dyads([(k, k * k, 0) for k in range(5)]), "follow from the others, as for tr"),
        (lambda s: s.dyads(FIVE, turn=1), "5 poses do not go with: turn. Leave that out."),
        (lambda s: s.dyads(FIVE[:4], circle=(0, 0)), "with: circle. Give turn, or nothing."),
        (lambda s: s.dyads(FIVE[:3]), "3 poses leave a choice open. Give circle or centre."),
        (lambda s: s.dyads(FIVE[:2], circle=(0, 0)), "Give circle and turn or centre and turn"),
        (lambda s: s.dyads(FIVE[:3], circle=(0, 0, 0)), r"circle has the shape \(1, 3\)"),
        (lambda s: s.dyads(FIVE[:4], turn=[1, math.tau]), "A turn of the link is zero"),
        (lambda s: s.freudenstein([0, 1], [0, 1]), "Give three to five of both"),
        (
            lambda s: s.freudenstein([0, 1, 1], [0, 1, 1]),
            "Some precision points follow from the others",
        ),
        (lambda s: s.freudenstein([0, 1, 2], [0, 1, 2]), "where two are equal or outputs are"),
        (lambda s: s.FourBar((0, 0), (1, 0), (1, 0), (0, 1), (2, 2)), "are in one place. Give it"),
        (lambda s: s.path(FIVE, AROUND), "Give five of both"),
        (lambda s: s.chebyshev_spacing(0, 1, 0), "count is 0. Give how many precision points"),
        (lambda s: s.chebyshev_spacing(0, 1, 1.5), "count is 1.5. Give how many precision points"),
        (lambda s: s.chebyshev_spacing(0, 1, 10**12), "Give how many precision points"),
        (lambda s: s.chebyshev_spacing(math.nan, 1, 3), "start and end: a number is not finite"),
        (lambda s: s.four_bar(*s.dyads(FIVE)[:2], FIVE[0]), r"have the shape \(3,\)"),
        (lambda s: s.four_bar(*s.dyads(FIVE)[:1] * 2, FIVE), "Two pivots are one"),
        (
            lambda s: s.four_bar(*s.dyads(FIVE)[:2], [*FIVE[:4], (0, 0, 0)]),
            "does not lead through the poses: its length changes by",
        ),
        (lambda s: s.FourBar((0, 0), (1, 0), (1, 1), (0, 1), (2, 2), "rod"), "driven is 'rod'"),
        (lambda s: s.FourBar((0, 0), (1, 0), (1, 1), (0, 1), 3), "the joints: these are not n"),
        (
            lambda s: s.cognates(s.FourBar((0, 0), (1, 0), (1, 1), (0, 1), (1, 1))),
            "P is in A or B, so that its path is an arc",
        ),
    ],
)
def test_that_what_cannot_be_is_refused_with_what_to_do(call, message):
    with pytest.raises(kc.InputError, match=message):
        call(kc.synthesis)


def through(linkage, poses):
    """Return how far a four-bar is from poses at the times of its passage, solved on its own."""
    s = linkage.sketch()
    module = kc.compile(s.mechanism())
    solution = kc.solve(module, linkage.passage.times)
    assert solution.success
    return np.abs(np.column_stack((solution["P.x"], solution["P.y"])) - poses[:, :2]).max()


def test_that_five_poses_give_four_bars_of_which_the_working_ones_come_first():
    poses = poses_at(np.radians([10.0, 40, 80, 120, 150]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = kc.synthesis.four_bars(poses)
    works = [item.passage.works for item in found]
    assert len(found) == 12
    assert works == sorted(works, reverse=True)
    assert 1 <= sum(works) < 12
    assert all(through(item, poses) < 1e-9 for item in found if item.passage.works)
    own = [item for item in found if np.allclose(item.lengths, (GROUND, CRANK, COUPLER, ROCKER))]
    assert [item.passage.works for item in own] == [True]
    assert own[0].passage.message == (
        "The crank turns by 140 deg through the poses in their order."
    )
    assert all(item.passage.message.endswith(".") for item in found)
    locked = [item for item in found if "LOCK_UP" in item.passage.message]
    assert locked
    assert all(math.isnan(item.passage.deviation) for item in locked)


def dyads_of(sizes):
    """Return the dyads of a four-bar by its sizes."""
    crank, coupler, rocker, ground = sizes
    B = coupler - POINT
    first = kc.synthesis.Dyad((0, 0), (-POINT.real, -POINT.imag), crank, 0)
    return first, kc.synthesis.Dyad((ground, 0), (B.real, B.imag), rocker, 0)


def test_that_poses_out_of_order_show_in_the_turns_of_the_crank():
    poses = poses_at(np.radians([0.0, 90, 45, 120]))
    passage = kc.synthesis.four_bar(*dyads_of((CRANK, COUPLER, ROCKER, GROUND)), poses).passage
    assert (passage.in_order, passage.one_branch, passage.works) == (False, True, False)
    assert math.isnan(passage.deviation)
    assert passage.message == "The order in which the crank meets the poses is 1, 3, 2, 4."


def test_that_poses_on_two_circuits_are_found():
    sizes = CRANK, COUPLER, ROCKER, GROUND  # a crank-rocker, by Grashof
    poses = np.vstack((poses_at([0.2, 0.5]), poses_at([0.9], side=-1)))
    passage = kc.synthesis.four_bar(*dyads_of(sizes), poses).passage
    assert (passage.one_branch, passage.one_circuit, passage.works) == (False, False, False)
    assert "Poses on another circuit than the first: 3; take another pair." in passage.message


def by_coupler(direction, side, sizes):
    """Return A and B at directions of the coupler."""
    crank, coupler, rocker, ground = sizes
    A = meet(0, crank, ground - coupler * direction, rocker, side)
    return A, A + coupler * direction


def by_rocker(direction, side, sizes):
    """Return A and B at directions of the rocker."""
    crank, coupler, rocker, ground = sizes
    B = ground + rocker * direction
    return meet(np.zeros_like(B), crank, B, coupler, side), B


def by_crank(direction, side, sizes):
    """Return A and B at directions of the crank."""
    return places(np.angle(direction), side, sizes)[:2]


@pytest.mark.parametrize(
    ("least", "at", "sizes"),
    [
        ("crank", by_crank, (CRANK, COUPLER, ROCKER, GROUND)),
        ("coupler", by_coupler, (5.0, 2.0, 5.0, 4.0)),
        ("rocker", by_rocker, (ROCKER, COUPLER, CRANK, GROUND)),
        ("ground", by_crank, (3.0, 2.8, 3.2, 1.0)),
    ],
)
def test_that_a_turn_of_the_least_link_is_a_circuit(least, at, sizes):
    """By Grashof: the mirrored positions of the others are another."""
    assert sizes.index(min(sizes)) == ["crank", "coupler", "rocker", "ground"].index(least)
    direction = np.exp(1j * np.array([0.3, 1.4, 2.5, 3.6, 4.7, 5.8]))
    first, second = (np.array(at(direction, side, sizes)) for side in (1, -1))
    mixed = np.where(np.arange(6) < 4, first, second)
    passages = []
    for A, B in (first, second, mixed):
        angles = np.angle((B - A) / sizes[1])
        P = A + np.exp(1j * angles) * POINT
        poses = np.column_stack((P.real, P.imag, angles))
        passages.append(kc.synthesis.four_bar(*dyads_of(sizes), poses).passage)
    assert [item.one_circuit for item in passages] == [True, True, False]
    folds = least in {"coupler", "rocker"}  # whose turn folds coupler and rocker
    assert [item.one_branch for item in passages] == [not folds, not folds, False]
    assert "circuit than the first: 5, 6;" in passages[2].message


def test_that_a_linkage_that_is_not_grashofs_has_two_branches_on_one_circuit():
    sizes = 3.0, 2.5, 3.2, 4.0  # shortest and longest make more than the others
    poses = np.vstack((poses_at([0.5, 0.7], 1, sizes), poses_at([0.9], -1, sizes)))
    passage = kc.synthesis.four_bar(*dyads_of(sizes), poses).passage
    assert (passage.one_branch, passage.one_circuit, passage.works) == (False, True, False)
    assert "Poses on another branch than the first: 3; drive another link." in passage.message


def test_that_a_crank_turns_the_way_in_which_the_poses_follow():
    poses = poses_at(np.radians([100.0, 60, 10]))
    linkage = kc.synthesis.four_bar(*dyads_of((CRANK, COUPLER, ROCKER, GROUND)), poses)
    assert linkage.turn == pytest.approx(np.radians(-90))
    assert linkage.passage.works
    np.testing.assert_allclose(linkage.passage.times, (0, 4 / 9, 1), atol=1e-12)


def test_that_a_path_at_crank_angles_gives_the_four_bar_back():
    poses = poses_at(AROUND)
    found = kc.synthesis.path(poses[:, :2], AROUND + 0.3)
    assert any(np.allclose(item.lengths, (GROUND, CRANK, COUPLER, ROCKER)) for item in found)
    for item in found:
        if item.passage.works:
            assert item.turn == pytest.approx(AROUND[-1])
            np.testing.assert_allclose(item.passage.times, AROUND / AROUND[-1], atol=1e-9)
            assert through(item, poses) < 1e-9


def test_that_the_five_points_of_the_literature_are_met_exactly():
    """Without limits of Grashof, whose best error, of `fit`, is 7.4e-7."""
    points = np.array([(3, 3), (2.759, 3.363), (2.372, 3.663), (1.890, 3.862), (1.355, 3.943)])
    found = kc.synthesis.path(points, np.radians([30, 45, 60, 75, 90]))
    working = [item for item in found if item.passage.works]
    assert working
    for item in working:
        np.testing.assert_allclose(item.passage.times, np.linspace(0, 1, 5), atol=1e-9)
        assert through(item, points) < 1e-10


def power(count):
    """Return input and output angles of y = x^1.5 on 1..4 at precision points."""
    x = kc.synthesis.chebyshev_spacing(1, 4, count)
    return np.radians(20 + 30 * (x - 1)), np.radians(40 + 90 * (x**1.5 - 1) / 7)


def test_that_three_precision_points_give_freudensteins_lengths():
    """As computed with 30 digits: crank, coupler and rocker for a ground of 1."""
    (found,) = kc.synthesis.freudenstein(*power(3))
    expected = (1, 0.545874184319922, 0.872936471028201, 0.496810872280478)
    np.testing.assert_allclose(found.lengths, expected, rtol=0, atol=1e-13)
    (larger,) = kc.synthesis.freudenstein(*power(3), ground=50.0)
    np.testing.assert_allclose(larger.lengths, 50 * np.array(expected), rtol=1e-12)
    assert found.passage.works
    theta, phi = power(3)
    solution = kc.solve(kc.compile(found.sketch().mechanism()), found.passage.times)
    np.testing.assert_allclose(solution["crank.phi"], theta, rtol=0, atol=1e-12)
    np.testing.assert_allclose(solution["rocker.phi"], phi, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [4, 5])
def test_that_more_precision_points_are_met_from_angles_that_are_found(count):
    theta, phi = power(count)
    found = kc.synthesis.freudenstein(theta, phi)
    assert len(found) == count - 2
    assert found[0].passage.works
    for item in found:
        if item.passage.works:
            solution = kc.solve(kc.compile(item.sketch().mechanism()), item.passage.times)
            for column, wanted in (("crank.phi", theta), ("rocker.phi", phi)):
                turns = solution[column] - solution[column][0]
                np.testing.assert_allclose(turns, wanted - wanted[0], rtol=0, atol=1e-10)
            if count == 4:
                assert math.cos(solution["crank.phi"][0] - theta[0]) ** 2 == pytest.approx(1)


@pytest.mark.parametrize("count", [3, 4, 5])
def test_that_the_angles_of_a_four_bar_give_it_back(count):
    angles = AROUND[:count] + 0.2
    _, B, _ = places(angles)
    outputs = np.angle(B - GROUND) - (0.4 if count > 3 else 0)
    inputs = angles + (0.9 if count > 4 else 0)
    found = kc.synthesis.freudenstein(inputs, outputs, ground=GROUND)
    expected = GROUND, CRANK, COUPLER, ROCKER
    assert any(np.allclose(item.lengths, expected, rtol=1e-9) for item in found)


def test_that_precision_points_are_zeros_of_chebyshevs_polynomial():
    np.testing.assert_allclose(
        kc.synthesis.chebyshev_spacing(1, 4, 5), 2.5 + 1.5 * chebyshev.chebpts1(5), atol=1e-15
    )


def path_of(linkage, times):
    """Return the path of P."""
    solution = kc.solve(kc.compile(linkage.sketch().mechanism()), times)
    assert solution.success
    return solution["P.x"] + 1j * solution["P.y"]


@pytest.mark.parametrize("driven", ["crank", "coupler", "rocker"])
def test_that_cognates_go_along_the_same_path_at_the_same_times(driven):
    A, B, direction = places([0.4])
    joints = [
        (item.real, item.imag)
        for item in (A[0], B[0], complex(GROUND), A[0] + direction[0] * POINT)
    ]
    turn = math.tau if driven == "crank" else 0.3
    linkage = kc.synthesis.FourBar((0, 0), *joints, driven=driven, turn=turn)
    times = np.linspace(0, 1, 73)
    P = path_of(linkage, times)
    if driven == "crank":
        A, _, direction = places(0.4 + math.tau * times)
        np.testing.assert_allclose(P, A + direction * POINT, rtol=0, atol=1e-12)
    for item in kc.synthesis.cognates(linkage):
        np.testing.assert_allclose(path_of(item, times), P, rtol=0, atol=1e-12)
        assert not np.allclose(sorted(item.lengths), sorted(linkage.lengths))


def test_that_chebyshevs_linkage_is_a_cognate_of_hoekens():
    hoeken = kc.synthesis.FourBar((0, 0), (-1, 0), (0.5, 2), (2, 0), (2, 4))
    first, second = kc.synthesis.cognates(hoeken)
    np.testing.assert_allclose(first.lengths, (4, 5, 2, 5), rtol=1e-14)
    assert first.driven == "coupler"
    again, _ = kc.synthesis.cognates(first)
    np.testing.assert_allclose(again.lengths, hoeken.lengths, rtol=1e-14)
    assert second.driven == "crank"
