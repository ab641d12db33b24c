"""The functions of a program as JavaScript: each fills in numbers of a point."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.emitters import solve_statements
from kincompile.emitters.lines import braced, wrapped
from kincompile.emitters.printer import ELEMENTARY, Dialect, Printer
from kincompile.emitters.solve_statements import block_call, factorization, solution
from kincompile.emitters.statements import Statements

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.planned_solve import SolveListing
    from kincompile.ir.inline import InlineProgram
    from kincompile.quantities import Quantity

JAVASCRIPT = Dialect(
    "JavaScript",
    {name: f"Math.{name}({{}})" for name in ELEMENTARY},
    pi="Math.PI",
    signs={"&": "&&", "|": "||", "==": "===", "!=": "!=="},
)
"""How JavaScript writes expressions; `square` and `spline` are the template's."""

WRITE = Statements("//", "const {}", "{}[{}]", "")


def kernel(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the function that computes quantities at a point."""
    results = [quantity for quantity, _ in listing.results]
    taken = _taken(*quantities.states_of(results), "t", "p", *results)
    return ["", *_function(f"{name}_at", "at", taken, WRITE.evaluation(code, listing, printer))]


def single(quantity: Quantity, code: InlineProgram) -> list[str]:
    """Return the function of a quantity, of one point: an array, or an array of rows."""
    name, states = quantity.name, ", ".join(quantity.states)
    kernel_name = quantities.kernel_of(quantity, quantities.kernels_apart(code.program.quantities))
    return [
        "",
        f"// {quantity.about}",
        f"function {name}({states}, t, p = DEFAULTS) {{",
        f'    return evaluated({kernel_name}_at, "{name}", {{ {states} }}, t, p);',
        "}",
    ]


def solve_functions(code: InlineProgram, listing: SolveListing) -> list[str]:
    """Return the functions that factor Phi_q and that solve Phi_q x = right."""
    printer = Printer(JAVASCRIPT, listing.plan.nodes, listing.names)
    call = block_call(WRITE, "{}({}, [")
    factored = factorization(WRITE, code, listing, printer, call)
    solved = solution(WRITE, listing, printer, call)
    return solve_statements.solve_functions(
        code,
        listing,
        _function("factor_at", "at", _taken("Phi_q", "F", "determinants"), factored),
        _function("solve_at", "F, right, to", [], solved),
    )


def _taken(*names: str) -> list[str]:
    """Return the statement that takes vectors out of a point."""
    return [f"const {{ {', '.join(names)} }} = at;"]


def _function(name: str, arguments: str, first: Sequence[str], body: Sequence[str]) -> list[str]:
    return braced([f"function {name}({arguments}) {{"], [*first, *body])


def vectors(code: InlineProgram) -> list[str]:
    """Return the vectors of a point; of matrices the entries that vary are to be filled in."""
    program = code.program
    lines = [f"{name}: new Float64Array(N_COORDINATES)," for name in ("q", "q_dot", "q_ddot")]
    for quantity in program.quantities:
        if not quantity.is_matrix:
            lines.append(f"{quantity.name}: new Float64Array({program.shape_of(quantity)[0]}),")
            continue
        numbers = [code.number(entry.node) for entry in code.entries(quantity.name)]
        entries = wrapped("0" if value is None else repr(float(value)) for value in numbers)
        lines += [f"{quantity.name}: Float64Array.of(", *(f"    {line}" for line in entries), "),"]
    return lines
