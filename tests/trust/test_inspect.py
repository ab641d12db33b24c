"""What `kc.inspect` says of mechanisms whose mobility textbooks print, and of broken ones."""

import math

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir import redundancy
from kincompile.ir.interpret import interpreter


def chain(count):
    """Return an open chain of links, each pinned to the one before."""
    m = kc.Mechanism("chain")
    before, end = m.ground, (0.0, 0.0)
    for k in range(count):
        link = m.body(f"link{k}", guess=(k + 0.5, 0, 0))
        m.add(kc.Revolute(f"P{k}", before, end, link, (-0.5, 0)))
        before, end = link, (0.5, 0)
    return m


def watt_six_bar():
    """Return two four-bars, the second driven by the rocker of the first."""
    m = kc.Mechanism("watt")
    ground, (crank, rod, rocker, second_rod, last) = (
        m.ground,
        [
            m.body(name, guess=guess)
            for name, guess in (
                ("crank", (0.2, 0.4, 1.1)),
                ("rod", (1.2, 1.2, 0.4)),
                ("rocker", (1.8, 0.7, 1.2)),
                ("second_rod", (2.6, 1.5, 0.1)),
                ("last", (3.3, 0.8, 1.3)),
            )
        ],
    )
    m.add(kc.Revolute("A", ground, (0, 0), crank, (-0.5, 0)))
    m.add(kc.Revolute("B", crank, (0.5, 0), rod, (-1, 0)))
    m.add(kc.Revolute("C", rod, (1, 0), rocker, (0.6, 0)))
    m.add(kc.Revolute("D", rocker, (-0.6, 0), ground, (1.6, 0.1)))
    m.add(kc.Revolute("E", rocker, (0.2, 0.7), second_rod, (-0.9, 0)))
    m.add(kc.Revolute("F", second_rod, (0.9, 0), last, (0.6, 0)))
    m.add(kc.Revolute("G", last, (-0.6, 0), ground, (3.1, 0.2)))
    return m


def slider_crank(*extra):
    m = kc.Mechanism("slider_crank")
    crank = m.body("crank", guess=(0.4, 0.3, 0.6))
    rod = m.body("rod", guess=(1.6, 0.3, -0.3))
    slider = m.body("slider", guess=(2.6, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-0.5, 0)))
    m.add(kc.Revolute("B", crank, (0.5, 0), rod, (-1, 0)))
    m.add(kc.Revolute("C", rod, (1, 0), slider, (0, 0)))
    m.add(kc.Translational("D", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    for constraint in extra:
        m.add(constraint)
    return m


def pendulum(*extra):
    m = kc.Mechanism("pendulum")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), rod, (-1, 0)))
    for constraint in extra:
        m.add(constraint)
    return m


MOTOR = kc.AbsoluteAngle("motor", "rod", kc.t)


@pytest.mark.parametrize(
    ("model", "degrees"),
    [
        (chain(1), 1),
        (chain(2), 2),
        (chain(7), 7),
        (watt_six_bar(), 1),
        (slider_crank(), 1),
        (pendulum(), 1),
    ],
    ids=lambda item: getattr(item, "name", item),
)
def test_the_mobility_that_textbooks_give(model, degrees):
    """Gruebler's 3 (n - 1) - 2 j of linkages of generic lengths; there it is the rank's, too."""
    found = kc.inspect(model)
    assert found.mobility == found.degrees_of_freedom == degrees
    assert found.rank == len(found.equations) == found.structural_rank
    assert (found.redundant, found.conflicting) == ((), ())
    assert len(found.missing_drivers) == degrees


@pytest.mark.parametrize("drivers", range(5))
def test_a_five_bar_with_so_many_drivers(build, drivers):
    found = kc.inspect(build["five_bar"](drivers=drivers))
    assert found.mobility == 2
    assert found.degrees_of_freedom == max(0, 2 - drivers)
    assert found.rank == 10 + min(drivers, 2)
    assert found.conflicting == tuple(f"motor{k}" for k in range(3, drivers + 1))


def test_an_example(example):
    found = kc.inspect(example.model)
    assert found.degrees_of_freedom == 0
    assert found.rank == len(found.coordinates) == found.structural_rank == found.rank_at_start
    assert found.is_assembled
    assert (found.redundant, found.conflicting, found.free, found.problem) == ((), (), (), "")
    assert "What to do" not in found.to_text()
    # The blocks are those of which the whole is made, in an order in which each has what it needs.
    names = [item.name for item in found.coordinates]
    known = set()
    for block in found.blocks:
        known |= set(block.coordinates)
        rows = [found.equations.index(name) for name in block.equations]
        assert {names[column] for row, column in found.pattern if row in rows} <= known
    assert known == set(names)


def test_that_a_missing_driver_is_asked_for_by_body_and_type(build):
    found = kc.inspect(build["five_bar"](drivers=1))
    assert found.free == ("left_rod", "right_rod", "right")
    (missing,) = found.missing_drivers
    assert (missing.kind, missing.drives in found.free) == ("AbsoluteAngle", True)
    text = found.to_text()
    assert f"a driver is missing: add, for instance, AbsoluteAngle of {missing.drives}" in text
    assert "too few equations: left_rod, right_rod, right have 9 coordinates, and 8" in text


def driven(model, missing):
    """Add the drivers that are asked for."""
    for k, item in enumerate(missing):
        name = f"extra{k}"
        if item.kind == "Equation":
            model.add(kc.Equation(name, sympy.Symbol(item.drives) - kc.t))
        elif item.kind == "AbsoluteAngle":
            model.add(kc.AbsoluteAngle(name, item.drives, kc.t))
        else:
            model.add(getattr(kc, item.kind)(name, item.drives, (0, 0), kc.t))
    return model


def idle_body():
    m = pendulum(MOTOR)
    m.body("idle")
    return m


def slide():
    """Return a block on an inclined guide."""
    m = kc.Mechanism("slide")
    block = m.body("block", guess=(1, 1, math.pi / 4))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 1), block, (0, 0), (1, 0)))
    return m


def cam():
    """Return a disc and a lever that follows it, with nothing to turn them."""
    m = kc.Mechanism("cam")
    disc, lever = m.body("disc"), m.body("lever", guess=(0.06, 0.02, 2.6))
    m.add(kc.Revolute("shaft", disc, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("pivot", lever, (-0.04, 0), m.ground, (0.1, 0)))
    wave = 0.05 + sympy.cos(2 * kc.alpha) / 100
    m.add(kc.PointFollower("pin", lever, (0.04, 0), disc, (0, 0), wave, guess=1.0))
    return m


@pytest.mark.parametrize(
    "make",
    [lambda: chain(3), idle_body, slide, cam, slider_crank, watt_six_bar],
    ids=["chain", "idle_body", "slide", "cam", "slider_crank", "watt"],
)
def test_that_the_drivers_asked_for_leave_nothing_free(make):
    model = make()
    missing = kc.inspect(model).missing_drivers
    found = kc.inspect(driven(model, missing))
    assert (found.degrees_of_freedom, found.free, found.missing_drivers) == (0, (), ())


def test_that_a_body_without_a_joint_is_named():
    found = kc.inspect(idle_body())
    assert found.free == ("idle",)
    assert [(item.kind, item.drives) for item in found.missing_drivers] == [
        ("AbsoluteX", "idle"),
        ("AbsoluteY", "idle"),
        ("AbsoluteAngle", "idle"),
    ]
    assert "too few equations: idle have 3 coordinates, and 0 equations" in found.to_text()


def test_that_two_drivers_too_many_are_named_and_taken_away(build):
    model = build["five_bar"](drivers=4)
    found = kc.inspect(model)
    assert [item.constraint for item in found.surpluses] == ["motor3", "motor4"]
    assert all(item.conflicting and item.is_driver for item in found.surpluses)
    many = found.too_many
    assert len(many.equations) - len(many.coordinates) == 2
    text = found.to_text()
    assert "2 of them can never be independent" in text
    assert "remove the driver motor3" in text
    model.constraints[-2:] = []
    assert kc.inspect(model).surpluses == ()


def test_that_one_message_says_what_is_too_much_when_it_is_compiled(build):
    with pytest.raises(kc.StructuralError, match=r"remove: motor3, motor4.*remove the driver mot"):
        kc.solve(kc.compile(build["five_bar"](drivers=4)), 0)


def test_that_a_driver_for_a_structure_has_nothing_to_move(build):
    """The third crank is longer: the coupler cannot move."""
    found = kc.inspect(build["double_parallelogram"](third=1.1))
    assert found.conflicting == ("motor",)
    assert "nothing is left for it to move" in found.to_text()


def test_that_a_four_bar_with_a_link_too_long_cannot_be_assembled(build):
    found = kc.inspect(build["four_bar"]((0.2, 0.5, 0.1, 5)))
    assert not found.is_assembled
    # The links reach 0.8 of the 5: what is missing is spread over the loop.
    missing = sum(
        abs(value)
        for name, value in zip(found.equations, found.residuals, strict=True)
        if name.endswith(".x")
    )
    assert missing == pytest.approx(4.2, rel=0.05)
    text = found.to_text()
    assert "cannot be assembled at t = 0" in text
    assert "B.x by " in text
    assert "crank at (" in text
    assert "rank 9 at generic states: " in text


def test_that_a_guess_far_away_is_helped_by_the_runtime(build):
    """The rank is taken near the position that the runtime finds."""
    model = build["four_bar"](guess=(1.0, -2.5, -2.0))
    found = kc.inspect(model)
    assert found.is_assembled
    solution = kc.solve(kc.compile(model), 0.0)
    assert solution.success
    assert max(map(abs, found.residuals)) < 1e-9


@pytest.mark.parametrize("start", [0.0, math.pi], ids=["stretched", "folded"])
def test_that_a_singular_pose_is_not_a_redundancy(build, start):
    """The parallelogram at its change point: the rank there is 8, at a generic state 9."""
    model = build["four_bar"]((1.0, 2.0, 1.0, 2.0), start=start, guess=(start, 0.0, start))
    guess = [item.guess for item in kc.inspect(model).coordinates]
    here = kc.compile(model).Phi_q(np.array(guess), 0.0)
    assert np.linalg.matrix_rank(here, tol=1e-9) == 8
    found = kc.inspect(model)
    assert (found.rank, found.redundant, found.problem) == (9, (), "")
    assert found.rank_at_start == 8
    assert "rank 8 at t = 0: no equation is redundant" in found.to_text()
    assert "singular at t = 0, a dead point or a change point" in found.to_text()


def test_a_slider_crank_driven_by_its_slider_from_the_dead_point():
    """The crank and the rod in one line: the slider cannot start to move them."""
    t = kc.t
    push = [kc.AbsoluteX("push", "slider", (0, 0), 3 - start - t / 9) for start in (0, 0.2)]
    at_dead_point, later = (kc.inspect(slider_crank(driver)) for driver in push)
    assert (at_dead_point.rank, at_dead_point.rank_at_start) == (9, 8)
    assert (later.rank, later.rank_at_start) == (9, 9)
    assert "singular" not in later.to_text()


def three_bars(angle, size=1.0):
    """Return a plate on three equal parallel bars, each a distance."""
    m = kc.Mechanism("bars")
    plate = m.body("plate", guess=(size * math.cos(angle), size * math.sin(angle), 0))
    for k in (-1, 0, 1):
        m.add(kc.AbsoluteDistance(f"bar{k + 1}", plate, (k * size, 0), (k * size, 0), size))
    return m


@pytest.mark.parametrize("angle", [0.8, 1.3, 0.0], ids=["generic", "steep", "flat"])
def test_that_three_equal_bars_are_redundant_from_every_guess(angle):
    """Gruebler counts no freedom; the plate moves on a circle, and one bar repeats the others."""
    found = kc.inspect(three_bars(angle))
    assert (int(found.mobility), found.degrees_of_freedom) == (0, 1)
    assert (found.redundant, found.free) == (("bar2",), ("plate",))
    assert "only 2 of them are independent" in found.problem
    assert found.problem in found.to_text()


@pytest.mark.parametrize("size", [1e-3, 1e3, 1e6])
def test_that_the_unit_of_length_does_not_matter(size):
    found = kc.inspect(three_bars(0.8, size))
    assert (found.redundant, found.free, found.rank) == (("bar2",), ("plate",), 2)


x, y, z = sympy.symbols("x y z")


@pytest.mark.parametrize(
    ("equations", "rank", "redundant", "conflicting", "free"),
    [
        ([x - 1, y - z], 2, (), (), ("y", "z")),
        ([x, y, z, x + y], 3, ("equation_4",), (), ()),
        ([x, y, z, x + y - 1], 3, (), ("equation_4",), ()),
        ([x - 1, x**2 - 1, y - z], 2, ("equation_2",), (), ("y", "z")),
        ([x * y - 1, 2 * x * y - 2, z], 2, ("equation_2",), (), ("x", "y")),
    ],
    ids=["too few", "repeated", "contradictory", "one twice", "curved"],
)
def test_free_equations(equations, rank, redundant, conflicting, free):
    found = kc.inspect(kc.ConstraintSystem("s", "x y z", equations, guess=(1, 1, 0)))
    assert found.rank == rank
    assert (found.redundant, found.conflicting, found.free) == (redundant, conflicting, free)
    assert found.problem
    for name in (*redundant, *conflicting):
        assert f"leave out {name}" in found.to_text()


def test_free_equations_without_a_solution():
    found = kc.inspect(kc.ConstraintSystem("s", "x y", [x**2 + y**2 + 1, x - y - kc.t]))
    assert not found.is_assembled
    assert "equation_1 by 1. There: x = " in found.to_text()


@pytest.mark.slow
def test_that_a_hundred_bodies_are_readable_and_analysed_in_few_steps(monkeypatch):
    """Neither a wide pattern nor long lists; and the work does not grow with the redundancy."""
    calls = []

    def counting(*given):
        evaluate = interpreter(*given)

        def counted(*state):
            calls.append(1)
            return evaluate(*state)

        return counted

    monkeypatch.setattr(redundancy, "interpreter", counting)
    found = kc.inspect(parallel_cranks(33))
    assert len(found.redundant) == 31
    few, calls[:] = len(calls), []
    found = kc.inspect(parallel_cranks(99))
    assert len(found.redundant) == 97
    assert len(calls) <= 1.5 * few <= 90
    text = found.to_text()
    assert max(map(len, text.splitlines())) < 350
    assert "crank11 and 88 more" in text
    assert "\n  head98.y  x_crank98, phi_crank98" not in text
    assert "head98.y  y_crank98, phi_crank98, y_coupler, phi_coupler" in text


def parallel_cranks(count):
    """Return a coupler on so many equal cranks: all but two of them are redundant."""
    m = kc.Mechanism("cranks")
    cranks = [m.body(f"crank{k}", guess=(2 * k + 0.35, 0.35, 0.8)) for k in range(count)]
    coupler = m.body("coupler", guess=(0.7, 0.7, 0))
    for k, crank in enumerate(cranks):
        m.add(kc.Revolute(f"foot{k}", m.ground, (2 * k, 0), crank, (-0.5, 0)))
        m.add(kc.Revolute(f"head{k}", crank, (0.5, 0), coupler, (2 * k, 0)))
    m.add(kc.AbsoluteAngle("motor", cranks[0], kc.t + 0.8))
    return m
