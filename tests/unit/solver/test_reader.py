"""What the reader of the solver's text refuses, each at its line; and what it makes of the rest."""

from typing import Any

import pytest

from kincompile.solver.expressions import Refused
from kincompile.solver.nodes import LANE, Comment, Name, variables_in
from kincompile.solver.reader import MARCH, read, solver, source_of
from kincompile.solver.vocabulary import ABREAST, CAREFUL

TEXT = "".join(map(source_of, MARCH))

REFUSED = {
    "a name that is unknown": ("going & is_large", "going & is_larg", "is_larg is not known"),
    "a name out of its block": (
        "o.status = where(going, NOT", "o.status = where(is_large, NOT", "is_large is not known"
    ),
    "a field that is none": ("o.residual = 0.0", "o.residuals = 0.0", "Outcome has no residuals"),
    "a statement that is none": (
        "            take_up(at, b, 0)\n        else", "            del at\n        else",
        "Delete is no stat"
    ),
    "an expression that is none": ("PATTERN[e][0]\n", "[x for x in PATTERN][0]\n", "no expression"),
    "a chain of relations": ("size > o.residual", "0.0 < size > o.residual", "no expression"),
    "an operation that is none": ("+= h * (b.q_dot[i] +", "+= h ** (b.q_dot[i] +", "Pow is no"),
    "lanes said in a function of lanes": (
        "complete(b, s, o)\n    err", "complete(b, s, o, lanes=1)\n    err",
        "complete is called without lanes"
    ),
    "lanes not said elsewhere": ("following, o, lanes=1)", "following, o)", "step takes as t"),
    "a kernel for no lanes": (
        "position(b, lanes=1)", "position(b)", "position is called with lanes"
    ),
    "what lanes share is set in one": (
        "    o.residual = 0.0", "    s.tolerance = 1.0", "tolerance is one value for all lanes"
    ),
    "too many arguments": (
        "complete(b, s, o)\n    err", "complete(b, s, o, o)\n    err", "takes 3 arguments, 4"
    ),
    "an argument of another kind": (
        "position(b)\n    s.m", "position(s)\n    s.m", "position takes"
    ),
    "a lane that decides a branch": ("not any_lane(going)", "not going", "not is said of one"),
    "another name of an array": ("copied(b.determinants)", "b.determinants", "another name of an"),
    "an index of a lane in a function of lanes": (
        "o.residual = 0.0", "o.residual[0] = 0.0", "no index of a lane"
    ),
    "rows as one number": ("size = abs(b.Phi[i])", "size = abs(b.Phi)", "abs takes number"),
    "too many indices": ("o.status[good]", "o.status[good][0]", "too many indices"),
    "a loop that goes beyond an array": (
        "1.0 if ANGULAR[i]", "1.0 if IS_REDUNDANT[i]", "goes to N, and there are M"
    ),
    "a truth for a number": ("h = size if h > 0.0", "h *= True if h > 0.0", "bool and real do not"),
    "a real number for a whole one": (
        "    iterations: Int = 0\n", "    iterations: Int = 0.0\n", "real, where int"
    ),
    "a count and a whole number": ("good < count and", "status < count and", "count and int do"),
    "and of lanes": ("(o.status == CONVERGED) & has", "(o.status == CONVERGED) and has", "a lane"),
    "a parameter that is set": ("    forward = t -", "    t = t\n    forward = t -", "t stays"),
    "a second type": ("    is_stuck: Bool", "    h: Bool", "h has a type already"),
    "a type that is none": ("size: Real, s: Scales", "size: Float, s: Scales", "Float is no type"),
    "a parameter without a type": ("s: Scales, k: Count)", "s: Scales, k)", "k has no type"),
    "a default": ("s: Scales, k: Count)", "s: Scales, k: Count = 0)", "not plain"),
    "a function below": ("missed(b, s.weight", "step(b, s.weight", "step is no word"),
    "a result that is not used": ("    nu(b)\n", "    solve(b, b.nu)\n", "what solve gives is not"),
    "a result that is none": ("    return most\n", "    return True\n", "speed_of gives real"),
    "no result": ("    return most\n", "    most = 0.0\n", "ends without a result"),
    "a variable of a loop that is set": (
        "gain += abs(b.q_ddot[i]) * s.inverse[i]", "i += 1", "i stays what it is"
    ),
    "a function that says nothing": (
        'Count):\n    """Take the scales of one lane."""\n', "Count):\n", "does not say what"
    ),
    "something beside structs and functions": (
        "class State", "X = 1\n\n\nclass State", "nothing el"
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_that_a_text_is_refused_at_its_line(what):
    old, new, message = REFUSED[what]
    before, found, after = TEXT.partition(old)
    assert found
    last = new.rstrip("\n").count("\n")
    lines = range(before.count("\n") + 1, before.count("\n") + 2 + last)
    with pytest.raises(Refused, match=message) as refusal:
        read(before + new + after)
    assert int(str(refusal.value).partition(":")[0].removeprefix("line ")) in lines


CHOICE = """    for i in range(N):
        speed = abs(b.q_dot[i][0]) * s.inverse[i][0]
        if IS_CAREFUL:
            # The last one serves.
            most = speed
        else:
            # It is the largest.
            most = speed if speed > most else most
"""


def test_that_a_choice_of_march_leaves_one_branch_and_its_comments():
    head, _, rest = TEXT.partition("    for i in range(N):\n        speed = abs(b.q_dot")
    text = head + CHOICE + rest[rest.index("    return most") :]
    for chosen, comment in (((), "It is the largest."), ((CAREFUL,), "The last one serves.")):
        loop: Any = read(text, chosen=chosen).functions["speed_of"].body[1]
        assert loop.body[1] == Comment((comment,))
        assert isinstance(loop.body[2].value, Name) == bool(chosen)
    plain, careful = solver(), solver(CAREFUL)
    assert "advance_carefully" in careful.functions.keys() - plain.functions.keys()
    assert "put_on" in solver(ABREAST).functions.keys() - plain.functions.keys()
    assert "is_there" in careful.structs["Outcome"].fields.keys() - plain.structs["Outcome"].fields


def test_that_parameters_which_a_function_changes_are_known():
    changes = {name: function.changes for name, function in solver().functions.items()}
    assert changes["measure"] == {"b", "s"}
    assert changes["step"] == {"b", "o"}
    assert changes["advance"] == {"b", "at", "o"}
    assert changes["speed_of"] == set()


def test_that_a_name_keeps_the_type_of_its_first_value():
    function = solver().functions["step"]
    types = {x.name: x.type for x in variables_in(function.body)}
    assert types["h"].dims == (LANE,)
    assert types["before"].dims == ("BLOCKS", LANE)
    assert types["is_past"].base == "bool"
