"""Slips as people make them, typed by a person beside what is right, and what is said of them."""

from functools import cache
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.checker.report import Report

t = kc.t


S1, C1, S2, C2, S3, C3 = (f"{f}(theta{k})" for k in (1, 2, 3) for f in ("sin", "cos"))
S_I, C_I, S_J, C_J = "sin(phi_one)", "cos(phi_one)", "sin(phi_two)", "cos(phi_two)"


@cache
def leg() -> kc.ConstraintSystem:
    """Return a leg of a parallel robot, whose angles are free coordinates."""
    x, z, a, b, theta1, theta2, theta3 = sympy.symbols("x z a b theta1 theta2 theta3")
    Phi = [
        x - a * sympy.cos(theta1) - b * sympy.cos(theta2) * sympy.sin(theta3),
        z - a * sympy.sin(theta1) - b * sympy.sin(theta2) * sympy.sin(theta3),
        theta3 - 1 - t / 3,
        theta1 - sympy.sin(2 * t) / 2,
    ]
    names = ["x", "z", "theta1", "theta2", "theta3"]
    return kc.ConstraintSystem("leg", names, Phi, parameters={a: 0.4, b: 0.7})


@cache
def pair() -> kc.Mechanism:
    """Return two bodies that turn about a pin, one of them driven."""
    m = kc.Mechanism("pair")
    a, b, c, d = (
        m.parameter(n, v) for n, v in {"a": 0.25, "b": -0.15, "c": -0.35, "d": 0.45}.items()
    )
    i, j = m.body("one", guess=(0.3, -0.7, 0.4)), m.body("two", guess=(1.1, 0.5, -0.9))
    m.add(kc.Revolute("A", i, (a, b), j, (c, d)))
    m.add(kc.AbsoluteAngle("motor", i, 3 * t))
    return m


def handed_in(model: Any, quantity: str, changes: dict[str, str]) -> Report:
    """Compare the right formulas with some entries typed anew: by "row" or "row, column"."""
    matrix = getattr(model, quantity)
    system = model.system() if isinstance(model, kc.Mechanism) else model
    columns = [item.name for item in system.coordinates]
    rows = [[str(item) for item in matrix.row(k)] for k in range(matrix.rows)]
    for place, text in changes.items():
        row, _, column = place.partition(", ")
        rows[system.equations.index(row)][columns.index(column) if column else 0] = text
    # With the right Phi beside it a factor of a row is a mistake.
    beside = "Phi_q" if quantity == "Phi" else "Phi"
    given = {beside: getattr(model, beside), quantity: rows}
    report: Report = kc.compare(model, **given, strict=True)
    return report


# What a person typed, and the words that a sentence about it must hold. Right are, of the leg,
# Phi_q = [1 0 a S1 b S2 S3 -b C2 C3; 0 1 -a C1 -b C2 S3 -b S2 C3], and in gamma of its first row
# -a C1 w1^2 - b C2 S3 (w2^2 + w3^2) - 2 b S2 C3 w2 w3; of the pin B_i s_i and -B_j s_j.
GAMMA = (
    f"-a*{C1}*theta1_dot^2 - b*{C2}*{S3}*(theta2_dot^2 + theta3_dot^2)"
    f" - 2*b*{S2}*{C3}*theta2_dot*theta3_dot"
)
TYPED: list[tuple[Any, str, dict[str, str], list[str]]] = [
    (leg, "Phi_q", {"equation_1, theta2": f"b*{S2}*{S2}"}, [f"{S2} stands where {S3} belongs"]),
    (leg, "Phi_q", {"equation_1, theta2": f"b*{S1}*{S3}"}, [f"{S1} stands where {S2} belongs"]),
    (leg, "Phi_q", {"equation_1, theta2": f"a*{S2}*{S3}"}, ["a stands where b belongs"]),
    (leg, "Phi", {"equation_1": f"x - a*{C1} - b*{C2}*{S2}"}, [f"{S2} stands where {S3} belongs"]),
    (leg, "gamma", {"equation_1": GAMMA.replace("theta2_dot*theta3_dot", "theta2_dot*theta1_dot")},
     ["theta1_dot stands where theta3_dot belongs"]),
    (leg, "gamma", {"equation_1": GAMMA.replace(f"{C3}*", f"{C3}*b*")}, ["factor b is too much"]),
    (leg, "gamma", {"equation_1": GAMMA.replace(f"-a*{C1}", f"-{C1}")}, ["factor a is missing"]),
    (leg, "gamma", {"equation_1": GAMMA.replace("2*b*", "6*b*")}, ["term is 3 times"]),
    (leg, "gamma", {"equation_1": GAMMA.replace("2*b*", "b*").replace(f"-a*{C1}", f"a*{C1}")},
     ["two slips", "wrong sign"]),
    (leg, "nu", {"equation_3": "180/(3*pi)"}, ["pi/180", "degrees"]),
    (leg, "nu", {"equation_4": f"-1/3*{'cos(2*t)'}"}, ["1/3 times", "entry"]),
    # The sign of theta3 is wrong wherever it stands, as where a rotation is transposed.
    (leg, "Phi_q", {"equation_1, theta2": f"-b*{S2}*{S3}", "equation_2, theta2": f"b*{C2}*{S3}"},
     ["wrong sign"]),
    (leg, "Phi_q", {"equation_2, theta2": f"-b*{S2}*{C3}", "equation_2, theta3": f"-b*{C2}*{S3}"},
     ["columns of theta2 and theta3 are exchanged"]),
    (leg, "Phi_q", {"equation_1, theta2": f"-b*{C2}*{C3}", "equation_1, theta3": f"b*{S2}*{S3}",
                    "equation_2, theta2": f"-b*{S2}*{C3}", "equation_2, theta3": f"-b*{C2}*{S3}"},
     ["columns of theta2 and theta3 are exchanged"]),
    (pair, "Phi_q", {"A.x, phi_one": f"-(y_one + a*{S_I} + b*{C_I})",
                     "A.y, phi_one": f"x_one + a*{C_I} - b*{S_I}"},
     ["arm from the origin of the ground"]),
    (pair, "Phi_q", {"A.x, phi_two": f"y_two - y_one + c*{S_J} + d*{C_J}",
                     "A.y, phi_two": f"-(x_two - x_one + c*{C_J} - d*{S_J})"},
     ["arm from the origin of body i"]),
    (pair, "Phi_q", {"A.x, phi_one": f"-2*a*{S_I} - b*{C_I}",
                     "A.y, phi_one": f"2*a*{C_I} - b*{S_I}"},
     ["term is counted twice"]),
    (pair, "Phi_q", {"A.x, phi_one": f"-(a+0.1)*{S_I} - (b-0.2)*{C_I}",
                     "A.y, phi_one": f"(a+0.1)*{C_I} - (b-0.2)*{S_I}"},
     ["another vector stands where s_i belongs", "off by (0.1, -0.2)"]),
    (pair, "Phi_q", {"A.x, phi_one": f"-3*a*{S_I} - 3*b*{C_I}",
                     "A.y, phi_one": f"3*a*{C_I} - 3*b*{S_I}"},
     ["3 times"]),
    (pair, "nu", {"motor": "3*pi/180"}, ["pi/180 is too much"]),
]  # fmt: skip


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("model", "quantity", "changes", "meant"),
    TYPED,
    ids=[f"{item[1]}, {', '.join(item[3])}" for item in TYPED],
)
def test_that_a_slip_typed_by_a_person_is_found_and_named(
    model: Any, quantity: str, changes: dict[str, str], meant: list[str]
) -> None:
    report = handed_in(model(), quantity, changes)
    for place in changes:
        row, _, column = place.partition(", ")
        (entry,) = [
            item
            for item in report.different
            if (item.quantity, item.row, item.column) == (quantity, row, column or None)
        ]
        texts = [item.text for item in entry.diagnoses]
        assert any(all(word in text for word in meant) for text in texts), texts
    assert len(report.different) == len(changes), report.to_text()


def test_that_a_slip_without_a_rule_has_no_name() -> None:
    """A sentence is about numbers that it explains: an entry of nonsense gets none."""
    nonsense = {"equation_1, theta2": f"b*{S2}*{S3} + exp(x)/3 - {C1}^3*z"}
    report = handed_in(leg(), "Phi_q", nonsense)
    (entry,) = report.different
    (diagnosis,) = entry.diagnoses
    assert "no fault of the catalogue fits" in diagnosis.text
