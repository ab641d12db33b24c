"""simEngine2D's files: a model (`.adm`) and the time grid of its analysis (`.acf`), both JSON.

simEngine2D is the engine of the course ME451. Its model has bodies with absolute coordinates and
constraints by type; here it becomes a `Mechanism`. What only dynamics or drawing needs, masses,
forces, gravity, shapes, is left out, and the log says so where motion could depend on it.

MSC Adams uses the same two endings for text formats of its own; their first characters
distinguish them.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.files.content import decoded
from kincompile.files.data_text import listed_problems, read_json
from kincompile.files.file_fields import FieldReader
from kincompile.model.absolute import AbsoluteAngle, AbsoluteDistance, AbsoluteX, AbsoluteY
from kincompile.model.expressions import evaluate, t
from kincompile.model.gears import RackAndPinion
from kincompile.model.joints import Revolute, Translational
from kincompile.model.mechanism import Mechanism
from kincompile.model.relative import Distance, RelativeX, RelativeY
from kincompile.model.sections import MOST_POINTS
from kincompile.names import listed, name_problem, shown, suggestion

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.model.bodies import Body
    from kincompile.model.constraint import Constraint
    from kincompile.model.expressions import Scalar

LOG = logging.getLogger(__name__)

Row = dict[str, Any]

_ADAMS = re.compile(r"\s*(?:!|ADAMS|adams|(?i:part|marker|joint|default units|file|simulate)\b)")
_MATLAB = {".*": " *", "./": " /", ".^": " ^"}
_ANALYSES = ("Kinematics", "Dynamics", "InverseDynamics")
_IGNORED = {
    "forces": "forces and contacts are left out: they do not change kinematics",
    "contacts": "contacts are left out: they do not change kinematics",
    "vis": "the drawing (vis) is left out",
}


@dataclass(frozen=True, slots=True)
class AnalysisSettings:
    """The time grid that an `.acf` file asks for: `points` equally spaced times from 0 to `end`."""

    end: float
    points: int


def read_adm(path: Path, content: bytes) -> Mechanism:
    """Read a model of simEngine2D.

    Returns
    -------
    Mechanism
        A pair of AbsoluteX and AbsoluteY stays a pair; a name that cannot be one in code is
        changed, with underscores.

    Raises
    ------
    ModelError
        If it is not such a model; every problem with line and field.
    """
    reader = _AdmReader(_document(path, content))
    mechanism = reader.read()
    if not reader.problems and mechanism is not None:
        try:
            mechanism.system()
        except ModelError as error:
            reader.problems += [reader.located(problem) for problem in error.problems]
    if reader.problems or mechanism is None:
        raise listed_problems(reader.problems)
    return mechanism


def read_acf(path: Path, content: bytes) -> AnalysisSettings:
    """Read the settings of an analysis of simEngine2D.

    Returns
    -------
    AnalysisSettings
        A grid of outputSteps + 1 times; without outputSteps, one of steps of stepSize.

    Raises
    ------
    ModelError
        If it is not such a file; every problem with line and field.
    """
    reader = FieldReader(_document(path, content))
    data = reader.document.data
    if not isinstance(data, dict):
        raise ModelError(reader.document.problem((), f"expected an object, not {shown(data)}"))
    end = _positive(reader, data, "tend")
    _check_kind(reader, data.get("simulation", _ANALYSES[0]))
    steps = _steps(reader, data, end)
    if reader.problems:
        raise listed_problems(reader.problems)
    return AnalysisSettings(end, steps + 1)


def _check_kind(reader: FieldReader, given: Any) -> None:
    letters = "".join(filter(str.isalnum, given)).lower() if isinstance(given, str) else ""
    kind = next((word for word in _ANALYSES if word.lower() == letters), None)
    if kind is None:
        text = f"there is no analysis {shown(given)}; analyses are: {listed(_ANALYSES)}"
        reader.problem(("simulation",), text)
    elif kind != _ANALYSES[0]:
        LOG.warning(
            "%s: %s is asked for; its times are read, and the kinematics is solved at them, "
            "without masses and forces", reader.document.file, kind,
        )  # fmt: skip


def _steps(reader: FieldReader, data: Row, end: float) -> int:
    if "outputSteps" in data:
        steps = data["outputSteps"]
        if type(steps) is int and 1 <= steps <= MOST_POINTS:
            return int(steps)
        text = f"expected a whole number from 1 to {MOST_POINTS:,}, not {shown(steps)}"
        reader.problem(("outputSteps",), text)
        return 1
    steps = end / _positive(reader, data, "stepSize")
    if not reader.problems and steps > MOST_POINTS:
        reader.problem(("stepSize",), f"this is more than {MOST_POINTS:,} steps; make it larger")
        return 1
    return max(1, round(steps))


def _positive(reader: FieldReader, data: Row, key: str) -> float:
    if key not in data:
        reader.problem((), f"no {key}; an analysis has: simulation, tend, stepSize, outputSteps")
        return 1.0
    before = len(reader.problems)
    number = reader.number(data[key], (key,))
    if number <= 0:
        reader.problem((key,), f"expected a positive number, not {shown(number)}")
    return float(number) if len(reader.problems) == before else 1.0


def _document(path: Path, content: bytes) -> Document:
    """Return a JSON file; a file of Adams, which has the same ending, is refused by name."""
    if _ADAMS.match(decoded(path, content)):
        raise ModelError(
            f"{path}, line 1: this is a file of MSC Adams, which uses the ending "
            f"{path.suffix} too; what is read here is JSON, as simEngine2D writes it"
        )
    return read_json(path, content, _WORDS)


class _AdmReader(FieldReader):
    """Reads bodies and constraints; `body1`, `sP1` and others by their names in the file."""

    def __init__(self, document: Document) -> None:
        super().__init__(document)
        self._mechanism = Mechanism("model")
        self._bodies: dict[Any, Body] = {}
        self._names: set[str] = set()

    def read(self) -> Mechanism | None:
        """Return the mechanism as far as it could be read."""
        data = self.document.data
        if not isinstance(data, dict):
            self.problem((), f"expected an object with bodies and constraints, not {shown(data)}")
            return None
        for key, notice in _IGNORED.items():
            if data.get(key):
                LOG.warning("%s: %s", self.document.file, notice)
        mechanism = self._mechanism
        mechanism.name = self._speaking(data.get("name", "model"), "model", ("name",), set())
        for section in ("bodies", "constraints"):
            if section not in data:
                self.problem((), f"no {section}; a model of simEngine2D has bodies and constraints")
        for item in self.rows(data, "bodies"):
            self._body(*item)
        self._names = set()
        ids: dict[Any, None] = {}
        for address, row in self.rows(data, "constraints"):
            self._take_id(address, row, ids)
            found = self._constraint(address, row)
            if found is not None:
                mechanism.add(found)
        return mechanism

    def _body(self, address: Address, row: Row) -> None:
        identity = self._take_id(address, row, self._bodies)
        name = self._speaking(row.get("name", ""), f"body_{identity}", address, self._names)
        if "q0" not in row:
            self.problem(address, "no q0, the start values [x, y, phi]")
        guess = self.expressions(row.get("q0", [0, 0, 0]), (*address, "q0"), {}, "[x, y, phi]", 3)
        self._bodies[identity] = self._mechanism.body(name, (guess[0], guess[1], guess[2]))
        self.remember(f"guess of x_{name}", (*address, "q0"))
        self.remember(f"body {name!r}", address)

    def _take_id(self, address: Address, row: Row, taken: dict[Any, Any]) -> Any:
        """Return the id of a row, which need not be its place; a wrong one is noted."""
        if "id" not in row:
            self.problem(address, "no id, the whole number by which others refer to it")
            return f"of_entry_{address[1]}"
        identity = row["id"]
        if type(identity) is not int:
            self.problem((*address, "id"), f"expected a whole number, not {shown(identity)}")
            return f"of_entry_{address[1]}"
        if identity in taken:
            self.problem((*address, "id"), f"the id {shown(identity)} is given twice")
        taken.setdefault(identity, None)
        return identity

    def _speaking(self, given: Any, otherwise: str, address: Address, taken: set[str]) -> str:
        """Return a name that code can use, as close to the one given as possible."""
        if not isinstance(given, str):
            self.problem((*address, "name"), f"expected a name, not {shown(given)}")
            given = ""
        name = re.sub(r"\W+", "_", given, flags=re.ASCII).strip("_")[:40] or otherwise
        if name[0].isdigit():
            name = f"{otherwise.partition('_')[0]}_{name}"
        if name_problem(name, "it") or name == "ground":
            name = f"{name}_"
        name, stem, number = name, name, 2
        while name in taken:
            name, number = f"{stem}_{number}", number + 1
        taken.add(name)
        return name

    def _constraint(self, address: Address, row: Row) -> Constraint | None:
        kind = row.get("type")
        kind = _TYPES.get(kind.lower(), kind) if isinstance(kind, str) else kind
        if not isinstance(kind, str) or kind not in _CONSTRAINTS:
            hint = suggestion(kind, _CONSTRAINTS) if isinstance(kind, str) else ""
            given = f"no constraint type {shown(kind)}" if "type" in row else "no type"
            text = f"there is {given}{hint}; types are: {listed(_CONSTRAINTS)}"
            self.problem((*address, "type"), text)
            return None
        constraint, keys = _CONSTRAINTS[kind]
        what = f"constraint_{row.get('id', address[1]) if type(row.get('id')) is int else 0}"
        name = self._speaking(row.get("name", ""), what, address, self._names)
        required = [key for key in keys if key not in ("body2", "fun")]
        missing = [key for key in required if key not in row]
        if missing:
            self.problem(address, f"{kind} has no {listed(missing)}; its fields: {listed(keys)}")
            return None
        before = len(self.problems)
        values: list[Any] = [self._value(key, row, address) for key in keys]
        if len(self.problems) > before:
            return None
        self.remember(f"{constraint.__name__} {name!r}", address)
        return constraint(name, *values)

    def _value(self, key: str, row: Row, address: Address) -> Any:
        place = (*address, key)
        if key in ("body1", "body2"):
            return self._body_of(row, key, place)
        if key == "fun":
            return self._function(row.get("fun", "NONE"), place)
        if key[0] in "sv":
            point = self.expressions(row[key], place, {}, "[x, y]", 2)
            return self._normalised(point, place) if key[0] == "v" else tuple(point)
        return self.expression(row[key], place, {})

    def _body_of(self, row: Row, key: str, place: Address) -> Any:
        if key not in row:
            return self._mechanism.ground
        identity = row[key]
        body = self._bodies.get(identity) if type(identity) is int else None
        if body is None:
            known = listed(identity for identity in self._bodies if type(identity) is int)
            text = f"there is no body with the id {shown(identity)}; ids are: {known}"
            self.problem(place, text)
        return body

    def _normalised(self, direction: list[Any], place: Address) -> tuple[Scalar, Scalar]:
        x, y = (sympy.sympify(item) for item in direction)
        length = sympy.sqrt(x**2 + y**2)
        size = evaluate(length, {})
        if size is None or size == 0:
            self.problem(place, "the direction has no length; give one such as [1, 0]")
            return 1, 0
        return (direction[0], direction[1]) if size == 1 else (x / length, y / length)

    def _function(self, given: Any, place: Address) -> Scalar:
        """Return a function of t, which is MATLAB's text; NONE is zero."""
        if not isinstance(given, str):
            return self.expression(given, place, {})
        text = given.strip().rstrip(";")
        if text.upper() == "NONE":
            return 0
        for matlab, ours in _MATLAB.items():
            text = text.replace(matlab, ours)
        return self.expression(text, place, {"t": t})


_TWO_POINTS = ("body1", "sP1", "body2", "sP2")

_CONSTRAINTS: Mapping[str, tuple[type[Constraint], tuple[str, ...]]] = {
    "AbsoluteX": (AbsoluteX, ("body1", "sP1", "fun")),
    "AbsoluteY": (AbsoluteY, ("body1", "sP1", "fun")),
    "AbsoluteAngle": (AbsoluteAngle, ("body1", "fun")),
    "AbsoluteDistance": (AbsoluteDistance, ("body1", "sP1", "sP2", "fun")),
    "RelativeX": (RelativeX, (*_TWO_POINTS, "fun")),
    "RelativeY": (RelativeY, (*_TWO_POINTS, "fun")),
    "RelativeDistance": (Distance, (*_TWO_POINTS, "fun")),
    "RevoluteJoint": (Revolute, _TWO_POINTS),
    "TranslationalJoint": (Translational, ("body1", "sP1", "vP1", "body2", "sP2", "vP2")),
    "RackPinion": (
        RackAndPinion, ("body1", "sP1", "sQ1", "theta1", "body2", "sP2", "R2", "theta2"),
    ),
}  # fmt: skip
"""Constraint types of simEngine2D: what each becomes, and the fields that are its arguments."""

_TYPES = {kind.lower(): kind for kind in _CONSTRAINTS}
_KEYS = {key for _, keys in _CONSTRAINTS.values() for key in keys} | {
    "simulation", "tend", "stepSize", "outputSteps", "name", "bodies", "constraints", "id", "q0",
    "type", *_IGNORED,
}  # fmt: skip
_WORDS = {key.lower(): key for key in _KEYS}
"""Types and keys by their lower case: simEngine2D's own files differ in it."""
