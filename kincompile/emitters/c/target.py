"""The C target: one .c and one .h file that need a C99 compiler and nothing else."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from kincompile import quantities
from kincompile.emitters.c.functions import (
    OF_ALL,
    WRITE,
    C,
    angles_of,
    evaluator,
    places_of_angles,
    solve_functions,
)
from kincompile.emitters.c.march import CSolver
from kincompile.emitters.constants import items, named_lists
from kincompile.emitters.lines import WIDTH, indented, wrapped
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.emitters.printer import ELEMENTARY
from kincompile.emitters.solver_tables import NUMBERS, OF_LANES, solver_tables
from kincompile.quantities import nonzeros_of
from kincompile.report.templates import fill
from kincompile.solver.reader import solver_of_sets, start

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from kincompile.emitters.planned_solve import SolveListing
    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.quantities import Quantity

DIALECT = C

LANES = 32
"""Points in a strip: enough for the widest registers, few enough for the nearest cache."""

KEYWORDS = (
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else",
    "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long", "register",
    "restrict", "return", "short", "signed", "sizeof", "static", "struct", "switch", "typedef",
    "union", "unsigned", "void", "volatile", "while", "asm", "typeof", "bool",
    "true", "false", "nullptr", "constexpr", "alignas", "alignof", "static_assert", "thread_local",
    "linux", "unix", "NULL", "NAN", "INFINITY", "HUGE_VAL", "M_E", "M_PI",
    "HUGE_VALF", "HUGE_VALL", "MATH_ERRNO", "MATH_ERREXCEPT", "math_errhandling", "FP_NAN",
    "FP_INFINITE", "FP_ZERO", "FP_SUBNORMAL", "FP_NORMAL", "FP_ILOGB0", "FP_ILOGBNAN", "SIZE_MAX",
    *(f"{x}_{end}" for x in ("PTRDIFF", "SIG_ATOMIC", "WCHAR", "WINT", "INTPTR", "INTMAX")
      for end in ("MIN", "MAX")),
    *(f"{sign}INT{kind}{bits}_{end}" for sign in ("", "U") for kind in ("", "_LEAST", "_FAST")
      for bits in (8, 16, 32, 64) for end in ("MIN", "MAX")),
    "UINTPTR_MAX", "UINTMAX_MAX", "EXIT_SUCCESS", "EXIT_FAILURE", "RAND_MAX", "MB_CUR_MAX",
)  # fmt: skip
"""Words of C and of later standards, and macros of headers and compilers. Our own begin with an
underscore, as no name of a user does."""

RESERVED: tuple[str, ...] = (
    *KEYWORDS, "at", "lane", "t", "far", "exact", "Phi_q", "F", "right", "to",
    "square", "angle_of", "cos_sin", "cosine", "sine", "spline", "block_solve", "block_determinant",
    "fabs", "fmax", *ELEMENTARY,
)  # fmt: skip
"""Names that the functions of a mechanism use."""


evaluators = quantities.kernels
"""The kernels."""


function = evaluator
"""The function of a point, and the one for a strip of points."""


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the source and the header."""
    program, listing = code.program, schedule_solve(code, RESERVED, reads_entries=True)
    about = _about(code, listing)
    lines = [line for own in functions.values() for line in own]
    body, batch = [_strip(code, lines, called, listing)], _batch(code)
    body.append(fill("c/batch.c.jinja", {**_only(about, "name", "is_planned"), **batch}))
    if listing is not None:
        march = {**_only(about, "name", "NAME"), **_only(batch, "reads_angles"), **_march(program)}
        body.append(fill("c/march.c.jinja", march))
    data = {**_without(about, "NAME"), **_tables(code, listing), "body": "".join(body)}
    source = fill("c/module.c.jinja", data)
    guard = f"{program.name.upper()}_H"
    own = {"guard": guard, "places": places(program), "outputs": indented(_outputs(code))}
    head = fill("c/module.h.jinja", {**about, **own})
    return {f"{program.name}.c": source, f"{program.name}.h": head}


def _about(code: InlineProgram, listing: SolveListing | None) -> dict[str, Any]:
    """Return what source and header both say."""
    program = code.program
    return {
        "name": program.name,
        "NAME": program.name.upper(),
        "header": WRITE.heading(code),
        "n": len(program.coordinates),
        "m": len(program.equations),
        "k": len(program.parameters),
        "nonzeros": len(code.pattern()),
        "is_planned": listing is not None,
    }


def _only(data: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: data[key] for key in keys}


def _without(data: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in data.items() if key not in keys}


def _tables(code: InlineProgram, listing: SolveListing | None) -> dict[str, Any]:
    """Return the constants of the source file: names, numbers and the patterns of matrices."""
    program, lists = code.program, named_lists(code.program)
    patterns, entries = [], []
    for quantity in program.quantities:
        values = [code.number(entry.node) for entry in code.entries(quantity.name)]
        numbers = [f"{{{k}, {float(x)!r}}}" for k, x in enumerate(values) if x is not None]
        computed = [str(k) for k, value in enumerate(values) if value is None]
        if quantity.is_matrix:
            places = [f"{{{row}, {column}}}" for row, column in code.pattern(quantity.name)]
            kind = "const int" if quantity.name == "Phi_q" else "static const int"
            patterns.append(array(f"{kind} {_pattern_name(code, quantity)}[][2]", places))
        entries += [
            array(f"static const constant {quantity.name}_constant[]", numbers, "{0, 0.0}"),
            array(f"static const int {quantity.name}_computed[]", computed),
        ]
        if quantity.is_matrix:
            width = program.shape_of(quantity)[1]
            flat = [str(row * width + column) for row, column in code.pattern(quantity.name)]
            own = [flat[int(k)] for k in computed]
            entries.append(array(f"static const int {quantity.name}_place[]", own))
    return {
        "patterns": "\n".join(patterns),
        "entries": "\n".join(entries),
        "numbers": sum(len(code.entries(item.name)) for item in program.quantities),
        "lanes": LANES,
        "n_factors": 0 if listing is None else len(listing.factors),
        "n_blocks": 0 if listing is None else len(listing.plan.determinants),
        "fingerprint": program.fingerprint,
        "defaults": _array_lines(lists["DEFAULTS"]),
        "guess": _array_lines(lists["GUESS"]),
    }


def _pattern_name(code: InlineProgram, quantity: Quantity) -> str:
    return (
        f"{code.program.name}_pattern" if quantity.name == "Phi_q" else f"{quantity.name}_pattern"
    )


def array(declaration: str, items: Sequence[str], placeholder: str = "0") -> str:
    """Return an array, on one line where that is short."""
    lines = _array_lines(items, placeholder)
    short = f"{declaration} = {{ {lines.strip().rstrip(',')} }};"
    return (
        short if "\n" not in lines and len(short) <= WIDTH else f"{declaration} = {{\n{lines}\n}};"
    )


def _batch(code: InlineProgram) -> dict[str, Any]:
    """Return the tables of quantities and kernels by which a batch is evaluated."""
    program, rows, matrices = code.program, [], 0
    for quantity in program.quantities:
        height, width = (*program.shape_of(quantity), 0)[:2]
        entries, name = code.entries(quantity.name), quantity.name
        constants = sum(code.number(entry.node) is not None for entry in entries)
        nonzeros = f"offsetof({program.name}_batch, {nonzeros_of(quantity)})"
        rows += [
            f"{{offsetof(strip, {name}), offsetof({program.name}_batch, {name}),",
            f"    {nonzeros if quantity.is_matrix else 0}, {height}, {width}, {matrices},",
            f"    {len(entries)}, {constants}, {len(entries) - constants},",
            f"    {_pattern_name(code, quantity) if quantity.is_matrix else 'NULL'},",
            f"    {name}_constant, {name}_computed, {f'{name}_place' if width else 'NULL'}}},",
        ]
        matrices += height * width
    bits = {item.name: 1 << k for k, item in enumerate(program.quantities)}
    kernels = {
        name: f"{{{sum(bits[item] for item in given)}, {name}_of_strip}},"
        for name, given in quantities.kernels(program.quantities).items()
    }
    shared, found = angles_of(code, OF_ALL), {x: angles_of(code, [x]) for x in bits}
    return {
        "quantities": indented(rows),
        "n_quantities": len(bits),
        "writes": indented(
            line
            for k, bit in enumerate(bits.values())
            for line in (
                f"    if (wanted & {bit})",
                f"        write_quantity(batch, &QUANTITY[{k}], &b, matrices, start, count,",
                "            is_far);",
            )
        ),
        "matrices": max(matrices, 1),
        "reads_angles": sum(bits[x] for x, own in found.items() if own and own <= shared),
        "kinematics": indented([kernels.pop("kinematics")]),
        "kernels": indented(kernels.values()),
        **{
            f"reads_{state}": sum(
                bits[item.name] for item in program.quantities if state in item.reads
            )
            for state in ("q_dot", "q_ddot")
        },
    }


def _outputs(code: InlineProgram) -> list[str]:
    """Return the results of a batch as the header declares them."""
    program, lines = code.program, []
    if program.observers:
        lines.append(f"{program.name}_input q_ddot;  // second rates, of which outputs may depend")
    for quantity in program.quantities:
        size = " x ".join(map(str, program.shape_of(quantity)))
        lines.append(f"{program.name}_output {quantity.name};  // {size}: {quantity.about}")
        if quantity.is_matrix:
            size = str(len(code.entries(quantity.name)))
            about = f"{size} entries of {quantity.name}, in the order of the pattern"
            lines.append(f"{program.name}_output {nonzeros_of(quantity)};  // {about}")
    return lines


def places(program: Program) -> str:
    """Return the lines by which a program finds coordinates, parameters and outputs by name."""
    named = {
        "Q": program.names_of("coordinates"),
        "P": program.names_of("parameters"),
        "Y": program.names_of("outputs"),
    }
    return "\n".join(
        _array_lines([f"{program.name.upper()}_{kind}_{x} = {k}" for k, x in enumerate(names)])
        for kind, names in named.items()
        if names
    )


def _array_lines(items: Sequence[str], placeholder: str = "0") -> str:
    """Return the lines of an array; C has no empty ones."""
    return "\n".join(f"    {line}" for line in wrapped(items or [placeholder]))


def _strip(
    code: InlineProgram, lines: list[str], called: Collection[str], listing: SolveListing | None
) -> str:
    """Return the functions that work on a strip of points, and what they need."""
    largest = 0
    if listing is not None:
        lines = [*lines, *solve_functions(code, listing)]
        largest = listing.plan.largest_call
    data = {
        "is_planned": listing is not None,
        "n_angles": len(places_of_angles(code)),
        "elementary": elementary(code.program, called, largest),
        "functions": "\n".join(lines),
        "results": indented(
            f"double {item.name}[{max(len(code.entries(item.name)), 1)}][LANES];"
            for item in code.program.quantities
        ),
    }
    return fill("c/strip.c.jinja", data)


def elementary(
    program: Program, called: Collection[str], largest: int, *, is_fast: bool = True
) -> str:
    """Return what the code calls: functions of angles, splines, the solve of blocks of a size.

    Fast functions of angles take several points at once.
    """
    called = called if is_fast else ()
    data = {
        "is_fast": is_fast,
        "alone": [long for short, long in (("cos", "cosine"), ("sin", "sine")) if short in called],
        "tables": "\n\n".join(_splines(program)),
        "has_angles": "atan2" in called,
        "order": max(
            (len(row) for item in program.tables.values() for row in item.coefficients), default=0
        ),
        "largest_block": largest,
    }
    return fill("c/elementary.c.jinja", data)


def _splines(program: Program) -> Iterable[str]:
    """Return the tables of splines."""
    for name, spline in program.tables.items():
        rows = [f"{{{', '.join(repr(x) for x in row)}}}" for row in spline.coefficients]
        lines = [f"static const double {name}_breaks[] = {{"]
        lines += [f"    {line}" for line in wrapped([repr(x) for x in spline.breaks])]
        lines += ["};", f"static const double {name}_pieces[][{len(spline.coefficients[0])}] = {{"]
        lines += [f"    {row}," for row in rows]
        lines += ["};", f"static const spline_table {name} = {{"]
        lines += [f"    {len(rows)}, {name}_breaks, {name}_pieces,", "};"]
        yield "\n".join(lines)


@lru_cache(maxsize=16)
def _solver(name: str) -> dict[str, str]:
    """Return printed start and march, which depend on nothing but the name of the mechanism."""
    texts = {"solver": solver_of_sets(), "start": start()}
    return {part: CSolver(text, name).text() for part, text in texts.items()}


def _march(program: Program) -> dict[str, str]:
    """Return the solver, and what it judges by."""
    tables = {
        name: _array_lines(items(values, ("0", "1")))
        for name, values in solver_tables(program).items()
    }
    numbers = {name: repr(x) for name, x in {**NUMBERS, **OF_LANES}.items()}
    return {**tables, **_solver(program.name), **numbers}
