"""Wrong Jacobians of public code, books and lecture notes: all are found, and named as their fix.

`tests/data/museum.json` has each with its source; what a sentence must say was read off the fix.
"""

import json
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from kincompile.checker.report import Report

MUSEUM = Path(__file__).resolve().parents[2] / "data" / "museum.json"
CASES: dict[str, dict[str, Any]] = {
    item["name"]: item for item in json.loads(MUSEUM.read_text(encoding="utf-8"))["cases"]
}

# One sentence about the quantity must hold all the words of one of the lists.
MEANT = {
    "relative_x_last_entry": [["sine and cosine are swapped"]],
    "rope_factor_two": [["derivative by r_i", "half"]],
    "rope_rate_forgotten": [["left zero"]],
    "cylinder_rate_factor": [["the length instead of its square"]],
    "revolute_gamma_xi_eta": [["xi and eta of s_j are swapped"]],
    "translational_gamma_zero": [["left zero"]],
    "slot_gamma_squares": [["(w_j^2 - w_i^2)^2 stands where (w_j - w_i)^2 belongs"]],
    "four_bar_gamma_sign": [["w_j^2 A_j s_j", "wrong sign"]],
    "revolute_entry_sign_book": [["term has the wrong sign"]],
    "four_bar_phi_sign_book": [["term has the wrong sign"]],
    "rolling_sign": [["entry has the wrong sign"]],
    "arm_about_the_origin": [["arm from the origin of the ground", "body's own"]],
    "wheel_leg_extra_factor": [["factor leg is too much"]],
    "prismatic_coriolis_book": [["term is counted half"]],
    "dual_quaternion_base": [["term has the wrong sign"]],
    "other_rate_in_a_term": [["u1 stands where u2 belongs"]],
    "floating_base_columns": [["columns of roll and yaw are exchanged"]],
    "angle_of_three_points": [["factor 1/sqrt((x1 - x3)**2 + (y1 - y3)**2) is missing"]],
    "prismatic_blocks_exchanged": [["blocks of bodies i and j are exchanged"]],
    "inverse_point_quaternion_book": [["e0_one", "wrong", "transposed"]],
    "falcon_leg_third_column": [["sin(theta2) stands where sin(theta3) belongs"]],
}


def compared(case: dict[str, Any], which: str) -> Report:
    names: dict[str, Any] = {}
    exec(case["model_text"], names)
    if "inputs" in case:
        names["model"] = kc.transmission(names["model"], case["inputs"], case["outputs"])
    report: Report = kc.compare(
        names["model"],
        **case[which],
        constraint=case.get("constraint"),
        conventions={"form": case["form"]} if case.get("form") else None,
    )
    return report


def test_that_every_case_has_a_meaning() -> None:
    assert set(MEANT) == set(CASES)


@pytest.mark.every(4)
@pytest.mark.parametrize("name", MEANT)
def test_that_a_case_of_the_museum_is_found_and_named_as_its_fix_says(name: str) -> None:
    case = CASES[name]
    right, wrong = compared(case, "right"), compared(case, "wrong")
    assert right.equal, right.to_text()
    assert not wrong.equal
    assert {entry.quantity for entry in wrong.different} == {case["quantity"]}
    texts = {item.text for entry in wrong.different for item in entry.diagnoses}
    assert any(all(word in text for word in words) for words in MEANT[name] for text in texts), (
        case["fault"],
        texts,
    )
    assert not any("no fault of the catalogue fits" in text for text in texts), texts
