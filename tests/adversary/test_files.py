"""Random files that repeat a few tokens up to a megabyte: each is read or refused within limits.

The named hostile files are in tests/unit/files/hostile.py; these are of a seeded generator that
knows no case. Each is read by a process of its own, with limits on processor time and memory.
"""

import os
import random

import pytest

from tests.bounded import read_bounded

SECONDS = 10

TOKENS = {
    "toml": [
        "a", ".a", "'", '"', "'''", '"""', "[", "]", "[[", "]]", "{", "}", "= 1\n", "=", ",",
        "\n", "#", "\\", "a = 1\n", "[a]\n", "[[constraints]]\n", "name = 'x'\n", "0x1", "1e9",
        "_1", " ",
    ],
    "json": [
        "[", "]", "{", "}", '"', ":", ",", "1", '"a"', '"a":', "null", "\\", "\\u0000", "-", "e9",
        " ",
    ],
    "txt": [
        "a", "x_bob", "+", "*", "^2", "**", "(", ")", "[", "]", ",", ";", "\n", "sin(", "'", '"',
        "a = a\n", "b = x_bob\n", "gamma = [", "nu = ", "-", ".5", "1/", "diff(", "{", "}",
        "\\frac{",
    ],
}  # fmt: skip
TOKENS["adm"] = [*TOKENS["json"], "1/", "187/255", "//", "'", "sin(", '"name"']
TOKENS["acf"] = TOKENS["adm"]
FIRST = {
    "toml": ["", "kincompile = 1\n", "a = ", "a = [", "[a", 'name = "', "parameters = {"],
    "json": ["", '{"kincompile": 1, "name": ', "[", '{"bodies": ['],
    "txt": ["", "gamma = [", "Phi_q = [[", "a = x_bob\n", "nu = ", 'gamma = "'],
    "adm": ["", '{"name": "m", "bodies": [', "["],
    "acf": ["", '{"simulation": ', "["],
}


def hostile(rng, largest):
    """Return the ending of a file and its content: groups of tokens, repeated and nested."""
    ending = rng.choice(list(TOKENS))
    text = rng.choice(FIRST[ending])
    for _ in range(rng.randint(1, 3)):
        group = "".join(rng.choice(TOKENS[ending]) for _ in range(rng.randint(1, 4)))
        size = int(10 ** rng.uniform(1, 6.3))
        text += group * max(1, min(size, largest) // len(group))
    return ending, text[:largest]


def check_files(seed, count, largest, folder, record):
    """Read so many files; none may end in anything but a reading or a refusal."""
    rng = random.Random(seed)
    for number in range(count):
        ending, text = hostile(rng, largest)
        (folder / f"file{number:04}.{ending}").write_text(text, encoding="utf-8")
    found = read_bounded(folder, SECONDS)
    assert len(found) == count
    verdicts = [verdict for verdict, _, _ in found.values()]
    wrong = {name: item for name, item in found.items() if item[0] not in ("read", "refused")}
    slowest = max(used for _, _, used in found.values())
    record(tried=count, wrong=len(wrong), slowest=slowest)
    assert not wrong
    assert verdicts.count("refused") > 0.8 * count


def test_a_few_random_files(tmp_path, record):
    check_files(1, 8, 30_000, tmp_path, record)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3] if "ADVERSARY_REPORT" in os.environ else [2])
def test_many_random_files(seed, tmp_path, record):
    check_files(seed, 60, 1_000_000, tmp_path, record)
