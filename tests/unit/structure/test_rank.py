"""The generic rank of small systems whose manifold is known, without a mechanism."""

import numpy as np
import pytest

from kincompile.errors import InputError
from kincompile.structure.rank import drivers_of, generic_rank


def report(equations, guess, *, drivers=(), angular=None, end=1.0):
    """Take the rank of equations, each given as a function of x and t with its gradient."""
    guess = np.array(guess, dtype=float)

    def evaluate(q, t):
        x = q.T
        Phi = np.array([np.broadcast_to(f(x, t), t.shape) for f, _ in equations]).T
        rows = [[np.broadcast_to(part, t.shape) for part in slope(x)] for _, slope in equations]
        return Phi, np.moveaxis(np.array(rows), -1, 0)

    flags = np.zeros(guess.size, dtype=bool) if angular is None else np.array(angular)
    names = [f"e{k}" for k in range(len(equations))]
    return generic_rank(evaluate, guess, flags, drivers, (), end, names)


CIRCLE = (lambda x, t: x[0] ** 2 + x[1] ** 2 - 1, lambda x: (2 * x[0], 2 * x[1]))
DOUBLED = (lambda x, t: 2 * x[0] ** 2 + 2 * x[1] ** 2 - 2, lambda x: (4 * x[0], 4 * x[1]))
LARGER = (lambda x, t: x[0] ** 2 + x[1] ** 2 - 4, lambda x: (2 * x[0], 2 * x[1]))
PUSH = (lambda x, t: x[0] - 0.5 - t / 4, lambda x: (1, 0))
FOLLOW = (lambda x, t: x[1] - np.sqrt(1 - (0.5 + t / 4) ** 2), lambda x: (0, 1))
LEAD = (lambda x, t: x[1] - np.sqrt(1 - 0.25) - t, lambda x: (0, 1))


def test_that_a_driven_circle_is_square():
    found = report([CIRCLE, PUSH], (0.6, 0.7), drivers=[1])
    assert (found.rank, found.redundant, found.conflicting) == (2, (), ())
    assert (found.free, found.drive, found.assembled) == ((), (), True)
    np.testing.assert_allclose(found.nearest, [0.5, np.sqrt(0.75)], atol=1e-9)
    np.testing.assert_allclose(found.residuals, 0, atol=1e-9)


def test_that_a_free_circle_leaves_both_coordinates_free_and_wants_one_driver():
    found = report([CIRCLE], (0.6, 0.7))
    assert (found.rank, found.free, len(found.drive)) == (1, (0, 1), 1)


def test_that_an_angle_is_driven_rather_than_a_length():
    """x = 5 phi: either would do."""
    screw = (lambda x, t: x[0] - 5 * x[1], lambda x: (1, -5))
    assert report([screw], (1.0, 0.1), angular=[False, True]).drive == (1,)
    assert report([screw], (1.0, 0.1)).drive == (0,)


@pytest.mark.parametrize(
    ("equations", "drivers", "redundant", "conflicting"),
    [
        ([CIRCLE, DOUBLED], [], (1,), ()),
        ([CIRCLE, PUSH, DOUBLED], [1], (2,), ()),
        ([CIRCLE, PUSH, FOLLOW], [1, 2], (2,), ()),
        ([CIRCLE, PUSH, LEAD], [1, 2], (), (2,)),
        ([CIRCLE, LARGER], [], (), (1,)),
    ],
    ids=["twice", "twice and driven", "followed", "led", "two radii"],
)
def test_that_what_repeats_is_told_from_what_contradicts(
    equations, drivers, redundant, conflicting
):
    """LEAD agrees with the others at t = 0, and only there."""
    found = report(equations, (0.6, 0.7), drivers=drivers)
    assert (found.redundant, found.conflicting) == (redundant, conflicting)
    assert found.partners[max(*redundant, *conflicting, 0)][0] == 0


def test_that_joints_come_before_drivers_in_whatever_order_they_are_written():
    """The driver of a structure is what is too much, not the joint after it."""
    slope = (lambda x, t: x[1] - x[0], lambda x: (-1, 1))
    found = report([CIRCLE, PUSH, slope], (0.7, 0.7), drivers=[1])
    assert found.conflicting == (1,)


@pytest.mark.parametrize("guess", [(1.0, 0.0), (0.999, 0.02), (0.0, 1.0)])
def test_that_a_singular_guess_is_no_redundancy(guess):
    """Where the circle is vertical, x alone cannot be prescribed."""
    at_edge = (lambda x, t: x[0] - guess[0] + t / 4, lambda x: (1, 0))
    found = report([CIRCLE, at_edge], guess, drivers=[1])
    assert (found.rank, found.redundant) == (2, ())
    assert found.rank_at_start == (1 if guess == (1.0, 0.0) else 2)


def test_that_what_cannot_be_met_is_measured():
    far = (lambda x, t: x[0] - 3, lambda x: (1, 0))
    found = report([CIRCLE, far], (0.6, 0.7))
    assert not found.assembled
    assert np.abs(found.residuals).max() > 0.1
    assert np.isfinite(found.nearest).all()


def test_that_an_equation_without_values_is_named():
    root = (lambda x, t: np.sqrt(-1 - x[0] ** 2), lambda x: (-x[0] / np.sqrt(-1 - x[0] ** 2), 0))
    with pytest.raises(InputError, match=r"value near the guess: e1\. Look for"):
        report([CIRCLE, root], (0.6, 0.7))


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_that_scales_of_equations_do_not_matter(scale):
    large = (
        lambda x, t: scale * (x[0] ** 2 + x[1] ** 2 - 1),
        lambda x: (2 * scale * x[0], 2 * scale * x[1]),
    )
    assert report([CIRCLE, large], (0.6, 0.7)).redundant == (1,)
    assert report([large, PUSH], (0.6, 0.7), drivers=[1]).rank == 2


def test_that_equations_that_never_have_values_together_are_named():
    """One needs x above the guess, the other one below."""

    def root(sign):
        return (
            lambda x, t: np.sqrt(sign * (x[0] - 0.6)),
            lambda x: (sign / 2 / np.sqrt(sign * (x[0] - 0.6)), 0),
        )

    with pytest.raises(InputError, match=r"no finite value near the guess: e\d"):
        report([root(1), root(-1)], (0.6, 0.7))


def test_drivers_of_many_freedoms_take_the_first_of_equals_and_leave_nothing():
    """Against least squares: each row taken is the one with most beside those before it."""
    random = np.random.default_rng(3)
    motions = np.linalg.qr(random.normal(size=(9, 4)))[0].T
    rows = np.repeat(random.normal(size=(5, 9)), 2, axis=0)
    taken, left = drivers_of(motions, rows, np.ones(10))
    expected: list[int] = []
    for _ in range(4):
        known = (rows[expected] @ motions.T).T
        rates = (rows @ motions.T).T
        rest = rates - known @ np.linalg.lstsq(known, rates, rcond=None)[0]
        expected.append(int(np.argmax(np.round(np.linalg.norm(rest, axis=0), 9))))
    assert taken == expected
    assert all(row % 2 == 0 for row in taken)
    assert left.shape == (0, 9)
    assert drivers_of(motions, rows[:2], np.ones(2))[1].shape == (3, 9)
    np.testing.assert_allclose(
        drivers_of(motions, rows[:2], np.ones(2))[1] @ rows[0], 0, atol=1e-12
    )
