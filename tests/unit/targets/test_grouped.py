"""The grouped form: the same numbers as the inline form, whatever the size of the text."""

import ast

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import further
from kincompile.ir.grouping import group
from kincompile.ir.lower import lower
from kincompile.runtime.engine import blocks
from kincompile.runtime.engine.blocks import BlockSolver, EqualBlocks
from kincompile.runtime.engine.code import code_of

FUNCTIONS = ("Phi", "Phi_q", "nu", "Phi_q_nonzeros")


def loops(count, link, apart=5.0):
    """Return four-bar loops with lengths of their own, each crank linked to the loop before it."""
    m = kc.Mechanism("loops")
    ratio = m.parameter("ratio", 1.1)
    before = None
    for k in range(count):
        s, x = 1 + 0.01 * k, apart * k
        crank = m.body(f"crank{k}", (x + 0.5 * s, 0, 0))
        coupler = m.body(f"coupler{k}", (x + 2.13 * s, 0.643 * s, 0.517))
        rocker = m.body(f"rocker{k}", (x + 2.63 * s, 0.643 * s, 3.937))
        m.add(kc.Revolute(f"A{k}", m.ground, (x, 0), crank, (-0.5 * s, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (0.5 * s, 0), coupler, (-1.3 * s, 0)))
        m.add(kc.Revolute(f"C{k}", coupler, (1.3 * s, 0), rocker, (-0.9 * s, 0)))
        m.add(kc.Revolute(f"D{k}", rocker, (0.9 * s, 0), m.ground, (x + 2 * s, 0)))
        if before is None:
            m.add(kc.AbsoluteAngle("motor", crank, 1.5 * kc.t))
        elif link == "angle":
            m.add(kc.RelativeAngle(f"G{k}", before[0], crank, 0.1 * ratio))
        elif link == "equation":
            m.add(kc.Equation(f"G{k}", crank.phi - ratio * before[0].phi))
        elif link == "rocker":
            m.add(kc.RelativeAngle(f"G{k}", before[1], crank, -3.937))
        before = crank, rocker
    return m


def both(model):
    return kc.compile(model, form="grouped"), kc.compile(model, form="inline")


@pytest.mark.every(5)
def test_every_example_has_the_same_numbers_in_both_forms(example):
    grouped, written_out = both(example.model)
    rng = np.random.default_rng(7)
    n = grouped.N_COORDINATES
    q, q_dot, t = rng.normal(size=(4, n)), rng.normal(size=(4, n)), rng.uniform(0.1, 1, 4)
    np.testing.assert_array_equal(grouped.PATTERN, written_out.PATTERN)
    for name in FUNCTIONS:
        ours, theirs = getattr(grouped, name)(q, t), getattr(written_out, name)(q, t)
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        grouped.gamma(q, q_dot, t), written_out.gamma(q, q_dot, t), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("batch", [(), (3,)], ids=["point", "batch"])
def test_a_complex_step_gives_the_jacobian(rich, batch):
    rng = np.random.default_rng(9)
    q, step = rng.normal(size=(*batch, rich.N_COORDINATES)), 1e-30
    shifted = q[..., np.newaxis, :] + 1j * step * np.eye(rich.N_COORDINATES)
    by_column = rich.Phi(shifted, 0.3).imag / step
    np.testing.assert_allclose(np.swapaxes(by_column, -1, -2), rich.Phi_q(q, 0.3), atol=1e-13)
    by_time = rich.Phi(q, 0.3 + 1j * step).imag / step
    np.testing.assert_allclose(-by_time, rich.nu(q, 0.3), rtol=1e-13, atol=1e-13)
    by_parameter = rich.Phi(q, 0.3, rich.DEFAULTS + 1j * step * np.array([1, 0])).imag / step
    assert np.abs(by_parameter).max() > 0.01


def test_the_planned_solve_is_nan_where_a_matrix_is_singular():
    x, y = sympy.symbols("x y")
    m = kc.ConstraintSystem("turned", "x y", [x**2 - kc.t, x * y - 1])
    module = kc.compile(m, form="grouped")
    q = np.array([(2.0, 1.0), (0.0, 1.0)])
    found = module.solve(module.Phi_q_nonzeros(q, 0.0), np.ones(2))
    np.testing.assert_allclose(found[0], np.linalg.solve(module.Phi_q(q[0], 0.0), np.ones(2)))
    assert np.isnan(found[1]).all()


def test_the_frames_of_a_point_are_those_of_its_angles():
    """They are kept from call to call; a position that is changed in place is another."""
    module = kc.compile(loops(2, "angle"), form="grouped")
    q = module.GUESS.copy()
    before = module.Phi(q, 0.1)
    q[2] += 0.5
    after = module.Phi(q, 0.1)
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_array_equal(after, module.Phi(q[np.newaxis], 0.1)[0])


def test_an_evaluation_may_fill_the_arrays_of_an_earlier_one():
    module = kc.compile(loops(3, "equation"), form="grouped")
    q = module.GUESS + 0.1
    out = module.evaluate(module.GUESS, 0.1)
    Phi, nonzeros = module.evaluate(q, 0.2, out=out)
    assert Phi is out[0]
    assert nonzeros is out[1]
    np.testing.assert_array_equal(Phi, module.Phi(q, 0.2))
    np.testing.assert_array_equal(nonzeros, module.Phi_q_nonzeros(q, 0.2))


@pytest.mark.parametrize("link", ["angle", "equation", "rocker"])
def test_both_forms_give_the_same_motion(link):
    grouped, written_out = both(loops(4, link))
    t = np.linspace(0, 0.2, 9)
    ours, theirs = kc.solve(grouped, t), kc.solve(written_out, t, method="march")
    assert ours.success, ours.message
    assert theirs.success, theirs.message
    for ours_part, theirs_part in (
        (ours.q, theirs.q),
        (ours.q_dot, theirs.q_dot),
        (ours.q_ddot, theirs.q_ddot),
    ):
        np.testing.assert_allclose(ours_part, theirs_part, rtol=1e-9, atol=1e-9)


def test_that_parts_far_from_each_other_are_not_called_nearly_singular():
    module = kc.compile(loops(120, "equation", apart=1e4))
    # A warning is an error here. Beside the whole, each loop is small.
    assert kc.solve(module, [0, 0.01, 0.02], {"ratio": 1.0}).success


def test_the_text_does_not_grow_with_the_number_of_constraints():
    small, large = (len(kc.emit(loops(n, "angle"), form="grouped").source) for n in (10, 200))
    assert large < 1.02 * small


def test_a_written_module_reads_the_file_beside_it(tmp_path):
    model = loops(3, "angle")
    source, arrays = kc.emit(model, form="grouped").write(tmp_path)
    assert (source.name, arrays.name) == ("loops.py", "loops.npz")
    loaded, fresh = kc.load(source), kc.compile(model, form="grouped")
    q = np.linspace(0, 1, loaded.N_COORDINATES)
    np.testing.assert_array_equal(loaded.Phi(q, 0.3), fresh.Phi(q, 0.3))


def test_a_module_without_its_arrays_says_so(tmp_path):
    source, arrays = kc.emit(loops(3, "angle"), form="grouped").write(tmp_path)
    arrays.unlink()
    with pytest.raises(kc.ContractError, match=r"loops\.npz"):
        kc.load(source)


def test_the_module_imports_numpy_and_the_standard_library():
    tree = ast.parse(kc.emit(loops(3, "angle"), form="grouped").source)
    imported = {
        a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names
    }
    assert imported == {"math", "pathlib", "numpy"}


def test_size_chooses_the_form():
    assert "FORM" in vars(kc.compile(loops(40, "angle")))
    assert "FORM" not in vars(kc.compile(loops(3, "angle")))


def test_a_large_mechanism_without_its_driver_is_refused_by_name():
    m = loops(40, "angle")
    m.constraints = [item for item in m.constraints if item.name != "motor"]
    with pytest.raises(kc.StructuralError, match="1 more equation is needed"):
        kc.solve(kc.compile(m), 0)


def parallel_cranks(count):
    """Return cranks of equal length under one coupler, and more such mechanisms without a third."""
    m = kc.Mechanism("parallel")
    for k in range(count):
        cranks = [m.body(f"crank{k}_{i}", (2 * i + 0.35, 0.35, 0.8)) for i in range(2 + (k == 0))]
        coupler = m.body(f"coupler{k}", (2.7, 0.7, 0))
        for i, crank in enumerate(cranks):
            m.add(kc.Revolute(f"foot{k}_{i}", m.ground, (2 * i, 0), crank, (-0.5, 0)))
            m.add(kc.Revolute(f"head{k}_{i}", crank, (0.5, 0), coupler, (2 * i - 2, 0)))
        m.add(kc.AbsoluteAngle(f"motor{k}", cranks[0], 0.8 + 0.3 * kc.t))
    return m


@pytest.mark.parametrize(
    "count", [1, pytest.param(40, marks=pytest.mark.slow)], ids=["small", "large"]
)
def test_redundant_equations_are_solved_as_in_the_other_form(count):
    text = "'parallel' has redundant equations: .*redundant: "
    with pytest.warns(kc.RedundantConstraintWarning, match=text):
        grouped = kc.compile(parallel_cranks(count), form="grouped")
    with pytest.warns(kc.RedundantConstraintWarning):
        written_out = kc.compile(parallel_cranks(1), form="inline")
    assert written_out.REDUNDANT == grouped.REDUNDANT
    assert not hasattr(grouped, "solve")
    t = np.linspace(0, 0.5, 6)
    ours, theirs = kc.solve(grouped, t), kc.solve(written_out, t)
    assert ours.success, ours.message
    np.testing.assert_allclose(ours.q[:, :12], theirs.q, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.q_ddot[:, :12], theirs.q_ddot, rtol=1e-9, atol=1e-9)
    assert np.isfinite(ours.condition).all()


def test_equations_that_are_dependent_everywhere_have_no_solve_in_either_form():
    x, y = sympy.symbols("x y")
    twice = kc.ConstraintSystem("twice", "x y", [x + y - kc.t, 2 * x + 2 * y - 2 * kc.t])
    for module in both(twice):
        assert not hasattr(module, "solve")
        solution = kc.solve(module, [0.0, 1.0])
        assert solution.status[0] == kc.Status.SINGULAR


def test_too_many_equations_of_a_very_large_mechanism_are_refused(monkeypatch):
    monkeypatch.setattr(further, "LARGEST_REDUNDANT", 10)
    with pytest.raises(kc.StructuralError, match="13 equations for 12 coordinates"):
        kc.solve(kc.compile(parallel_cranks(1), form="grouped"), 0)


def test_numbers_that_all_constraints_share_stay_in_the_code():
    program = group(lower(loops(5, "angle").system()))
    angles = [item for item in program.groups if item.sample.name.startswith("G")]
    assert len(angles) == 1
    assert {source.kind for source in angles[0].inputs.values()} <= {"q", "value"}
    bearings = next(item for item in program.groups if item.sample.name == "B0")
    assert bearings.inputs["s_i_x"].kind == "number"
    assert "s_i_y" not in bearings.inputs


def motors(count):
    """Return wheels, each with a driver of its own and a cam's contact."""
    m = kc.Mechanism("motors")
    a = m.parameter("a", 0.3)
    for k in range(count):
        wheel, pin = m.body(f"wheel{k}", (5.0 * k, 0, 0)), m.body(f"pin{k}", (5.0 * k + 1, 0, 0))
        m.add(kc.Revolute(f"axle{k}", m.ground, (5.0 * k, 0), wheel, (0, 0)))
        angle = (1.5 + 0.1 * k) * kc.t + a * sympy.sin(kc.t * (2 + k)) / (3 + k)
        m.add(kc.AbsoluteAngle(f"motor{k}", wheel, angle))
        rho = 1 + a / (2 + k) * sympy.cos(2 * kc.alpha + 0.1 * k)
        m.add(kc.PointFollower(f"slot{k}", pin, (0.1, 0.2), wheel, (0, 0), rho, guess=0.3))
        m.add(kc.AbsoluteAngle(f"turn{k}", pin, 0.1 * k))
        m.add(kc.AbsoluteX(f"guide{k}", pin, (0, 0), 5.0 * k + 0.9 + 0.01 * kc.t**2))
    return m


def test_drivers_and_profiles_of_one_structure_are_one_piece_of_code():
    small, large = (len(kc.emit(motors(n), form="grouped").source) for n in (40, 120))
    assert large < 1.02 * small
    ours, theirs = both(motors(12))
    rng = np.random.default_rng(2)
    q, q_dot = rng.normal(size=(2, 5, ours.N_COORDINATES))
    for batch in (slice(0, 5), 0):
        for found, known in zip(
            ours.kinematics(q[batch], q_dot[batch], 0.4),
            theirs.kinematics(q[batch], q_dot[batch], 0.4),
            strict=True,
        ):
            np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-12)


def test_that_a_grid_is_refused_with_what_to_do():
    module = kc.compile(loops(2, "equation"), form="grouped")
    with pytest.raises(kc.InputError, match=r"grouped form do: use method='march', or compile it"):
        kc.solve(module, [0.0, 0.1], method="grid")


def test_that_variants_are_solved_one_after_the_other(example_named):
    t, sets = np.linspace(0, 1, 5), np.array([[10, 26, 18, 20, 1.5]] * 3)[:, np.newaxis]
    sets[1, 0, 1], sets[2, 0, 1] = 100.0, 25.0  # a coupler too long to be assembled, and a good one
    found, known = (kc.solve(module, t, p=sets) for module in both(example_named("four_bar").model))
    np.testing.assert_array_equal(found.status, known.status)
    np.testing.assert_allclose(found.q[[0, 2]], known.q[[0, 2]], atol=1e-12)
    np.testing.assert_allclose(found.q_ddot[[0, 2]], known.q_ddot[[0, 2]], atol=1e-10)
    assert not found.success
    assert found.message == known.message


@pytest.mark.slow
def test_that_a_large_mechanism_stays_numpys_where_c_is_asked_for(caplog):
    with caplog.at_level("INFO", logger="kincompile"):
        module = kc.compile(loops(40, "angle"), target="c")
    assert "loops is in grouped form, which C does not have: it stays NumPy's" in caplog.text
    assert module.FORM == "grouped"
    assert not hasattr(module, "compiled_march")
    assert kc.solve(module, [0.0, 0.1]).success


@pytest.mark.parametrize("target", ["c", "octave", "javascript"])
@pytest.mark.parametrize(("count", "form"), [(40, None), (2, "grouped")])
def test_that_other_targets_say_what_to_do_with_a_large_mechanism(target, count, form):
    wanted = f"target '{target}' has no grouped form; use target='numpy', or form='inline'"
    with pytest.raises(kc.UnsupportedError, match=wanted):
        kc.emit(loops(count, "angle"), target, form)


def test_an_unknown_form_is_refused():
    with pytest.raises(kc.InputError, match="forms are: inline, grouped"):
        kc.emit(loops(1, "angle"), form="tree")


def test_an_impossible_position_ends_with_a_status():
    m = loops(2, "angle")
    block = m.body("block", (5, 0, 0))
    m.add(kc.Equation("lift", block.y - 10 * kc.t))
    m.add(kc.AbsoluteAngle("level", block, 0))
    m.add(kc.Distance("rod", block, (0, 0), m.ground, (0, 0), 5.0))  # too short from t = 0.5 on
    solution = kc.solve(kc.compile(m, form="grouped"), np.linspace(0, 1, 5))
    assert solution.status.tolist()[:2] == [0, 0]
    first = np.flatnonzero(solution.status)[0]
    assert first in (2, 3)
    assert solution.status[first] in (kc.Status.LOCK_UP, kc.Status.SINGULAR)
    assert (solution.status[first + 1 :] == kc.Status.NOT_REACHED).all()
    assert np.isnan(solution.q_dot[first:]).all()


def test_equal_loops_are_solved_side_by_side():
    solver = BlockSolver(code_of(kc.compile(loops(12, "angle"), form="grouped")))
    assert max(kind.rows.shape[1] for kind in solver._kinds) >= 12  # noqa: SLF001
    assert len(solver._kinds) <= 6  # noqa: SLF001


def test_a_chain_of_loops_hands_on_few_numbers():
    solver = BlockSolver(code_of(kc.compile(loops(12, "rocker"), form="grouped")))
    assert 0 < solver._count <= 5 * 12  # noqa: SLF001


@pytest.mark.parametrize("count", [3, 60])
def test_one_circle_of_equations_is_solved_whole_or_as_a_block(count):
    names = [f"u{k}" for k in range(count)]
    u = sympy.symbols(names)
    equations = [u[k] + u[k - 1] ** 2 / 4 - kc.t / (k + 2) for k in range(count)]
    module = kc.compile(kc.ConstraintSystem("circle", names, equations), form="grouped")
    q = np.random.default_rng(6).normal(size=count)
    solver, Phi_q, b = BlockSolver(code_of(module)), module.Phi_q(q, 0.1), np.arange(1.0, count + 1)
    factors = solver.factor(module.Phi_q_nonzeros(q, 0.1))
    assert (factors.whole is None) == (count <= blocks.LARGEST_BLOCK)
    np.testing.assert_allclose(solver.solve(factors, b), np.linalg.solve(Phi_q, b), rtol=1e-12)
    assert abs(np.prod(solver.determinants(factors))) == pytest.approx(abs(np.linalg.det(Phi_q)))


def branched(count):
    """Return a tree: each crank is driven by a rocker before it, and drives two more."""
    m = loops(count, None)
    for k in range(1, count):
        before, crank = m.bodies[3 * ((k - 1) // 2) + 2], m.bodies[3 * k]
        m.add(kc.RelativeAngle(f"G{k}", before, crank, -3.937))
    return m


@pytest.mark.parametrize("band", [200, 0], ids=["blocks", "whole"])
@pytest.mark.parametrize("model", [loops(12, "rocker"), branched(15)], ids=["chain", "tree"])
def test_the_sparse_solve_is_that_of_the_dense_matrix(model, band, monkeypatch):
    monkeypatch.setattr(blocks, "LARGEST_BAND", band)
    module = kc.compile(model, form="grouped")
    q = module.GUESS + np.random.default_rng(3).normal(scale=0.05, size=module.N_COORDINATES)
    solver, Phi_q = BlockSolver(code_of(module)), module.Phi_q(q, 0.1)
    b = np.random.default_rng(4).normal(size=module.N_EQUATIONS)
    factors = solver.factor(module.Phi_q_nonzeros(q, 0.1))
    assert (factors.whole is None) == (band > 0)
    np.testing.assert_allclose(
        solver.solve(factors, b), np.linalg.solve(Phi_q, b), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("largest", [40, 0], ids=["blocks", "whole"])
def test_the_signs_of_blocks_make_up_the_sign_of_the_determinant(largest, monkeypatch):
    monkeypatch.setattr(blocks, "LARGEST_BLOCK", largest)
    module = kc.compile(loops(5, "rocker"), form="grouped")
    solver, found = BlockSolver(code_of(module)), set()
    for q in module.GUESS + np.random.default_rng(5).normal(size=(8, module.N_COORDINATES)):
        factors = solver.factor(module.Phi_q_nonzeros(q, 0.1))
        ours = np.prod(np.sign(solver.determinants(factors)))
        found.add((int(ours), int(np.linalg.slogdet(module.Phi_q(q, 0.1))[0])))
    # The order of rows and columns gives both the same or the opposite sign everywhere.
    assert found in ({(1, 1), (-1, -1)}, {(1, -1), (-1, 1)})


def test_that_each_block_has_pivots_of_its_own():
    """Where the first number of a column is zero or tiny in one block, its rows change places."""
    rng = np.random.default_rng(8)
    matrices = rng.normal(size=(50, 4, 4))
    matrices[::3, 0, 0], matrices[1::3, 0, 0] = 0.0, 1e-14
    places = np.stack(np.divmod(np.arange(16), 4))
    numbers = np.arange(16 * 50).reshape(16, 50)
    index = np.arange(4 * 50).reshape(4, 50)
    kind = EqualBlocks(index, index, numbers, places, np.zeros(16, dtype=bool))
    factors = kind.factor(matrices.transpose(1, 2, 0).ravel())
    b = rng.normal(size=(4, 50))
    known = np.linalg.solve(matrices, b.T[..., np.newaxis])[..., 0].T
    np.testing.assert_allclose(kind.solve(factors, b.copy()), known, rtol=1e-9)
    np.testing.assert_allclose(factors.determinants, np.linalg.det(matrices), rtol=1e-9)
    units = kind.units(factors, np.array([1, 3]))
    inverses = np.linalg.inv(matrices).transpose(1, 2, 0)
    np.testing.assert_allclose(units, inverses[:, [1, 3]], rtol=1e-8, atol=1e-12)


def forest(count, seed):
    """Return loops, each driven by a motor of its own or by a body of any loop before it."""
    rng = np.random.default_rng(seed)
    m = loops(count, None)
    for k in range(1, count):
        body, crank = m.bodies[int(rng.integers(3 * k))], m.bodies[3 * k]
        match int(rng.integers(5)):
            case 0:
                m.add(kc.AbsoluteAngle(f"G{k}", crank, rng.uniform(1, 2) * kc.t))
            case 1:
                m.add(kc.RelativeAngle(f"G{k}", body, crank, rng.uniform(0, 0.1)))
            case 2:
                m.add(kc.Equation(f"G{k}", crank.phi - rng.uniform(0.5, 2) * body.phi))
            case 3:
                m.add(kc.Gear(f"G{k}", body, (0.1, 0.2), 2, 0, crank, (-0.5, 0), 3, np.pi))
            case 4:
                m.add(kc.Equation(f"G{k}", crank.phi - sympy.sin(body.phi) * body.x / (k + 1)))
    return m


@pytest.mark.parametrize("seed", range(6))
def test_loops_linked_at_random_are_solved_as_by_the_dense_matrix(seed):
    module = kc.compile(forest(30, seed), form="grouped")
    rng = np.random.default_rng(seed)
    q = module.GUESS + rng.normal(scale=0.02, size=module.N_COORDINATES)
    solver, Phi_q = BlockSolver(code_of(module)), module.Phi_q(q, 0.1)
    b = rng.normal(size=module.N_EQUATIONS)
    x = solver.solve(solver.factor(module.Phi_q_nonzeros(q, 0.1)), b)
    np.testing.assert_allclose(Phi_q @ x, b, rtol=1e-8, atol=1e-8 * np.abs(x).max())


def test_a_planned_solve_that_loses_digits_gives_way_to_pivoting(monkeypatch):
    module = kc.compile(loops(12, "rocker"), form="grouped")
    t = np.linspace(0, 0.1, 3)
    expected = kc.solve(module, t)
    assert "pivoted" not in expected.statistics
    put = EqualBlocks.put  # elimination that fails cannot be had to order

    def put_wrongly(self, values, x):
        put(self, np.array([value * (1 + 1e-4 * k) for k, value in enumerate(values, 1)]), x)

    monkeypatch.setattr(EqualBlocks, "put", put_wrongly)
    solution = kc.solve(module, t)
    assert solution.success, solution.message
    assert solution.statistics["pivoted"] >= 2 * 3  # velocity and acceleration, at least
    np.testing.assert_allclose(solution.q_ddot, expected.q_ddot, rtol=1e-9, atol=1e-9)


def test_that_small_numbers_along_a_chain_are_no_dependence():
    names = [f"u{k}" for k in range(40)]
    u = sympy.symbols(names)
    equations = [u[0] - kc.t, *(u[k] / 20 + u[k - 1] - kc.t for k in range(1, 40))]
    module = kc.compile(kc.ConstraintSystem("chain", names, equations), form="grouped")
    assert hasattr(module, "solve")
    assert len(module.BLOCKS[2]) == 40


def test_a_module_without_its_blocks_is_to_be_emitted_again(tmp_path):
    files = kc.emit(loops(2, "angle"), form="grouped").write(tmp_path)
    file = next(path for path in files if path.suffix == ".py")
    file.write_text(file.read_text().replace("BLOCKS = ", "STAGES = "))
    with pytest.raises(kc.ContractError, match=r"it has no BLOCKS, .* Emit it again"):
        kc.load(file)


def test_the_solve_of_a_singular_matrix_is_not_finite():
    module = kc.compile(loops(2, "angle"), form="grouped")
    solver = BlockSolver(code_of(module))
    with np.errstate(all="ignore"):  # as the callers do
        factors = solver.factor(np.zeros(len(module.PATTERN)))
        assert np.isnan(solver.solve(factors, np.ones(module.N_EQUATIONS))).all()
