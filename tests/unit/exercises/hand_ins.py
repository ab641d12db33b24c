"""300 right and 300 wrong answers of the corpora as hand-ins of an exercise, some in each."""

import json
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from kincompile.exercises.blanks import is_fair
from tests.unit.compare.conftest import ADD, mechanism

CORPORA = Path(__file__).resolve().parents[2] / "corpora"
FORMS = (
    "multiplied out", "half angles", "half-angle tangents", "complex exponentials",
    "bodies by number", "coordinates by number", "Greek letters, dots and superscripts",
)  # fmt: skip
FAST = "AbsoluteX", "AbsoluteY", "RelativeX", "RelativeY", "RelativeAngle", "AbsoluteAngle"
WANTED = 300

SYSTEMS = {kind: mechanism(kind).system() for kind in ADD}


class Answer(NamedTuple):
    """What is typed for an entry."""

    quantity: str
    row: int
    column: int | None
    text: str


def cells(text: str) -> list[str]:
    """Return the parts between commas that stand in no brackets."""
    found, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and not depth:
            found.append("")
        else:
            found[-1] += letter
    return [item.strip() for item in found]


def entries(kind: str, quantity: str, text: str) -> Iterator[Answer]:
    """Yield the entries of a matrix as text that an exercise would ask for."""
    right = getattr(SYSTEMS[kind], quantity)
    for row, line in enumerate(cells(text.strip()[1:-1])):
        for column, entry in enumerate(cells(line[1:-1])):
            if is_fair(right[row, column]):
                yield Answer(quantity, row, column if quantity == "Phi_q" else None, entry)


def answers(corpus: str) -> Any:
    return tomllib.loads((CORPORA / f"{corpus}.toml").read_text(encoding="utf-8"))["answer"]


def right_hand_ins() -> Iterator[tuple[str, list[Answer]]]:
    for item in answers("right_answers"):
        if item["form"] in FORMS and not {"convention", "given_as"} & item.keys():
            given = [x for x in ("Phi_q", "gamma") if x in item]
            yield item["model"], [y for x in given for y in entries(item["model"], x, item[x])]


def wrong_hand_ins() -> Iterator[tuple[str, list[Answer]]]:
    """Yield a fault in each entry of every mechanism, then more of those that are marked fast."""
    places: dict[str, Any] = defaultdict(lambda: defaultdict(dict))
    for item in answers("single_faults"):
        kind, quantity = item["model"], item["quantity"]
        if quantity not in ("Phi_q", "gamma") or len(item["entries"]) > 1:
            continue
        ((row, column, text),) = item["entries"]
        if getattr(SYSTEMS[kind], quantity)[row, column] != 0:
            place = quantity, row, column if quantity == "Phi_q" else None
            places[kind][place][text] = Answer(*place, text)
    lists = {kind: [list(x.values()) for x in own.values()] for kind, own in places.items()}
    yield from ((kind, [found[0] for found in own]) for kind, own in lists.items())
    for kind in (*FAST, *(x for x in lists if x not in FAST)):
        for k in range(1, max(map(len, lists[kind]))):
            yield kind, [found[k] for found in lists[kind] if len(found) > k]


def first(hand_ins: Iterator[tuple[str, list[Answer]]]) -> Iterator[tuple[str, list[Answer]]]:
    """Yield hand-ins with as many answers as are wanted."""
    left = WANTED
    for kind, own in hand_ins:
        if own and left:
            yield kind, own[:left]
            left -= len(own[:left])
    assert not left


def write(folder: Path) -> dict[str, int]:
    """Write the exercise; return the points of each answer of a sheet, 1 or 0, by sheets."""
    right = [(*item, 1) for item in first(right_hand_ins())]
    wrong = [(*item, 0) for item in first(wrong_hand_ins())]
    (folder / "instructor" / "models").mkdir(parents=True)
    models = {kind: system.to_toml() for kind, system in SYSTEMS.items()}
    blanks: dict[str, Any] = {}
    points = {}
    for number, (kind, own, worth) in enumerate([*right, *wrong], 1):
        sheet = f"{number:03}"
        model = folder / "instructor" / "models" / f"{sheet}.toml"
        model.write_text(models[kind], encoding="utf-8")
        blanks[sheet] = [
            {"name": f"B{k}", "constraint": "K", "quantity": x.quantity, "row": x.row,
             "column": x.column, "question": ""}
            for k, x in enumerate(own, 1)
        ]  # fmt: skip
        path = folder / "students" / sheet / "hand_in.txt"
        path.parent.mkdir(parents=True)
        lines = [f"B{k} = {x.text}\n" for k, x in enumerate(own, 1)]
        path.write_text("".join(lines), encoding="utf-8")
        points[sheet] = worth
    key = {"format": 2, "name": "corpora", "blanks": blanks}
    (folder / "instructor" / "blanks.json").write_text(json.dumps(key), encoding="utf-8")
    return points
