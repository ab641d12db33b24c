"""Questions for Moodle: Cloze for the numbers of an exam, STACK for formulas, as Moodle XML.

The format is that of Moodle's importer, question/format/xml/format.php; numbers in Cloze are those
of question/type/multianswer, a STACK question that of the plugin's samples.
"""

from __future__ import annotations

import base64
import re
from html import escape
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import sympy

from kincompile.errors import UnsupportedError
from kincompile.exercises.blanks import DIGITS, PLACE
from kincompile.exercises.rounded import SLACK, half_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.exercises.blanks import Blank, State
    from kincompile.model.system import ConstraintSystem

    Sheet = tuple[str, str, ConstraintSystem, Sequence[Blank]]

FUNCTIONS = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan,
    sympy.sinh, sympy.cosh, sympy.tanh, sympy.exp, sympy.log,
)  # fmt: skip
"""What Maxima calls as SymPy does."""

WRONG_SIGN = "The entry has the wrong sign."

INPUT = {
    "boxsize": "50", "strictsyntax": "1", "insertstars": "1", "syntaxhint": "",
    "syntaxattribute": "0", "forbidwords": "", "forbidfloat": "0", "requirelowestterms": "0",
    "checkanswertype": "0", "mustverify": "1", "showvalidation": "1", "options": "",
}  # fmt: skip
"""What a STACK input has besides its name and answer; products may lack their signs."""


def moodle_xml(name: str, sheets: Sequence[Sheet], states: Sequence[State]) -> str:
    """Return a category with a question for each sheet.

    Raises
    ------
    UnsupportedError
        If STACK cannot say what is asked; it says what to use.
    """
    category = _node("category", [_text(f"$course$/top/{name}")])
    quiz = _node("quiz", [_node("question", [category], type="category")])
    for k, sheet in enumerate(sheets):
        quiz.append(_cloze(name, sheet, states[k]) if states else _stack(name, sheet))
    ET.indent(quiz)
    text = ET.tostring(quiz, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _cloze(name: str, sheet: Sheet, state: State) -> Element:
    """Return a question with a box for the number of each blank, to three digits."""
    _, _, system, blanks = sheet
    derived = system.Phi_q, system.gamma
    lines = []
    for item in blanks:
        entry = item.answer(*derived)
        right = float(entry.subs({x: state[str(x)] for x in entry.free_symbols}))
        off = half_unit(right, DIGITS) * SLACK
        box = f"{{1:NUMERICAL:={right!r}:{off!r}~%0%{-right!r}:{off!r}#{WRONG_SIGN}}}"
        lines.append(f"<p>{item.name}, {escape(item.label(system))}: {box}</p>")
    return _question("cloze", name, sheet, lines, [])


def _stack(name: str, sheet: Sheet) -> Element:
    """Return a question with an input and a response tree for the formula of each blank."""
    _, _, system, blanks = sheet
    derived = system.Phi_q, system.gamma
    lines, variables, parts = [], [], []
    for item in blanks:
        answer = _maxima(item, item.answer(*derived)) if item.quantity != PLACE else None
        if answer is None:
            raise _unsaid(item, "its answer is the name of an entry")
        text, names = answer
        ans, known = f"ans{item.name}", f"ta{item.name}"
        variables.append(f"{known}: {text};")
        inputs = f"[[input:{ans}]] [[validation:{ans}]] [[feedback:prt{item.name}]]"
        lines.append(f"<p>{item.name}, {escape(item.label(system))} = {inputs}</p>")
        own = {"name": ans, "type": "algebraic", "tans": known, **INPUT}
        own["allowwords"] = ",".join(names)
        parts += [_node("input", [_node(*pair) for pair in own.items()]), _tree(item.name)]
    parts.insert(0, _node("questionvariables", [_text("\n".join(variables))]))
    return _question("stack", name, sheet, lines, parts)


def _tree(name: str) -> Element:
    """Return the response tree of a blank: equal, else equal but for the sign."""
    nodes = [
        _response("0", name, f"ta{name}", "1", "1", ""),
        _response("1", name, f"-ta{name}", "0", "-1", WRONG_SIGN),
    ]
    head = {"name": f"prt{name}", "value": "1", "autosimplify": "1", "feedbackstyle": "1"}
    variables = _node("feedbackvariables", [_text("")])
    return _node("prt", [*(_node(*pair) for pair in head.items()), variables, *nodes])


def _response(k: str, name: str, right: str, score: str, after: str, said: str) -> Element:
    """Return a node that gives a score, and says something, where an answer is equivalent."""
    own = {
        "name": k, "answertest": "AlgEquiv", "sans": f"ans{name}", "tans": right,
        "testoptions": "", "quiet": "1",
        "truescoremode": "=", "truescore": score, "truepenalty": "", "truenextnode": "-1",
        "trueanswernote": f"{name}-{k}-T",
        "falsescoremode": "=", "falsescore": "0", "falsepenalty": "", "falsenextnode": after,
        "falseanswernote": f"{name}-{k}-F",
    }  # fmt: skip
    feedback = [
        _node(f"{outcome}feedback", [_text(text)], format="html")
        for outcome, text in (("true", said), ("false", ""))
    ]
    return _node("node", [*(_node(*pair) for pair in own.items()), *feedback])


def _maxima(blank: Blank, entry: sympy.Expr) -> tuple[str, list[str]]:
    """Return an entry as Maxima reads it, its numbers exact, and the names in it."""
    names = sorted(map(str, entry.free_symbols))
    if other := [x for x in names if not re.fullmatch(r"[A-Za-z]\w*", x, re.ASCII)]:
        raise _unsaid(blank, f"Maxima has no name {other[0]}")
    known = (*FUNCTIONS, sympy.Symbol, sympy.Number, sympy.Add, sympy.Mul, sympy.Pow)
    for item in sympy.preorder_traversal(entry):
        if not isinstance(item, known) and item not in (sympy.pi, sympy.E):
            raise _unsaid(blank, f"{type(item).__name__} is not among the functions of STACK")
    exact = entry.xreplace({x: sympy.Rational(str(x)) for x in entry.atoms(sympy.Float)})
    text = re.sub(r"\bpi\b", "%pi", str(exact).replace("**", "^"))
    return re.sub(r"\bE\b", "%e", text), names


def _unsaid(blank: Blank, why: str) -> UnsupportedError:
    return UnsupportedError(
        f"STACK cannot ask for {blank.name} of {blank.constraint}: {why}. Use gradescope, "
        "nbgrader, otter or prairielearn, which mark by kincompile itself"
    )


def _question(
    kind: str, name: str, sheet: Sheet, lines: Sequence[str], parts: Sequence[Element]
) -> Element:
    """Return a question with the page of a sheet as a file."""
    student, page, _, _ = sheet
    file = f"{student}.html"
    link = f'<p><a href="@@PLUGINFILE@@/{file}">The page of sheet {student}</a></p>'
    own = _node("file", base64.b64encode(page.encode()).decode())
    own.attrib |= {"name": file, "path": "/", "encoding": "base64"}
    return _node(
        "question",
        [
            _node("name", [_text(f"{name} {student}")]),
            _node("questiontext", [_text("\n".join([link, *lines])), own], format="html"),
            _node("generalfeedback", [_text("")], format="html"),
            _node("defaultgrade", str(len(sheet[3]))),
            _node("penalty", "0.3333333"),
            _node("hidden", "0"),
            *parts,
        ],
        type=kind,
    )


def _text(content: str) -> Element:
    return _node("text", content)


def _node(tag: str, content: str | Sequence[Element], **attributes: str) -> Element:
    """Return an element with a text or with others in it."""
    made = Element(tag, attributes)
    if isinstance(content, str):
        made.text = content
    else:
        made.extend(content)
    return made
