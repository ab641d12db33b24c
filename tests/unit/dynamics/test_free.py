"""Bodies that no constraint holds: thrown, on springs, at rest."""

import numpy as np
import pytest

import kincompile as kc

G = 9.81


def thrown():
    """Return a body whose centre of mass is not its origin."""
    m = kc.Mechanism("thrown", end=0.5, points=6)
    m.gravity = (0, -G)
    m.body("club", (0, 2, 0.3), mass=2, inertia=0.1, centre=(0.1, 0))
    return m


def hung():
    """Return two bodies below each other on springs; torsion springs keep them upright."""
    m = kc.Mechanism("hung", end=1, points=21)
    m.gravity = (0, -G)
    a = m.body("a", (0, -1, 0), mass=2, inertia=0.1)
    b = m.body("b", (0, -2, 0), mass=1, inertia=0.1)
    for body in (a, b):
        m.add(kc.TorsionSpring(f"upright_{body.name}", m.ground, body, 3.0, 0.0))
    m.add(kc.Spring("upper", m.ground, (0, 0), a, (0, 0), 300.0, 1.0))
    m.add(kc.Spring("lower", a, (0, 0), b, (0, 0), 100.0, 1.0))
    return m


@pytest.mark.parametrize(
    ("target", "method"), [("numpy", "DOP853"), ("numpy", "Radau"), ("c", "DOP853")]
)
def test_that_a_thrown_body_flies_along_a_parabola(target, method, quick_compiler):
    module = kc.compile(thrown(), target=target)
    start = {"club.x": 1, "club.y": 3, "club.phi": 4}
    found = kc.simulate(module, np.linspace(0, 0.5, 6), velocity=start, method=method, rtol=1e-10)
    assert found.success
    t, phi = found.t, 0.3 + 4 * found.t
    np.testing.assert_allclose(found["club.phi"], phi, atol=1e-9)
    # The centre of mass falls; the origin goes around it.
    arm, spin = 0.1 * np.exp(0.3j), 0.1j * 4 * np.exp(0.3j)
    centre = 2j + arm + (1 + 3j + spin) * t - 0.5j * G * t**2
    place = centre - 0.1 * np.exp(1j * phi)
    np.testing.assert_allclose(found["club.x"] + 1j * found["club.y"], place, atol=1e-9)
    forces = kc.forces(found)
    assert np.abs(forces["F_y_ground"]).max() < 1e-12


def test_that_two_masses_on_springs_swing_in_their_modes():
    module = kc.compile(hung())
    found = kc.simulate(module, np.linspace(0, 1, 21), rtol=1e-11)
    stiffness, mass = np.array([[400.0, -100.0], [-100.0, 100.0]]), np.diag([2.0, 1.0])
    squares, modes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    rest = -np.linalg.solve(stiffness, mass @ [G, G])
    amplitudes = np.linalg.solve(modes, -rest)
    swing = np.cos(np.sqrt(squares) * found.t[:, np.newaxis])
    down = rest + (amplitudes * swing) @ modes.T
    np.testing.assert_allclose(found.q[:, [1, 4]], np.array([-1, -2]) + down, atol=1e-8)
    still = kc.equilibrium(module)
    assert still.success
    assert list(still.stability) == ["stable"]
    np.testing.assert_allclose(still.q[0, [1, 4]], [-1 + rest[0], -2 + rest[1]], atol=1e-9)


def test_what_is_said_where_no_driver_makes_it_move():
    module = kc.compile(thrown())
    with pytest.raises(kc.StructuralError, match=r"3 coordinates.*leave them free: kc\.simulate"):
        kc.solve(module, [0, 1])
    assert "the loads on club are not balanced there" in kc.equilibrium(module).message
    m = kc.Mechanism("bare")
    m.body("stone")
    with pytest.raises(kc.ModelError, match="has no constraints"):
        kc.compile(m)


def test_that_a_free_body_has_files_pages_and_emitted_motion(tmp_path):
    (tmp_path / "thrown.toml").write_text(thrown().to_toml())
    model = kc.read_model(str(tmp_path / "thrown.toml"))
    found = kc.simulate(kc.compile(model), np.linspace(0, 0.5, 6))
    assert found.success
    assert "club" in kc.page(model, found).html
    kc.emit(model, dynamics=True).write(tmp_path)
    module = kc.load(tmp_path / "thrown.py")
    still = [0, 2, 0.3], [0, 0, 0], 0
    np.testing.assert_allclose(module.accelerations(*still), [0, -G, 0], atol=1e-12)
    assert module.multipliers(*still).shape == (0,)
    np.testing.assert_allclose(kc.compile(model, form="grouped").Q(*still), module.Q(*still))
