"""Faults are called different and named, those typed by hand and all of the catalogue."""

from collections.abc import Iterator
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Components, Vector, VectorSymbol
from kincompile.checker.compare import compare
from kincompile.checker.comparison import Verdict
from kincompile.checker.fault import Kind
from kincompile.checker.joint_faults import JointFaults
from kincompile.checker.reference import Reference
from kincompile.checker.report import Report
from kincompile.checker.vectors import Exchanged
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.model.resolve import Joint
from kincompile.model.symbolic import SymbolicEnvironment

NUMBERS = {
    "a": 0.25, "b": -0.15, "c": -0.35, "d": 0.45, "e": 0.6, "f": 0.9, "g": -0.4, "h": 0.7,
    "reach": 2.0, "omega": 1.3, "R_i": 0.5, "R_j": 0.8, "theta_i": 0.2, "theta_j": -0.3,
    "k": 1.05, "l": 0.2,
}  # fmt: skip


def model() -> kc.Mechanism:
    """Return the five types of the catalogue, every attribute a parameter of its own."""
    m = kc.Mechanism("two_bodies")
    p = {name: m.parameter(name, value) for name, value in NUMBERS.items()}
    i, j = m.body("i", guess=(0.3, -0.7, 0.4)), m.body("j", guess=(1.1, 0.5, -0.9))
    s_i, s_j, v_i, v_j = (p["a"], p["b"]), (p["c"], p["d"]), (p["e"], p["f"]), (p["g"], p["h"])
    rod = p["reach"] + p["l"] * sympy.sin(p["omega"] * kc.t)
    angles = p["theta_i"], p["theta_j"]
    m.add(kc.Revolute("R", i, s_i, j, s_j))
    m.add(kc.Distance("D", i, s_i, j, s_j, rod))
    m.add(kc.Translational("T", i, s_i, v_i, j, s_j, v_j))
    m.add(kc.Gear("G", i, s_i, p["R_i"], angles[0], j, s_j, p["R_j"], angles[1]))
    m.add(kc.RackAndPinion("K", i, s_i, (p["k"], p["l"]), angles[0], j, s_j, p["R_j"], angles[1]))
    return m


MODEL = model()
REFERENCE = Reference(MODEL)
RIGHT = {name: getattr(MODEL, name) for name in ("Phi", "Phi_q", "nu", "gamma")}
ROW = {name: k for k, name in enumerate(REFERENCE.equations)}
COLUMN = {name: k for k, name in enumerate(REFERENCE.coordinates)}


def faulty(quantity: str, entries: dict[tuple[str, str] | str, str]) -> Report:
    """Compare the right formulas with some entries typed anew."""
    matrix = RIGHT[quantity].as_mutable()
    rows = [[str(item) for item in matrix.row(k)] for k in range(matrix.rows)]
    for place, text in entries.items():
        row, column = (place, "") if isinstance(place, str) else place
        rows[ROW[row]][COLUMN.get(column, 0)] = text
    # With gamma at hand a reversed nu is not a convention that both would follow.
    given = {"gamma": RIGHT["gamma"], quantity: rows}
    report: Report = compare(
        REFERENCE, **given, aliases={"w_i": "phi_id", "w_j": "phi_jd"}, strict=True
    )
    return report


def kinds(report: Report) -> set[str]:
    entries = [entry for entry in report.entries if entry.verdict is not Verdict.EQUAL]
    return {item.kind for entry in entries for item in entry.diagnoses}


S_I, C_I, S_J, C_J = "sin(phi_i)", "cos(phi_i)", "sin(phi_j)", "cos(phi_j)"
# -v_i^T B_ij v_j, but for its sign; the length of the rod, and its second derivative
TURNED = "(f*g - e*h)*cos(phi_j - phi_i) - (e*g + f*h)*sin(phi_j - phi_i)"
ROD, ROD_DDOT = "(reach + l*sin(omega*t))", "(-l*omega^2*sin(omega*t))"
BY_I = [("R.x", "phi_i"), ("R.y", "phi_i")]
BY_J = [("R.x", "phi_j"), ("R.y", "phi_j")]


def pair(places: list[tuple[str, str]], x: str, y: str) -> dict[Any, str]:
    return dict(zip(places, (x, y), strict=True))


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("quantity", "entries", "kind"),
    [
        # B_i s_i is (-a S - b C, a C - b S)
        ("Phi_q", pair(BY_I, f"a*{C_I} - b*{S_I}", f"a*{S_I} + b*{C_I}"), Kind.A_FOR_B),
        ("Phi_q", pair(BY_I, f"a*{S_I} - b*{C_I}", f"a*{C_I} + b*{S_I}"), Kind.TRANSPOSED),
        ("Phi_q", pair(BY_I, f"-a*{C_I} - b*{S_I}", f"a*{S_I} - b*{C_I}"), Kind.SINE_COSINE),
        ("Phi_q", pair(BY_I, f"-a*{S_J} - b*{C_J}", f"a*{C_J} - b*{S_J}"), "phi_i and phi_j mixed"),
        ("Phi_q", pair(BY_I, f"-c*{S_I} - d*{C_I}", f"c*{C_I} - d*{S_I}"), "s_i and s_j mixed"),
        ("Phi_q", pair(BY_I, f"-b*{S_I} - a*{C_I}", f"b*{C_I} - a*{S_I}"), "xi and eta swapped"),
        ("Phi_q", pair(BY_I, f"-a*{S_I} + b*{C_I}", f"-a*{C_I} - b*{S_I}"), Kind.TRANSPOSED),
        ("Phi_q", pair(BY_J, f"-c*{S_J} - d*{C_J}", f"c*{C_J} - d*{S_J}"), "sign"),
        ("Phi_q", {("R.x", "phi_i"): f"-a*{S_I} + b*{C_I}"}, "sign"),
        ("Phi_q", {("R.x", "phi_i"): f"-a*{S_I}"}, "missing term"),
        ("Phi_q", {("R.x", "phi_i"): f"-a*{C_I} - b*{C_I}"}, Kind.SINE_COSINE),
        ("Phi_q", {("R.x", "phi_i"): "0", ("R.y", "phi_i"): "0"}, "left zero"),
        ("Phi_q", {("D", "phi_i"): "0"}, "left zero"),
        ("Phi_q", {("D", "x_i"): str(RIGHT["Phi_q"][ROW["D"], 0] / 2)}, "factor 2 or 1/2"),
        ("Phi_q", {("T.normal", "x_j"): str(RIGHT["Phi_q"][ROW["T.normal"], 4]),
                   ("T.normal", "y_j"): str(RIGHT["Phi_q"][ROW["T.normal"], 3])}, Kind.X_AND_Y),
        ("Phi_q", {("D", name): str(RIGHT["Phi_q"][ROW["D"], (k + 3) % 6])
                   for k, name in enumerate(REFERENCE.coordinates)}, "body blocks swapped"),
        ("nu", {"D": str(-RIGHT["nu"][ROW["D"]])}, "driver's rate reversed"),
        ("nu", {"D": "0"}, "left zero"),
        ("gamma", {"R.x": f"(a*{C_I} - b*{S_I})*w_i - (c*{C_J} - d*{S_J})*w_j^2",
                   "R.y": f"(a*{S_I} + b*{C_I})*w_i - (c*{S_J} + d*{C_J})*w_j^2"},
         Kind.MISSING_SQUARE),
        ("gamma", {"R.x": f"-(a*{C_I} - b*{S_I})*w_i^2 + (c*{C_J} - d*{S_J})*w_j^2",
                   "R.y": f"-(a*{S_I} + b*{C_I})*w_i^2 + (c*{S_J} + d*{C_J})*w_j^2"}, "whole sign"),
        ("gamma", {"R.x": "0", "R.y": "0"}, "left zero"),
        ("gamma", {"D": f"{RIGHT['gamma'][ROW['D']]} - 2*{ROD}*{ROD_DDOT}"},
         Kind.SECOND_DERIVATIVE),
        ("gamma", {"T.parallel": f"-({TURNED})*(w_j^2 - w_i^2)"}, Kind.SQUARES),
    ],
)  # fmt: skip
def test_that_a_fault_typed_by_hand_is_named(
    quantity: str, entries: dict[Any, str], kind: str
) -> None:
    report = faulty(quantity, entries)
    assert report.verdict in (Verdict.DIFFERENT, Verdict.MANIFOLD)
    assert kind in kinds(report)


class Misread(SymbolicEnvironment):
    """A joint's leaves in SymPy, with what the catalogue calls xi and eta swapped."""

    def vector(self, symbol: VectorSymbol) -> Components:
        components = super().vector(VectorSymbol(symbol.name))
        return components[::-1] if isinstance(symbol, Exchanged) else components


def hypotheses(quantity: str) -> Iterator[tuple[str, dict[tuple[int, int], sympy.Expr]]]:
    """Yield a fault of each kind in each joint in SymPy, expanded apart from the catalogue."""
    for block in REFERENCE.blocks:
        joint = block.constraint
        assert isinstance(joint, Joint)
        expansion = Expansion(Misread(joint))
        row_blocks = derive(joint.template)
        coordinates = joint.template.coordinates
        seen: set[str] = set()
        for fault in JointFaults(joint, quantity, REFERENCE, REFERENCE.random).formulas():
            if fault.kind in seen:
                continue
            seen.add(fault.kind)
            entries = {}
            for (b, k), expression in fault.result.items():
                row = sum(2 if isinstance(item.Phi, Vector) else 1 for item in row_blocks[:b])
                column = sum(item.size for item in coordinates[:k])
                columns = [expansion.components(expression)]
                if quantity == "Phi_q":
                    whole = partials(joint.template)[b][k].columns(expression)
                    columns = [expansion.components(item) for item in whole]
                for c, items in enumerate(columns):
                    for r, item in enumerate(items):
                        entries[block.rows[row + r], column * (quantity == "Phi_q") + c] = item
            yield fault.kind, entries


def judged(quantity: str, entries: dict[tuple[int, int], Any]) -> Report:
    matrix = RIGHT[quantity].as_mutable()
    for place, item in entries.items():
        matrix[place] = item
    # Elsewhere a gamma that is right wherever the constraints hold is accepted, and has no name.
    is_strict = quantity == "gamma"
    report: Report = compare(REFERENCE, **{quantity: matrix}, strict=is_strict)
    return report


def tally(quantity: str) -> dict[str, int]:
    """Count how the hypotheses are judged."""
    counts = dict.fromkeys(("all", "right", "forgiven", "manifold", "unique", "tie", "missed"), 0)
    for kind, entries in hypotheses(quantity):
        report = judged(quantity, entries)
        if report.verdict is Verdict.EQUAL:
            counts["right"] += 1  # this slip makes no difference in this joint
            continue
        counts["all"] += 1
        counts["forgiven"] += report.verdict is Verdict.CONVENTION
        counts["manifold"] += report.verdict is Verdict.MANIFOLD
        named = kinds(report)
        counts["unique"] += named == {kind}
        counts["tie"] += kind in named and len(named) > 1
        # Entries that are all zero have one name, whatever led to them.
        counts["missed"] += kind not in named and named != {"left zero"}
    return counts


# One of each kind in each joint, of four thousand.
@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["Phi_q", "gamma"])
def test_that_single_faults_are_called_different_and_named(quantity: str) -> None:
    counts = tally(quantity)
    assert counts["all"] >= 40
    assert counts["forgiven"] == 0
    assert counts["missed"] == 0
    assert counts["unique"] >= 0.8 * counts["all"]
