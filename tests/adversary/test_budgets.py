"""Formulas in all bracketings, sparse files, links and runs of one character: a budget for each.

A formula may be 27 characters long and stand for a number of a billion digits. So the formulas here
are made of what grows, in every bracketing; they are read or refused in 5 s and 1 GB a file.
"""

import os
import random
from itertools import product

import pytest

from kincompile.files.content import MAX_BYTES
from tests.bounded import read_bounded

SECONDS, BYTES = 5, 1_000_000_000
LEAVES = (
    "7",
    "64",
    "63",
    "2",
    "-64",
    "-1",
    "1/3",
    "(2/7)",
    "0.5",
    "9e99",
    "a",
    "b",
    "(2*a)",
    "x",
    "(x+1)",
)
LONGEST = 30
FORMULAS = 27
"""In a file."""


def bracketed(leaves, operators):
    """Yield every bracketing of leaves with operators between them."""
    if len(leaves) == 1:
        yield leaves[0]
    for k, operator in enumerate(operators):
        for left in bracketed(leaves[: k + 1], operators[:k]):
            for right in bracketed(leaves[k + 1 :], operators[k + 1 :]):
                yield f"({left}{operator}{right})"


def formulas(rng, count):
    """Return formulas of so many leaves, every bracketing of every choice of ^ * /, if short."""
    found = [
        text
        for operators in product("^*/", repeat=count - 1)
        for text in bracketed([rng.choice(LEAVES) for _ in range(count)], operators)
    ]
    return [text for text in found if len(text) <= LONGEST]


TOWERS = [
    *("(" * k + base + "^64)" * k for base in ("7", "(1/3)", "(2*a)", "0.1", "a") for k in (3, 5)),
    *("(" * k + "9^-64)" + "^-64)" * (k - 1) for k in (3, 5)),
    "((7^(1/3))^64)^64", "sqrt(9^300-31)*(9^64*9^64*9^64-15)^(1/9)",
    "+".join(f"1/{p}^60" for p in range(3, 200, 2)),
    "+".join(f"a/{p}^60" for p in range(3, 200, 2)),
    "*".join(f"{p}^(1/{p})" for p in range(3, 200, 2)),
    "Piecewise((1, a < " * 20 + "3" + "), (2, True))" * 20,
]  # fmt: skip


def model(values):
    """Return a model in TOML with formulas for the values of its drivers, by names."""
    same = 'type = "AbsoluteX", body = "x", point = [0, 0]'
    rows = (
        f'    {{ {same}, name = "c{k}", value = "{text}" }},\n' for k, text in enumerate(values)
    )
    return (
        'kincompile = 1\nname = "m"\nbodies = [{ name = "x" }]\n'
        "parameters = { a = 1.5, b = 2.5, k = 3 }\nconstraints = [\n" + "".join(rows) + "]\n"
    )


def hand(values):
    """Return formulas as they are derived by hand."""
    return "".join(f"y{k} = {text}\n" for k, text in enumerate(values)) + "gamma = [y0, y1, y2]\n"


def write(texts, folder):
    """Write formulas, so many in a file of each kind."""
    for first in range(0, len(texts), FORMULAS):
        part = texts[first : first + FORMULAS]
        (folder / f"f{first:05}.toml").write_text(model(text.replace("x", "b") for text in part))
        by_hand = (text.replace("x", "x_bob").replace("a", "t") for text in part)
        (folder / f"f{first:05}.txt").write_text(hand(by_hand))


def check(folder, record, tried=None):
    """Read the files of a folder; each is read or refused within its budget."""
    found = read_bounded(folder, SECONDS, BYTES)
    wrong = {name: item[:2] for name, item in found.items() if item[0] not in ("read", "refused")}
    slowest = max(used for *_, used in found.values())
    record(tried=tried or len(found), wrong=len(wrong), slowest=slowest)
    assert not wrong
    return found


@pytest.mark.slow
def test_formulas_that_grow_and_files_without_end(tmp_path, record):
    """Sparse files of 20 GB, links to a device without end and to themselves; towers of powers."""
    write(formulas(random.Random(1), 3), tmp_path)
    for k, text in enumerate(TOWERS):
        (tmp_path / f"tower{k:03}.toml").write_text(model([text]))
    for ending in ("toml", "json", "adm", "acf", "txt"):
        with (tmp_path / f"endless_sparse.{ending}").open("wb") as stream:
            stream.truncate(20_000_000_000)
        (tmp_path / f"endless_device.{ending}").symlink_to("/dev/zero")
        (tmp_path / f"endless_loop.{ending}").symlink_to(f"endless_loop.{ending}")
    found = check(tmp_path, record)
    assert {item[0] for name, item in found.items() if name.startswith("endless")} == {"refused"}
    towers = [item[0] for name, item in found.items() if name.startswith("tower")]
    assert towers.count("refused") > 0.6 * len(TOWERS)


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 5])
def test_every_bracketing(count, tmp_path, record):
    texts = formulas(random.Random(count), count)
    if count == 5 and "ADVERSARY_REPORT" not in os.environ:
        texts = texts[::3]
    write(texts, tmp_path)
    check(tmp_path, record, len(texts))


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["toml", "json", "adm", "acf", "txt"])
def test_runs_of_one_character(ending, tmp_path, record):
    """As long as a file may be."""
    for character in "\0 \n#\"'[{,=a1.\\;(":
        (tmp_path / f"run{ord(character):03}.{ending}").write_text(character * MAX_BYTES)
    found = check(tmp_path, record)
    assert {verdict for verdict, *_ in found.values()} == {"refused"}
