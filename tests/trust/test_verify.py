"""Verification by oracles that know Phi alone: what is right passes, a fault anywhere does not."""

import re
import types

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.native.module import make_native

x, y = sympy.symbols("x y")


def spoiled(module, function, place, index, by):
    """Return a copy of a module with one number of one function wrong, for single states and all.

    `place` is where the quantity stands in what the function returns, None if it is all of it.
    """
    copy = types.ModuleType(module.__name__)
    vars(copy).update(vars(module))
    right = getattr(module, function)

    def wrong(*given, **named):
        found = right(*given, **named)
        parts = [np.array(found)] if place is None else [np.array(part) for part in found]
        parts[place or 0][..., *index] += by
        return parts[0] if place is None else tuple(parts)

    setattr(copy, function, wrong)
    return copy


def driven_pendulum(angle):
    m = kc.Mechanism("pendulum")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, angle))
    return m


def spline_cam():
    """Return a cam whose profile is a spline through 24 radii, and a lever that follows it."""
    m = kc.Mechanism("cam")
    disc, lever = m.body("disc"), m.body("lever", guess=(0.06, 0.02, 2.6))
    angles = np.linspace(0, 2 * np.pi, 25)
    radii = 0.05 + np.cos(2 * angles) / 100
    radii[-1] = radii[0]
    m.add(kc.Revolute("shaft", disc, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("pivot", lever, (-0.04, 0), m.ground, (0.1, 0)))
    m.add(kc.PointFollower("pin", lever, (0.04, 0), disc, (0, 0), (angles, radii), guess=1.0))
    m.add(kc.AbsoluteAngle("motor", disc, 2 * kc.t))
    return m


def two_pieces():
    """Return a driver that turns faster from t = 1/2 on, with the same slope there."""
    t, half = kc.t, sympy.Rational(1, 2)
    return driven_pendulum(sympy.Piecewise((t**2, t < half), (t - half**2, True)))


def free(*equations, guess=(1.0, 0.3)):
    return kc.ConstraintSystem("free", "x y", equations, guess=guess)


MODELS = {
    "spline cam": spline_cam,
    "piecewise driver": two_pieces,
    "free": lambda: free(x**2 * y - kc.t, sympy.exp(x) + sympy.sin(x * y) - 3),
    "root and logarithm": lambda: free(sympy.sqrt(x) - 1 - kc.t, y - sympy.log(x)),
    "no complex form": lambda: free(sympy.atan2(y, x) - kc.t, x**2 + y**2 - 1),
    "millimetres": lambda: free(x**2 + y**2 - 1e6, x - 900 - kc.t, guess=(900.0, 435.0)),
}


@pytest.fixture(params=MODELS)
def model(request):
    return MODELS[request.param]()


@pytest.mark.every(5)
def test_that_an_example_passes(example):
    found = kc.verify(example.module)
    assert found.passed
    assert found.states == (6, 6)
    outputs = 4 * len(getattr(example.module, "OUTPUTS", ()))
    loads = 8 * example.module.N_COORDINATES if hasattr(example.module, "LOADS") else 0
    assert len(found.table) == 5 * example.module.N_EQUATIONS + 1 + outputs + loads
    assert found.table[0].oracle == "the model"
    assert "all agree" in found.to_text()
    assert max(check.error for check in found.table) < 1e-9


@pytest.mark.every(5)
def test_that_the_grouped_form_passes(example):
    assert kc.verify(kc.compile(example.model, form="grouped")).passed


@pytest.mark.slow
def test_that_compiled_c_passes(example, quick_compiler):
    assert kc.verify(example.native).passed


@pytest.mark.parametrize("form", ["inline", "grouped"])
def test_that_a_model_that_is_hard_for_complex_numbers_passes(model, form):
    assert kc.verify(kc.compile(model, form=form)).passed


@pytest.mark.every(5)
def test_that_such_a_model_passes_in_c(model, quick_compiler):
    assert kc.verify(kc.compile(model, target="c")).passed


def test_that_redundant_and_incomplete_ones_are_judged_too(build):
    assert kc.verify(build["double_parallelogram"]()).passed
    assert kc.verify(build["scott_russell_pair"]()).passed
    with pytest.raises(kc.StructuralError, match="1 more equation is needed"):
        kc.verify(build["five_bar"](drivers=1))


FAULTS = [
    ("Phi", "position", 0),
    ("Phi", "kinematics", 0),
    ("Phi_q", "Phi_q", None),
    ("Phi_q", "velocity", 0),
    ("nu", "nu", None),
    ("nu", "kinematics", 2),
    ("gamma", "gamma", None),
    ("gamma", "acceleration", 1),
]


@pytest.mark.parametrize(("quantity", "function", "place"), FAULTS)
@pytest.mark.parametrize("size", [1e-6, 0.1])
def test_that_a_fault_is_found_and_its_entry_is_named(
    example_named, quantity, function, place, size
):
    module = example_named("slider_crank").module
    random = np.random.default_rng(3)
    for _ in range(3):
        row, column = random.integers(0, 9, 2)
        index = (row, column) if quantity == "Phi_q" else (row,)
        found = kc.verify(spoiled(module, function, place, index, size))
        coordinate = module.COORDINATES[column] if quantity == "Phi_q" else ""
        assert not found.passed
        (wrong,) = [check for check in found.table if not check.passed]
        expected = (quantity, module.EQUATIONS[row], coordinate)
        assert (wrong.quantity, wrong.equation, wrong.coordinate) == expected
        by = f" by {coordinate}" if coordinate else ""
        assert f"DIFFERS: {quantity} of {module.EQUATIONS[row]}{by}" in found.to_text()


@pytest.mark.parametrize("quantity", ["Phi_q", "nu", "gamma"])
def test_that_a_fault_is_found_where_complex_numbers_are_no_help(model, quantity):
    module = kc.compile(model)
    row = module.N_EQUATIONS - 1
    index = (row, 0) if quantity == "Phi_q" else (row,)
    size = 1e-2 * np.max(np.abs(module.Phi_q(module.GUESS, 0.0)[row]))
    found = kc.verify(spoiled(module, quantity, None, index, size))
    (wrong,) = [check for check in found.table if not check.passed]
    assert (wrong.quantity, wrong.equation) == (quantity, module.EQUATIONS[row])


@pytest.mark.parametrize("dimensions", [1, 2], ids=["single state", "batch"])
def test_that_a_fault_of_one_shape_alone_is_found(example_named, dimensions):
    """A batch may run on other code than a single state does."""
    module = example_named("four_bar").module
    wrong = spoiled(module, "gamma", None, (3,), 1e-6)
    everywhere = wrong.gamma
    wrong.gamma = lambda q, *given: (everywhere if q.ndim == dimensions else module.gamma)(
        q, *given
    )
    found = kc.verify(wrong)
    assert [check.entry for check in found.table if not check.passed] == ["gamma of B.y"]


@pytest.mark.parametrize("place", range(4), ids=["Phi", "nonzeros", "nu", "gamma"])
def test_that_a_fault_of_the_batch_of_lanes_is_found(example_named, place):
    module = example_named("four_bar").module
    found = kc.verify(spoiled(module, "kinematics_batch_last", place, (0, slice(None)), 1e-6))
    (wrong,) = [check for check in found.table if not check.passed]
    assert wrong.entry.startswith(("Phi of ", "Phi_q of ", "nu of ", "gamma of ")[place])


def test_that_a_fault_of_compiled_c_is_found(example_named, quick_compiler):
    module = example_named("four_bar").native
    found = kc.verify(spoiled(module, "gamma", None, (3,), 1e-6))
    assert [check.entry for check in found.table if not check.passed] == ["gamma of B.y"]


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("right", "wrong", "entry"),
    [
        ("at->Phi_q[7][lane] = -C", "at->Phi_q[7][lane] = C", "Phi_q of B.x by phi_coupler"),
        ("at->nu[0][lane] = 0.0;", "at->nu[0][lane] = 1e-6;", "nu of A.x"),
        ("at->gamma[4][lane] = C", "at->gamma[4][lane] = 2 * C", "gamma of C.x"),
        ("at->Phi[2][lane] = ", "at->Phi[2][lane] = 1e-3 + ", "Phi of B.x"),
        ("y_coupler = -(b_4 -", "y_coupler = -(b_4 +", "solve of B.y"),
    ],
    ids=["Phi_q", "nu", "gamma", "Phi", "solve"],
)
def test_that_a_slip_in_the_c_file_is_found(example_named, quick_compiler, right, wrong, entry):
    """Of all places where the C file writes it, the first one is wrong."""
    example = example_named("four_bar")
    files = dict(example.files("c"))
    name = next(name for name in files if name.endswith(".c"))
    assert files[name].count(right) > ("solve" not in entry)  # the plan stands there once
    files[name] = files[name].replace(right, wrong, 1)
    found = kc.verify(make_native(kc.compile(example.model), files))
    assert entry in [check.entry for check in found.table if not check.passed]


@pytest.mark.parametrize(
    ("right", "wrong", "entry"),
    [
        ("-wrist_pin_rod_y,  # wrist_pin.x by phi_rod", "wrist_pin_rod_y,", "Phi_q of wrist_pin.x"),
        ("2 * t,", "2.0001 * t,", "nu of motor"),
        ("-crank_pin_crank_w2_x,", "-0.99999 * crank_pin_crank_w2_x,", "gamma of main_bearing.x"),
        ("phi_crank - t**2,", "phi_crank - t**2 + 1e-9,", "Phi of motor"),
    ],
)
def test_that_a_slip_in_the_file_is_found(example_named, tmp_path, right, wrong, entry):
    """The first place alone: the same number elsewhere in the file is right."""
    source = example_named("slider_crank").source
    assert source.count(right.partition(",")[0]) > 1
    path = tmp_path / "slip.py"
    path.write_text(source.replace(right, wrong, 1))
    found = kc.verify(kc.load(path))
    assert not found.passed
    assert any(check.entry.startswith(entry) for check in found.table if not check.passed)


def test_that_a_mechanism_that_does_not_assemble_is_judged_where_it_is(build):
    found = kc.verify(build["four_bar"]((0.2, 0.5, 0.1, 5)))
    assert (found.passed, found.states) == (True, (6, 0))
    assert "no assembled position was found near the guess" in found.to_text()


def test_a_singular_guess(build):
    """The change point of a parallelogram: formulas are formulas there, too."""
    model = build["four_bar"]((1.0, 2.0, 1.0, 2.0), start=0.0, guess=(0.0, 0.0, 0.0))
    assert kc.verify(model).passed


def test_that_equations_without_a_value_are_an_error_that_says_so():
    model = free(sympy.sqrt(x) - 1 - kc.t, y - sympy.log(x), guess=(-9.0, 0.0))
    with pytest.raises(kc.InputError, match="finite"):
        kc.verify(model)


@pytest.mark.parametrize("wrong", [np, types.ModuleType("empty")], ids=["numpy", "empty"])
def test_that_another_module_is_refused(wrong):
    with pytest.raises(kc.ContractError, match=re.escape(wrong.__name__)):
        kc.verify(wrong)


def test_that_what_is_no_model_is_refused():
    with pytest.raises(kc.ModelError, match="str is not a model"):
        kc.verify("slider_crank")


def test_that_the_table_of_a_large_mechanism_is_cut():
    m = kc.Mechanism("many")
    for k in range(30):
        rod = m.body(f"rod{k}", guess=(1, 0, 0))
        m.add(kc.Revolute(f"pin{k}", m.ground, (0, 0), rod, (-1, 0)))
        m.add(kc.AbsoluteAngle(f"motor{k}", rod, kc.t))
    module = kc.compile(m)
    text = kc.verify(module).to_text()
    assert len(text.splitlines()) < 50
    assert "411 more comparisons agree better than these" in text
    text = kc.verify(spoiled(module, "Phi_q", None, (7, 2), 1e-6)).to_text()
    assert "DIFFERS: Phi_q of pin2.y by phi_rod0" in text
