"""Exercises: variants that assemble, pages without solutions, marks that are right both ways."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker.compare import compare
from kincompile.exercises import kit as kits
from kincompile.exercises import marking
from kincompile.exercises import variants as drawing
from kincompile.model.catalogue import CONSTRAINTS

ROOT = Path(__file__).resolve().parents[3]


def read(name: str) -> Any:
    """Return one of the ready exercises."""
    return kc.read_model(ROOT / "examples" / name)


def ready() -> list[str]:
    """Return the models that docs/exercises.md lists."""
    text = (ROOT / "docs" / "exercises.md").read_text(encoding="utf-8")
    return re.findall(r"`examples/([\w/]+\.toml)`", text)


def by_hand(system: Any, row: int, column: int | None) -> Any:
    """Return an entry by SymPy alone, from Phi: the oracle that the kit does not use."""
    q = [sympy.Symbol(item.name) for item in system.coordinates]
    q_dot = [sympy.Symbol(f"{item.name}_dot") for item in system.coordinates]
    Phi = system.Phi[row]
    if column is not None:
        return Phi.diff(q[column])
    velocity = sum(Phi.diff(x) * rate for x, rate in zip(q, q_dot, strict=True))
    total = sum(velocity.diff(x) * rate for x, rate in zip(q, q_dot, strict=True))
    return -(total + 2 * velocity.diff(kc.t) + Phi.diff(kc.t, 2))


def fill(folder: Path, student: str, change: dict[str, Any]) -> None:
    """Write the hand-in file of a student: right answers, some of them changed."""
    system = kc.read(folder / "instructor" / "models" / f"{student}.toml").system()
    blanks = json.loads((folder / "instructor" / "blanks.json").read_text())["blanks"][student]
    lines = ["# my answers"]
    for item in blanks:
        answer = by_hand(system, item["row"], item["column"])
        lines.append(f"{item['name']} = {change.get(item['name'], lambda x: x)(answer)}")
    (folder / "students" / student / "hand_in.txt").write_text("\n".join(lines), encoding="utf-8")


def rows_of(folder: Path) -> dict[str, dict[str, str]]:
    """Return the lines of the table of marks by student."""
    table = csv.DictReader(StringIO(kc.mark(folder).to_csv()))
    return {row["student"]: row for row in table}


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a written exercise with four students."""
    folder = tmp_path_factory.mktemp("kit") / "four_bar"
    kc.exercise(read("four_bar.toml"), 4, 3, signs=True).write(folder)
    return folder


def test_that_the_ready_exercises_have_every_type_of_constraint() -> None:
    found = {type(item) for name in ready() for item in read(name).constraints}
    assert set(CONSTRAINTS.values()) <= found


@pytest.mark.parametrize("name", ready())
@pytest.mark.slow
def test_that_variants_of_a_ready_exercise_assemble_and_differ(name: str) -> None:
    made = kc.exercise(read(name), 2, 5, signs=True, lengths=True)
    texts = set()
    for variant in made.variants:
        solution = kc.solve(kc.compile(variant), np.linspace(0, variant.end, 40))
        assert solution.success, solution.message
        assert not variant.parameters
        texts.add(variant.to_toml())
    assert len(texts) == 2
    quantities = {item.quantity for item in made.blanks[0]}
    # The follower never turns, and gamma of the contact is too long to be asked for.
    assert quantities == ({"Phi_q"} if name == "cam_flat_follower.toml" else {"Phi_q", "gamma"})
    system = made.variants[0].system()
    for item in made.blanks[0]:  # what is asked for varies, and is no riddle
        answer = item.answer(system.Phi_q, system.gamma)
        assert answer.free_symbols
        assert sympy.count_ops(answer) <= 100


IN_SHORT = ("inverted_slider_crank.toml", "gear_train.toml", "exercises/relative_constraints.toml")


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=() if x in IN_SHORT else pytest.mark.slow) for x in ready()]
)
@pytest.mark.slow
def test_that_right_answers_have_all_points(name: str, tmp_path: Path) -> None:
    folder = kc.exercise(read(name), 1, 2, signs=True).write(tmp_path / "kit")
    fill(folder, "01", {})
    row = rows_of(folder)["01"]
    assert (row["points"], row["reasons"]) == (row["of"], "")


def test_that_frames_that_are_turned_change_signs_and_not_the_motion() -> None:
    model = read("inverted_slider_crank.toml")
    plain = kc.exercise(model, 6, 1).variants
    turned = kc.exercise(model, 6, 1, signs=True).variants
    points = [[item.constraints[1].point_i for item in made] for made in (plain, turned)]
    assert all(x >= 0 for x, _ in points[0])
    assert any(x < 0 for x, _ in points[1])


def test_that_an_end_that_is_an_expression_is_that_of_the_variant() -> None:
    (made,) = kc.exercise(read("swing_and_dwell.toml"), 1, 1).variants
    model = read("swing_and_dwell.toml")
    assert 0.5 * model.end < made.end < 1.5 * model.end
    assert isinstance(made.end_given, float)


def test_that_an_overconstrained_model_is_refused_by_name(monkeypatch: Any) -> None:
    monkeypatch.setattr(drawing, "_drawn", None)  # no variant is drawn
    with pytest.raises(kc.InputError, match=r"bennett is overconstrained.*replace the Revolute"):
        kc.exercise(read("space/bennett.toml"))


def test_that_a_variant_keeps_masses_forces_points_and_outputs() -> None:
    """The frame of a body is a matter of convention: turned by half a turn, it changes no force."""
    m = kc.Mechanism("swing", end=1)
    a = m.parameter("a", 2.0)
    crank = m.body("crank", (1, 0, 0.4), mass=3, inertia=a, centre=(a / 20, 0))
    rod = m.body("rod", (3, 1, 0), mass=a, inertia=1, centre=(0.2, 0.1))
    m.gravity = (0, -9.81)
    foot = m.point("foot", rod, (a / 4, 0.3))
    m.output("height", foot.y + a)
    m.add(kc.Revolute("O", crank, (-1, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("A", crank, (1, 0), rod, (-a, 0)))
    m.add(kc.AbsoluteY("guide", rod, (a, 0), 0))
    m.add(kc.AbsoluteAngle("motor", crank, 0.4 + kc.t))
    m.add(kc.Spring("spring", foot, m.ground, (1, 3), stiffness=7 * a, free_length=1))
    values = (("a", 2.0),)
    change = drawing.Change(values, (("ground", 1.0), ("crank", 1.0), ("rod", 1.0)), ("rod",))
    made = drawing.VariantBuilder(m, change).mechanism()
    assert not made.parameters
    assert made.bodies[1].centre == (-0.2, -0.1)
    wanted, found = (kc.forces(kc.solve(kc.compile(x), np.linspace(0, 1, 5))) for x in (m, made))
    for name in ("motor.drive", "x_foot", "height"):
        np.testing.assert_allclose(found.motion[name], wanted.motion[name], rtol=1e-9, err_msg=name)


def test_that_a_model_without_parameters_varies_in_its_lengths() -> None:
    made = kc.exercise(read("slider_crank.toml"), 3, 1).variants
    assert len({str(item.constraints[1].point_i) for item in made}) > 1


def test_that_a_wrong_sign_costs_its_blank_and_is_named(four_bar: Path) -> None:
    fill(four_bar, "01", {"B2": lambda x: -x, "B8": lambda x: -x})
    row = rows_of(four_bar)["01"]
    assert [name for name in row if name.startswith("B") and row[name] == "0"] == ["B2", "B8"]
    assert row["points"] == str(int(row["of"]) - 2)
    for name in ("B2", "B8"):
        assert re.search(rf"\b{name}(, B\d)?: [^;]*wrong sign", row["reasons"]), row["reasons"]


def test_that_all_signs_wrong_is_no_convention(four_bar: Path) -> None:
    fill(four_bar, "02", {f"B{k}": lambda x: -x for k in range(1, 10)})
    assert rows_of(four_bar)["02"]["points"] == "0"


def test_that_the_sign_of_a_whole_row_is_that_of_the_given_constraint(tmp_path: Path) -> None:
    m = kc.Mechanism("tethered")
    plate = m.body("plate", guess=(1.0, 1.2, 0.0))
    m.add(kc.AbsoluteDistance("rod", plate, (-0.3, 0.2), (0, 0), 1.5))
    m.add(kc.AbsoluteX("push", plate, (0.2, 0.1), 1.2 + kc.t / 10))
    m.add(kc.AbsoluteAngle("turn", plate, kc.t / 2))
    folder = kc.exercise(m, 1, 1).write(tmp_path / "kit")
    blanks = json.loads((folder / "instructor" / "blanks.json").read_text())["blanks"]["01"]
    rod = [item["name"] for item in blanks if item["constraint"] == "rod"]
    assert len(rod) == 4  # the whole row of Phi_q, and gamma
    fill(folder, "01", {name: (lambda x: -x) for name in rod})
    row = rows_of(folder)["01"]
    assert [row[name] for name in rod] == ["0"] * 4


def test_that_another_form_of_an_answer_is_right(four_bar: Path) -> None:
    fill(four_bar, "03", {"B1": lambda x: f"({x})*(cos(1)^2 + sin(1)^2)", "B3": sympy.factor})
    row = rows_of(four_bar)["03"]
    assert row["points"] == row["of"]


def test_that_what_cannot_be_read_costs_its_own_blank(four_bar: Path) -> None:
    change = {
        "B1": lambda _: "__import__('os').system('true')", "B4": lambda _: "sin(",
        "B5": lambda _: "", "B9": lambda _: "wobble",
    }  # fmt: skip
    fill(four_bar, "04", change)
    row = rows_of(four_bar)["04"]
    assert [row[f"B{k}"] for k in range(1, 10)] == list("?11?0111?")
    for part in ("B1: cannot be read", "B4: cannot be read: sin( (", "wobble"):
        assert part in row["not read"]
    assert row["reasons"] == "B5: not filled"


@pytest.mark.slow
def test_that_what_surrounds_an_answer_does_not_matter(four_bar: Path) -> None:
    fill(four_bar, "03", {"B1": lambda x: f"{x};", "B2": lambda x: f"{x}  % from the page"})
    path = four_bar / "students" / "03" / "hand_in.txt"
    path.write_text(path.read_text(encoding="utf-8").replace("B", "b"), encoding="utf-8")
    assert rows_of(four_bar)["03"]["points"] == "9"


@pytest.mark.slow
def test_that_a_line_that_is_not_read_is_told(four_bar: Path) -> None:
    fill(four_bar, "04", {"B9": lambda _: "1 +"})
    path = four_bar / "students" / "04" / "hand_in.txt"
    text = path.read_text(encoding="utf-8").replace("B2 =", "B2:")
    path.write_text(f"{text}\nB4 = 0\n", encoding="utf-8")
    row = rows_of(four_bar)["04"]
    assert [row[f"B{k}"] for k in range(1, 10)] == list("1?1?1111?")
    for part in ("B2: not read, for there is no = sign: B2:", "B4: filled more than once"):
        assert part in row["not read"]
    assert "row 1, column" not in row["not read"]  # of a matrix that no student has seen


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "nothing handed in"),
        (b"\xff\xfe\x00", "not text in UTF-8"),
        (b"B1 = 1\n" * 20_000, "more than 100,000 bytes"),
        (b"B1 = " + b" ;" * 45_000 + b"x", "cannot be read"),
        (b"", "not filled"),
    ],
)
def test_that_a_hand_in_file_that_is_no_hand_in_has_no_points(
    four_bar: Path, content: bytes | None, reason: str
) -> None:
    path = four_bar / "students" / "02" / "hand_in.txt"
    path.unlink(missing_ok=True)
    if content is not None:
        path.write_bytes(content)
    row = rows_of(four_bar)["02"]
    assert row["points"] == "0"
    assert reason in row["not read" if reason == "cannot be read" else "reasons"]
    assert row["reasons"].count("B9") == 1
    assert row["reasons"].count("nothing handed in") <= 1


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="links and pipes are those of POSIX")
def test_that_what_is_no_file_of_ones_own_is_not_read(four_bar: Path) -> None:
    path = four_bar / "students" / "02" / "hand_in.txt"
    neighbour = four_bar / "students" / "01" / "hand_in.txt"

    def sparse() -> None:
        path.touch()
        os.truncate(path, 20 * 2**30)

    makers = (
        (sparse, "more than 100,000 bytes"),
        (lambda: path.symlink_to(neighbour), "it is a link"),
        (lambda: os.mkfifo(path), "B9: cannot read hand_in.txt: it is a pipe or a device; save"),
        (path.mkdir, "a folder"),
    )
    for make, reason in makers:
        path.unlink(missing_ok=True)
        make()
        row = rows_of(four_bar)["02"]
        assert (row["points"], reason in row["reasons"]) == ("0", True), row["reasons"]
    path.rmdir()


@pytest.mark.slow
def test_that_one_student_does_not_stop_the_others(four_bar: Path, monkeypatch: Any) -> None:
    fill(four_bar, "01", {})
    fill(four_bar, "02", {})
    usual = compare

    def endless(reference: Any, **given: Any) -> Any:
        while "endless" in str(given):
            pass
        return usual(reference, **given)

    monkeypatch.setattr(marking, "compare", endless)
    monkeypatch.setattr(marking, "SECONDS", 1)
    fill(four_bar, "01", {"B1": lambda _: "endless"})
    rows = rows_of(four_bar)
    assert (rows["01"]["points"], rows["02"]["points"]) == ("0", "9")
    assert "took more than 1 s or 2 GB" in rows["01"]["reasons"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others set no such limit")
def test_that_a_student_who_takes_too_much_memory_has_no_points(
    four_bar: Path, monkeypatch: Any
) -> None:
    usual = compare

    def large(reference: Any, **given: Any) -> Any:
        if "large" in str(given):
            bytearray(2 * marking.MOST_MEMORY)
        return usual(reference, **given)

    monkeypatch.setattr(marking, "compare", large)
    fill(four_bar, "01", {"B1": lambda _: "large"})
    fill(four_bar, "02", {})
    rows = rows_of(four_bar)
    assert (rows["01"]["points"], rows["02"]["points"]) == ("0", "9")
    assert "or 2 GB" in rows["01"]["reasons"]


@pytest.mark.parametrize("has_processes", [True, False])
def test_that_a_student_whose_marking_breaks_is_not_marked_again(
    four_bar: Path, monkeypatch: Any, tmp_path: Path, has_processes: bool
) -> None:
    """Neither is done again without a budget, nor is it called too slow."""
    log = tmp_path / "log"
    fill(four_bar, "01", {})

    def fails(reference: Any, **given: Any) -> Any:
        with log.open("a") as stream:
            stream.write(f"{os.getpid()}\n")
        raise error

    monkeypatch.setattr(marking, "compare", fails)
    if not has_processes:
        monkeypatch.delattr(os, "fork")
    error: Exception = RecursionError("maximum recursion depth exceeded")
    reasons = rows_of(four_bar)["01"]["reasons"]
    assert "B9: stopped: a formula is nested too deeply; write shorter formulas" in reasons
    error = KeyError("wobble")
    with pytest.raises(kc.InternalError, match="marking ended by KeyError: 'wobble'") as caught:
        kc.mark(four_bar)
    assert "in fails" in caught.value.__notes__[0]
    assert (str(os.getpid()) in log.read_text().split()) != has_processes
    damaged = shutil.copytree(four_bar, tmp_path / "damaged")
    (damaged / "instructor" / "models" / "01.toml").write_text("wobble = 1")
    with pytest.raises(kc.InputError, match=r"01\.toml, line 1: this is not a model"):
        kc.mark(damaged)


def test_that_a_reason_commands_no_terminal_and_no_spreadsheet(four_bar: Path) -> None:
    fill(four_bar, "01", {})
    path = four_bar / "students" / "01" / "hand_in.txt"
    path.write_text("B1 \x1b]0;pwned\x07 x\nB2 = \x1b[2J\nB3 = =1+1\n", encoding="utf-8")
    table = kc.mark(four_bar).to_csv()
    assert "\x1b" not in table
    assert "\\x1b]0;pwned" in table
    cells = [cell for row in rows_of(four_bar).values() for cell in row.values()]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@"))]


@pytest.mark.slow
def test_that_zeros_have_no_points(four_bar: Path) -> None:
    a = "phi_crank"
    zero = {
        "01": f"7 + 1e15*sin(2*{a}) - 2e15*sin({a})*cos({a})",
        "02": f"1.234e9*sin(2*{a}) - 2.468e9*sin({a})*cos({a})",
    }
    for student, text in zero.items():
        fill(four_bar, student, {f"B{k}": lambda _, text=text: text for k in range(1, 10)})
    rows = rows_of(four_bar)
    assert [rows[student]["points"] for student in zero] == ["0", "0"]
    assert "cannot be decided" in rows["01"]["reasons"]


def test_that_a_page_has_hints_and_no_solution(four_bar: Path) -> None:
    page = (four_bar / "students" / "01" / "exercise.html").read_text(encoding="utf-8")
    assert page.count("Hint 1:") == page.count("Hint 2:") == page.count("Hint 3:") > 3
    assert '<svg class="figure"' in page
    assert "script" not in page
    assert sorted(item.name for item in (four_bar / "students" / "01").iterdir()) == [
        "exercise.html", "hand_in.txt",
    ]  # fmt: skip
    solutions = (four_bar / "instructor" / "solutions.html").read_text(encoding="utf-8")
    lines = re.findall(r"<td>B1</td><td>.*?</td><td>(<math>.*?</math>)</td>", solutions)
    assert len(lines) == 4
    assert lines[0] not in page


@pytest.mark.slow
def test_that_the_same_seed_gives_the_same_bytes_and_another_other_ones() -> None:
    model = read("four_bar.toml")
    first = kc.exercise(model, 2, 8, signs=True).files()
    assert kc.exercise(model, 2, 8, signs=True).files() == first
    assert kc.exercise(model, 2, 9, signs=True).files() != first
    of_all = "solutions.html", "blanks.json"  # of the whole class
    one = kc.exercise(model, 1, 8, signs=True).files().items()
    assert {item for item in one if not item[0].endswith(of_all)} <= first.items()


@pytest.mark.slow
def test_that_bytes_do_not_depend_on_the_order_of_sets(tmp_path: Path) -> None:
    program = (
        "import sys, hashlib, kincompile as kc\n"
        "files = kc.exercise(kc.read_model(sys.argv[1]), 2, 4, signs=True).files()\n"
        "print(hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest())\n"
    )
    found = set()
    for value in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": value}
        model = str(ROOT / "examples" / "shaper.toml")
        done = subprocess.run(
            [sys.executable, "-c", program, model],
            env=environment, cwd=tmp_path, capture_output=True, text=True, check=True,
        )  # fmt: skip
        found.add(done.stdout)
    assert len(found) == 1


def test_that_a_kit_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: Any) -> None:
    made = kc.exercise(read("four_bar.toml"), 2)
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "hand_in.txt").write_text("precious", encoding="utf-8")
    with pytest.raises(kc.InputError, match="old exists: name a new folder"):
        made.write(tmp_path / "old")
    with pytest.raises(kc.InputError, match=r"the folder .*nowhere does not exist"):
        made.write(tmp_path / "nowhere" / "kit")

    def broken(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kits, "as_html", broken)
    with pytest.raises(kc.InputError, match="No space left on device"):
        made.write(tmp_path / "kit")
    assert sorted(item.name for item in tmp_path.iterdir()) == ["old"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: kc.exercise(read("problem_3_5_6.toml")), "no mechanism of bodies and joints"),
        (lambda: kc.exercise(read("four_bar.toml"), 0), "0 students: give a number from 1 to 500"),
        (lambda: kc.exercise(still()), "no variant was found for student 1"),
        (lambda: kc.exercise(prescribed()), "no joint whose Phi_q or gamma varies"),
    ],
)
@pytest.mark.slow
def test_that_a_model_that_makes_no_exercise_is_refused(make: Any, message: str) -> None:
    with pytest.raises(kc.InputError, match=message):
        make()


def still() -> kc.Mechanism:
    """Return a mechanism that cannot move as far as it is driven."""
    m = kc.Mechanism("still", end=3.0)
    arm = m.body("arm", guess=(1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (-1, 0)))
    m.add(kc.AbsoluteX("push", arm, (0, 0), 0.5 + kc.t))
    return m


def prescribed() -> kc.Mechanism:
    """Return a mechanism without a rotation in its constraints."""
    m = kc.Mechanism("prescribed")
    arm = m.body("arm")
    m.add(kc.AbsoluteX("x", arm, (0, 0), kc.t))
    m.add(kc.AbsoluteY("y", arm, (0, 0), 1))
    m.add(kc.AbsoluteAngle("phi", arm, 1))
    return m


@pytest.mark.parametrize(
    "content", [None, "[]", "{", '{"blanks": 3}', '{"format": 9, "blanks": []}']
)
def test_that_a_folder_that_is_no_exercise_is_refused(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "instructor").mkdir()
        (tmp_path / "instructor" / "blanks.json").write_text(content, encoding="utf-8")
    with pytest.raises(kc.InputError, match=r"no exercise|not the key|format 9"):
        kc.mark(tmp_path)


@pytest.mark.slow
def test_that_a_mechanism_in_space_makes_an_exercise(tmp_path: Path) -> None:
    """Entries in Euler parameters; right answers have all points, a wrong sign costs its own."""
    model, folder = read("space/rssr.toml"), tmp_path / "kit"
    made = kc.exercise(model, 2, 1, signs=True, lengths=True)
    made.write(folder)
    assert len({item.to_toml() for item in made.variants}) == 2
    page = (folder / "students/01/exercise.html").read_text(encoding="utf-8")
    assert "Euler parameters" in page
    assert "sines and cosines" not in page
    fill(folder, "01", {})
    fill(folder, "02", {"B2": lambda x: -x})
    rows = rows_of(folder)
    assert rows["01"]["points"] == rows["01"]["of"]
    assert int(rows["02"]["points"]) == int(rows["02"]["of"]) - 1
    assert rows["02"]["B2"] == "0"
