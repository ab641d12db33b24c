"""Slips of `tests/data/slips.toml`, typed by hand: each is found, and called what it is.

The corpus of single faults is made of the catalogue, and cannot show what is missing in it. Here a
slip that the catalogue does not know fails a test, and so does a fault that nobody has typed.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.checker.fault import Kind

DATA = Path(__file__).resolve().parents[2] / "data" / "slips.toml"
SLIPS: list[dict[str, Any]] = tomllib.loads(DATA.read_text(encoding="utf-8"))["slip"]
t = kc.t
ALIASES = {
    "si": "sin(phi_one)", "ci": "cos(phi_one)", "sj": "sin(phi_two)", "cj": "cos(phi_two)",
    "wi": "phi_one_dot", "wj": "phi_two_dot", "xd": "x_one_dot", "yd": "y_one_dot",
    "dx": "x_two - x_one", "dy": "y_two - y_one",
    "dxd": "x_two_dot - x_one_dot", "dyd": "y_two_dot - y_one_dot",
}  # fmt: skip
TYPED = {
    "test_compare_museum.py": {
        Kind.SIGN, Kind.LEFT_ZERO, Kind.SINE_COSINE, Kind.MISSING_FACTOR, Kind.BLOCKS,
        Kind.OTHER_FORM,
    },
    "test_compare_typed_faults.py": {
        Kind.MULTIPLE, Kind.DEGREES, Kind.OTHER_VARIABLE, Kind.EXTRA_FACTOR, Kind.COLUMNS,
        Kind.ARM, Kind.OTHER_VECTOR, Kind.TWO_SLIPS, Kind.DRIVER_DEGREES,
    },
    "test_compare_names_of_faults.py": {Kind.OFFSET, Kind.WHOLE_TRANSPOSED},
    "test_compare_forms.py": {Kind.SAME_SPACE},
    "test_compare_loads.py": {Kind.WITHOUT},
    "test_checking.py, test_small_rotations.py": {Kind.E0_LAST, Kind.TILDE, Kind.GLOBAL_OMEGA},
    "test_compare_transmissions.py": {
        Kind.INVERSE, Kind.FRAME, Kind.CHAIN_RULE, Kind.BRANCH, Kind.EXTRA_TERM,
    },
}  # fmt: skip
"""The kinds of faults that other tests have, in slips that a person typed too."""


@cache
def model_of(name: str) -> kc.Mechanism | kc.ConstraintSystem:
    m = kc.Mechanism(name)
    a, b, c, d, u, v, length = (
        m.parameter(key, value)
        for key, value in
        {"a": 0.25, "b": -0.15, "c": -0.35, "d": 0.45, "u": 0.2, "v": 0.7, "L": 1.3}.items()
    )  # fmt: skip
    if name == "belt":
        x, theta = sympy.symbols("x theta")
        return kc.ConstraintSystem("belt", ["x", "theta"], [x - t**2 * sympy.cos(theta)])
    i, j = m.body("one", guess=(0.3, -0.7, 0.4)), m.body("two", guess=(1.1, 0.5, -0.9))
    if name == "pair":
        m.add(kc.Revolute("A", i, (a, b), j, (c, d)))
        m.add(kc.AbsoluteAngle("motor", i, u + v * t**3))
    elif name == "slide":
        m.add(kc.RevoluteTranslational("K", i, (0, 0), (1, 0), j, (c, d), 0))
    else:
        m.add(kc.AbsoluteDistance("K", i, (0, 0), (0, 0), length + v * t**2))
    return m


@pytest.mark.every(5)
@pytest.mark.parametrize("slip", SLIPS, ids=[f"{x['quantity']}, {x['kind']}" for x in SLIPS])
def test_that_a_slip_typed_by_hand_is_called_what_it_is(slip: dict[str, Any]) -> None:
    model, quantity = model_of(slip["model"]), slip["quantity"]
    system = model.system() if isinstance(model, kc.Mechanism) else model
    rows = getattr(system, quantity).tolist()
    for place, typed in slip["entries"].items():
        row, _, column = place.partition(", ")
        k = system.equations.index(row)
        rows[k][[item.name for item in system.coordinates].index(column) if column else 0] = typed
    aliases = {} if slip["model"] == "belt" else ALIASES
    report = kc.compare(model, **{"Phi": system.Phi, quantity: rows}, aliases=aliases)
    labels = [f"{quantity}[{place}]" for place in slip["entries"]]
    assert [entry.label for entry in report.different] == labels, report.to_text()
    for entry in report.different:
        named = [item for item in entry.diagnoses if item.kind == slip["kind"]]
        assert any(all(word in item.text for word in slip["words"]) for item in named), (
            entry.diagnoses
        )


def test_that_every_fault_of_the_catalogue_has_been_typed_by_a_person() -> None:
    """The ring closes here: a fault without a slip would be tested by its own transformation."""
    kinds = {value for name, value in vars(Kind).items() if name.isupper()}
    assert kinds == set().union(*TYPED.values(), (slip["kind"] for slip in SLIPS))
