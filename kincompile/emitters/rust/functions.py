"""The functions of a program as Rust: each fills in numbers of a point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.emitters import solve_statements
from kincompile.emitters.lines import braced, wrapped
from kincompile.emitters.printer import ELEMENTARY, Dialect, Printer
from kincompile.emitters.solve_statements import block_call, factorization, solution
from kincompile.emitters.statements import Statements
from kincompile.quantities import kernel_of, kernels_apart, pattern_of

if TYPE_CHECKING:
    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.planned_solve import SolveListing
    from kincompile.ir.inline import InlineProgram
    from kincompile.quantities import Quantity

RUST = Dialect(
    "Rust",
    {name: f"f64::{name}({{}})" for name in ELEMENTARY}
    | {"pow": "f64::powf({})", "log": "f64::ln({})"},
    pi="std::f64::consts::PI",
    nan="f64::NAN",
    select="(if {} {{ {} }} else {{ {} }})",
    table="spline(&{}, {}, {})",
    signs={"&": "&&", "|": "||"},
    number=lambda value: repr(float(value)),
)
"""How Rust writes expressions; `square` and `spline` are the template's."""

WRITE = Statements(
    "//", "let {}", "at.{}[{}]", "", kept="{} as u8 as f64", taken="{} != 0.0", time="let t = at.t;"
)
SOLVE = replace(WRITE, element="{}[{}]")


def kernel(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the function that computes quantities at a point."""
    body = WRITE.evaluation(code, listing, printer)
    return ["", *braced([f"fn {name}_at(at: &mut Point) {{"], body)]


def single(quantity: Quantity, code: InlineProgram) -> list[str]:
    """Return the function of a quantity, of one point: an array, or an array of rows."""
    name, states = quantity.name, quantity.states
    kernel_name = kernel_of(quantity, kernels_apart(code.program.quantities))
    rows, *columns = code.program.shape_of(quantity)
    kind = f"[[f64; {columns[0]}]; {rows}]" if columns else f"[f64; {rows}]"
    given = [*(f"{x}: &[f64; N_COORDINATES]" for x in states), "t: f64", "p: &[f64; N_PARAMETERS]"]
    body = [
        "let mut at = Point::new();",
        *(f"at.{x} = *{x};" for x in states),
        "at.t = t;",
        "at.p = *p;",
        f"{kernel_name}_at(&mut at);",
    ]
    if columns:
        body += [
            f"let mut matrix = [[0.0; {columns[0]}]; {rows}];",
            f"for (k, &[i, j]) in {pattern_of(quantity)}.iter().enumerate() {{",
            f"    matrix[i][j] = at.{name}[k];",
            "}",
            "matrix",
        ]
    else:
        body.append(f"at.{name}")
    head = [f"pub fn {name}(", *(f"    {x}," for x in given), f") -> {kind} {{"]
    return ["", f"/// {quantity.about}", *braced(head, body)]


def solve_functions(code: InlineProgram, listing: SolveListing) -> list[str]:
    """Return the functions that factor Phi_q and that solve Phi_q x = right."""
    printer = Printer(RUST, listing.plan.nodes, listing.names)
    call = block_call(WRITE, "{}::<{}>(&[")
    factored = factorization(WRITE, code, listing, printer, call)
    solved = ["let mut to = [0.0; N_COORDINATES];", *solution(SOLVE, listing, printer, call), "to"]
    given = "F: &[f64; FACTORS], right: &[f64; N_EQUATIONS]"
    return solve_statements.solve_functions(
        code,
        listing,
        braced(["fn factor_at(at: &mut Point) {"], factored),
        braced([f"fn solve_at({given}) -> [f64; N_COORDINATES] {{"], solved),
    )


def vectors(code: InlineProgram) -> tuple[list[str], list[str]]:
    """Return the fields of a point, and their first values: entries that never change have them."""
    program, fields, values = code.program, [], []
    for quantity in program.quantities:
        numbers = [code.number(entry.node) for entry in code.entries(quantity.name)]
        if not quantity.is_matrix:
            size = program.shape_of(quantity)[0]
            fields.append(f"pub {quantity.name}: [f64; {size}],")
            values.append(f"{quantity.name}: [0.0; {size}],")
            continue
        entries = wrapped("0.0" if value is None else repr(float(value)) for value in numbers)
        fields.append(f"pub {quantity.name}: [f64; {len(numbers)}],")
        values += [f"{quantity.name}: [", *(f"    {line}" for line in entries), "],"]
    return fields, values
