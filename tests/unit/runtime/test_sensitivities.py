"""Exact derivatives of motions by parameters, against closed forms and complex steps."""

import pickle

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.errors import InputError, UnsupportedError
from kincompile.runtime.load import from_source

VALUES = {"r": 0.1, "L": 0.3, "e": 0.02, "w": 5.0}


def slider_crank(scale=1.0):
    """Return the slider-crank of the tables, all its lengths times a factor."""
    m = kc.Mechanism("slider_crank")
    r, length, e = (m.parameter(name, scale * VALUES[name], "m") for name in "rLe")
    w = m.parameter("w", VALUES["w"], "rad/s")
    at = scale * np.array([0.1, 0.39, 1.0])
    crank = m.body("crank", guess=(0.0, 0.0, 0.3))
    rod = m.body("rod", guess=(at[0], 0.03 * scale, 0.0))
    slider = m.body("slider", guess=(at[1], 0.02 * scale, 0.0))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (length, 0), slider, (0, 0)))
    m.add(kc.AbsoluteY("guide", slider, (0, 0), e))
    m.add(kc.AbsoluteAngle("level", slider, 0))
    m.add(kc.AbsoluteAngle("motor", crank, w * kc.t + 0.3))
    m.output("stroke", slider.x, "m")
    m.output("slope", kc.outputs.rate(rod.phi) * r, "m/s")
    return m


def closed_form(name, t, order, by):
    """Return a derivative of x or beta, of some order by t and by one parameter or several."""

    def beta(time, r, length, e, w):
        return mpmath.asin((e - r * mpmath.sin(w * time + 0.3)) / length)

    def x(time, r, length, e, w):
        angle = beta(time, r, length, e, w)
        return r * mpmath.cos(w * time + 0.3) + length * mpmath.cos(angle)

    with mpmath.workdps(40):
        where = (mpmath.mpf(t), *map(mpmath.mpf, VALUES.values()))
        orders = (order, *(by.count(name) for name in VALUES))
        return float(mpmath.diff({"x": x, "beta": beta}[name], where, orders))


TIMES = np.array([0.0, 0.2, 0.7])


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_a_slider_crank_has_the_derivatives_of_its_closed_form(target, request):
    if target == "c":
        request.getfixturevalue("quick_compiler")
    solution = kc.solve(kc.compile(slider_crank(), target), TIMES)
    found = kc.sensitivities(solution, [*VALUES])
    for name, column in {"x": "slider.x", "beta": "rod.phi"}.items():
        for order, ending in enumerate(("", "_dot", "_ddot")):
            for by in VALUES:
                known = [closed_form(name, t, order, [by]) for t in TIMES.tolist()]
                np.testing.assert_allclose(
                    found[column + ending, by], known, rtol=1e-10, atol=1e-12
                )
                if name == "x":
                    y = found["stroke" + ending, by]
                    np.testing.assert_allclose(y, known, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_second_derivatives_are_those_of_the_closed_form(target, request):
    if target == "c":
        request.getfixturevalue("quick_compiler")
    solution = kc.solve(kc.compile(slider_crank(), target), TIMES)
    found = kc.sensitivities(solution, ["L", "r", "w"], of=["rod.phi", "stroke"], second=True)
    for name, column in {"x": "stroke", "beta": "rod.phi"}.items():
        for order, ending in enumerate(("", "_dot", "_ddot")):
            for pair in (("L", "L"), ("L", "r"), ("w", "L"), ("w", "w")):
                known = [closed_form(name, t, order, pair) for t in TIMES.tolist()]
                own = found[column + ending, *pair]
                np.testing.assert_allclose(own, known, rtol=1e-9, atol=1e-9)
    assert found.second.shape == (3, 3, 2, 3, 3)
    assert found.unit("stroke_dot", "L", "w") == "m/s/m/(rad/s)"


@pytest.mark.parametrize("name", ["four_bar", "cam_flat_follower", "shaper"])
def test_that_second_derivatives_are_differences_of_the_first(name, example_named):
    example = example_named(name)
    t = np.linspace(0.05, 0.4, 4) * example.model.end
    names = example.module.PARAMETERS[:3]
    solution = kc.solve(example.module, t)
    found = kc.sensitivities(solution, names, second=True)
    for k, by in enumerate(names):
        h = 1e-5 * solution.parameters[by]
        ends = [
            kc.sensitivities(kc.solve(example.module, t, p={by: x}), names)
            for x in (solution.parameters[by] + h, solution.parameters[by] - h)
        ]
        for order, part in enumerate(("q_p", "q_dot_p", "q_ddot_p")):
            slopes = (getattr(ends[0], part) - getattr(ends[1], part)) / (2 * h)
            own = found.second[order][:, : len(solution.coordinates), :, k]
            assert np.abs(own - slopes).max() <= 1e-7 * max(1, np.abs(slopes).max())


def test_that_second_derivatives_are_asked_for():
    found = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r", "L"])
    with pytest.raises(InputError, match="give second=True to kc"):
        found["rod.phi", "r", "L"]
    with pytest.raises(InputError, match="by a column and a parameter"):
        found["rod.phi", "r", "L", "r"]


def test_that_the_table_of_the_reference_is_met():
    found = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r", "w"])
    table = {
        ("slider.x", "r"): (0.945922332188895, 0.0139030832031804, -0.962966136466818),
        ("slider.x_ddot", "r"): (-38.2252181109208, 6.71558874380237, 14.8396266730593),
        ("rod.phi_ddot", "r"): (20.5909168625614, 88.3174184006052, -40.6615758515534),
        ("rod.phi_dot", "w"): (-0.318607037640045, 0.237683500540269, -0.39382868281745),
        ("slider.x_ddot", "w"): (-1.25060814836819, 0.618239463740062, 0.902377998040317),
    }
    for names, known in table.items():
        np.testing.assert_allclose(found[names], known, rtol=1e-10)


def test_that_an_output_of_rates_and_of_the_parameter_itself_is_differentiated():
    solution = kc.solve(kc.compile(slider_crank()), TIMES)
    found = kc.sensitivities(solution, ["r", "L"])
    beta, dot = solution["rod.phi_dot"], solution["rod.phi_ddot"]
    r = VALUES["r"]
    np.testing.assert_allclose(found["slope", "r"], beta + r * found["rod.phi_dot", "r"])
    np.testing.assert_allclose(found["slope_dot", "r"], dot + r * found["rod.phi_ddot", "r"])
    np.testing.assert_allclose(found["slope_dot", "L"], r * found["rod.phi_ddot", "L"])
    assert np.isnan(found["slope_ddot", "r"]).all()  # would need the third derivative of phi


def complex_atan2(y, x):
    """Return arctan2 of complex steps, which NumPy does not have: ln(x + i y) differentiated."""
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return np.arctan2(y.real, x.real) + 1j * slope


def by_complex_steps(solution, name):
    """Return derivatives of q, q_dot and q_ddot by Newton's method with p + 1e-30 i."""
    module = solution.module
    p = np.array(list(solution.parameters.values()), dtype=complex)
    p[list(solution.parameters).index(name)] += 1e-30j
    q, t = solution.q.astype(complex), solution.t

    def solved(matrix, right):
        return np.linalg.solve(matrix, right[..., np.newaxis])[..., 0]

    for _ in range(3):
        Phi, Phi_q = module.position(q, t, p)
        q = q - solved(Phi_q, Phi)
    Phi_q, nu = module.velocity(q, t, p)
    q_dot = solved(Phi_q, nu)
    q_ddot = solved(Phi_q, module.gamma(q, q_dot, t, p))
    outputs = ()
    if solution.observed.names:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module.ARRAYS, "atan2", staticmethod(complex_atan2), raising=False)
            outputs = module.observe(q, q_dot, q_ddot, t, p)
    return [part.imag / 1e-30 for part in (q, q_dot, q_ddot, *outputs)]


def assert_complex_steps(solution, found, bound=1e-9):
    """Compare all derivatives, each relative to the largest of its kind."""
    arrays = (found.q_p, found.q_dot_p, found.q_ddot_p, found.y_p, found.y_dot_p, found.y_ddot_p)
    seen = solution.observed
    motion = (solution.q, solution.q_dot, solution.q_ddot, seen.y, seen.y_dot, seen.y_ddot)
    for k, name in enumerate(found.parameters):
        known = by_complex_steps(solution, name)
        for own, mine, other in zip(motion, arrays, known, strict=False):
            here, real = mine[..., k], np.isfinite(own)
            np.testing.assert_array_equal(np.isfinite(here), real)
            scale = max(1.0, np.abs(other[real]).max(initial=0.0))
            assert np.abs(here - other)[real].max(initial=0.0) <= bound * scale


def test_that_all_examples_agree_with_complex_steps(example):
    names = example.module.PARAMETERS[:6]
    solution = kc.solve(example.module, np.linspace(0, example.model.end, 7))
    if not names:  # then there is nothing to differentiate by, and that is said
        with pytest.raises(InputError, match="has no parameters"):
            kc.sensitivities(solution, "a")
        return
    assert_complex_steps(solution, kc.sensitivities(solution, names))


@pytest.mark.every(4)
@pytest.mark.parametrize("seed", range(12))
def test_that_random_linkages_agree_with_complex_steps(seed):
    rng = np.random.default_rng(seed)
    m = kc.Mechanism("random_linkage")
    a, b, c, d = (
        m.parameter(name, value + rng.uniform(-0.3, 0.3), "m")
        for name, value in {"a": 1.0, "b": 3.0, "c": 2.5, "d": 3.0}.items()
    )
    w, s = m.parameter("w", rng.uniform(0.5, 2)), m.parameter("s", rng.uniform(-1, 1))
    crank, rod, rocker = (m.body(name) for name in ("crank", "rod", "rocker"))
    slider = m.body("slider")
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (a, 0), rod, (-b / 2, 0)))
    m.add(kc.Revolute("C", rod, (b / 2, 0), rocker, (c, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (d, s / 5)))
    m.add(kc.Translational("guide", slider, (0, s), (1, s / 7), m.ground, (0, -2), (1, s / 9)))
    m.add(kc.Distance("link", rod, (s, a / 2), slider, (0, 0), 4 + d))
    m.add(kc.AbsoluteAngle("motor", crank, w * kc.t + s * kc.t**2 + 0.4))
    m.output("reach", sympy.sqrt(slider.x**2 + b) * sympy.sin(rocker.phi))
    m.output("speed", kc.outputs.rate(rod.phi) * c)
    solution = kc.solve(kc.compile(m), np.linspace(0, 0.6, 9), assembly=1)
    assert solution.success, solution.message
    assert_complex_steps(solution, kc.sensitivities(solution, [*"abcdws"]))


def test_that_a_mechanism_in_space_agrees_with_complex_steps():
    """A four-bar of two hinges at right angles, and a rod between ball joints."""
    m = spatial.Mechanism("rssr")
    a, b, w = m.parameter("a", 0.2, "m"), m.parameter("b", 1.0, "m"), m.parameter("w", 2.0)
    x, z = (1, 0, 0), (0, 0, 1)
    crank, rocker = m.body("crank"), m.body("rocker", (1.0, 0, 0.3))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), z, crank, (0, 0, 0), z))
    m.add(spatial.Revolute("B", m.ground, x, (0, 1, 0), rocker, (0, 0, -0.3), (0, 1, 0)))
    m.add(spatial.Distance("rod", crank, (a, 0, 0), rocker, (0, 0, 0.1), b))
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, crank, z, x, w * kc.t + 0.3))
    m.output("reach", spatial.outputs.distance(m.point("tip", rocker, (0, 0, 0.4)), (0, a, 0)), "m")
    solution = kc.solve(kc.compile(m), np.linspace(0, 3, 9))
    assert solution.success, solution.message
    assert_complex_steps(solution, kc.sensitivities(solution, ["a", "b", "w"]))


def coupled_equations(seed):
    """Return five equations of five unknowns that need all of each other, and are random."""
    rng = np.random.default_rng(seed)
    x = sympy.symbols("x1:6")
    names = {"a": 0.3, "b": -0.2, "w": 0.7}
    a, b, w = sympy.symbols("a b w")
    weights = rng.uniform(-0.2, 0.2, (5, 5)).tolist()
    phases = rng.uniform(0, 6, 5).tolist()
    equations = [
        x[k]
        - sum(c * sympy.sin(y + a * z) for c, y, z in zip(row, x, x[::-1], strict=True))
        - b * sympy.cos(w * kc.t + phase) * x[k - 1] ** 2 - a * kc.t
        for k, (row, phase) in enumerate(zip(weights, phases, strict=True))
    ]  # fmt: skip
    return kc.ConstraintSystem(
        "coupled", coordinates=x, equations=equations, guess=[0.1] * 5, parameters=names
    )


@pytest.mark.parametrize("seed", range(3))
def test_that_large_blocks_are_eliminated_too(seed):
    solution = kc.solve(kc.compile(coupled_equations(seed)), np.linspace(0, 1, 6))
    assert solution.success, solution.message
    assert_complex_steps(solution, kc.sensitivities(solution, ["a", "b", "w"]))


@pytest.mark.parametrize("name", ["jansen", "four_bar", "slider_crank"])
def test_that_points_which_are_not_trusted_are_solved_by_matrices(name, example_named, monkeypatch):
    model = slider_crank() if name == "slider_crank" else example_named(name).model
    solution = kc.solve(kc.compile(model), np.linspace(0, model.end, 5))
    names = tuple(solution.parameters)[:4]
    column = solution.coordinates[-1]
    usual, few = (kc.sensitivities(solution, names, of=x) for x in (None, column))
    monkeypatch.setattr(
        "kincompile.runtime.engine.linear.SMALLEST_DETERMINANT", 2.0
    )  # every determinant is smaller than twice the largest
    assert_complex_steps(solution, kc.sensitivities(solution, names))
    matrices = kc.sensitivities(solution, names, of=column)
    second = kc.sensitivities(solution, names, of=column, second=True)
    assert np.isnan(second.second).all()
    for part in ("q_p", "q_dot_p", "q_ddot_p", "y_p", "y_dot_p", "y_ddot_p"):
        np.testing.assert_allclose(getattr(few, part), getattr(matrices, part), atol=1e-9)
    np.testing.assert_allclose(few.q_ddot_p[..., 0, :], usual.q_ddot_p[..., -1, :], atol=1e-9)


@pytest.mark.parametrize(
    ("target", "name", "columns"),
    [("numpy", "jansen", ["G.y", "leg.phi"]), ("c", "four_bar", "rocker.phi")],
)
def test_that_few_columns_of_many_parameters_are_those_of_all(
    target, name, columns, example_named, request
):
    if target == "c":
        request.getfixturevalue("quick_compiler")
    model = example_named(name).model
    solution = kc.solve(kc.compile(model, target), np.linspace(0, 1, 5))
    in_numpy = kc.solve(kc.compile(model), solution.t)
    every = kc.sensitivities(in_numpy, tuple(solution.parameters))
    few = kc.sensitivities(solution, tuple(solution.parameters), of=columns)
    assert len(few.coordinates) == 1
    for column in (*few.coordinates, *few.outputs):
        for ending in ("", "_dot", "_ddot"):
            for by in every.parameters:
                close(few[column + ending, by], every[column + ending, by])
    with pytest.raises(InputError, match=r"no column 'crank\.phi'"):
        few["crank.phi", "a"]


def test_that_an_output_of_rates_goes_backward_too():
    solution = kc.solve(kc.compile(slider_crank()), TIMES)
    every, few = (kc.sensitivities(solution, [*VALUES], of=x) for x in (None, "slope"))
    close(few.y_p, every.y_p[..., 1:, :])
    close(few.y_dot_p, every.y_dot_p[..., 1:, :])
    assert np.isnan(few.y_ddot_p).all()
    assert few.q_p.shape == (3, 0, 4)


def test_that_parameter_sets_are_differentiated_by_few_columns():
    module = kc.compile(slider_crank())
    solution = kc.solve(module, TIMES, p={"L": np.array([0.25, 0.3]), "e": np.array([0.0, 0.03])})
    every, few = (kc.sensitivities(solution, [*VALUES], of=x) for x in (None, "rod.phi"))
    assert few.q_ddot_p.shape == (2, 3, 1, 4)
    close(few["rod.phi_ddot", "e"], every["rod.phi_ddot", "e"])


def test_what_is_said_of_columns_that_are_none():
    solution = kc.solve(kc.compile(slider_crank()), TIMES)
    with pytest.raises(InputError, match=r"has no column 'rod\.ph'; did you mean"):
        kc.sensitivities(solution, "r", of="rod.ph")
    with pytest.raises(InputError, match="derivatives of rates come with them"):
        kc.sensitivities(solution, "r", of=["rod.phi_dot"])


def close(found, known):
    np.testing.assert_allclose(found, known, rtol=1e-11, atol=1e-11)


def test_that_the_phase_and_speed_of_a_driver_move_along_the_motion():
    m = kc.Mechanism("four_bar")
    lengths = [m.parameter(name, x, "m") for name, x in zip("abcd", (1, 3, 2.5, 3), strict=True)]
    a, b, c, d = lengths
    w, phase = m.parameter("w", 2.0, "rad/s"), m.parameter("phase", 0.3, "rad")
    crank = m.body("crank", guess=(0, 0, 0.3))
    rod, rocker = m.body("rod", guess=(1, 0, 0.7)), m.body("rocker", guess=(3, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (a, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (b, 0), rocker, (c, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, w * kc.t + phase))
    m.output("reach", rod.x + c * sympy.cos(rod.phi), "m")
    t = np.linspace(0, 3, 40)
    solution = kc.solve(kc.compile(m), t)
    found = kc.sensitivities(solution, [*"abcd", "w", "phase"])
    q_dot, q_ddot, t = solution.q_dot, solution.q_ddot, t[:, np.newaxis]
    close(found.q_p[..., 5], q_dot / 2)
    close(found.q_dot_p[..., 5], q_ddot / 2)
    close(found.q_p[..., 4], t * q_dot / 2)
    close(found.q_dot_p[..., 4], q_dot / 2 + t * q_ddot / 2)
    close(found.y_p[..., 5], solution.observed.y_dot / 2)
    # With all lengths times s, angles stay and lengths become s times as long (Euler).
    sizes = np.array([1, 3, 2.5, 3])
    is_length = np.array([solution.units[name] == "m" for name in solution.coordinates])
    motion = (solution.q, solution.q_dot, solution.q_ddot)
    parts = (found.q_p, found.q_dot_p, found.q_ddot_p)
    for own, part in zip(motion, parts, strict=True):
        close(part[..., :4] @ sizes, own * is_length)
    y = found.y_ddot_p[..., :4] @ sizes
    close(y, solution.observed.y_ddot)


def test_that_parameter_sets_are_differentiated_each_for_itself():
    module = kc.compile(slider_crank())
    t = np.linspace(0, 1, 5)
    lengths = np.array([0.25, 0.3, 0.4])
    found = kc.sensitivities(kc.solve(module, t, p={"L": lengths}), ["e", "L"])
    assert found.q_dot_p.shape == (3, 5, 9, 2)
    for number, length in enumerate(lengths):
        one = kc.sensitivities(kc.solve(module, t, p={"L": length}), ["e", "L"])
        for name in ("q_p", "q_dot_p", "q_ddot_p", "y_p", "y_dot_p"):
            several, alone = getattr(found, name)[number], getattr(one, name)
            np.testing.assert_allclose(several, alone, rtol=1e-9, atol=1e-11)


def test_that_redundant_equations_change_nothing():
    m = slider_crank()
    slider = m.bodies[2]
    m.add(kc.AbsoluteY("second_guide", slider, (0.01, 0), sympy.Symbol("e")))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(m)
    found = kc.sensitivities(kc.solve(module, TIMES), ["r", "e"])
    same = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r", "e"])
    for name in ("q_p", "q_dot_p", "q_ddot_p"):
        np.testing.assert_allclose(getattr(found, name), getattr(same, name), atol=1e-10)


def test_that_there_are_none_where_there_is_no_motion():
    module = kc.compile(slider_crank())
    t = np.linspace(0, 1, 40)
    solution = kc.solve(module, t, p={"e": 0.3 - 0.1 + 0.05})
    assert not solution.success
    found = kc.sensitivities(solution, ["r"])
    lost = np.isnan(solution.q).any(axis=1)
    assert 0 < np.count_nonzero(lost) < 40
    assert np.isnan(found.q_p[lost]).all()
    assert np.isfinite(found.q_ddot_p[solution.good]).all()


def test_that_masses_and_loads_change_nothing():
    m = kc.Mechanism("arm")
    r = m.parameter("r", 0.5, "m")
    arm = m.body("arm", guess=(-0.5, 0, 0), mass=2.0, inertia=0.3)
    m.add(kc.Revolute("pin", arm, (r, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, kc.t))
    found = kc.sensitivities(kc.solve(kc.compile(m), TIMES), "r")
    close(found["arm.x", "r"], -np.cos(TIMES))
    close(found["arm.y_dot", "r"], -np.cos(TIMES))
    assert "x_arm_by_r" in kc.emit(m, sensitivities=["r"]).source


def test_that_units_are_quotients():
    found = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r", "w"])
    assert found.unit("rod.phi_dot", "r") == "rad/s/m"
    assert found.unit("slider.x", "r") == ""
    assert found.unit("stroke", "w") == "m/(rad/s)"


def test_that_the_table_shows_the_largest_of_each_column():
    found = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r"])
    text = found.to_text()
    assert text.startswith("slider_crank: sensitivities to r at 3 times")
    assert all(part in text for part in ("x_slider", "0.962966"))
    assert "0.962966" in found._repr_html_()


def test_what_is_said_of_wrong_names():
    module = kc.compile(slider_crank())
    solution = kc.solve(module, TIMES)
    for wrong, said in {
        ("LL",): "no parameter 'LL'; did you mean 'L'",
        (): "name each parameter once; there are r, L, e, w",
        ("r", "r"): "name each parameter once",
    }.items():
        with pytest.raises(InputError, match=said):
            kc.sensitivities(solution, wrong)
    found = kc.sensitivities(solution, "r")
    with pytest.raises(InputError, match=r"no column 'rod\.ph'; did you mean 'phi_rod'"):
        found["rod.ph", "r"]
    with pytest.raises(InputError, match="no sensitivities to 'L'"):
        found["rod.phi", "L"]
    with pytest.raises(InputError, match="by a column and a parameter"):
        found["rod.phi"]
    with pytest.raises(InputError, match="expected a Solution"):
        kc.sensitivities(module, ["r"])


def test_what_is_said_of_a_module_from_elsewhere(tmp_path):
    model = slider_crank()
    (path, *_) = kc.emit(model).write(tmp_path)
    with pytest.raises(InputError, match="Compile the model, solve with that"):
        kc.sensitivities(kc.solve(kc.load(path), TIMES), ["r"])
    copied = pickle.loads(pickle.dumps(kc.solve(kc.compile(model), TIMES)))
    with pytest.raises(InputError, match="was pickled"):
        kc.sensitivities(copied, ["r"])


def test_that_a_result_can_be_pickled():
    found = kc.sensitivities(kc.solve(kc.compile(slider_crank()), TIMES), ["r"])
    copied = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(copied.q_p, found.q_p)


def test_that_a_name_that_is_taken_is_refused():
    m = slider_crank()
    m.parameter("x_rod_by_r", 1.0)
    solution = kc.solve(kc.compile(m), TIMES)
    with pytest.raises(kc.ModelError, match="x_rod_by_r"):
        kc.sensitivities(solution, ["r"])


def test_that_large_mechanisms_are_refused_in_words():
    solution = kc.solve(kc.compile(slider_crank(), form="grouped"), TIMES)
    with pytest.raises(UnsupportedError, match="slider_crank is in grouped form"):
        kc.sensitivities(solution, ["L"])
    m = kc.Mechanism("chain")
    a, before = m.parameter("a", 1.0), m.ground
    for k in range(101):
        body = m.body(f"b{k}", guess=(k, 0, 0.1))
        m.add(kc.Revolute(f"J{k}", body, (0, 0), before, (a, 0)))
        m.add(kc.AbsoluteAngle(f"M{k}", body, kc.t))
        before = body
    with pytest.raises(UnsupportedError, match="303 coordinates"):
        kc.emit(m, form="inline", sensitivities=["a"])


@pytest.mark.parametrize("target", ["numpy", "c", "octave", "javascript"])
def test_that_every_target_has_them_as_coordinates_of_their_own(target):
    emitted = kc.emit(slider_crank(), target, sensitivities=["r", "e"])
    assert all(name in emitted.source for name in ("phi_rod_by_e", "slope_by_r"))


def test_that_an_emitted_module_gives_motion_and_sensitivities_at_once():
    model = slider_crank()
    source = kc.emit(model, sensitivities=["L", "w"]).source
    both = kc.solve(from_source(source, "both"), TIMES)
    assert both.success
    found = kc.sensitivities(kc.solve(kc.compile(model), TIMES), ["L", "w"])
    for name in ("x_slider", "phi_rod", "stroke"):
        for ending in ("", "_dot", "_ddot"):
            for by in ("L", "w"):
                own = both[f"{name}_by_{by}{ending}"]
                np.testing.assert_allclose(own, found[name + ending, by], rtol=1e-9, atol=1e-10)
    assert both.units["phi_rod_by_L"] == "rad/m"


def test_that_emit_refuses_what_cannot_be():
    with pytest.raises(InputError, match="no parameter 'LL'; did you mean 'L'"):
        kc.emit(slider_crank(), sensitivities=["LL"])
    with pytest.raises(UnsupportedError, match="grouped form has no sensitivities"):
        kc.emit(slider_crank(), form="grouped", sensitivities=["L"])
