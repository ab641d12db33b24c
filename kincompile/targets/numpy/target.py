"""The NumPy target: one readable module that imports math and NumPy and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.ir.elimination import plan_solve
from kincompile.names import rate
from kincompile.targets.constants import constants
from kincompile.targets.evaluators import EVALUATORS
from kincompile.targets.headings import header, place, short_title, title
from kincompile.targets.lines import WIDTH, broken, commented, indented, quoted, wrapped
from kincompile.targets.naming import NameTable
from kincompile.targets.numpy.dialect import NUMPY
from kincompile.targets.numpy.solve import solve_functions
from kincompile.targets.planned_solve import schedule_solve
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.targets.evaluators import Listing
    from kincompile.targets.printer import Printer

DIALECT = NUMPY

FUNCTIONS = {
    "asin": "np.arcsin", "acos": "np.arccos", "atan": "np.arctan", "atan2": "np.arctan2",
    "asinh": "np.arcsinh", "acosh": "np.arccosh", "atanh": "np.arctanh",
    "pow": "np.power", "where": "np.where", "cos_sin": "staticmethod(_cos_sin)",
}  # fmt: skip
"""NumPy's names of elementary functions where they are not those of `math`."""

SCALAR_FUNCTIONS = {
    "where": "staticmethod(lambda condition, a, b: a if condition else b)",
    "cos_sin": "staticmethod(lambda angle, cos=math.cos, sin=math.sin: (cos(angle), sin(angle)))",
}
"""Functions that `math` does not have."""

RESERVED: tuple[str, ...] = (
    "f", "q", "q_dot", "t", "p", "np", "math", "pi", "spline", *FUNCTIONS,
    "sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
)  # fmt: skip
"""Names that the code of the functions uses."""

RESERVED_IN_SOLVE = ("f", "J", "F", "b")


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a function of a point, or of arrays of points."""
    quantities = EVALUATORS[name]
    states = "q, q_dot" if "gamma" in quantities else "q"
    body = [*_unpack(code.program, listing), *function_body(quantities, listing, code, printer)]
    return ["", "", f"def _{name}(f, {states}, t, p):", *(f"    {line}" for line in body)]


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the module."""
    kernels = [line for lines in functions.values() for line in lines]
    lanes = list(EVALUATORS)
    plan = plan_solve(code)
    if plan is not None:
        solving = schedule_solve(code, plan, NameTable(RESERVED_IN_SOLVE))
        kernels += ["", "", *solve_functions(code, solving)]
        lanes += ["factor", "solve"]
    data = _data(code, kernels, sorted(called))
    data["lanes"] = indented(f'"{name}": _{name},' for name in lanes)
    data["is_planned"] = plan is not None
    data["has_large_blocks"] = plan is not None and plan.has_large_blocks
    data |= shared_text()
    return {f"{code.program.name}.py": fill("numpy/module.py.jinja", data)}


def _data(code: InlineProgram, kernels: list[str], called: list[str]) -> dict[str, Any]:
    program = code.program
    entries = [entry for section in code.sections for entry in section.entries["Phi_q"]]
    values = [code.number(entry.node) for entry in entries]
    numbers = [value for value in values if value is not None]
    fixed = [k for k, value in enumerate(values) if value is not None]
    moving = [k for k, value in enumerate(values) if value is None]
    return {
        **constants(code, 1, "({}, {})"),
        "title": program.name,
        "header": "\n".join(header(code)),
        "nonzeros": len(entries),
        "redundant": indented(quoted(program.redundant)),
        "units": indented(_units(program)),
        "constants": indented(wrapped(repr(float(value)) for value in numbers)),
        "fixed": indented(wrapped(map(str, fixed))),
        "varying": indented(wrapped(map(str, moving))),
        "tables": "\n".join(_tables(program)),
        "scalar_functions": indented(scalar_functions(called)),
        "array_functions": indented(array_functions(called)),
        "kernels": "\n".join(kernels),
    }


def shared_text() -> dict[str, str]:
    """Return the parts that both forms of a module have in common, by slot."""
    files = {
        "arguments": "arguments",
        "block_functions": "blocks",
        "cos_sin": "cos_sin",
        "spline": "spline",
    }
    return {slot: fill(f"numpy/{name}.py.jinja", {}).rstrip() for slot, name in files.items()}


def scalar_functions(called: Iterable[str]) -> list[str]:
    """Return a class body that maps the functions called to those of `math`."""
    return [f"{name} = {SCALAR_FUNCTIONS.get(name, f'math.{name}')}" for name in called]


def array_functions(called: Iterable[str]) -> list[str]:
    """Return a class body that maps the functions called to those of NumPy."""
    return [f"{name} = {FUNCTIONS.get(name, f'np.{name}')}" for name in called]


def _units(program: Program) -> list[str]:
    units = {item.name: item.unit for item in program.coordinates}
    units.update({item.name: item.unit for item in program.parameters})
    return [f"{name!r}: {unit!r}," for name, unit in units.items()]


def _tables(program: Program) -> list[str]:
    lines = []
    for name, spline in program.tables.items():
        lines += [f"{name} = (", "    np.array(("]
        lines += [f"        {line}" for line in wrapped([repr(x) for x in spline.breaks])]
        lines += ["    )),", "    np.array(("]
        lines += [f"        ({', '.join(repr(x) for x in row)})," for row in spline.coefficients]
        lines += ["    )),", ")"]
    return lines


def function_body(
    quantities: Sequence[str],
    listing: Listing,
    code: InlineProgram,
    printer: Printer,
    *,
    titled: bool = True,
) -> list[str]:
    """Return the lines of a function whose inputs have their names already.

    Without `titled` there are no comments that name constraints: the code is for many.
    """
    body = []
    if listing.functions:
        called = ", ".join(listing.functions)
        body.append(f"{called} = {', '.join(f'f.{name}' for name in listing.functions)}")
    body += _frames(listing, printer)
    for section, assignments in listing.steps:
        body += [f"# {short_title(section)}"] if titled else []
        for item in assignments:
            body += _assignment(item.name, printer.definition(item.node))
    body.append("return (")
    for quantity, rows in listing.results:
        if len(quantities) > 1:
            body.append(f"    # {quantity}")
        for section, entries in rows:
            if titled and entries:
                body += [f"    {line}" for line in commented(title(section))]
            for entry in entries:
                comment = place(quantity, entry, code) if titled else ""
                body += _element(printer.text(entry.node), comment)
    body.append(")")
    if body[-2] == "return (":
        body[-2:] = ["return ()"]
    return body


def _assignment(name: str, text: str) -> list[str]:
    """Return a value with its name, a long one in parentheses."""
    lines = broken(text)
    if len(lines) == 1:
        return [f"{name} = {text}"]
    return [f"{name} = (", *(f"    {line}" for line in lines), ")"]


def _element(text: str, comment: str) -> list[str]:
    """Return an element of the returned tuple, a long one continued with deeper indentation."""
    first, *rest = broken(text)
    lines = [f"    {first}", *(f"        {line}" for line in rest)]
    lines[-1] += f",  # {comment}" if comment else ","
    return lines


def _unpack(program: Program, listing: Listing) -> list[str]:
    """Return the lines that name the inputs: all of a vector, or the few that are read."""
    coordinates = [item.name for item in program.coordinates]
    vectors = {
        "q": coordinates,
        "q_dot": [rate(name) for name in coordinates],
        "p": [item.name for item in program.parameters],
    }
    lines, names = [], listing.input_names
    for vector, members in vectors.items():
        read = [k for k, name in enumerate(members) if name in listing.inputs]
        if 2 * len(read) > len(members):
            lines += _targets([names[name] for name in members], vector)
        elif read:
            left = ", ".join(names[members[k]] for k in read)
            lines.append(f"{left} = {', '.join(f'{vector}[{k}]' for k in read)}")
    return lines


def _targets(members: Sequence[str], vector: str) -> list[str]:
    """Return the unpacking of a whole vector, a long one in parentheses."""
    left = f"({members[0]},)" if len(members) == 1 else ", ".join(members)
    if len(left) <= WIDTH - 8:
        return [f"{left} = {vector}"]
    return ["(", *(f"    {line}" for line in wrapped(members)), f") = {vector}"]


def _frames(listing: Listing, printer: Printer) -> list[str]:
    """Return the cosine and sine of each body's angle, a line a body."""
    if not listing.frames:
        return []
    lines = ["# body frames: A = [[c, -s], [s, c]]"]
    for frame in listing.frames:
        left = ", ".join(item.name for item in frame.values)
        if frame.angle is not None:
            lines.append(f"{left} = cos_sin({printer.text(frame.angle)})")
        else:
            lines += [f"{item.name} = {printer.definition(item.node)}" for item in frame.values]
    return lines
