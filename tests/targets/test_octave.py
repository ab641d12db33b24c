"""What the .m files have beside quantities: the function of a motion, and MATLAB's limits."""

import itertools

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from tests.adversary.chains import reach
from tests.adversary.test_chains import start_of
from tests.adversary.test_starts import (
    bad_starts,
    cases,
    in_octave,
    linkages,
    near_start,
    solved,
)
from tests.targets.conftest import NEEDED, OCTAVE, SPACE
from tests.unit.spatial.test_driven_angles import wheel


def test_that_the_function_finds_the_same_motion(example, results_of):
    found, solution = results_of("octave")[example.path.stem], example.solution
    np.testing.assert_allclose(found["T"][0], solution.t, rtol=1e-12, atol=1e-12)
    for quantity, expected in (
        ("Q", solution.q), ("Q_dot", solution.q_dot), ("Q_ddot", solution.q_ddot),
    ):  # fmt: skip
        # Two solvers stop at two points within the tolerance; Phi_q magnifies the difference.
        rows = found[quantity].reshape(expected.shape)
        np.testing.assert_allclose(rows, expected, rtol=1e-10, atol=1e-10)


def test_that_the_function_takes_times_parameters_and_a_guess(octave, example_named, tmp_path):
    example = example_named("four_bar")
    t, lengths = np.linspace(0.3, 1.7, 8), [9.0, 24.0, 19.0, 21.0, 2.0]
    guess = np.where([False, True, True] * 3, -1, 1) * example.module.GUESS
    solution = kc.solve(example.module, t, lengths, guess=guess)
    assert np.sin(solution["phi_coupler"][0]) < 0  # the other assembly
    kc.emit(example.model, "octave").write(tmp_path)
    found = octave([
        f"[T, Q, ~, Q_ddot, names] = four_bar({t.tolist()}', {lengths}, {guess.tolist()});",
        "show('T', T); show('Q', Q); show('Q_ddot', Q_ddot);",
        "show('row', Q(strcmp(names, 'phi_rocker'), :));",
    ])  # fmt: skip
    np.testing.assert_allclose(found["T"][0], t, rtol=1e-15)
    for name, expected in (("Q", solution.q), ("Q_ddot", solution.q_ddot)):
        rows = np.reshape(found[name][0], expected.shape)
        np.testing.assert_allclose(rows, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found["row"][0], solution["phi_rocker"], rtol=1e-10)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("path", SPACE, ids=lambda path: path.stem)
def test_that_the_function_in_space_finds_the_same_motion(octave, tmp_path, path):
    compare_motions(octave, tmp_path, kc.read_model(path))


@pytest.mark.slow
def test_that_the_function_counts_the_turns_of_angles(octave, tmp_path):
    """An angle and a screw beside motors of 8 and 16 turns, and an angle with its own cross."""
    model = wheel()
    disc = model.bodies[0]
    z, y, x = (0, 0, 1), (0, 1, 0), (1, 0, 0)
    model.add(spatial.JointAngle("aside", model.ground, z, y, disc, z, x, guess=-1.5))
    solution = compare_motions(octave, tmp_path, model)
    np.testing.assert_allclose(solution["theta_turn"], 50 * solution.t)
    np.testing.assert_allclose(solution["theta_aside"], 50 * solution.t - np.pi / 2)


def compare_motions(octave, tmp_path, model):
    """Compare the motion of the emitted function with the runtime's, and return that."""
    kc.emit(model, "octave").write(tmp_path)
    shown = {"T": "t", "Q": "q", "Q_dot": "q_dot", "Q_ddot": "q_ddot"}
    found = octave(
        [f"[{', '.join(shown)}] = {model.name}();", *(f"show('{name}', {name});" for name in shown)]
    )
    solution = kc.solve(kc.compile(model), np.array(found["T"][0]))
    for name, quantity in shown.items():
        expected = getattr(solution, quantity)
        rows = np.reshape(found[name][0], expected.shape)
        size = np.abs(expected).max()
        np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-9 * size)
    return solution


def test_that_from_a_guess_at_which_phi_q_is_singular_a_position_is_one(octave, tmp_path):
    """Newton goes 1e14 rad away, where corrections are small beside q and Phi is not zero.

    Shortened corrections do not.
    """
    m = kc.Mechanism("stuck")
    cam, follower = m.body("cam"), m.body("follower", guess=(0, 0.06, 0))
    angles = [2 * np.pi * k / 36 for k in range(36)]
    table = (angles, [0.05 + 0.01 * np.cos(angle) for angle in angles])
    m.add(kc.Revolute("axle", m.ground, (0, 0), cam, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (0, 1), follower, (0, 0), (0, 1)))
    m.add(kc.PointFollower("contact", follower, (0, 0), cam, (0, 0), table))
    m.add(kc.AbsoluteAngle("motor", cam, 2 * kc.pi * kc.t))
    emitted = kc.emit(m, "octave")
    assert "stuck_rho_j_contact.m" in emitted.files
    emitted.write(tmp_path)
    found = octave(["[~, Q] = stuck();", "show('q', Q(:, 1));"])
    q = np.array(found["q"][0])
    assert np.max(np.abs(q)) < np.pi
    np.testing.assert_allclose(kc.compile(m).Phi(q, 0.0), 0.0, atol=1e-12)


def test_that_what_cannot_be_assembled_has_no_motion(octave, tmp_path):
    x = sympy.Symbol("x")
    kc.emit(kc.ConstraintSystem("rootless", ["x"], [x**2 + 1 + kc.t**2]), "octave").write(tmp_path)
    refused = "show('refused', strfind(problem.message, 'no position found at t = 0;'));"
    found = octave(["try", "rootless", "show('found', 1);", "catch problem", refused, "end"])
    assert found == {"refused": [[11.0]]}


def test_that_the_function_moves_alike_in_every_unit_of_length(octave, tmp_path):
    """A point on a circle of radius r, found from a guess beside it: y = r sin((2 + t) / 4)."""
    x, y = sympy.symbols("x y")
    lines, units = [], {"tiny": 1e-9, "small": 1e-6, "plain": 1.0, "large": 1e6}
    for name, r in units.items():
        equations = [x - r * sympy.cos((2 + kc.t) / 4), x**2 + y**2 - r**2]
        system = kc.ConstraintSystem(
            f"circle_{name}", [x, y], equations, guess={"x": r, "y": r / 2}, end=4.0, points=9
        )
        kc.emit(system, "octave").write(tmp_path)
        lines += [
            f"[~, Q, Q_dot, Q_ddot] = {system.name}();",
            f"show('{name}', [Q(2, :); Q_dot(2, :); Q_ddot(2, :)]);",
        ]
    found, angle = octave(lines), (2 + np.linspace(0, 4, 9)) / 4
    known = np.array([np.sin(angle), np.cos(angle) / 4, -np.sin(angle) / 16])
    for name, r in units.items():
        values = np.reshape(found[name], (9, 3)).T
        np.testing.assert_allclose(values, r * known, rtol=0, atol=1e-12 * r)


def test_that_the_function_refuses_rates_where_phi_q_is_singular(octave, tmp_path):
    """It takes the least of all velocities there, 0, where the motion has 1."""
    x, y = sympy.symbols("x y")
    equations = [x - kc.t + sympy.Rational(1, 2), y**2 - x**2]
    guess = {"x": -0.5, "y": -0.5}
    system = kc.ConstraintSystem("crossing", [x, y], equations, guess=guess, end=1.0, points=5)
    kc.emit(system, "octave").write(tmp_path)
    refused = "show('refused', strfind(problem.message, 'Phi_q is singular at t = 0.5'));"
    found = octave(["try", "crossing", "show('found', 1);", "catch problem", refused, "end"])
    assert found == {"refused": [[11.0]]}


@pytest.mark.parametrize("number", [0, 1, 3])
def test_that_the_function_starts_where_the_runtime_does(octave, tmp_path, number):
    """By itself Newton's method ends up to hundreds of turns away, or at the far assembly."""
    case, random = list(cases())[number]
    guesses = bad_starts(case, random, 40)
    kc.emit(case.model, "octave").write(tmp_path)
    lines = ["warning('off', 'all');"]
    for k, guess in enumerate(guesses):
        call = f"[~, Q] = chain(0, [], {guess.tolist()})"
        lines.append(f"try, {call}; show('at_{k}', Q); catch, end")
    found = octave(lines)
    module = kc.compile(case.model)
    for k, guess in enumerate(guesses):
        status, q, _ = solved(module, guess)
        assert (f"at_{k}" in found) == (status == kc.Status.CONVERGED)
        if status == kc.Status.CONVERGED:
            np.testing.assert_allclose(found[f"at_{k}"][0], q, rtol=1e-9, atol=1e-9)
            assert start_of(case, q) is not None


@pytest.mark.skipif(OCTAVE is None, reason=NEEDED["octave"][1])
@pytest.mark.parametrize("number", [17, 21])
def test_that_a_near_start_ends_on_its_side_of_the_singular_position(tmp_path, number):
    """Newton's method alone ends at the assembly on the other side, which is further away."""
    case, random = next(itertools.islice(linkages(), number, None))
    guess = near_start(case, random)
    ((is_found, q),) = in_octave(tmp_path, case.model, guess[np.newaxis])
    assert is_found
    assert reach(q[np.newaxis], case.guess[np.newaxis], case.at.scale)[0] < 1e-6


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("name", ["undriven", "driven_twice"])
def test_that_the_function_of_what_is_not_square_says_why(octave, case_named, tmp_path, name):
    emitted = kc.emit(case_named(name).model, "octave")
    emitted.write(tmp_path)
    text = emitted.unsolvable.replace("'", "''")
    said = f"show('said', strcmp(problem.message, '{text}'));"
    found = octave(["try", name, "show('found', 1);", "catch problem", said, "end"])
    assert found == {"said": [[1.0]]}


@pytest.mark.skipif(OCTAVE is None, reason=NEEDED["octave"][1])
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_redundant_equations_are_left_out_of_the_start(octave, case_named, tmp_path):
    model = case_named("repeated").model
    kc.emit(model, "octave").write(tmp_path)
    found = octave(["[~, Q, Q_dot, Q_ddot] = repeated();", "show('found', [Q; Q_dot; Q_ddot]);"])
    phi = np.linspace(0, 1, 101) ** 2
    rates = 2 * np.sqrt(phi), np.full(101, 2.0)
    e = np.exp(1j * phi)
    velocity = 1j * rates[0] * e
    acceleration = (1j * rates[1] - rates[0] ** 2) * e
    expected = np.array([
        e.real, e.imag, phi, velocity.real, velocity.imag, rates[0],
        acceleration.real, acceleration.imag, rates[1],
    ])  # fmt: skip
    rows = np.reshape(found["found"], expected.shape, order="F")
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-9)


@pytest.mark.skipif(OCTAVE is None, reason=NEEDED["octave"][1])
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_redundant_equations_that_contradict_are_said(octave, case_named, tmp_path):
    """As where somebody changes a dimension of one of two parallel links."""
    kc.emit(case_named("repeated").model, "octave").write(tmp_path)
    path = tmp_path / "repeated_Phi.m"
    path.write_text(path.read_text().replace("end\n", "Phi(3) = Phi(3) + 1e-3;\nend\n", 1))
    refused = "show('refused', strfind(problem.message, 'contradict'));"
    found = octave(["try", "repeated", "show('found', 1);", "catch problem", refused, "end"])
    assert found.keys() == {"refused"}
    assert found["refused"][0]


def test_that_a_name_beyond_matlab_is_refused():
    m = kc.Mechanism("long")
    m.add(kc.AbsoluteAngle("motor", m.body("b" * 70), kc.t))
    m.add(kc.AbsoluteX("x", "b" * 70, (0, 0), 0))
    m.add(kc.AbsoluteY("y", "b" * 70, (0, 0), 0))
    with pytest.raises(kc.UnsupportedError, match="MATLAB reads 63 characters of a name"):
        kc.emit(m, "octave")


@pytest.mark.parametrize("name", ["i", "ans", "e", "zeros", "Q"])
def test_that_a_function_hides_nothing_of_octave(name):
    m = kc.Mechanism(name)
    crank = m.body("crank")
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    files = kc.emit(m, target="octave").files
    assert f"{name}.m" not in files
    assert f"{name}_Phi.m" in files
