import re
from types import SimpleNamespace

import numpy as np
import pytest

from kincompile.errors import InputError, StructuralError
from kincompile.runtime.newton import newton
from kincompile.runtime.solve import solve


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"t": "now"}, "t is str: give real numbers"),
        ({"t": None}, "t is NoneType: give real numbers"),
        ({"t": 1j}, "t is complex: give real numbers"),
        ({"t": True}, "t is bool: give real numbers"),
        ({"t": [0, "1"]}, "t is an array of <U21: give real numbers"),
        ({"t": [0, [1]]}, "t is not a regular array"),
        ({"t": []}, r"t has shape \(0,\): give one time, or a 1-D grid of at least one time"),
        ({"t": [[0, 1]]}, r"t has shape \(1, 2\): give one time, or a 1-D grid"),
        ({"t": np.nan}, r"t\[0\] is nan: times must be finite"),
        ({"t": [0, 1, -np.inf]}, r"t\[2\] is -inf: times must be finite"),
        ({"t": [0, 2, 1]}, r"t goes back and forth: sort the times.*np\.sort\(t\)"),
        ({"p": {"omega": np.nan}}, "parameter 'omega' is nan: give a finite number"),
        ({"p": [np.inf, 1]}, "parameter 'omega' is inf: give a finite number"),
        ({"p": {"omga": 1}}, r"no parameter 'omga'; did you mean 'omega'\? The parameters are"),
        ({"p": {"size": 1}}, r"no parameter 'size'\. The parameters are omega, phi_0"),
        ({"p": {3: 1}}, r"no parameter 3\."),
        ({"p": {"omega": "fast"}}, "parameter 'omega' is str: give real numbers"),
        ({"p": {"omega": [[1, 2]]}}, r"parameter 'omega' has shape \(1, 2\): give one number"),
        ({"p": [1, 2, 3]}, r"parameter vector has shape \(3,\), expected \(2,\): .*omega, phi_0"),
        ({"p": np.array([1, object()])}, "the parameter vector is an array of object"),
        ({"guess": (1, 0)}, r"coordinate vector has shape \(2,\), expected \(3,\): .*x_rod"),
        ({"guess": [[1, 0, 0]]}, r"coordinate vector has shape \(1, 3\), expected \(3,\)"),
        ({"guess": (1, np.nan, 0)}, "coordinate 'y_rod' is nan: give a finite number"),
        ({"guess": (1, 0, 1j)}, "the coordinate vector is an array of complex128"),
        ({"guess": {"phi": 1}}, r"no coordinate 'phi'.* The coordinates are x_rod, y_rod, phi_rod"),
        ({"tolerance": 0}, "tolerance is 0: give a positive number"),
        ({"tolerance": np.nan}, "tolerance is nan: give a positive number"),
        ({"tolerance": "1e-8"}, "tolerance is '1e-8': give a positive number"),
        ({"max_iterations": 0}, "max_iterations is 0: give an integer of at least 1"),
        ({"max_iterations": 2.5}, r"max_iterations is 2\.5: give an integer"),
    ],
)
def test_a_value_that_cannot_be_used_is_named(pendulum, given, message):
    with pytest.raises(InputError, match=message):
        solve(pendulum, **{"t": 0, **given})


def test_all_that_is_wrong_is_said_at_once(pendulum):
    with pytest.raises(InputError, match=r"^7 problems:\n  - t is str") as caught:
        solve(
            pendulum,
            "now",
            {"omega": np.nan, "rho": 1},
            {"x_rod": "left", "phi_rod": np.inf},  # what is refused
            tolerance=-1,
            max_iterations=0,
        )
    assert len(caught.value.problems) == 7


def test_newton_reads_its_inputs_in_the_same_way(pendulum):
    with pytest.raises(InputError, match="coordinate 'y_rod' is nan"):
        newton(pendulum, 0, (1, np.nan, 0))
    with pytest.raises(InputError, match="no parameter 'size'"):
        newton(pendulum, 0, None, {"size": 1})


def test_inputs_are_left_as_they_were(pendulum):
    t, p, guess = np.array([0.0, 0.1]), np.array([1.0, 2.0]), np.array([1.0, 0.0, 1.5])
    solution = solve(pendulum, t, p, guess)
    solution.t[:] = solution.q[:] = -1
    assert (t.tolist(), p.tolist(), guess.tolist()) == ([0, 0.1], [1, 2], [1, 0, 1.5])
    assert pendulum.GUESS[0] == 1


@pytest.mark.parametrize(
    ("module", "message"),
    [
        (SimpleNamespace(bodies=()), r"got a SimpleNamespace: compile .* kc\.compile\(m\)"),
        (None, r"got a NoneType: compile .* kc\.compile\(m\)"),
        ("four_bar.py", r"got a str: load the file first: module = kc\.load\(path\)"),
    ],
)
@pytest.mark.parametrize("function", [solve, newton])
def test_what_is_not_a_module_is_refused_with_the_missing_step(function, module, message):
    with pytest.raises(InputError, match=message):
        function(module, 0, None)


@pytest.mark.parametrize("function", [solve, newton])
def test_too_few_equations_are_counted(edited, function):
    module = edited(
        "pendulum",
        ("N_EQUATIONS = 3", "N_EQUATIONS = 2"),
        ('("pin.x", "pin.y", "motor")', '("pin.x", "pin.y")'),
        (", [2, 2]]", "]"),
    )
    message = "pendulum has 2 equations for 3 coordinates (x_rod, y_rod, phi_rod)"
    with pytest.raises(StructuralError, match=re.escape(message) + ".*add 1 more"):
        function(module, 0, None)


@pytest.mark.parametrize("function", [solve, newton])
def test_too_many_equations_are_counted(edited, function):
    module = edited(
        "pendulum",
        ("N_EQUATIONS = 3", "N_EQUATIONS = 4"),
        ('"motor")', '"motor", "brake")'),
    )
    with pytest.raises(StructuralError, match=r"4 equations for 3 .*remove 1 of them: .*brake"):
        function(module, 0, None)


def test_an_unknown_column_is_named(pendulum):
    solution = solve(pendulum, 0)
    with pytest.raises(InputError, match=r"no column 'phi_rot'; did you mean 'phi_rod'\?"):
        solution["phi_rot"]
    with pytest.raises(InputError, match=r"no column 'energy'\. The coordinates are x_rod, .*_dot"):
        solution["energy"]
    with pytest.raises(InputError, match="no column 2"):
        solution[2]  # type: ignore[index]  # what is refused
