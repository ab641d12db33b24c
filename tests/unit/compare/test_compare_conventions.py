"""Conventions are forgiven and named; what only looks like one is not."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker.reference import Reference
from kincompile.checker.report import Report


def two_bodies() -> kc.Mechanism:
    """Return a mechanism whose rows are all generic; it need not be square."""
    m = kc.Mechanism("two_bodies")
    reach = m.parameter("reach", 2.0)
    i, j = m.body("i", guess=(0.3, -0.7, 0.4)), m.body("j", guess=(1.1, 0.5, -0.9))
    m.add(kc.Revolute("R", i, (0.25, -0.15), j, (-0.35, 0.45)))
    rod = reach + 0.3 * sympy.sin(2 * kc.t)
    m.add(kc.Distance("D", i, (0.25, -0.15), j, (-0.35, 0.45), rod))
    m.add(kc.Translational("T", i, (0.25, -0.15), (0.6, 0.9), j, (-0.35, 0.45), (-0.4, 0.7)))
    m.add(kc.RelativeAngle("A", i, j, sympy.cos(kc.t)))
    m.add(kc.AbsoluteAngle("B", i, kc.t**2 / 3))
    return m


MODEL = two_bodies()
REFERENCE = Reference(MODEL)
PHI, PHI_Q, NU, GAMMA = MODEL.Phi, MODEL.Phi_q, MODEL.nu, MODEL.gamma
ROWS = {name: k for k, name in enumerate(REFERENCE.equations)}


def scaled(matrix: sympy.Matrix, factors: dict[str, Any]) -> Any:
    result = matrix.as_mutable()
    for name, factor in factors.items():
        result[ROWS[name], :] = factor * result[ROWS[name], :]
    return result


def kinds(report: Report) -> list[str]:
    return [item.kind for item in report.conventions]


def test_that_the_generated_matrices_are_equal_to_themselves() -> None:
    report = kc.compare(REFERENCE, PHI, PHI_Q, NU, GAMMA)
    assert (report.verdict, report.conventions) == ("equal", ())
    assert len(report.entries) == 7 * (1 + 6 + 1 + 1)


def test_row_signs() -> None:
    factors = {"R.x": -1, "T.parallel": -1}
    report = kc.compare(REFERENCE, *(scaled(item, factors) for item in (PHI, PHI_Q, NU, GAMMA)))
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["row sign"])
    assert report.conventions[0].rows == ("R.x", "T.parallel")
    verdicts = {entry.row: entry.verdict for entry in report.entries}
    assert (verdicts["R.x"], verdicts["R.y"]) == ("equal up to convention", "equal")


def test_half_of_the_squared_distance() -> None:
    half = sympy.Rational(1, 2)
    report = kc.compare(REFERENCE, *(scaled(item, {"D": half}) for item in (PHI, PHI_Q, NU, GAMMA)))
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["row scale"])
    assert "D: written as 0.5 times" in report.conventions[0].text


def test_a_scale_that_depends_on_a_parameter() -> None:
    reach = sympy.Symbol("reach")
    report = kc.compare(REFERENCE, None, scaled(PHI_Q, {"D": 1 / reach}))
    assert kinds(report) == ["row scale"]
    assert "depends on parameters" in report.conventions[0].text


def test_that_a_scale_must_not_depend_on_the_position() -> None:
    report = kc.compare(REFERENCE, Phi_q=scaled(PHI_Q, {"D": sympy.Symbol("x_i")}))
    assert {entry.row for entry in report.different} == {"D"}


def test_that_gamma_must_follow_the_sign_of_its_row() -> None:
    report = kc.compare(REFERENCE, Phi_q=scaled(PHI_Q, {"D": -1}), gamma=GAMMA)
    assert [entry.label for entry in report.different] == ["gamma[D]"]


def test_that_the_constraint_itself_decides_the_scale_of_its_row() -> None:
    report = kc.compare(REFERENCE, PHI, scaled(PHI_Q, {"D": sympy.Rational(1, 2)}))
    assert {entry.label[:7] for entry in report.different} == {"Phi_q[D"}


def test_the_order_of_rows() -> None:
    order = [3, 0, 1, 6, 2, 4, 5]
    report = kc.compare(REFERENCE, *(item[order, :] for item in (PHI, PHI_Q, NU, GAMMA)))
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["order of rows"])
    assert [e.row for e in report.entries[:7]] == [REFERENCE.equations[k] for k in order]


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        ([3, 4, 5, 0, 1, 2], "the bodies have another order"),
        ([2, 0, 1, 5, 3, 4], "angle first"),
        ([0, 3, 1, 4, 2, 5], "all x come first"),
        ([0, 1, 3, 4, 2, 5], "positions come first"),
        ([5, 3, 4, 2, 0, 1], "another order; each body has its angle first"),
    ],
)
def test_the_order_of_columns(columns: list[int], text: str) -> None:
    report = kc.compare(REFERENCE, Phi_q=PHI_Q[:, columns], gamma=GAMMA)
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["order of columns"])
    assert text in report.conventions[0].text
    assert report.entries[1].column == REFERENCE.coordinates[columns[1]]


SWAPPED = [3, 4, 5, 0, 1, 2]


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("kind", ["Revolute", "Translational", "Distance", "Gear"])
@pytest.mark.slow
def test_that_blocks_exchanged_in_one_constraint_are_no_order(
    kind: str, strict: bool, joint_types: Any
) -> None:
    model = joint_types[kind]()
    given = {"Phi": model.Phi, "nu": model.nu, "gamma": model.gamma}
    for beside in ({}, given):
        report = kc.compare(model, Phi_q=model.Phi_q[:, SWAPPED], **beside, strict=strict)
        found = {item.text for entry in report.different for item in entry.diagnoses}
        assert found == {"the blocks of bodies i and j are exchanged."}
        assert {entry.quantity for entry in report.different} == {"Phi_q"}
        assert report.conventions == ()


@pytest.mark.parametrize("name", ["R", "D", "T"])
def test_that_blocks_exchanged_in_one_of_many_constraints_are_no_order(name: str) -> None:
    matrix = PHI_Q.as_mutable()
    rows = [k for k, row in enumerate(REFERENCE.equations) if row.split(".")[0] == name]
    for row in rows:
        matrix[row, :] = matrix[row, SWAPPED]
    for given in ({}, {"Phi": PHI, "nu": NU, "gamma": GAMMA}):
        report = kc.compare(REFERENCE, Phi_q=matrix, **given)
        assert {entry.row for entry in report.different} == {REFERENCE.equations[k] for k in rows}
        assert {d.kind for e in report.different for d in e.diagnoses} == {"body blocks swapped"}
    alone = kc.compare(REFERENCE, Phi_q=PHI_Q[rows, SWAPPED], constraint=name)
    assert {d.kind for e in alone.different for d in e.diagnoses} == {"body blocks swapped"}


def test_that_another_order_of_bodies_is_that_of_the_whole_matrix(example_named: Any) -> None:
    model = example_named("four_bar").model
    # Exchanged are the first two of three bodies: the rows of the third joint stay as they are.
    order = [3, 4, 5, 0, 1, 2, 6, 7, 8]
    report = kc.compare(model, Phi_q=model.Phi_q[:, order], gamma=model.gamma)
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["order of columns"])
    assert report.conventions[0].text == (
        "Phi_q: the bodies have another order, the same in all rows: x_coupler, y_coupler, "
        "phi_coupler, x_crank, y_crank, phi_crank, x_rocker, y_rocker, phi_rocker."
    )
    assert not kc.compare(model, Phi_q=model.Phi_q[:, order], strict=True).equal
    matrix = model.Phi_q[:, order].as_mutable()
    matrix[2, 0] *= 2
    report = kc.compare(model, Phi=model.Phi, Phi_q=matrix)
    assert [entry.label for entry in report.different] == ["Phi_q[B.x, x_coupler]"]


@pytest.mark.parametrize("place", [0, 3, 6])
def test_columns_of_the_ground(place: int) -> None:
    ground = sympy.Matrix(7, 3, lambda row, column: row + column)
    wide = PHI_Q[:, :place].row_join(ground).row_join(PHI_Q[:, place:])
    report = kc.compare(REFERENCE, Phi_q=wide)
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["ground columns"])
    assert len(report.entries) == 7 * 6


@pytest.mark.parametrize("name", ["nu", "gamma"])
def test_the_sign_of_a_whole_vector(name: str) -> None:
    given = {"Phi_q": PHI_Q, "nu": NU, "gamma": GAMMA}
    flipped = {**given, name: -given[name]}
    assert not kc.compare(REFERENCE, **flipped).equal
    stated = {name: {"nu": "Phi_t", "gamma": "left side"}[name]}
    report = kc.compare(REFERENCE, **flipped, conventions=stated)
    assert (report.verdict, kinds(report)) == ("equal up to convention", [f"sign of {name}"])


def test_that_one_reversed_rate_is_no_convention() -> None:
    report = kc.compare(REFERENCE, Phi_q=PHI_Q, nu=scaled(NU, {"B": -1}))
    assert [entry.label for entry in report.different] == ["nu[B]"]
    assert report.different[0].diagnoses[0].kind == "driver's rate reversed"


def test_exchanged_roles_of_the_bodies() -> None:
    m = kc.Mechanism("exchanged")
    i, j = m.body("i"), m.body("j")
    rest = MODEL.constraints
    for item in (*rest[:2], None, *rest[3:]):
        if item is None:
            m.add(
                kc.Translational("T", j, (-0.35, 0.45), (-0.4, 0.7), i, (0.25, -0.15), (0.6, 0.9))
            )
        else:
            m.add(item)
    m.parameter("reach", 2.0)
    del i
    report = kc.compare(REFERENCE, m.Phi, m.Phi_q, m.nu, m.gamma)
    assert report.verdict == "equal up to convention"
    assert report.conventions[0].kind == "roles of i and j"
    assert set(report.conventions[0].rows) == {"T.normal", "T.parallel"}


@pytest.mark.parametrize("angle", [sympy.cos(kc.t), 0])
def test_that_an_angle_counted_from_the_other_body_turns_the_other_way(angle: Any) -> None:
    m, other = kc.Mechanism("exchanged"), kc.Mechanism("exchanged")
    i, j = m.body("i"), m.body("j")
    m.add(kc.RelativeAngle("A", i, j, angle))
    other.body("i"), other.body("j")
    other.add(kc.RelativeAngle("A", j, i, angle))
    report = kc.compare(m, other.Phi, other.Phi_q, other.nu, other.gamma)
    assert report.equal == (angle == 0)


def test_degrees() -> None:
    angles = [name for name in REFERENCE.coordinates if name.startswith("phi")]
    symbols = {sympy.Symbol(name) for name in angles}
    degrees = {s: s * sympy.pi / 180 for s in symbols}
    degrees |= {
        sympy.Symbol(f"{s}_dot"): sympy.Symbol(f"{s}_dot") * sympy.pi / 180 for s in symbols
    }
    report = kc.compare(REFERENCE, None, PHI_Q.xreplace(degrees), NU, GAMMA.xreplace(degrees))
    assert (report.verdict, kinds(report)) == ("equal up to convention", ["degrees"])
    assert "angles are taken in degrees" in report.conventions[0].text


def test_derivatives_per_degree() -> None:
    columns = [PHI_Q[:, k] * (sympy.pi / 180 if k in (2, 5) else 1) for k in range(6)]
    report = kc.compare(REFERENCE, Phi_q=sympy.Matrix.hstack(*columns))
    assert kinds(report)[0] == "degrees"
    assert report.equal


def test_one_constraint_with_its_own_columns() -> None:
    rows = [ROWS["T.normal"], ROWS["T.parallel"]]
    report = kc.compare(REFERENCE, Phi_q=PHI_Q[rows, :], gamma=GAMMA[rows, :], constraint="T")
    assert (report.verdict, len(report.entries)) == ("equal", 14)
    report = kc.compare(REFERENCE, Phi_q=PHI_Q[[ROWS["B"]], :3], constraint="B")
    assert (report.verdict, len(report.entries)) == ("equal", 3)


def test_functions_and_arrays() -> None:
    slider = kc.Mechanism("crank")
    crank = slider.body("crank", guess=(0, 0, 0.5))
    slider.add(kc.Revolute("O", slider.ground, (0, 0), crank, (-0.06, 0)))
    slider.add(kc.AbsoluteAngle("motor", crank, 2 * kc.t))
    module = kc.compile(slider)
    report = kc.compare(slider, module.Phi, module.Phi_q, module.nu, module.gamma)
    assert report.verdict == "equal"
    report = kc.compare(slider, Phi_q=lambda q, t: module.Phi_q(q, t) * [1, 1, -1])
    # Its other entry decides that the angle's entry is wrong; the driver's row is a row sign.
    assert {entry.label for entry in report.different} == {
        "Phi_q[O.x, phi_crank]", "Phi_q[O.y, phi_crank]",
    }  # fmt: skip
    random = np.random.default_rng(4)
    states = {"q": random.normal(size=(5, 3)), "q_dot": random.normal(size=(5, 3)), "t": 0.3}
    gamma = module.gamma(states["q"], states["q_dot"], 0.3)
    assert kc.compare(slider, gamma=gamma, states=states).verdict == "equal"
    gamma[:, 0] += gamma[:, 1]
    assert [e.row for e in kc.compare(slider, gamma=gamma, states=states).different] == ["O.x"]


def test_dynamicsymbols_and_aliases() -> None:
    x, phi = sympy.Function("x")(kc.t), sympy.Function("phi")(kc.t)
    system = kc.ConstraintSystem("free", "x phi", [x - sympy.sin(phi), phi - 2 * kc.t])
    rate = phi.diff(kc.t)
    report = kc.compare(system, gamma=sympy.Matrix([-sympy.sin(phi) * rate**2, 0]))
    assert report.verdict == "equal"
    report = kc.compare(system, gamma="[-s*w^2; 0]", aliases={"w": "phid", "s": sympy.sin(phi)})
    assert report.verdict == "equal"


def test_that_a_reversed_rate_of_a_relative_angle_is_no_exchange_of_roles() -> None:
    report = kc.compare(REFERENCE, Phi_q=PHI_Q, nu=scaled(NU, {"A": -1}))
    assert [entry.label for entry in report.different] == ["nu[A]"]
