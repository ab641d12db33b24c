"""A mechanism, or a system of free equations, as data: TOML or JSON.

    kincompile = 1
    name = "arm"
    bodies = [{ name = "arm", guess = [1, 0, 0] }]

    [[constraints]]
    type = "Revolute"
    name = "pin"
    i = "arm"
    point_i = [-1, 0]
    j = "ground"
    point_j = [0, 0]

A file can do nothing but describe: its formulas are parsed by a whitelist (`safe_expressions`), and
nothing in it is run. All problems are reported together, each with line and field.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.files.body_reader import BodyReader
from kincompile.files.data_text import listed_problems, read_json, read_toml
from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.files.file_format import (
    FIELDS,
    MOST_POINTS,
    SMOOTHNESS,
    TASKS,
    VERSION,
    constraint_fields,
    fields_of,
    load_fields,
)
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Coordinate, Parameter
from kincompile.model.equation import Equation
from kincompile.model.expressions import alpha, t
from kincompile.model.outputs import Output
from kincompile.model.system import ConstraintSystem
from kincompile.names import listed, rate, shown, suggestion

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from kincompile.files.data_lines import Address
    from kincompile.model.arguments import Argument
    from kincompile.model.constraint import Constraint, Element
    from kincompile.model.load import Load
    from kincompile.model.mechanism import Mechanism

Row = dict[str, Any]


def read_data_model(path: Path, content: bytes) -> Mechanism | ConstraintSystem:
    """Read a model from TOML or JSON.

    Returns
    -------
    Mechanism or ConstraintSystem
        A mechanism where the file has no coordinates of its own.

    Raises
    ------
    ModelError
        If it is not a model; every problem with line and field.
    """
    read = read_toml if path.suffix.lower() == ".toml" else read_json
    reader = _ModelReader(read(path, content))
    model = reader.read()
    if reader.problems or model is None:
        raise listed_problems(reader.problems)
    return model


class _ModelReader(BodyReader):
    """Reads the sections of a model one after the other."""

    def read(self) -> Mechanism | ConstraintSystem | None:
        """Return the model as far as it could be read, None where nothing is left of it."""
        data = self.document.data
        if not self._is_model(data):
            return None
        self.has_fields((), data, fields_of("model", self.words.count))
        name = self.name(data, (), "the model") or "model"
        given = [self._parameter(*item) for item in self.rows(data, "parameters")]
        parameters = [item for item in given if item]
        options = {
            "length_unit": self.unit(data.get("length_unit", "m"), ("length_unit",), "lengths"),
            **self._analysis(data.get("analysis", {})),
        }
        drawn = self.words.mechanism(name)
        if "sketch" in data:
            drawn = self.drawn(name, options, parameters, data["sketch"])
        bodies = [self.body(*item) for item in self.rows(data, "bodies")]
        free = [self._coordinate(*item) for item in self.rows(data, "coordinates")]
        points = [self.point(*item) for item in self.rows(data, "points")]
        rows = self.rows(data, "constraints")
        for _, row in rows:
            self._declare_contacts(row)
        constraints = [self._constraint(*item) for item in rows]
        outputs = [self._output(*item) for item in self.rows(data, "outputs")]
        loads = [self._load(*item) for item in self.rows(data, "loads")]
        content = {
            "parameters": drawn.parameters or parameters,
            "bodies": [*drawn.bodies, *(item for item in bodies if item)],
            "coordinates": {item.name: item.guess for item in free if item},
            "constraints": [*drawn.constraints, *(item for item in constraints if item)],
            "outputs": [*drawn.outputs, *(item for item in (*points, *outputs) if item)],
            "loads": [item for item in loads if item],
            "gravity": self.place(data, (), "gravity"),
            "tasks": self._tasks(data),
        }
        return self._checked(name, content, options)

    def _tasks(self, data: Row) -> Row:
        """Return the tables of commands, whose fields are those of the format."""
        found = {key: data[key] for key in TASKS if key in data}
        for key, table in found.items():
            self.table(table, key, (key,))
        return found

    def _is_model(self, data: Any) -> bool:
        """Check that the file is of this format, and of this version."""
        if not isinstance(data, dict):
            self.problem((), f"expected names and values, not {shown(data)}")
        elif "kincompile" not in data:
            self.problem((), f"this is not a model for kincompile: one says kincompile = {VERSION}")
        elif type(data["kincompile"]) is not int or data["kincompile"] != VERSION:
            given = shown(data["kincompile"])
            self.problem(
                ("kincompile",), f"format {VERSION} is read here, not {given}; convert the file"
            )
        elif not self._has_dimensions(data.get("space", PLANE)):
            text = f"it is {PLANE} or {SPACE}, not {shown(data['space'])}"
            self.problem(("space",), text)
        return not self.problems

    def _has_dimensions(self, given: Any) -> bool:
        """Return whether the file is of the plane or of space, and take its words."""
        known = type(given) is int and given in (PLANE, SPACE)
        if known:
            self.words = dimensions(given)
        return known

    def _checked(
        self, name: str, content: dict[str, Any], options: dict[str, Any]
    ) -> Mechanism | ConstraintSystem | None:
        model = self.words.mechanism(name, **options)
        model.parameters, model.bodies = content["parameters"], content["bodies"]
        model.constraints, model.outputs = content["constraints"], content["outputs"]
        model.gravity, model.tasks = content["gravity"], content["tasks"]
        for load in content["loads"]:
            model.add(load)
        free = content["coordinates"]
        if self.problems and not (model.constraints and (model.bodies or free)):
            return None
        try:
            if not free:
                model.system()
                return model
            return ConstraintSystem(
                name,
                coordinates=list(free),
                equations=model.written(),
                parameters=model.parameters,
                guess=list(free.values()),
                bodies=model.bodies,
                outputs=model.outputs,
                loads=model.loads,
                gravity=model.gravity,
                ground=model.ground,
                tasks=model.tasks,
                **options,
            )
        except ModelError as error:
            self.problems += [self.located(problem) for problem in error.problems]
        return None

    def _analysis(self, given: Any) -> Row:
        if not isinstance(given, dict):
            self.problem(("analysis",), f"expected a table of end and points, not {shown(given)}")
            return {}
        self.has_fields(("analysis",), given, FIELDS["analysis"])
        found: Row = {}
        if "end" in given:
            names = {name: symbol for name, symbol in self.names.items() if symbol != t}
            found["end"] = self.constant(given["end"], ("analysis", "end"), names)
        points = given.get("points", 101)
        if type(points) is int and 1 <= points <= MOST_POINTS:
            return {**found, "points": points}
        text = f"expected a whole number from 1 to {MOST_POINTS:,}, not {shown(points)}"
        self.problem(("analysis", "points"), text)
        return found

    def _parameter(self, address: Address, row: Row) -> Parameter | None:
        complete = self.has_fields(address, row, FIELDS["parameter"])
        name = self.name(row, address, "a parameter")
        given = self.values(row, FIELDS["parameter"], address, {})
        if name:
            self.names[name] = sympy.Symbol(name)
            self.remember(f"parameter {name!r}", address)
        is_new = self.is_free(name, address)
        return Parameter(name, **{"default": 1.0, **given}) if is_new and complete else None

    def _coordinate(self, address: Address, row: Row) -> Coordinate | None:
        self.has_fields(address, row, FIELDS["coordinate"])
        name = self.name(row, address, "a coordinate")
        given = self.values(row, FIELDS["coordinate"], address, self.names)
        if name:
            self.names[name] = sympy.Symbol(name)
            self.remember(f"guess of {name}", address)
        return Coordinate(name, **given) if self.is_free(name, address) else None

    def _output(self, address: Address, row: Row) -> Output | None:
        complete = self.has_fields(address, row, FIELDS["output"])
        name = self.name(row, address, "an output")
        self.remember(f"output {name!r}", address)
        given = self.values(row, FIELDS["output"], address, self._moving_names())
        is_new = self.is_free(name, address, "output")
        return Output(name, **{"expression": 0, **given}) if is_new and complete else None

    def _moving_names(self) -> dict[str, sympy.Expr]:
        """Return the names that may occur in an output or a load: those of rates too."""
        symbols = [item for item, value in self.names.items() if value.is_Symbol]
        rates = [rate(item, order) for item in symbols for order in (1, 2)]
        return {**self.names, **self.spins, **{item: sympy.Symbol(item) for item in rates}}

    def _load(self, address: Address, row: Row) -> Load | None:
        known = self.words.loads()
        before = len(self.problems)
        name = self.name(row, address, "a load")
        kind = self._type_of(row, address, known)
        if kind is None:
            return None
        self.is_free(name, address, "load")
        self.remember(f"{kind} {name!r}", address)
        self.remember(f"the load {name!r}", address)
        self.has_fields(address, row, load_fields(known[kind]))
        given = self._arguments(address, row, known[kind], name)
        return known[kind](name, **given) if len(self.problems) == before else None

    def _type_of(self, row: Row, address: Address, known: Collection[str]) -> str | None:
        kind = row.get("type")
        if isinstance(kind, str) and kind in known:
            return kind
        hint = suggestion(kind, known) if isinstance(kind, str) else ""
        given = f"no type {shown(kind)}" if "type" in row else "no type"
        self.problem((*address, "type"), f"there is {given}{hint}; types: {listed(known, 20)}")
        return None

    def _declare_contacts(self, row: Row) -> None:
        kind, name = row.get("type"), row.get("name")
        known = self.words.constraints
        if isinstance(kind, str) and kind in known and isinstance(name, str):
            contacts = known[kind].contacts_of(name)
            self.names |= {contact: sympy.Symbol(contact) for contact in contacts}

    def _constraint(self, address: Address, row: Row) -> Constraint | Equation | None:
        before = len(self.problems)
        known = self.words.constraints
        kind = self._type_of(row, address, (*known, "Equation"))
        if kind is None:
            return None
        name = self.name(row, address, "a constraint")
        self._remember_constraint(kind, name, address)
        found = (
            self._equation(address, row, name)
            if kind == "Equation"
            else self._joint(address, row, known[kind], name)
        )
        return found if len(self.problems) == before else None

    def _remember_constraint(self, kind: str, name: str, address: Address) -> None:
        """Note how the checks of the system call a constraint and its arguments."""
        self.is_free(name, address, "constraint")
        for title in (f"{kind} {name!r}", f"equation {name!r}", f"equation '{name}."):
            self.remember(title, address)

    def _equation(self, address: Address, row: Row, name: str) -> Equation:
        self.has_fields(address, row, FIELDS["Equation"])
        given, place = row.get("expressions", [1]), (*address, "expressions")
        count = max(1, len(given)) if isinstance(given, list) else 1
        return Equation(
            name,
            *self.expressions(given, place, self.names, "a list of formulas", count),
            corners=self._corners(row, address),
        )

    def _joint(
        self, address: Address, row: Row, kind: type[Constraint], name: str
    ) -> Constraint | None:
        fields = constraint_fields(kind)
        self.has_fields(address, row, fields)
        arguments = self._arguments(address, row, kind, name)
        if len(arguments) < len(kind.arguments()):
            return None
        if "guess" in row and "guess" in fields:
            arguments["guess"] = self._contact_guess(kind, row["guess"], (*address, "guess"))
        return kind(name, **arguments, corners=self._corners(row, address))

    def _arguments(self, address: Address, row: Row, kind: type[Element], name: str) -> Row:
        """Return the arguments that are given, whose places the checks of the system know."""
        found = {
            key: self._argument(item, row[key], (*address, key))
            for key, item in kind.arguments().items()
            if key in row
        }
        for key in found:
            self.remember(f"{kind.__name__} {name!r}, {key}", (*address, key))
        return found

    def _contact_guess(self, kind: type[Constraint], given: Any, address: Address) -> Any:
        if not isinstance(given, list):
            return self.expression(given, address, self.names)
        count = len(kind.contacts)
        return self.expressions(given, address, self.names, f"{count} start values", count)

    def _argument(self, item: Argument, given: Any, address: Address) -> Any:
        if item.kind is Kind.BODY:
            return self.body_name(given, address)
        if item.kind in (Kind.POINT, Kind.AXIS):
            return self.components(given, address, self.words.place)
        if item.kind is Kind.PROFILE:
            return self._profile(given, address)
        if item.kind in (Kind.VALUE, Kind.DISTANCE):
            return self.driven(given, address)
        if item.kind is Kind.LOAD:
            return self._force(given, address)
        if item.kind is Kind.LOADS:
            size = self.words.count
            if not isinstance(given, list) or len(given) != size:
                expected = ("[F_x, F_y]", "[F_x, F_y, F_z]")[size - PLANE]
                self.problem(address, f"expected {expected}, not {shown(given)}")
                return (1.0,) * size
            return tuple(self._force(part, (*address, k)) for k, part in enumerate(given))
        return self.expression(given, address, self.names)

    def _force(self, given: Any, address: Address) -> Any:
        if isinstance(given, dict):
            return self.driven(given, address)
        return self.expression(given, address, self._moving_names())

    def _profile(self, given: Any, address: Address) -> Any:
        if not isinstance(given, dict):
            return self.expression(given, address, {**self.names, alpha.name: alpha})
        if not self.has_fields(address, given, FIELDS["profile"]):
            return 1.0
        if given["smoothness"] != SMOOTHNESS or isinstance(given["smoothness"], bool):
            self.problem(
                (*address, "smoothness"),
                f"a table becomes a periodic quintic spline with {SMOOTHNESS} continuous "
                f"derivatives; write smoothness = {SMOOTHNESS}",
            )
        return tuple(self._numbers(given[key], (*address, key)) for key in ("angles", "radii"))

    def _corners(self, row: Row, address: Address) -> bool:
        given = row.get("corners", False)
        if not isinstance(given, bool):
            self.problem((*address, "corners"), f"expected true or false, not {shown(given)}")
        return given is True

    def _numbers(self, given: Any, address: Address) -> list[float]:
        if not isinstance(given, list):
            self.problem(address, f"expected a list of numbers, not {shown(given)}")
            return []
        return [self.number(item, (*address, k)) for k, item in enumerate(given)]
