"""Files from strangers: refused with a place or read, never run, never hanging, nothing written.

A few hundred in the normal run, more than 20,000 with `-m slow`.
"""

import random
import re
import runpy
import signal
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.files.formula_text import ExpressionError
from kincompile.files.safe_expressions import parse_expression
from tests.bounded import pace

CORPUS = runpy.run_path(str(Path(__file__).with_name("corpus.py")))
NAMES = {"t": sympy.Symbol("t"), "x": sympy.Symbol("x")}
SECONDS = 2.0
LOCATED = re.compile(r"fuzz\.(toml|json|adm|acf)(, line \d+: |: the file has more than)")

# What a file must not make happen. An audit hook cannot be taken away, so it has a switch.
FORBIDDEN = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect",
             "os.remove", "os.rename", "os.mkdir", "shutil.rmtree", "ctypes.dlopen")  # fmt: skip
WATCH: dict[str, Any] = {"on": False, "seen": []}


def audit(event, arguments):
    if not WATCH["on"]:
        return
    is_write = event == "open" and isinstance(arguments[1], str) and set(arguments[1]) & set("wax+")
    if event in FORBIDDEN or is_write:
        WATCH["seen"].append((event, arguments))


sys.addaudithook(audit)


@contextmanager
def watched(seconds=SECONDS):
    """Watch what the code inside does, and end it where it takes too long on the processor."""
    seconds *= pace()

    def too_long(number, frame):
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGVTALRM, too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    WATCH["on"], WATCH["seen"] = True, []
    try:
        yield
    finally:
        WATCH["on"] = False
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
    assert WATCH["seen"] == []


def check_expression(text):
    problem = None
    with watched():
        try:
            parse_expression(text, NAMES)
        except ExpressionError as error:
            problem = error
    assert problem is None or min(problem.line, problem.column) >= 1


def check_file(path, ending, content, compiles):
    """Read a file; where it is good, it must compile or be refused too."""
    path.write_bytes(content)
    problems = ()
    with watched():
        try:
            read = kc.read_analysis if ending == "acf" else kc.read
            model = read(path)
        except kc.ModelError as error:
            problems = error.problems
    if problems:
        located = [problem for problem in problems if LOCATED.search(problem)]
        assert len(located) >= len(problems) - 1, problems  # the last may be "and 7 more problems"
        return
    if compiles and ending != "acf":
        with watched():
            try:
                kc.emit(model)
            except (kc.ModelError, kc.UnsupportedError):
                return


def run_corpus(tmp_path, seed, n_expressions, n_files, share):
    """Check a seeded corpus; of the good files compile a share."""
    rng = random.Random(seed)
    for number, text in enumerate(CORPUS["expressions"](rng, n_expressions)):
        try:
            check_expression(text)
        except BaseException as error:
            raise AssertionError(f"expression {number} of seed {seed}: {text[:300]!r}") from error
    for number, (ending, content) in enumerate(CORPUS["files"](rng, n_files)):
        try:
            check_file(tmp_path / f"fuzz.{ending}", ending, content, rng.random() < share)
        except BaseException as error:
            raise AssertionError(f"file {number} of seed {seed}, .{ending}") from error
    assert {path.suffix for path in tmp_path.iterdir()} <= {".toml", ".json", ".adm", ".acf"}
    assert not Path("CANARY").exists()


@pytest.mark.parametrize("text", CORPUS["HOSTILE"], ids=range(len(CORPUS["HOSTILE"])))
def test_that_a_hostile_formula_does_nothing(text):
    check_expression(text)


def test_that_a_small_corpus_is_refused_or_read(tmp_path):
    run_corpus(tmp_path, 1, 300, 300, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_that_a_large_corpus_is_refused_or_read(tmp_path, seed):
    run_corpus(tmp_path, seed, 1000, 1400, 0.05)


@pytest.mark.slow
def test_that_broken_robots_are_refused_or_read(tmp_path):
    """What replaces bytes, and values in quotes; MuJoCo is loaded by the good files."""
    rng, data = random.Random(1), Path(__file__).parents[1] / "data" / "robots"
    good = [data / "5bar_linkage_iso3d.urdf", data / "welded_four_bar.xml"]
    for path in good:
        kc.read(path)
    verdicts = set()
    for number in range(160):
        source = good[number % 2]
        path, text = tmp_path / f"fuzz{source.suffix}", source.read_text(encoding="utf-8")
        change = CORPUS["with_hostile_formula"] if number % 4 < 2 else CORPUS["mutated"]
        changed = change(rng, text if number % 4 < 2 else text.encode())
        path.write_bytes(
            changed if isinstance(changed, bytes) else changed.encode("utf-8", "replace")
        )
        problems: tuple[str, ...] = ()
        with watched():
            try:
                kc.read(path)
            except kc.ModelError as error:
                problems = error.problems
        verdicts.add("refused" if problems else "read")
        assert [problem for problem in problems[:49] if str(path) not in problem] == []
    assert verdicts == {"read", "refused"}


@pytest.mark.slow
def test_that_3000_bodies_are_read_within_the_limit(tmp_path):
    m = kc.Mechanism("chain")
    a = m.parameter("a", 1.0)
    for k in range(3000):
        body = m.body(f"b{k}", guess=(k, 0.1, 0.2))
        m.add(kc.Revolute(f"A{k}", m.ground, (k, 0), body, (-a / 2, 0)))
        m.add(kc.AbsoluteAngle(f"M{k}", body, a * kc.t))
    path = tmp_path / "chain.toml"
    path.write_text(m.to_toml(), encoding="utf-8")
    with watched():
        read = kc.read(path)
    assert len(read.system().coordinates) == 9000


@settings(max_examples=200)
@given(st.text(max_size=60))
def test_that_any_text_is_refused_or_read(text):
    check_expression(text)


@settings(max_examples=100)
@given(st.binary(max_size=80))
def test_that_any_bytes_are_refused(tmp_path_factory, content):
    for ending in ("toml", "json", "adm", "acf"):
        check_file(tmp_path_factory.getbasetemp() / f"fuzz.{ending}", ending, content, False)


def spin():
    while True:
        pass


def test_that_the_watch_sees_what_it_is_for(tmp_path):
    with pytest.raises(AssertionError), watched():
        (tmp_path / "x").write_text("written", encoding="utf-8")
    with pytest.raises(TimeoutError), watched(0.05):
        spin()
