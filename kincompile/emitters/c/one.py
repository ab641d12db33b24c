"""C for one point at a time, on a controller: one .c and one .h file, and a state of the caller."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from kincompile import criteria, quantities
from kincompile.emitters.c.float32 import NAMES, in_float32
from kincompile.emitters.c.functions import ABOUT, WRITE, C, block_call
from kincompile.emitters.c.march import CSolver
from kincompile.emitters.c.target import RESERVED, array, elementary, places
from kincompile.emitters.constants import items
from kincompile.emitters.lines import braced, indented
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.emitters.printer import ELEMENTARY, Printer
from kincompile.emitters.schedule import count_uses
from kincompile.emitters.solve_statements import factorization, solution, solve_functions
from kincompile.emitters.solver_printer import ATOM, OneLane
from kincompile.emitters.solver_tables import solver_tables
from kincompile.quantities import quantity_named
from kincompile.report.templates import fill
from kincompile.solver.nodes import LANE, Call, Constant, Field, Index, Name
from kincompile.solver.reader import one_point
from kincompile.solver.vocabulary import COUNTS, CRITERIA, STATUSES, TABLES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.planned_solve import SolveListing
    from kincompile.emitters.solver_printer import Lines
    from kincompile.emitters.target import Start
    from kincompile.ir.graph import Node
    from kincompile.ir.inline import InlineProgram
    from kincompile.quantities import Quantity
    from kincompile.solver.nodes import (
        Assign,
        Declare,
        Expression,
        Function,
        Struct,
        Text,
        Variable,
    )

ONE = replace(C, functions={name: f"{name}({{}})" for name in ELEMENTARY})
"""How expressions are written: angles go to libm, whose code is smaller than what takes strips."""

WRITE_ONE = replace(WRITE, element="at->{}[{}]", time="const double t = at->t;", pair=())

NUMBERS = (*CRITERIA, *COUNTS, "MAX_ITERATIONS", "TOLERANCE")
"""The criteria by which a point is judged."""
KERNELS = ("position", "nu", "gamma", "observe")
INNER = ("Scales", "Outcome")
"""Structs that the header has as they are printed; the others it has by hand."""
BYTES = {"float64": 8, "float32": 4}
"""Bytes of a number."""


class OneSolver(OneLane, CSolver):
    """Prints the solver as C in which a lane is a number."""

    has_lanes = False

    def __init__(self, name: str, sizes: Mapping[str, int]) -> None:
        CSolver.__init__(self, one_point(), name, sizes)
        self.one: set[Variable] = set()

    def kind(self, base: str) -> str:
        """Return the type of a base; structs are in the header."""
        return f"{self.name}_{base.lower()}" if base in self.structs else super().kind(base)

    def linkage(self, name: str) -> str:
        """Return what stands before a function: that it is of the file alone."""
        return "static "

    def text(self) -> str:
        """Return the functions."""
        return "\n".join(x for item in self.functions.values() for x in [*self.function(item), ""])

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return "PATTERN" if node.value == "PATTERN" else CSolver.constant(self, node)

    def parameter(self, item: Function, variable: Variable) -> str:
        """Return a parameter, of which a lane is a number."""
        if variable.type.is_lane:
            return f"double {variable.name}"
        return super().parameter(item, variable)

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration."""
        kind, name = node.variable.type, node.variable.name
        if not kind.is_lane:
            return super().declared(node)
        const = "" if node.variable.is_mutable else "const "
        type_name = "double" if kind.base == "real" else "int"
        return [f"{const}{type_name} {name} = {self.expression(node.value)};"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment; a status of a lane is whole."""
        if node.target.type.is_lane:
            sign = f"{node.operation}="
            return [f"{self.place(node.target)} {sign} {self.expression(node.value)};"]
        return super().assigned(node)

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry."""
        return self.place(node), ATOM

    def place(self, node: Expression) -> str:
        """Return where a value is, without the index of the one lane."""
        match node:
            case Index(array, indices) if array.type.dims[len(indices) - 1] == LANE:
                indices = indices[:-1]
                return self.place(array) + "".join(f"[{self.expression(x)}]" for x in indices)
        return super().place(node)

    @staticmethod
    def kernel(name: str) -> str:
        """Return what a kernel is called."""
        return f"{name}_at"

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        match node.name, node.arguments:
            case "missed", (Name() as b, weight, *totals):
                given = [
                    self.pointer(b),
                    self.place(weight),
                    *(f"&{self.place(x)}" for x in totals),
                ]
                return f"missed_at({', '.join(given)})", ATOM
        return super().call(node)

    def given(self, argument: Expression, parameter: Variable | None) -> str:
        """Return an argument: of a struct its address."""
        is_lane = parameter is not None and parameter.type.is_lane
        return self.expression(argument) if is_lane else super().given(argument, parameter)


@dataclass(frozen=True, slots=True)
class Target:
    """C for one point at a time, which begins at a position of a mechanism."""

    start: Start

    DIALECT = ONE
    RESERVED = (*RESERVED, *NAMES, *NUMBERS, *TABLES, "PHI_Q", "START_P", "START_Q")

    def evaluators(self, given: Sequence[Quantity]) -> Mapping[str, tuple[str, ...]]:
        """Return the kernels that a motion takes."""
        own = quantities.kernels_apart(given)
        return {name: own[name] for name in KERNELS if name in own}

    def function(
        self, name: str, code: InlineProgram, listing: Listing, printer: Printer
    ) -> list[str]:
        """Return the function of a point; outputs are written to the state."""
        of = "state" if name == "observe" else "point"
        head = [f"static void {name}_at({code.program.name}_{of} *at)", "{"]
        body = WRITE_ONE.evaluation(code, listing, printer)
        about = ABOUT.get(name) or quantity_named(name).about
        return [
            "",
            f"// {about}",
            *braced(head, body if "at->" in "".join(body) else ["(void)at;"]),
        ]

    def files(
        self, code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
    ) -> Mapping[str, str]:
        """Return the source and the header."""
        program, listing = code.program, schedule_solve(code, self.RESERVED, reads_entries=True)
        assert listing is not None
        lines = [x for own in functions.values() for x in own] + _solve_functions(code, listing)
        sizes = _sizes(code, listing)
        solver, has_outputs = OneSolver(program.name, sizes), bool(sizes["Y"])
        about = {"header": WRITE.heading(code), "name": program.name}
        source = {
            "sizes": indented(f"{x} = {n}," for x, n in sizes.items()),
            "numbers": indented(numbers(self.start.real, NUMBERS), 0),
            "tables": "\n".join(_tables(code)),
            "fingerprint": program.fingerprint,
            "elementary": elementary(program, called, listing.plan.largest_call, is_fast=False),
            "functions": indented(lines, 0),
            "solver": solver.text(),
            "p": array(
                "static const double START_P[]", [repr(x.default) for x in program.parameters]
            ),
            "q": array("static const double START_Q[]", [repr(x) for x in self.start.q]),
            "size": repr(self.start.size),
            "has_outputs": has_outputs,
        }
        head = {
            "NAME": program.name.upper(),
            "places": places(program),
            "statuses": indented(f"{program.name.upper()}_{x} = {n}," for x, n in STATUSES.items()),
            "structs": "\n\n".join("\n".join(solver.struct(solver.structs[x])) for x in INNER),
            **{x: max(n, 1) for x, n in sizes.items()},
            "has_outputs": has_outputs,
        }
        files = {
            f"{program.name}.c": fill("c/one.c.jinja", {**about, **source}),
            f"{program.name}.h": fill("c/one.h.jinja", {**about, **head}),
        }
        return {x: in_real(self.start.real, text) for x, text in files.items()}

    def needs(self, code: InlineProgram) -> str:
        """Return how large a state is, and what a step takes."""
        listing = schedule_solve(code, self.RESERVED, reads_entries=True)
        assert listing is not None
        sizes, plan = _sizes(code, listing), listing.plan
        found = [x.node for name in ("Phi", "Phi_q") for x in code.entries(name)]
        solved = *plan.solution, *plan.determinants
        count = operations(code.nodes, found) + operations(plan.nodes, solved)
        size = _state_bytes(sizes, one_point(), BYTES[self.start.real])
        return needs_of(code.program.name, size, count)


def in_real(real: str, text: str) -> str:
    """Return a text of doubles with numbers of a type."""
    return in_float32(text) if real == "float32" else text


def numbers(real: str, names: Iterable[str]) -> Iterator[str]:
    """Yield the definitions of criteria for numbers of a type; counts may be set for a compiler."""
    value_of = criteria.for_float32 if real == "float32" else partial(getattr, criteria)
    for name in names:
        own = f"#define {name} {value_of(name)!r}"
        yield from [f"#ifndef {name}", own, "#endif"] if name in COUNTS else [own]


def operations(nodes: Sequence[Node], wanted: Iterable[int]) -> int:
    """Return how many operations, calls of functions among them, some values take."""
    used = count_uses(nodes, wanted)
    return sum(nodes[k][0] not in ("input", "const", "pi", "nan") for k in used)


def needs_of(name: str, size: int, count: int) -> str:
    """Return the words for the bytes of a state, and the operations of a correction."""
    return (
        f"{name}_state has {size} bytes; a correction of Newton's method takes {count} operations"
    )


def _state_bytes(sizes: Mapping[str, int], text: Text, real: int) -> int:
    """Return the size of a state: that of its numbers, and of the whole ones beside them."""
    filled = {x: max(n, 1) for x, n in sizes.items()}
    alike = 1 + filled["K"] + 3 * filled["N"] + filled["BLOCKS"]
    kernels = filled["FACTORS"] + 3 * filled["M"] + filled["NONZEROS"]
    reals = real * (2 * alike + kernels + 3 * sizes["Y"] + 1)
    return reals + sum(bytes_of(text.structs[name], filled, real) for name in INNER)


def bytes_of(struct: Struct, sizes: Mapping[str, int], real: int) -> int:
    """Return the bytes of a printed struct: those of its numbers, and of the whole ones."""
    counts = {"real": 0, "int": 0, "bool": 0}
    for kind in struct.fields.values():
        counts[kind.base] += math.prod(max(sizes[x], 1) for x in kind.dims if x != LANE)
    return real * (counts["real"] + math.ceil(4 * (counts["int"] + counts["bool"]) / real))


def _sizes(code: InlineProgram, listing: SolveListing) -> dict[str, int]:
    """Return the sizes of arrays."""
    program = code.program
    return {
        "N": len(program.coordinates),
        "M": len(program.equations),
        "K": len(program.parameters),
        "NONZEROS": len(code.pattern()),
        "FACTORS": len(listing.factors),
        "BLOCKS": len(listing.plan.determinants),
        "Y": len(program.outputs),
    }


def _tables(code: InlineProgram) -> Iterator[str]:
    """Yield the tables of a mechanism that a point needs."""
    most = max(len(code.program.coordinates), len(code.program.equations))
    whole = "unsigned char" if most < 256 else "unsigned short"
    places = [f"{{{i}, {j}}}" for i, j in code.pattern()]
    yield array(f"static const {whole} PATTERN[][2]", places)
    values = [code.number(entry.node) for entry in code.entries("Phi_q")]
    yield array("static const double PHI_Q[]", [repr(float(x or 0.0)) for x in values])
    tables = solver_tables(code.program)
    for name in ("ANGULAR", "IS_REDUNDANT"):
        yield array(f"static const unsigned char {name}[]", items(tables[name], ("0", "1")))
    yield array("static const double PROBE[]", items(tables["PROBE"]))


def _solve_functions(code: InlineProgram, listing: SolveListing) -> list[str]:
    """Return the functions that factor Phi_q and that solve Phi_q x = right at a point."""
    printer = Printer(ONE, listing.plan.nodes, listing.names)
    body = solution(replace(WRITE_ONE, element="{}[{}]"), listing, printer, block_call)
    factors = factorization(WRITE_ONE, code, listing, printer, block_call)
    head = [f"static void factor_at({code.program.name}_point *at)", "{"]
    solve = [
        "static void solve_at(const double *Phi_q, const double *F, const double *right,",
        "    double *to)",
        "{",
    ]
    return solve_functions(
        code,
        listing,
        braced(head, factors or ["(void)at;"]),
        braced(solve, ["(void)Phi_q, (void)F;", *body]),
    )
