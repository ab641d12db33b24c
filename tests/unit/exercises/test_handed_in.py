"""Hand-ins as students type them: one grammar, what is not read apart, rounded numbers by name."""

import csv
from io import StringIO
from pathlib import Path

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli
from kincompile.errors import KincompileError


def arm() -> kc.Mechanism:
    """Return a pendulum: Phi_q[pin.x, phi_arm] is -3.1875 sin(phi_arm), by hand."""
    m = kc.Mechanism("arm")
    arm = m.body("arm", guess=(3.1875, 0.0, 0.0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-3.1875, 0)))
    m.add(kc.AbsoluteAngle("turn", arm, kc.t))
    return m


MODEL = arm()


def is_equal(quantity: str, x: str, y: str) -> bool:
    """Return whether formulas are accepted for the rows of the pin."""
    rows = [["-1", "0", x], ["0", "-1", y]] if quantity == "Phi_q" else [x, y]
    return bool(kc.compare(MODEL, constraint="pin", **{quantity: rows}).equal)


@pytest.mark.parametrize(
    "text",
    [
        "3.1875 cos(phi_arm)", "3.1875cos(phi_arm)", "3,1875 cos(phi_arm)", "3.1875 Cos(phi_arm)",
        "3.1875(cos(phi_arm))", "(3.1875)(cos(phi_arm))",
        "6.375/2 cos(phi_arm)", "0 - -6,3750/2 cos(phi_arm)", "(6.375 /2 cos(phi_arm))",
        "6.375 cos(phi_arm)/2", r"3.1875 \cos{\left(\phi_{arm} \right)}", "3.1875 COS(phi_1)",
    ],
)  # fmt: skip
def test_that_a_right_entry_is_right_however_it_is_spelt(text: str) -> None:
    assert is_equal("Phi_q", "-3.1875 sin(phi_arm)", text)
    assert not is_equal("Phi_q", "-3.1875 sin(phi_arm)", text.replace("3", "4"))


@pytest.mark.parametrize(
    "text",
    [
        "3.1875 phi_arm_dot^2 {}(phi_arm)", "3.1875phi_arm_dot**2 {}(phi_arm)",
        r"3.1875 \phi_{{arm dot}}^{{2}} \{}{{\left(\phi_{{arm}} \right)}}",
        "3.1875 phi1d phi1d {}(phi1)",
    ],
)  # fmt: skip
def test_that_rates_are_read_as_sympy_and_people_write_them(text: str) -> None:
    assert is_equal("gamma", text.format("cos"), text.format("sin"))
    assert not is_equal("gamma", text.format("cos"), text.replace("3.1", "4.1").format("sin"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("3,125*cos(phi_arm)", "3,125 can be read in two ways; write 3.125 or 3125"),
        ("3.1875 cosd(phi_arm)", "cosd takes degrees"),
        ("phi_arm/2 cos(phi_arm)", r"a quotient before a product .* write \(a/b\)\*c"),
        ("3 + phi_arm^1/2 cos(phi_arm)", "a quotient before a product"),
        ("phi_arm^-1/2 cos(phi_arm)", "a quotient before a product"),
        ("1/2 phi_arm/3 cos(phi_arm)", "a quotient before a product"),
        ("1/2cos(phi_arm)", r"1/2 before a factor can be read as \(1/2\)\*c or 1/\(2\*c\)"),
        ("1,5/2phi_arm", r"write one of these, or a blank after 1,5/2 for the first"),
        ("phi_arm(3.1875)", "'phi_arm' is not a function.*; write \\* for a product"),
        ("3.1875 phi_arm (2)", "'phi_arm' is not a function"),
        ("3 1875 cos(phi_arm)", "found"),
        ("3.1875 cos phi_arm", "found"),
        ("1,2,3 cos(phi_arm)", "not allowed here"),
        ("3.1875.cos(phi_arm)", "calls nothing"),
        ("3.1875 cos(phi_arm) if 1 else 2", "not allowed here"),
    ],
)
def test_that_what_can_be_read_in_two_ways_is_refused(text: str, problem: str) -> None:
    with pytest.raises(KincompileError, match=problem):
        is_equal("Phi_q", "-3.1875 sin(phi_arm)", text)


def test_that_commas_between_arguments_stay() -> None:
    right = "3.1875 cos(phi_arm)"
    assert is_equal("Phi_q", "-3.1875 sin(phi_arm)", f"{right} + atan2(0,1)")
    assert not is_equal("Phi_q", "-3.1875 sin(phi_arm)", f"{right} + atan2(1,5)")
    assert not is_equal("Phi_q", "-3.1875 sin(phi_arm)", f"{right} + 0x1")  # x1 is a name


def marked(folder: Path, *options: str) -> dict[str, str]:
    """Return the line of the table that the command line prints."""
    done = CliRunner().invoke(cli, ["mark", str(folder), *options], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return next(csv.DictReader(StringIO(done.stdout)))


@pytest.mark.slow
def test_that_marks_say_what_was_rounded_and_what_cannot_be_read(tmp_path: Path) -> None:
    """The variant of this seed has the length 2.86875."""
    folder = kc.exercise(MODEL, 1, 1).write(tmp_path / "kit")
    path = folder / "students" / "01" / "hand_in.txt"
    hints = path.read_text(encoding="utf-8").split("\n\n")[0]
    assert "#   B1 = -0.25*sin(phi_arm)\n" in hints
    assert "#   B3 = -0.25*sin(phi_arm)*phi_arm_dot^2\n" in hints
    path.write_text(
        "B1 = -2.87 sin(phi_arm)\nB2 = 2,86875cos(phi_arm)\nB3 = 2.86875 cosd(phi_arm)\n"
        "B4 = -2.87 phi_arm_dot^2 sin(phi_arm)\n",
        encoding="utf-8",
    )
    row = marked(folder)
    assert [row[f"B{k}"] for k in (1, 2, 3, 4)] == ["0", "1", "?", "0"]
    assert "B1: 2.86875 was rounded to 2.87; else the entry is right" in row["reasons"]
    assert "B4" in row["reasons"]
    assert "B4: 2.86875 was rounded" not in row["reasons"]  # the sign is wrong too
    assert row["not read"].startswith("B3: cannot be read: 2.86875 cosd(phi_arm) (")
    row = marked(folder, "--tolerance", "0.001")
    assert [row[f"B{k}"] for k in (1, 2, 3, 4)] == ["1", "1", "?", "0"]
    assert [marked(folder, "--tolerance", "1e-5")[f"B{k}"] for k in (1, 2)] == ["0", "1"]
    with pytest.raises(kc.InputError, match=r"tolerance is nan; give one from 0 to 0\.1"):
        kc.mark(folder, tolerance=float("nan"))


def hand_in(folder: Path, *answers: str) -> Path:
    """Write the answers of the only student, and return the folder."""
    path = folder / "students" / "01" / "hand_in.txt"
    lines = [f"B{k} = {answer}\n" for k, answer in enumerate(answers, 1)]
    path.write_text("".join(lines), encoding="utf-8")
    return folder


def test_that_numbers_count_to_the_digits_asked_for(tmp_path: Path) -> None:
    """The length is 2.86875: 2.87 has three of its digits, 2.9 two, and 2.86 is no rounding."""
    folder = kc.exercise(MODEL, 1, 1).write(tmp_path / "kit")
    gamma = "{} phi_arm_dot^2 cos(phi_arm)"
    hand_in(folder, "-2.87 sin(phi_arm)", "2.9cos(phi_arm)", gamma.format("5.74/2"), "2.86")

    def points(*options: str) -> str:
        row = marked(folder, *options)
        return "".join(row[f"B{k}"] for k in (1, 2, 3, 4))

    assert points() == points("--digits", "4") == "0000"
    assert points("--digits", "3") == "1010"
    assert points("--digits", "2") == "1110"
    row = marked(folder, "--digits", "3")
    assert "B1: right to 3 digits: 2.87 stands for 2.86875" in row["reasons"]
    assert "B2: 2.86875 was rounded to 2.9; else the entry is right" in row["reasons"]
    assert "B3: right to 3 digits: 5.74 stands for 5.7375" in row["reasons"]
    assert row["points"] == "2"
    hand_in(folder, "-2.8700001 sin(phi_arm)", "2.863 cos(phi_arm)", "", "2.87 phi_arm_dot^2")
    assert points("--digits", "3") == "1000"


def test_that_digits_hide_no_slip(tmp_path: Path) -> None:
    """A term of a thousandth is a slip, though the value agrees to two digits everywhere."""
    folder = kc.exercise(MODEL, 1, 1).write(tmp_path / "kit")
    answers = (
        "-2.87 sin(phi_arm) + 0.001 cos(phi_arm)", "2.87 cos(1.001 phi_arm)",
        "2.87 phi_arm_dot^2 cos(phi_arm) + 1e-4", "-2.87 phi_arm_dot^2 sin(phi_arm)",
    )  # fmt: skip
    row = marked(hand_in(folder, *answers), "--digits", "2")
    assert [row[f"B{k}"] for k in (1, 2, 3, 4)] == ["0", "1", "0", "0"]
    assert "B2: right to 2 digits: 1.001 stands for 1 and 2.87 stands for 2.86875" in row["reasons"]


def test_that_a_divisor_that_is_fitted_to_zero_stops_no_marking(tmp_path: Path) -> None:
    """The entry is half of the right one: a step of Newton's method takes its 4 to 0."""
    folder = kc.exercise(MODEL, 1, 1).write(tmp_path / "kit")
    row = marked(hand_in(folder, "-5.7375 sin(phi_arm)/4", "2.86875 cos(phi_arm)"))
    assert [row[f"B{k}"] for k in (1, 2)] == ["0", "1"]


def test_that_digits_are_few_and_no_tolerance() -> None:
    for digits in (0, 7, 2.5, True):
        with pytest.raises(kc.InputError, match="give a number from 1 to 6"):
            kc.mark("nowhere", digits=digits)
    with pytest.raises(kc.InputError, match="both given; give one of them"):
        kc.mark("nowhere", digits=3, tolerance=0.1)


def test_that_a_reason_is_said_once(tmp_path: Path) -> None:
    folder = kc.exercise(MODEL, 1, 1).write(tmp_path / "kit")
    path = folder / "students" / "01" / "hand_in.txt"
    path.unlink()
    assert marked(folder)["reasons"] == "B1, B2, B3, B4: nothing handed in"
    path.write_text("B1 = wobble(phi_arm)\n", encoding="utf-8")
    row = marked(folder)
    assert row["reasons"] == "B2, B3, B4: not filled"
    assert "'wobble' is not a function" in row["not read"]
    assert "sinh" not in row["not read"]


def test_that_a_report_begins_its_end_with_what_is_accepted() -> None:
    gamma = ["3.1875 phi_arm_dot^2 cos(phi_arm)", "0"]
    report = kc.compare(MODEL, gamma=gamma, constraint="pin")
    assert report.to_text().endswith("Accepted: 1 of 2 entries.\nVerdict: different.\n")
    assert "Accepted: 1 of 2 entries." in report.to_html()
