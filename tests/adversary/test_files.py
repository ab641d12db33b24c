"""Random files that repeat a few tokens up to a megabyte: each is read or refused within limits.

The named hostile files are in tests/unit/files/hostile.py; these are of a seeded generator that
knows no case. Each is read by a process of its own, with limits on processor time and memory.
"""

import json
import os
import random
import subprocess
import sys

import pytest

SECONDS, BYTES = 10, 1_500_000_000

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

READ = f"""
import json, os, resource, sys, time
from pathlib import Path
import kincompile as kc

m = kc.Mechanism("pendulum")
bob = m.body("bob", guess=(1, 0, 0))
m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
m.add(kc.AbsoluteAngle("motor", bob, kc.t**2))
m.system()


def read(path):
    if path.suffix == ".txt":
        kc.compare_file(m, path)
    else:
        (kc.read_analysis if path.suffix == ".acf" else kc.read)(path)


for path in sorted(Path().glob("file*")):
    told, its = os.pipe()
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, ({SECONDS}, {SECONDS}))
        resource.setrlimit(resource.RLIMIT_AS, ({BYTES}, {BYTES}))
        started, verdict = time.process_time(), "read"
        try:
            read(path)
        except kc.KincompileError as error:
            verdict = "refused" if len(str(error)) < 50_000 else "a message without end"
        except BaseException as error:
            verdict = type(error).__name__
        os.write(its, json.dumps([verdict, time.process_time() - started]).encode())
        os._exit(0)
    os.close(its)
    os.waitpid(child, 0)
    answer = os.read(told, 10_000)
    os.close(told)
    print(json.dumps([path.name, *(json.loads(answer) if answer else ["no end", {SECONDS}])]))
"""


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
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    run = [sys.executable, "-c", READ]
    done = subprocess.run(
        run, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == count
    wrong = [item for item in found if item[1] not in ("read", "refused")]
    slowest = max(found, key=lambda item: item[2])
    record(tried=count, wrong=len(wrong), slowest=slowest[2])
    assert wrong == []
    assert sum(item[1] == "refused" for item in found) > 0.8 * count
    return slowest


def test_a_few_random_files(tmp_path, record):
    check_files(1, 8, 30_000, tmp_path, record)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_many_random_files(seed, tmp_path, record):
    check_files(seed, 60, 1_000_000, tmp_path, record)
