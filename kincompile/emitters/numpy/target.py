"""The NumPy target: one readable module that imports math and NumPy and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from kincompile.emitters.evaluators import frames_title, varying, vectors
from kincompile.emitters.headings import entry_titles, header, short_title, title
from kincompile.emitters.lines import WIDTH, commented, indented, table, wrapped
from kincompile.emitters.numpy.solve import solve_functions
from kincompile.emitters.numpy.text import (
    NUMPY,
    assignments,
    element,
    list_texts,
    packed,
    solvability_text,
    tuple_text,
)
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.quantities import FORMAT, kernel_of, kernels, pattern_of, quantity_named, states_of
from kincompile.report.templates import fill

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.printer import Printer
    from kincompile.ir.inline import ConstraintRows, Entry, InlineProgram
    from kincompile.ir.program import Program
    from kincompile.quantities import Quantity

DIALECT = NUMPY

Style = Literal["titled", "plain", "packed"]

FUNCTIONS = {
    "asin": "np.arcsin", "acos": "np.arccos", "atan": "np.arctan", "atan2": "staticmethod(_atan2)",
    "asinh": "np.arcsinh", "acosh": "np.arccosh", "atanh": "np.arctanh",
    "pow": "np.power", "where": "np.where", "cos_sin": "staticmethod(_cos_sin)",
    "spline": "staticmethod(spline)",
}  # fmt: skip
"""NumPy's names of elementary functions where they are not those of `math`."""

SCALAR_FUNCTIONS = {
    "where": "staticmethod(lambda condition, a, b: a if condition else b)",
    "cos_sin": "staticmethod(lambda angle, cos=math.cos, sin=math.sin: (cos(angle), sin(angle)))",
    "spline": "staticmethod(spline)",
}
"""Functions that `math` does not have."""

RESERVED: tuple[str, ...] = (
    "f", "q", "q_dot", "q_ddot", "t", "p", "np", "math", "nan", "pi", *FUNCTIONS,
    "sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
)  # fmt: skip
"""Names that the code of the functions uses."""

RESERVED_IN_SOLVE = ("f", "J", "F", "b")


evaluators = kernels
"""The kernels."""


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a kernel: code for a point, or for arrays of points."""
    states = ", ".join(states_of(computed for computed, _ in listing.results))
    body = [*_unpack(code.program, listing)]
    body += function_body(code, listing, printer, "packed" if name == "kinematics" else "titled")
    matrix = _matrix(code, printer) if name == "position" else []
    return ["", "", *matrix, f"def _{name}(f, {states}, t, p):", *(f"    {line}" for line in body)]


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the module."""
    lines = [line for own in functions.values() for line in own]
    keys = list(functions)
    solving = schedule_solve(code, RESERVED_IN_SOLVE)
    plan = None if solving is None else solving.plan
    if solving is not None:
        lines += ["", "", *solve_functions(code, solving)]
        keys += ["factor", "solve"]
    text = "\n".join(lines)
    if plan is not None and plan.has_choices:
        called = {*called, "where"}
    large = {"has_large_blocks": plan is not None and plan.largest_call > 0}
    data = {
        **_constants(code),
        "kernels": text,
        "has_pi": _has("pi", text),
        "has_nan": _has("nan", text),
        "functions": "\n".join(_functions(code)),
        "results": "\n".join(_results(code.program)),
        "lanes": f"dict{tuple_text(f'{name}=_{name}' for name in keys)}",
        "is_planned": plan is not None,
        **support(code.program, called, **large),
        "portable": portable(code.program, called, **large),
    }
    return {f"{code.program.name}.py": fill("numpy/module.py.jinja", data)}


def _has(name: str, text: str) -> bool:
    """Return whether a constant is used as a word; `re` takes milliseconds for `pi` in `pin`."""
    start = text.find(name)
    while start >= 0:
        end = start + len(name)
        beside = text[start - 1 : start] + text[end : end + 1]
        if not any(letter.isalnum() or letter == "_" for letter in beside):
            return True
        start = text.find(name, end)
    return False


def _constants(code: InlineProgram) -> dict[str, Any]:
    """Return what the head of the module says."""
    program = code.program
    units = [item.unit for item in program.coordinates]
    units += [item.unit for item in program.parameters]
    units += [item.unit for item in program.outputs]
    return {
        "title": program.name,
        "header": "\n".join(header(code)),
        "name": program.name,
        "format": FORMAT,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "k": len(program.parameters),
        "nonzeros": len(code.pattern()),
        "solvability": solvability_text(program),
        "in_space": any("e0" in body.kernel.letters for body in program.bodies),
        "has_outputs": bool(program.outputs),
        "has_motion": bool(program.motion),
        "loads": tuple_text(f'"{item.name}"' for item in program.loads),
        "bodies": bodies_text(program),
        "units": tuple_text((f'"{unit}"' for unit in units), WIDTH - 44),
        **list_texts(program),
        "patterns": "\n".join(_patterns(code)),
        "tables": "\n".join(tables(program)),
    }


def bodies_text(program: Program) -> str:
    """Return the bodies: name, first column and number of columns of each."""
    return tuple_text(
        f'("{body.name}", {body.columns.start}, {len(body.columns)})' for body in program.bodies
    )


def _patterns(code: InlineProgram) -> Iterator[str]:
    """Yield the places of the entries of each matrix, and its entries that never change."""
    for quantity in code.program.quantities:
        if not quantity.is_matrix:
            continue
        entries, name = code.entries(quantity.name), pattern_of(quantity)
        places = wrapped([f"({entry.row}, {entry.column})" for entry in entries])
        values = {k: code.number(entry.node) for k, entry in enumerate(entries)}
        constants = [f"{k}: {float(x)!r}" for k, x in values.items() if x is not None]
        yield f"# row, column of the entries of {quantity.name} that are not identically zero"
        yield f"{name} = np.array((\n{indented(places)}\n), dtype=int).reshape(-1, 2)"
        yield "# number in the pattern and value of the entries that never change"
        suffix = name.removeprefix("PATTERN")
        yield f"_CONSTANTS{suffix} = {{\n{indented(wrapped(constants))}\n}}"


def _results(program: Program) -> Iterator[str]:
    """Yield the lines that say what the functions return."""
    sizes = {
        "equations": "N_EQUATIONS",
        "coordinates": "N_COORDINATES",
        "outputs": "len(OUTPUTS)",
        "parameters": "len(PARAMETERS)",
    }
    results: dict[str, list[str]] = {}
    for quantity in program.quantities:
        rows, name = sizes[quantity.rows], _result(quantity.name)
        if not quantity.is_matrix:
            results.setdefault(f"({rows},), range({rows})", []).append(name)
            continue
        columns, pattern = sizes[quantity.columns], pattern_of(quantity)
        constants = f"_CONSTANTS{pattern.removeprefix('PATTERN')}"
        places = f"{pattern} @ ({columns}, 1)"
        results[f"({rows}, {columns}), {places}, {constants}"] = [name]
        size = f"len({pattern})"
        results[f"({size},), range({size}), {constants}"] = [_result(f"{quantity.name}_nonzeros")]
    for arguments, names in results.items():
        yield f"{' = '.join(names)} = _Quantity({arguments})"


def _result(name: str) -> str:
    """Return the name of the result of a function; of M and Q it must not be that of the code."""
    return f"_{name.upper()}" if name != name.upper() else f"_{name}_RESULT"


def _functions(code: InlineProgram) -> Iterator[str]:
    """Yield the public functions of the quantities."""
    given = code.program.quantities
    found = kernels(given)
    counts = {
        item.name: sum(len(varying(code, part, item.name)) for part in code.sections)
        for item in given
    }
    for quantity, name, lines in public_functions(code.program, len(code.pattern())):
        kernel = kernel_of(quantity, found)
        computed = found[kernel]
        skip = sum(counts[item] for item in computed[: computed.index(quantity.name)])
        result = _result(name)
        yield from lines
        states = ", ".join(quantity.states)
        yield f"    return _evaluate(_{kernel}, {skip}, {result}, t, p, {states})\n\n"


def public_functions(
    program: Program, nonzeros: int
) -> Iterator[tuple[Quantity, str, tuple[str, ...]]]:
    """Yield name and first lines of the functions of quantities, of a matrix also its nonzeros."""
    for quantity in program.quantities:
        shape = ", ".join(map(str, program.shape_of(quantity)))
        texts = {quantity.name: f"{quantity.about.rstrip('.')}, shape (..., {shape})."}
        if quantity.is_matrix:
            size = nonzeros if quantity.name == "Phi_q" else "nonzeros"
            order = f"Entries of {quantity.name} in the order of {pattern_of(quantity)}"
            texts[f"{quantity.name}_nonzeros"] = f"{order}, shape (..., {size})."
        states = ", ".join(quantity.states)
        for name, text in texts.items():
            yield quantity, name, (f"def {name}({states}, t, p=DEFAULTS):", f'    """{text}"""')


def support(program: Program, called: Collection[str], *, has_large_blocks: bool) -> dict[str, str]:
    """Return the parts that the forms of a module have in common, by slot."""
    own = {*called, "spline"} if program.tables else called
    functions = {
        "scalar_functions": _class_body(own, SCALAR_FUNCTIONS, "math"),
        "array_functions": _class_body(own, FUNCTIONS, "np"),
        "spline": fill("numpy/spline.py.jinja", {}).rstrip() if program.tables else "",
        "has_frames": "cos_sin" in called,
        "has_angles": "atan2" in called,
        "has_large_blocks": has_large_blocks,
    }
    files = {"arguments": {}, "elementary": functions}
    return {name: fill(f"numpy/{name}.py.jinja", data).rstrip() for name, data in files.items()}


def portable(program: Program, called: Collection[str], *, has_large_blocks: bool) -> str:
    """Return the functions of a module on other libraries."""
    parts = {"cos_sin": ("cos", "sin"), "where": (), "pow": ()}
    names = {name for given in called for name in parts.get(given, (given,))}
    data = {
        "called": called,
        "names": tuple_text(f'"{name}"' for name in sorted(names)) if names else "",
        "has_tables": bool(program.tables),
        "has_large_blocks": has_large_blocks,
    }
    return fill("numpy/portable.py.jinja", data).rstrip()


def _class_body(called: Iterable[str], own: Mapping[str, str], module: str) -> str:
    """Return a class body that maps the functions called to a module's, or to our own."""
    return indented(f"{name} = {own.get(name, f'{module}.{name}')}" for name in sorted(called))


def tables(program: Program) -> list[str]:
    """Return the tables of splines."""
    lines = []
    for name, spline in program.tables.items():
        lines += [f"{name} = (", "    np.array(("]
        lines += [f"        {line}" for line in wrapped([repr(x) for x in spline.breaks])]
        lines += ["    )),", "    np.array(("]
        lines += [f"        ({', '.join(repr(x) for x in row)})," for row in spline.coefficients]
        lines += ["    )),", ")"]
    return lines


def function_body(
    code: InlineProgram, listing: Listing, printer: Printer, style: Style
) -> list[str]:
    """Return the lines of a function whose inputs have their names already.

    The style is ``"titled"``: an entry a line, under comments that name constraints; ``"plain"``:
    without such comments, since the code is for many constraints; ``"packed"``: entries that stand
    elsewhere with comments, as many a line as fit.
    """
    body = []
    is_first = style == "titled" and listing.results[0][0] == "Phi"  # where a reader begins
    if listing.functions:
        called = ", ".join(listing.functions)
        body.append(f"{called} = {', '.join(f'f.{name}' for name in listing.functions)}")
    body += _frames(listing, printer, is_first)
    for section, own in listing.steps:
        body += [f"# {short_title(section)}"] if is_first else []
        texts = [(item.name, printer.definition(item.node)) for item in own]
        body += assignments(texts, is_titled=style != "packed")
    body.append("return (")
    for name, rows in listing.results:
        body += [f"    # {name}"] if len(listing.results) > 1 else []
        if style == "packed":
            body += packed([printer.text(entry.node) for _, own in rows for entry in own])
            continue
        about = entry_titles(name, code) if style == "titled" else None
        for section, entries in rows:
            body += _section(name, section, entries, about, printer)
    body.append(")")
    if body[-2] == "return (":
        body[-2:] = ["return ()"]
    return body


def _section(
    name: str,
    section: ConstraintRows,
    entries: Sequence[Entry],
    about: Callable[[Entry], str] | None,
    printer: Printer,
) -> list[str]:
    """Return the entries of a constraint, right sides on one line where they fit.

    `about` says what an entry is, of titled code.
    """
    texts = [printer.text(entry.node) for entry in entries]
    if about is None or not entries:
        return [line for text in texts for line in element(text, "")]
    lines: list[str] = []
    if quantity_named(name).is_by_constraint:
        line = f"    {', '.join(texts)},  # {short_title(section)}"
        if name != "Phi" and len(line) <= WIDTH - 4:
            return [line]
        whole = title(section)
        line = f"    {texts[0]},  # {whole}"
        if len(texts) == 1 and len(line) <= WIDTH - 4:
            return [line]
        lines = [f"    {line}" for line in commented(whole)]
    for entry, text in zip(entries, texts, strict=True):
        lines += element(text, about(entry))
    return lines


def _matrix(code: InlineProgram, printer: Printer) -> list[str]:
    """Return Phi_q as a comment, with all its entries, where it is not wider than a line."""
    coordinates = [item.name for item in code.program.coordinates]
    rows = [[name, *("." for _ in coordinates)] for name in code.program.equations]
    for entry in code.entries("Phi_q"):
        rows[entry.row][entry.column + 1] = printer.text(entry.node)
    for heads in (coordinates, [str(k) for k in range(len(coordinates))]):
        lines = table([["Phi_q", *heads], *rows], gap=1)
        if max(map(len, lines)) <= WIDTH:
            return [f"# {line}" for line in lines]
    return []


def _unpack(program: Program, listing: Listing) -> list[str]:
    """Return the lines that name the inputs: all of a vector, or the few that are read."""
    lines, names = [], listing.input_names
    for vector, members in vectors(program).items():
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


def _frames(listing: Listing, printer: Printer, is_first: bool) -> list[str]:
    """Return the cosine and sine of each body's angle, a line a body."""
    lines = [f"# {title}" for title in frames_title(listing.frames) if is_first]
    for frame in listing.frames:
        left = ", ".join(item.name for item in frame.values)
        if frame.angle is not None:
            lines.append(f"{left} = cos_sin({printer.text(frame.angle)})")
        else:
            lines += [f"{item.name} = {printer.definition(item.node)}" for item in frame.values]
    return lines
