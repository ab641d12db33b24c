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

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.files import file_format as form
from kincompile.files.body_reader import BodyReader
from kincompile.files.data_text import listed_problems, read_json, read_toml
from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.model.arguments import Kind
from kincompile.model.equation import Equation
from kincompile.model.expressions import alpha, t
from kincompile.model.sections import Profile
from kincompile.model.system import ConstraintSystem
from kincompile.names import listed, rate, shown, suggestion

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

    from kincompile.files.data_lines import Address
    from kincompile.model.arguments import Argument
    from kincompile.model.bodies import Coordinate, Parameter
    from kincompile.model.constraint import Constraint, Element
    from kincompile.model.declared import Field, Schema
    from kincompile.model.limits import JointLimit
    from kincompile.model.load import Load
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.outputs import Output

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
        fields = form.fields_of("model", self.words.count)
        self.remember("outline of ground", ("outline",))
        self.has_fields((), {"kincompile": form.VERSION, **data}, fields)
        name = self.name(data, (), "the model") or "model"
        given = [self._parameter(*item) for item in self.rows(data, "parameters")]
        parameters = [item for item in given if item]
        options = {
            "length_unit": self.unit(data.get("length_unit", "m"), ("length_unit",), "lengths"),
            **self.values(data, {"mass_unit": fields["mass_unit"]}, (), None),
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
        limits = [self._limit(*item) for item in self.rows(data, "limits")]
        outputs = [self._output(*item) for item in self.rows(data, "outputs")]
        loads = [self._load(*item) for item in self.rows(data, "loads")]
        content = {
            "parameters": drawn.parameters or parameters,
            "bodies": [*drawn.bodies, *(item for item in bodies if item)],
            "coordinates": {item.name: item.guess for item in free if item},
            "constraints": [*drawn.constraints, *(item for item in constraints if item)],
            "drawn": drawn.drawn,
            "outputs": [*drawn.outputs, *(item for item in (*points, *outputs) if item)],
            "loads": [item for item in loads if item],
            "limits": [item for item in limits if item],
            "gravity": self._own(data, "gravity", (0,) * self.words.count),
            "outline": self._own(data, "outline", ()),
            "tasks": self._tasks(data),
        }
        return self._checked(name, content, options)

    def _own(self, data: Row, key: str, without: Any) -> Any:
        """Return a value of the file itself, in place of which another stands."""
        schema = form.fields_of("model", self.words.count)[key].schema
        given = self.value(data[key], schema, (key,), self.names) if key in data else None
        return without if given is None else given

    def _tasks(self, data: Row) -> Row:
        """Return the tables of commands, whose fields are those of the format."""
        found = {key: data[key] for key in form.TASKS if key in data}
        for key, table in found.items():
            self.table(table, key, (key,))
        return found

    def _is_model(self, data: Any) -> bool:
        """Check that the file is of this format, and of this version."""
        if not isinstance(data, dict):
            self.problem((), f"expected names and values, not {shown(data)}")
        elif "kincompile" not in data:
            self.problem(
                (), f"this is not a model for kincompile: one says kincompile = {form.VERSION}"
            )
            return bool({"constraints", "sketch"} & data.keys())  # it means to be one
        elif type(data["kincompile"]) is not int or data["kincompile"] != form.VERSION:
            given = shown(data["kincompile"])
            self.problem(
                ("kincompile",),
                f"format {form.VERSION} is read here, not {given}; convert the file",
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
        model.constraints, model.outputs = [], content["outputs"]
        model.drawn = content["drawn"]
        for item in content["constraints"]:
            model.add(item)
        model.gravity, model.tasks = content["gravity"], content["tasks"]
        model.limits, model.outline = content["limits"], content["outline"]
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
                ground=replace(model.ground, outline=model.outline),
                tasks=model.tasks,
                limits=model.limits,
                **options,
            )
        except ModelError as error:
            self.problems += [self.located(problem) for problem in error.problems]
        return None

    def _analysis(self, given: Any) -> Row:
        names = {name: symbol for name, symbol in self.names.items() if symbol != t}
        found = self.table(given, "analysis", ("analysis",), names)
        return {} if found is None else vars(found)

    def _titled(
        self, table: str, address: Address, row: Row, names: Mapping[str, sympy.Expr], words: str
    ) -> Any:
        """Return a table with a name as its declared class; None where the name cannot be used.

        `words` are how the checks of the system call it. An output is no symbol of formulas.
        """
        fields, is_output = form.fields_of(table), table == "output"
        complete = self.has_fields(address, row, fields)
        name = self.name(row, address, "an output" if is_output else f"a {table}")
        given = self.values(row, fields, address, names)
        self.remember(words.format(name), address)
        if name and not is_output:
            self.names[name] = sympy.Symbol(name)
        is_new = self.is_free(name, address, table if is_output else "symbol")
        return form.DECLARED[table](name, **given) if is_new and complete else None

    def _parameter(self, address: Address, row: Row) -> Parameter | None:
        found: Parameter | None = self._titled("parameter", address, row, {}, "parameter {!r}")
        return found

    def _coordinate(self, address: Address, row: Row) -> Coordinate | None:
        found: Coordinate | None = self._titled(
            "coordinate", address, row, self.names, "guess of {}"
        )
        return found

    def _output(self, address: Address, row: Row) -> Output | None:
        names = self._moving_names()
        found: Output | None = self._titled("output", address, row, names, "output {!r}")
        return found

    def _limit(self, address: Address, row: Row) -> JointLimit | None:
        self.remember(f"limit of {row.get('joint')!r}", address)
        found: JointLimit | None = self.made(
            self.words.mechanism.limit_type, row, address, self.names
        )
        return found

    def _moving_names(self) -> dict[str, sympy.Expr]:
        """Return the names that may occur in an output or a load: those of rates too."""
        symbols = [item for item, value in self.names.items() if value.is_Symbol]
        rates = [rate(item, order) for item in symbols for order in (1, 2)]
        return {**self.names, **self.spins, **{item: sympy.Symbol(item) for item in rates}}

    def _load(self, address: Address, row: Row) -> Load | None:
        before, known = len(self.problems), self.words.loads()
        name = self.name(row, address, "a load")
        kind = self._type_of(row, address, known)
        if kind is None:
            return None
        self.is_free(name, address, "load")
        self.remember(f"{kind} {name!r}", address)
        self.remember(f"the load {name!r}", address)
        given = self._arguments(address, row, known[kind], form.load_fields(known[kind]))
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
        if kind == "Equation":
            given = self._arguments(address, row, Equation, form.equation_fields())
        else:
            given = self._arguments(address, row, known[kind], form.constraint_fields(known[kind]))
        if len(self.problems) > before:
            return None
        if kind == "Equation":
            return Equation(name, *given.pop("expressions"), **given)
        return known[kind](name, **given)

    def _remember_constraint(self, kind: str, name: str, address: Address) -> None:
        """Note how the checks of the system call a constraint and its arguments."""
        self.is_free(name, address, "constraint")
        for title in (f"{kind} {name!r}", f"equation {name!r}", f"equation '{name}."):
            self.remember(title, address)

    def _arguments(
        self,
        address: Address,
        row: Row,
        cls: type[Element | Equation],
        fields: Mapping[str, Field],
    ) -> Row:
        """Return the fields that are given, whose places the checks of the system know."""
        self.has_fields(address, row, fields)
        known: Mapping[str, Argument] = getattr(cls, "arguments", dict)()
        found = {}
        for key in (key for key in fields if key in row and key not in ("type", "name")):
            place = (*address, key)
            found[key] = self._argument(known.get(key), row[key], fields[key].schema, place)
            self.remember(f"{cls.__name__} {row.get('name')!r}, {key}", place)
        return found

    def _argument(self, item: Argument | None, given: Any, schema: Schema, address: Address) -> Any:
        kind = item and item.kind
        if kind is Kind.BODY:
            return self.body_name(given, address)
        names = self._moving_names() if kind in (Kind.LOAD, Kind.LOADS) else self.names
        if kind is Kind.PROFILE:
            names = {**names, alpha.name: alpha}
        found = self.value(given, schema, address, names)
        return (found.angles, found.radii) if isinstance(found, Profile) else found
