"""A model as the text of a file, TOML or JSON, which reads back to the same model."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import sympy
from sympy.printing.str import StrPrinter

from kincompile.errors import ModelError
from kincompile.files.dimensions import SPACE
from kincompile.files.file_format import TASKS, VERSION, load_fields
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body
from kincompile.model.constraint import CamConstraint, Constraint, Element
from kincompile.model.declared import declared_fields
from kincompile.model.directions import VectorFunction
from kincompile.model.expressions import as_expression, as_sympy, deg, t
from kincompile.model.laws import TableLaw
from kincompile.model.outputs import Output, ResolvedOutput
from kincompile.model.resolve import Joint
from kincompile.model.sections import SMOOTHNESS, Analysis, MotionRows, Profile
from kincompile.model.system import ConstraintSystem
from kincompile.model.text_views import model_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from kincompile.model.bodies import Coordinate
    from kincompile.model.expressions import Scalar
    from kincompile.model.laws import MotionLaw
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.resolve_loads import AppliedLoad


@model_text.register(ConstraintSystem)
def _model_text(system: ConstraintSystem, form: str) -> str:
    data = model_data(system)
    if form == "toml":
        return toml_text(data)
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def model_data(system: ConstraintSystem) -> dict[str, Any]:
    """Return a system as the values of a model file."""
    sections = {
        "parameters": [row(item) for item in system.parameters],
        "bodies": [row(item.written()) for item in system.bodies],
        "coordinates": [row(item) for item in _free_coordinates(system)],
        "points": [row(item) for item in system.body_points],
        "outputs": _outputs(system),
        "limits": [row(item) for item in system.limits],
        "loads": [_load(item) for item in system.loads if type(item.written).__name__ != "Mass"],
        "constraints": [_constraint(item) for item in system.constraints if not _is_own(item)],
    }
    gravity = [value(item) for item in system.gravity]
    return {
        "kincompile": VERSION,
        "name": system.name,
        **({"space": SPACE} if len(system.ground.kind.axes) == SPACE else {}),
        "length_unit": system.length_unit,
        **({} if system.mass_unit == "kg" else {"mass_unit": system.mass_unit}),
        "analysis": row(_analysis(system)),
        **({"gravity": gravity} if any(gravity) else {}),
        **({"outline": data(system.ground.outline)} if len(system.ground.outline) else {}),
        **{name: rows for name, rows in sections.items() if rows},
        **system.tasks,
    }


def _analysis(system: ConstraintSystem) -> Analysis:
    given = system.end_given
    end = given if isinstance(given, sympy.Expr) else float(given)
    return Analysis(end, int(system.points))


def row(item: Any) -> dict[str, Any]:
    """Return what is declared as the fields of its table; defaults are left out."""
    found = {}
    cls: type = type(item)
    for name, field in declared_fields(cls).items():
        given = getattr(item, field.attribute)
        if field.is_written or not _is_same(given, field.default):
            found[name] = data(given)
    return found


def _is_same(given: Any, default: Any) -> bool:
    """Return whether a value is a default, a list entry by entry."""
    if default is None or isinstance(default, str | float):
        return bool(given == default)
    return len(given) == len(default) and all(x == y for x, y in zip(given, default, strict=True))


def data(given: Any) -> Any:
    """Return a value as a file has it: a name, a list, a number or a formula."""
    if isinstance(given, str | Body):
        return getattr(given, "name", given)
    return [data(item) for item in given] if hasattr(given, "__len__") else value(given)


def _is_own(item: Joint | FreeEquation) -> bool:
    """Return whether it is an equation that a body brings itself."""
    return isinstance(item, Joint) and item.written.is_own


def _outputs(system: ConstraintSystem) -> list[dict[str, Any]]:
    """Return the outputs but those of points, whose coordinates have names in the others."""
    named = {
        coordinate: sympy.Symbol(name)
        for item in system.body_points
        for name, coordinate in zip(item.output_names, item.coordinates, strict=True)
    }
    rows = []
    for item in system.observers:
        if not isinstance(item, ResolvedOutput):
            continue
        expression = as_sympy(item.written.expression).xreplace(named)
        rows.append(row(Output(item.name, expression, item.unit)))
    return rows


def _free_coordinates(system: ConstraintSystem) -> Iterable[Coordinate]:
    """Return the coordinates that neither a body nor a cam has brought along."""
    others = {name for body in system.bodies for name in body.coordinates}
    for item in system.constraints:
        if isinstance(item, Joint):
            others.update(item.written.contact_names if item.written.contacts else ())
    return (item for item in system.coordinates if item.name not in others)


def _constraint(item: Joint | FreeEquation) -> dict[str, Any]:
    if not isinstance(item, Joint):
        expressions = [value(expression) for expression in item.expressions]
        return {"type": "Equation", "name": item.name, "expressions": expressions, **_corners(item)}
    return _row(item) | _corners(item) | _guess(item.written)


def _load(item: AppliedLoad) -> dict[str, Any]:
    """Return a load; arguments that are zero, as their defaults are, are left out."""
    fields = load_fields(type(item.written))
    return {key: x for key, x in _row(item).items() if x != 0 or fields[key].is_required}


def _row(item: Joint | AppliedLoad) -> dict[str, Any]:
    """Return type, name and arguments."""
    written = item.written
    row: dict[str, Any] = {"type": type(written).__name__, "name": written.name}
    bodies = iter(item.bodies)
    for name, argument in written.arguments().items():
        if argument.kind is Kind.BODY:
            row[name] = next(bodies).name
        elif argument.kind in (Kind.POINT, Kind.AXIS):
            row[name] = [value(number) for number in getattr(written, name)]
        elif argument.kind is Kind.PROFILE:
            row[name] = _profile(written, name, item.profiles[argument.symbol])
        elif argument.kind is Kind.LOADS:
            row[name] = [_scalar(number) for number in item.points[argument.symbol]]
        else:
            row[name] = _scalar(item.scalars[argument.symbol])
    return row


def _corners(item: Joint | FreeEquation) -> dict[str, Any]:
    return {"corners": True} if item.corners else {}


def _scalar(given: Scalar) -> Any:
    """Return a value: a table over time as its columns, anything else as a number or formula."""
    if isinstance(given, TableLaw) and not given.order:
        (over,), (times, values, velocities) = given.args, given.given
        return row(MotionRows(times, values, velocities, None if over == t else over))
    return value(given)


def _profile(written: Element, name: str, rho: sympy.Expr) -> Any:
    given = getattr(written, name)
    if isinstance(given, tuple | list):
        angles, radii = ([float(number) for number in column] for column in given)
        return row(Profile(angles, radii, SMOOTHNESS))
    return value(rho)


def _guess(written: Constraint) -> dict[str, Any]:
    if not isinstance(written, CamConstraint) or written.guess is None:
        return {}
    guess = written.guess
    if isinstance(guess, tuple | list):
        return {"guess": [value(item) for item in guess]}
    return {"guess": value(guess)}


def value(given: Any) -> int | float | str:
    """Return a number as it is, an expression as the text that is read back to it."""
    expression = as_expression(given)
    if not isinstance(expression, sympy.Expr):
        return expression
    if isinstance(expression, sympy.Integer):
        return int(expression)
    if isinstance(expression, sympy.Float):
        return float(expression)
    rare = expression.atoms(sympy.NumberSymbol) - {sympy.pi, sympy.E, deg}
    if rare:
        expression = expression.xreplace({symbol: sympy.Float(symbol) for symbol in rare})
    named = {
        item: sympy.Function(type(item).__name__)(*item.args)
        for item in expression.atoms(VectorFunction)
    }
    expression = expression.xreplace(named)  # people read it written out, a file by its name
    return str(_Printer().doprint(expression))  # type: ignore[no-untyped-call]


class _Printer(StrPrinter):
    """Prints an expression in the language of `safe_expressions`, no digit lost."""

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def _print_Exp1(self, expr: sympy.Expr) -> str:
        del expr
        return "exp(1)"

    def _print_And(self, expr: sympy.And) -> str:
        return self._connected(expr, " and ")

    def _print_Or(self, expr: sympy.Or) -> str:
        return self._connected(expr, " or ")

    def _connected(self, expr: sympy.And | sympy.Or, word: str) -> str:
        arguments = sorted(expr.args, key=sympy.default_sort_key)
        return word.join(f"({self._print(item)})" for item in arguments)

    def _print_MotionLaw(self, expr: MotionLaw) -> str:
        if expr.order:
            return str(self._print(expr.in_pieces()))
        return str(self._print_Function(expr))  # type: ignore[no-untyped-call]

    def _print_TableLaw(self, expr: sympy.Expr) -> str:
        return self._print_PeriodicSpline(expr)

    def _print_PeriodicSpline(self, expr: sympy.Expr) -> str:
        raise ModelError(
            f"{expr} is a table within an expression, which a file cannot hold; give the table as "
            "the profile, or the value, itself"
        )


def toml_text(data: dict[str, Any]) -> str:
    """Return the values of a model file as TOML: a line a body, a block a constraint."""
    lines: list[str] = []
    for key, content in data.items():
        if key == "constraints":
            for row in content:
                lines += ["", "[[constraints]]"]
                lines += _fields(row)
        elif key in TASKS and isinstance(content, dict):
            lines += ["", f"[{key}]", *_fields(content)]
        else:
            lines += _fields({key: content})
    return "\n".join(lines) + "\n"


def _fields(content: dict[str, Any]) -> Iterator[str]:
    """Yield fields as TOML, a line each; of a list of tables a line a table."""
    for name, item in content.items():
        if isinstance(item, list) and item and isinstance(item[0], dict):
            yield from (f"{_key(name)} = [", *(f"    {_toml(row)}," for row in item), "]")
        else:
            yield f"{_key(name)} = {_toml(item)}"


def _toml(item: Any) -> str:
    if isinstance(item, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(part)}" for key, part in item.items()) + " }"
    if isinstance(item, list):
        return "[" + ", ".join(map(_toml, item)) + "]"
    return json.dumps(item, ensure_ascii=False) if isinstance(item, str | bool) else repr(item)


def _key(name: str) -> str:
    """Return a key, in quotes where it has to be."""
    is_bare = name.isascii() and name.replace("-", "_").isidentifier()
    return name if is_bare else json.dumps(name, ensure_ascii=False)
