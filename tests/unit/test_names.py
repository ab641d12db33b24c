"""Naming rules, and names in messages."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli
from kincompile.errors import InputError, ModelError
from kincompile.model.bodies import Body
from kincompile.names import (
    listed,
    name_problem,
    rate,
    suggestion,
    unit_problem,
)


@pytest.mark.parametrize("name", ["a", "A1", "crank_2", "x_", "lambda", "None"])
def test_that_an_identifier_is_a_name(name: str) -> None:
    assert name_problem(name, "a parameter") is None


@pytest.mark.parametrize("name", ["", "1a", "_a", "a b", "é", "a.b", "a\n", None, 3, b"a"])
def test_that_anything_else_is_none(name: object) -> None:
    problem = name_problem(name, "a body")
    assert problem is not None
    assert problem.startswith(f"a body is named {name!r}: a name is")


def test_that_a_reserved_name_says_what_it_means() -> None:
    assert "t is time" in (name_problem("t", "a coordinate") or "")
    assert name_problem("t", "a body") is None


@pytest.mark.parametrize("unit", ["", "m", "rad/s", "m/s^2", "N·m", "kg*m**2", "°", "%", "1 / s"])
def test_that_a_unit_is_a_unit(unit: str) -> None:
    assert unit_problem(unit, "parameter 'L'") is None


@pytest.mark.parametrize("unit", ['"', "'", "\\", "m\n", "*/", "{{", None, 1])
def test_that_a_unit_cannot_end_a_text(unit: object) -> None:
    assert "the unit of parameter 'L' is" in (unit_problem(unit, "parameter 'L'") or "")


def test_that_rates_and_coordinates_have_one_name_everywhere() -> None:
    assert (rate("x_rod"), rate("x_rod", 2)) == ("x_rod_dot", "x_rod_ddot")
    assert Body("rod").coordinates == ("x_rod", "y_rod", "phi_rod")


def test_that_a_long_list_is_cut() -> None:
    assert listed([]) == "none"
    assert listed(["a", 2]) == "a, 2"
    assert listed(range(15)) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 3 more"
    assert listed("abcd", most=2) == "a, b and 2 more"


def test_that_a_close_name_is_suggested() -> None:
    assert suggestion("crnk", ["rod", "crank"]) == "; did you mean 'crank'?"
    assert suggestion("wheel", ["rod", "crank"]) == ""


TOML = 'kincompile = 1\nname = "m"\n'
HOSTILE = "\x1b]0;pwned\x07\u202e\u2028"


def test_that_a_message_holds_no_command_of_a_terminal(tmp_path: Path) -> None:
    files = {
        "key.toml": TOML + '"\\u001b]0;pwned\\u0007\\u202E" = 1\n',
        "key.json": '{"kincompile": 1, "name": "m", "constraints": [{"\\u001b]0;p\\u0007": 1}]}',
        "twice.json": '{"\\u001b]0;p\\u0007": 1, "\\u001b]0;p\\u0007": 2}',
        "name.toml": TOML.replace('"m"', '"\\u001b]0;pwned\\u0007"'),
        "unit.toml": TOML + 'length_unit = "\\u001b]0;pwned\\u0007"\n',
        "deep.toml": TOML + '"\\u001b".a.b.c.d.e = 1\n',
        f"path{HOSTILE}.toml": "a = ",
        f"path{HOSTILE}.py": "import nothing_of_this_name",
    }
    for name, content in files.items():
        path = tmp_path / name
        path.write_text(content, encoding="utf-8")
        with pytest.raises(ModelError) as caught:
            kc.read_model(path)
        assert all(ch.isprintable() or ch == "\n" for ch in str(caught.value)), name
        done = CliRunner().invoke(cli, ["inspect", str(path)])
        assert done.exit_code == 2
        assert all(ch.isprintable() or ch == "\n" for ch in done.output), name
    with pytest.raises(InputError, match=r"\\x1b\]0;pwned\\x07\\u202e\\u2028"):
        kc.read(tmp_path / f"missing{HOSTILE}.toml")


def test_that_a_name_has_a_length() -> None:
    assert name_problem("a" * 100, "a body") is None
    assert "has 101 characters" in str(name_problem("a" * 101, "a body"))
