"""Hand files: what is read, and what a bad one is told."""

import io
import json
import re
from pathlib import Path

import click.testing
import pytest
import rich.console
import sympy

import kincompile as kc
from kincompile.checker.hand_file import read_hand_file
from kincompile.cli import cli
from kincompile.errors import InputError
from tests.pendulum import pendulum

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT / "tests" / "data"
EXAMPLE = str(ROOT / "examples" / "problem_3_5_6.py")


@pytest.fixture(scope="module")
def system() -> kc.ConstraintSystem:
    model = kc.read_model(EXAMPLE)
    assert isinstance(model, kc.ConstraintSystem)
    return model


def texts(path: Path, quantity: str) -> list[list[str]]:
    return [[cell.text for cell in row] for row in read_hand_file(path).quantities[quantity]]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.toml", 'Phi_q = "[[1, 0], [cos(x) - 2, y^2]]"'),
        ("b.toml", "Phi_q = [[1, 0],\n  [cos(x) - 2, y^2]]"),
        ("c.toml", 'Phi_q = [[1, 0], ["cos(x) - 2", "y^2"]]'),
        ("d.toml", 'Phi_q = ["[1, 0]", "[cos(x) - 2, y^2]"]'),
        ("e.json", '{"Phi_q": [[1, 0], ["cos(x) - 2", "y^2"]]}'),
        ("f.json", '{"Phi_q": "[1 0; cos(x) - 2, y^2]"}'),
        ("g.m", "% by hand\nPhi_q = [1 0   # first\n  cos(x) - 2  y^2];"),
        ("h.txt", "Phi_q = [1, 0; ...\n cos(x) - 2, y^2]\n"),
        ("i.txt", 'Phi_q = """[[1, 0],\n\n[cos(x) - 2, y^2]]"""\n'),
        ("j.txt", "\ufeffPhi_q = [[1, 0]\r\n [cos(x) - 2, y^2]]"),
    ],
)
def test_that_people_may_write_a_matrix_as_they_are_used_to(
    tmp_path: Path, name: str, content: str
) -> None:
    (tmp_path / name).write_text(content, encoding="utf-8", newline="")
    assert texts(tmp_path / name, "Phi_q") == [["1", "0"], ["cos(x) - 2", "y^2"]]


def test_the_rule_for_blanks(tmp_path: Path) -> None:
    (tmp_path / "a.m").write_text("nu = [a - b  a -b  a-b  2 * c  sin(a + b)]")
    assert texts(tmp_path / "a.m", "nu") == [["a - b", "a", "-b", "a-b", "2 * c", "sin(a + b)"]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "Phi_q = [[1, 0, zeta],\n [0, 1, 0],\n [0, 0, 1]]",
         r"a.txt, Phi_q, line 1, column 17: .* no 'zeta'.*names are: x2, y2, phi3, t, and rates"),
        ("a.txt", "nu = [0; 0;\n  phi3dd]", r"line 2, column 3: 'phi3dd' cannot stand here: accel"),
        ("a.txt", "nu = [0; 0; phi_3]", r"did you mean 'phi3'"),
        ("a.txt", "Phi_q = [[1, 0, 0], [0, 1], [0, 0, 1]]", r"line 1: row 2 of Phi_q has 2"),
        ("a.txt", "Phi_q = [[1, 0], [0, 1], [0, 0]]", r"2 columns; expected 3"),
        ("a.txt", "nu = [0, 0]", r"nu has 2 rows; expected 3.*equation_1, equation_2"),
        ("a.txt", "nu = [0; 0; 0\ngamma = [0; 0; 0]", r"line 1, column 6: nu: this .* is never"),
        ("a.txt", "nu = [0; 0; (1 + 2]", r"line 1, column 19.*opened with '\('"),
        ("a.txt", "nu = [0, , 0]", r"line 1, column 10: nu: an element is missing"),
        ("a.txt", "nu = [0; 0; open('x')]", r"line 1, column 13.*not a function|character"),
        ("a.txt", "nu = [0; 0; x2.__class__]", r"an attribute"),
        ("a.txt", "import os\nnu = [0; 0; 0]", r"line 1, column 1: expected 'name = value'"),
        ("a.txt", "Phiq = [1]", r"no quantity 'Phiq'; did you mean 'Phi_q'"),
        ("a.txt", "nu = [0;0;0]\nnu = [0;0;0]", r"line 2, column 6: nu is given twice"),
        ("a.txt", "w = 3\n", r"compares nothing"),
        ("a.txt", "x2 = 3\nnu = [0;0;0]", r"alias 'x2': this name has a meaning"),
        ("a.txt", "w = zeta\nnu = [0;0;0]", r"alias 'w': line 1, column 5: there is no 'zeta'"),
        ("a.txt", "constraint = equation_9\nnu = [0]", r"no constraint 'equation_9'.*equation_1"),
        ("a.toml", 'nu = [0, 0, "x2 +"]', r"a.toml, nu, line 1, column 18"),
        ("a.toml", "nu = [true, 0, 0]", r"a truth value is not an element"),
        ("a.json", '{"nu": [0, 0,}', r"a.json, line 1: this is not JSON: .* column 14"),
        ("a.json", "[]", r"expected names and values"),
    ],
)  # fmt: skip
def test_that_a_bad_file_is_told_where_and_what(
    system: kc.ConstraintSystem,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    content: str,
    message: str,
) -> None:
    file = tmp_path / name
    file.write_text(content)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        kc.compare_file(system, file)
    assert [item.name for item in tmp_path.iterdir()] == [name]


def test_that_all_problems_come_at_once(system: kc.ConstraintSystem, tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("Phi_q = [[1, 0, zeta], [0, eta, 0], [0, 0, 1]]\nnu = [0; 0]\n")
    with pytest.raises(InputError) as caught:
        kc.compare_file(system, file)
    assert len(caught.value.problems) == 3


def test_a_missing_file_and_one_that_is_no_text(
    system: kc.ConstraintSystem, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="cannot read"):
        kc.compare_file(system, tmp_path / "none.toml")
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        kc.compare_file(system, tmp_path / "a.txt")


def test_what_the_function_refuses(system: kc.ConstraintSystem) -> None:
    with pytest.raises(InputError, match="nothing to compare"):
        kc.compare(system)
    with pytest.raises(InputError, match="'q'"):
        kc.compare(system, nu=[0, 0, 0], states={"time": 1})
    with pytest.raises(InputError, match="takes 1 arguments"):
        kc.compare(system, nu=lambda q: q)


def run(*arguments: str) -> click.testing.Result:
    return click.testing.CliRunner().invoke(cli, ["compare", EXAMPLE, *arguments])


def test_the_command_where_all_is_equal() -> None:
    result = run(str(DATA / "problem_3_5_6.toml"))
    assert result.exit_code == 0
    assert "Verdict: equal." in result.stdout


@pytest.mark.parametrize("option", ["--output", "--gradescope"])
def test_the_command_never_writes_over_what_it_compares(tmp_path: Path, option: str) -> None:
    hand = tmp_path / "hand.txt"
    hand.write_text("nu = [0, 0, 0]", encoding="utf-8")
    result = run(str(hand), option, str(hand))
    assert result.exit_code == 2
    assert result.stderr == f"Error: {hand} is the file to compare; give another name to write to\n"
    assert hand.read_text(encoding="utf-8") == "nu = [0, 0, 0]"


def test_the_command_where_something_differs(tmp_path: Path) -> None:
    hand = str(DATA / "problem_3_5_6.txt")
    result = run(hand)
    assert result.exit_code == 1
    assert "equation_1: written with the opposite sign." in result.stdout
    assert "gamma[equation_3]: different" in result.stdout
    assert "a term has the wrong sign" in result.stdout
    assert "y2_dot" not in result.stdout
    assert "right: " in run(hand, "--reveal").stdout

    names = [str(tmp_path / name) for name in ("a.html", "a.json", "results.json")]
    assert run(hand, "-o", names[0]).exit_code == 1
    assert run(hand, "-o", names[1], "--gradescope", names[2]).exit_code == 1
    page = Path(names[0]).read_text()
    assert "a term has the wrong sign" in page
    assert "For instance yours " in page
    assert "http" not in page
    data = json.loads(Path(names[1]).read_text())
    assert (data["verdict"], data["equal"]) == ("different", False)
    (entry,) = (item for item in data["entries"] if item["verdict"] == "different")
    assert (entry["row"], entry["generated"]) == ("equation_3", None)
    assert set(entry["difference"]["state"]) >= {"x2", "phi3_dot", "t"}
    tests = json.loads(Path(names[2]).read_text())["tests"]
    assert [item["name"] for item in tests if item["status"] == "failed"] == ["gamma, equation_3"]


def test_the_command_with_a_bad_file(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("nu = [zeta; 0; 0]")
    result = run(str(tmp_path / "a.txt"))
    assert result.exit_code == 2
    assert "there is no 'zeta'" in result.stderr
    assert run(str(DATA / "problem_3_5_6.toml"), "-o", "a.pdf").exit_code == 2


def test_what_a_report_shows_and_what_it_keeps(system: kc.ConstraintSystem) -> None:
    report = kc.compare_file(system, DATA / "problem_3_5_6.txt")
    screen = io.StringIO()
    rich.console.Console(file=screen, width=100, force_terminal=True).print(report.to_rich())
    assert "gamma[equation_3]" in screen.getvalue()
    assert "\x1b[1;31mdifferent" in screen.getvalue()  # bold and red
    (entry,) = report.different
    assert entry.generated == "-2*x2_dot**2 - 2*y2_dot**2 + 1/50"
    for form in (report.to_text, report.to_json, report.to_html, report.to_gradescope):
        assert entry.generated not in form()
        assert entry.generated in form(reveal=True)


def test_that_a_page_shows_what_was_written_and_does_not_obey_it() -> None:
    system = kc.ConstraintSystem("free", "x", [sympy.Symbol("x") - kc.t])
    report = kc.compare(system, gamma="[Piecewise((1, x<1), (2, True))]")
    assert "x&lt;1" in report.to_html()
    assert "x<1" not in report.to_html()


@pytest.mark.parametrize("text", ["{} = 1", "{}", "a{} = 3", "x = 1{}", "nu = [0, 0, 2*t] % {}"])
def test_that_no_control_character_of_a_file_is_passed_on(text: str, tmp_path: Path) -> None:
    path = tmp_path / "hand.txt"
    path.write_text(text.format("\x1b]0;pwned\x07\x1b[2J\x9b2J\x00"), encoding="utf-8")
    try:
        report = kc.compare_file(pendulum(), path)
        texts = [report.to_text(), report.to_html(), report.to_gradescope()]
    except kc.KincompileError as error:
        texts = [str(error)]
    for found in texts:
        assert not re.findall(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", found)
