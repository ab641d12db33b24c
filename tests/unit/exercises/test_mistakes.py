"""Find the mistake: slips from the checker's catalogue, really wrong, in one entry, and marked."""

import json
import re
from pathlib import Path
from random import Random
from typing import Any

import pytest
import sympy
from click.testing import CliRunner

import kincompile as kc
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.fault import Kind
from kincompile.cli import cli
from kincompile.exercises import mistakes as drawing
from tests.unit.exercises.test_exercise import by_hand, read, rows_of

MODELS = ("inverted_slider_crank.toml", "problem_3_5_6.toml")


@pytest.fixture(scope="module", params=MODELS)
def kit(request: pytest.FixtureRequest) -> Any:
    return kc.exercise(read(request.param), 2, 3, mistakes=True)


@pytest.fixture
def folder(kit: Any, tmp_path: Path) -> Any:
    return kit.write(tmp_path / "kit")


def numbers(formula: Any, seed: int) -> float:
    """Return the number of a formula at a random state."""
    random = Random(seed)
    names = sorted(map(str, sympy.sympify(formula).free_symbols))
    values = {name: random.uniform(-2, 2) for name in ("t", *names)}
    return float(sympy.sympify(formula).subs(values))


def test_that_one_entry_is_wrong_and_shows_it(kit: Any) -> None:
    """Against derivatives by SymPy of each Phi, which the generator does not use."""
    for variant, slips in zip(kit.variants, kit.mistakes, strict=True):
        system = variant.system()
        assert len(slips) == 3
        for item in slips:
            numbers_in = {x for entry in item.rows.values() for x in entry.atoms(sympy.Float)}
            assert not any(float(x).is_integer() for x in numbers_in)  # 1.0 would catch the eye
            (first,) = (
                k for k, x in enumerate(system.constraints) if x.name == item.entry.constraint
            )
            start = system.row_offsets[first]
            rows = range(start, start + len(system.constraints[first].equation_names))
            wrong = []
            for row in rows:
                for column in range(len(system.coordinates)):
                    right, shown = by_hand(system, row, column), item.rows.get((row, column), 0)
                    apart = sympy.sympify(shown) - right
                    if max(abs(numbers(apart, k)) for k in range(3)) > 1e-9:
                        wrong.append((row, column))
                        assert abs(numbers(apart, 1)) > 1e-3 * abs(numbers(right, 1))
            assert wrong == [(item.entry.row, item.entry.column)]
            assert item.kind in vars(Kind).values()
            assert item.rows[wrong[0]].free_symbols


def test_that_students_have_slips_of_their_own(kit: Any) -> None:
    first, second = ([(x.entry.row, x.entry.column, x.text) for x in own] for own in kit.mistakes)
    assert first != second
    kinds = {item.kind for own in kit.mistakes for item in own}
    assert len(kinds) > 1


def test_that_slips_are_those_of_the_catalogue(monkeypatch: Any) -> None:
    """The generator has no list of its own: what the checker no longer knows is not drawn."""
    usual = TypedEntry.formulas

    def signs(entry: TypedEntry) -> Any:
        return (fault for fault in usual(entry) if fault.kind == Kind.SIGN)

    monkeypatch.setattr(TypedEntry, "formulas", signs)
    (found,) = kc.exercise(read("problem_3_5_6.toml"), 1, 5, mistakes=True).mistakes
    assert {item.kind for item in found} == {Kind.SIGN}
    monkeypatch.setattr(TypedEntry, "formulas", lambda entry: iter(()))
    with pytest.raises(kc.InputError, match="too few entries of Phi_q that vary"):
        kc.exercise(read("problem_3_5_6.toml"), 1, 5, mistakes=True)


def test_that_a_slip_too_small_to_be_seen_is_not_drawn(monkeypatch: Any) -> None:
    monkeypatch.setattr(drawing, "VISIBLE", 1e9)
    with pytest.raises(kc.InputError, match="no slip to find"):
        kc.exercise(read("problem_3_5_6.toml"), 1, 5, mistakes=True)


def fill(folder: Path, kit: Any, student: int, change: dict[str, str]) -> None:
    """Write a hand-in file: right answers, some of them changed."""
    system = kit.variants[student - 1].system()
    lines = ["# my answers"]
    for item in kit.mistakes[student - 1]:
        row, column = item.entry.row, item.entry.column
        place = f"{system.equations[row]}, {system.coordinates[column].name}"
        own = {item.place.name: place, item.entry.name: by_hand(system, row, column)}
        lines += [f"{name} = {change.get(name, answer)}" for name, answer in own.items()]
    path = folder / "students" / f"{student:02}" / "hand_in.txt"
    path.write_text("\n".join(lines), encoding="utf-8")


def test_that_right_answers_have_all_points(kit: Any, folder: Path) -> None:
    fill(folder, kit, 1, {})
    rows = rows_of(folder)
    assert (rows["01"]["points"], rows["01"]["of"], rows["01"]["reasons"]) == ("6", "6", "")
    assert rows["02"]["points"] == "0"


def test_that_a_wrong_place_and_the_slip_itself_are_named(kit: Any, folder: Path) -> None:
    system, (first, second, _) = kit.variants[0].system(), kit.mistakes[0]
    place = next(x for x in first.rows if x != (first.entry.row, first.entry.column))
    names = system.equations[place[0]], system.coordinates[place[1]].name
    fill(folder, kit, 1, {
        "P1": f"Phi_q[{names[0]}, {names[1]}]",
        "B2": str(second.rows[second.entry.row, second.entry.column]),
        "P3": "nowhere, \x1b[2J",
    })  # fmt: skip
    row = rows_of(folder)["01"]
    assert [row[x] for x in ("P1", "B1", "P2", "B2", "P3", "B3")] == list("011001")
    assert f"P1: {names[0]}, {names[1]} is right as it stands" in row["reasons"]
    assert re.search(
        r"P3: no entry of Phi_q of \w+: nowhere, \\x1b\[2J. Write an equation", row["reasons"]
    )
    assert re.search(
        r"B2: \w.*(sign|half|twice|stands|swapped|missing|what it should)", row["reasons"]
    )


def test_that_an_entry_may_be_named_by_its_body(folder: Path, kit: Any) -> None:
    system, (first, *_) = kit.variants[0].system(), kit.mistakes[0]
    name = system.coordinates[first.entry.column].name
    letter, _, body = name.partition("_")
    if body:  # of a mechanism
        fill(folder, kit, 1, {"P1": f"{system.equations[first.entry.row]}, {body}.{letter}"})
        assert rows_of(folder)["01"]["P1"] == "1"


def test_that_a_page_shows_the_slip_and_not_the_solution(kit: Any, folder: Path) -> None:
    page = (folder / "students" / "01" / "exercise.html").read_text(encoding="utf-8")
    solutions = (folder / "instructor" / "solutions.html").read_text(encoding="utf-8")
    assert "Find the mistake" in page
    assert "P1" in (folder / "students" / "01" / "hand_in.txt").read_text(encoding="utf-8")
    for item in kit.mistakes[0]:
        assert item.text in solutions
        assert item.text not in page


def test_that_the_key_has_the_blanks_of_each_student(kit: Any, folder: Path) -> None:
    path = folder / "instructor" / "blanks.json"
    key = json.loads(path.read_text())
    assert [item["name"] for item in key["blanks"]["02"]] == ["P1", "B1", "P2", "B2", "P3", "B3"]
    for wrong in ({**key, "blanks": {"01": key["blanks"]["01"]}}, {**key, "blanks": []}):
        path.write_text(json.dumps(wrong))
        with pytest.raises(kc.InputError, match="write the exercise again"):
            kc.mark(folder)


def test_the_command_and_that_a_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    model = Path(__file__).resolve().parents[3] / "examples" / "problem_3_5_6.toml"
    texts = []
    for name in ("a", "b"):
        out = ["-o", str(tmp_path / name), "--students", "2", "--seed", "4", "--mistakes"]
        result = CliRunner().invoke(cli, ["exercise", str(model), *out])
        assert result.exit_code == 0, result.output
        assert "2 students, 6 blanks" in result.output
        files = sorted(path for path in (tmp_path / name).rglob("*") if path.is_file())
        texts.append([path.read_bytes() for path in files])
    assert texts[0] == texts[1]
    assert len(texts[0]) == 8
