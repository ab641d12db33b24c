"""The start in Octave: what is a statement there, and which loops are none."""

import pytest

from kincompile.emitters.octave.march import OctaveSolver
from kincompile.solver.reader import read

STRUCTS = """
class Start(Struct):
    \"\"\"Numbers.\"\"\"
    t: Real
    terms: Row[N]
    step: Row[N]
"""
GROWS = """
def grows(s: Start) -> Bool:
    \"\"\"Say it.\"\"\"
    s.t += 1.0
    return s.t > 2.0
"""


def printed(body, result=""):
    """Return the lines that Octave has of a function with a body and a result."""
    lines = "\n".join(f"    {line}" for line in body)
    source = f'{STRUCTS}{GROWS}\ndef own(s: Start, last: Int){result}:\n    """Do it."""\n{lines}\n'
    text = OctaveSolver(read(source), {"N": 3}).text()
    return text.partition("= own(")[2].split("\n")[2:-2]


@pytest.mark.parametrize(("body", "line"), [
    ("s.step[i] = s.t * abs(s.terms[i]) / s.step[i]",
     "s.step = s.t * abs(s.terms) ./ s.step;"),
    ("s.step[i] = 1.0 if s.terms[i] > s.t else s.terms[i]",
     "s.step = where(s.terms > s.t, 1.0, s.terms);"),
    ("s.t += s.terms[i] * s.step[i]", "s.t = s.t + sum(s.terms .* s.step);"),
    ("s.t = s.step[i] if s.step[i] > s.t else s.t", "s.t = max([s.t; s.step]);"),
    ("s.step[i] = 1.0", "s.step(:) = 1.0;"),
])  # fmt: skip
def test_that_a_loop_over_entries_is_no_loop(body, line):
    assert printed(["for i in range(N):", f"    {body}"]) == [line]


@pytest.mark.parametrize("body", [
    ["s.t += s.terms[i]", "s.step[i] = s.t"],
    ["s.step[i] = s.step[last]"],
    ["if s.step[i] > s.t:", "    s.t = s.step[i]"],
    ["if grows(s):", "    s.step[i] = 1.0"],
])  # fmt: skip
def test_that_a_loop_stays_one_where_a_pass_reads_what_another_writes(body):
    assert "for i = 1:N" in printed(["for i in range(N):", *(f"    {x}" for x in body)])


@pytest.mark.parametrize("body", [
    ["k = COVER[i]", "s.step[k] = s.terms[i]"],
    ["s.step[i] = 1.0", "if s.terms[i] > s.t:", "    return False"],
])  # fmt: skip
def test_that_a_loop_stays_one_where_it_matters_which_pass_is_the_last(body):
    lines = [*(f"    {x}" for x in body)]
    assert "for i = 1:N" in printed(["for i in range(N):", *lines, "return True"], " -> Bool")


def test_that_a_call_that_changes_is_made_only_where_what_is_before_it_holds():
    assert printed(["if last > 2 and grows(s):", "    s.t = 0.0"]) == [
        "is_so = last > 2;", "if is_so", "    [s, is_so] = grows(s);", "end",
        "if is_so", "    s.t = 0.0;", "end",
    ]  # fmt: skip
    assert printed(["while last > 2 and grows(s):", "    s.t = 0.0"]) == [
        "while true", "    is_so = last > 2;", "    if is_so", "        [s, is_so] = grows(s);",
        "    end", "    if ~is_so", "        break", "    end", "    s.t = 0.0;", "end",
    ]  # fmt: skip


def test_that_a_truth_that_is_asked_again_keeps_its_value_so_long():
    first = "is_large: Bool = last > 2"
    assert printed([first, "is_large = last > 1 and (grows(s) or is_large)"])[1:] == [
        "is_so = last > 1;", "if is_so", "    [s, is_so_2] = grows(s);",
        "    is_so = is_so_2 || is_large;", "end", "is_large = is_so;",
    ]  # fmt: skip
