"""What is wrong with a system of free equations, and with what is given instead of a model."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from sympy.physics.mechanics import dynamicsymbols

import kincompile as kc

x, y, L = sympy.symbols("x y L")
nan = float("nan")


def system(coordinates: Any = "x y", equations: Any = (x - 1, y - 2), **more: Any) -> Any:
    return kc.ConstraintSystem("s", coordinates, equations, **more)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"guess": (1,)}, r"the guess has 1 values for 2 coordinates \(x, y\); give one for each"),
        ({"guess": (1, 2, 3)}, "the guess has 3 values for 2 coordinates"),
        ({"guess": ()}, "the guess has 0 values for 2 coordinates"),
        ({"guess": 1.0}, "the guess 1.0 is not a list; give a value for each coordinate"),
        ({"guess": np.eye(2)}, "guess of x: array.* is not a number"),
        ({"guess": (1, nan)}, "guess of y: nan is not finite; give a finite number"),
        ({"guess": {"z": 1}}, "the guess names z; coordinates are: x, y"),
        ({"guess": {"x": "a"}}, "guess of x: 'a' is not a number"),
        ({"guess": (L, 1)}, "guess of x: L is not a number at the default parameters"),
        ({"coordinates": "x y x"}, "2 coordinates, rates and parameters are named 'x'; give"),
        ({"coordinates": "x y x_dot"}, "2 coordinates, rates and parameters are named 'x_dot'"),
        ({"coordinates": "x y t"}, "a coordinate is named 't', which is reserved"),
        ({"coordinates": "x y 2z"}, "a coordinate is named '2z': a name is an ASCII letter"),
        ({"coordinates": [x, y, 3]}, "a coordinate is named '3'"),
        ({"coordinates": 5}, r"the coordinates 5 are not a list; write coordinates=\[...\]"),
        ({"coordinates": None}, "the coordinates None are not a list"),
        ({"equations": x - 1}, r"the equations x - 1 are not a list; write equations=\[...\]"),
        ({"equations": "x - 1"}, "the equations 'x - 1' are not a list"),
        ({"equations": None}, "the equations None are not a list"),
        ({"equations": [x, "y - 1"]}, "equation 'equation_2': 'y - 1' is not a number"),
        ({"equations": [x, None]}, "equation 'equation_2': None is not a number"),
        ({"equations": [x, kc.Revolute]}, "equation 'equation_2': <class .* is not a number"),
        ({"equations": [x, y - sympy.Symbol("z")]}, "'equation_2' contains z, which is not"),
        ({"equations": [x, y - sympy.Symbol("xx")]}, r"is not declared; did you mean 'x'\?"),
        ({"equations": [x, y, sympy.Symbol("x_dot")]}, "contains x_dot, which is not declared"),
        ({"equations": [x, kc.t]}, "'equation_2' contains no coordinate, so it cannot constrain"),
        ({"equations": [x, sympy.Abs(y)]}, r"'equation_2': Abs\(y\) has no continuous derivative"),
        ({"parameters": {"L": None}}, r"parameter 'L' has no value; give a default: parameter"),
        ({"parameters": {"L": nan}}, "parameter 'L': nan is not finite"),
        ({"parameters": {"x": 1.0}}, "2 coordinates, rates and parameters are named 'x'"),
        ({"parameters": {"a b": 1.0}}, "a parameter is named 'a b'"),
        ({"parameters": 5}, r"the parameters 5 are not a list; write parameters=\[...\]"),
        ({"parameters": [("L", 1)]}, r"\('L', 1\) is not a parameter; give values by name: param"),
        ({"bodies": 5}, "the bodies 5 are not a list"),
        ({"bodies": ["rod"]}, "'rod' is not a body; make one with Mechanism.body"),
    ],
)  # fmt: skip
def test_that_a_mistake_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(kc.ModelError, match=message):
        system(**given)


def test_that_a_system_without_anything_says_what_it_needs() -> None:
    with pytest.raises(kc.ModelError) as caught:
        kc.ConstraintSystem("empty")
    assert caught.value.problems == (
        "'empty' has no constraints; add joints and drivers, or equations",
        "'empty' has no coordinates; add a body, or name coordinates",
    )


def test_that_a_velocity_in_dynamicsymbols_is_named() -> None:
    angle = dynamicsymbols("theta")
    with pytest.raises(kc.ModelError, match=r"equation_1': .* contains a time derivative"):
        kc.ConstraintSystem("s", [angle], [angle.diff(kc.t) - 1])


def test_that_a_joint_needs_its_bodies_among_those_of_the_system() -> None:
    crank = kc.Mechanism("m").body("crank")
    with pytest.raises(kc.ModelError, match="AbsoluteX 'slide', body: there is no body 'crank'"):
        kc.ConstraintSystem("s", "x", [kc.AbsoluteX("slide", crank, (0, 0), 1), x])


def test_that_all_problems_are_told_at_once() -> None:
    with pytest.raises(kc.ModelError) as caught:
        system("x y pi", [x - L, sympy.Abs(y)], guess=(1, nan), parameters={"c": None})
    assert len(caught.value.problems) == 5


def test_that_a_system_is_frozen() -> None:
    with pytest.raises(AttributeError, match="a ConstraintSystem is frozen; make a new one"):
        system().name = "other"


@pytest.mark.parametrize("what", [None, 5, "four_bar.py", [], {}, kc.Mechanism, object(), x - 1])
@pytest.mark.parametrize(
    "use",
    [kc.compile, kc.emit, kc.inspect, kc.page, kc.derivation, kc.plot_sparsity, kc.compare],
    ids=lambda use: use.__name__,
)
def test_that_what_is_no_model_is_refused(use: Any, what: Any) -> None:
    with pytest.raises(kc.ModelError, match=r"is not a model: give a kc.Mechanism or a"):
        use(what)


@pytest.mark.parametrize("what", [None, 5, [], system(), kc.Mechanism("m")], ids=repr)
def test_that_what_is_no_solution_is_refused(tmp_path: Path, what: Any) -> None:
    uses: Any = [
        lambda: kc.write(what, tmp_path / "motion.csv"),
        lambda: kc.animate(what),
        lambda: kc.page(system(), what or 0),
    ]
    for use in uses:
        with pytest.raises(kc.InputError, match=r"expected a Solution, got \w+: solve first"):
            use()


def test_that_an_unknown_target_is_refused() -> None:
    with pytest.raises(kc.UnsupportedError, match="there is no target 'fortran'; targets are: "):
        kc.emit(system(), "fortran")
