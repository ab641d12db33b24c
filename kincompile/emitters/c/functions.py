"""The functions of a program as C text: each works on one point of a strip of points."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kincompile.emitters import solve_statements
from kincompile.emitters.headings import title
from kincompile.emitters.lines import braced
from kincompile.emitters.printer import ELEMENTARY, Dialect, Printer
from kincompile.emitters.solve_statements import factorization, operands, solution
from kincompile.emitters.statements import Statements
from kincompile.ir.graph import Graph, reachable
from kincompile.quantities import quantity_named

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.planned_solve import BlockCall, SolveListing
    from kincompile.emitters.schedule import Assignment
    from kincompile.ir.graph import Node
    from kincompile.ir.inline import InlineProgram

C = Dialect(
    "C",
    {name: f"{name}({{}})" for name in ELEMENTARY}
    # These two say by `far` that an angle is out of their reach.
    | {"atan2": "angle_of({})"}
    | {"cos": "cosine({}, exact, &far)", "sin": "sine({}, exact, &far)"},
    pi="_pi",
    nan="NAN",
    table="spline(&{}, {}, {})",
    signs={"&": "&&", "|": "||"},
    # C divides integers to integers.
    number=lambda value: repr(float(value)),
)
"""How C writes expressions of doubles; names that are not of math.h are the template's."""

WRITE = Statements(
    "//", "const double {}", "at->{}[{}][lane]", "",
    time="const double t = at->t[lane];",
    pair=("double {0}, {1};", "far |= cos_sin({2}, exact, &{0}, &{1});"),
)  # fmt: skip

ABOUT = {
    "position": "Phi and Phi_q in one go: a step of Newton's method.",
    "kinematics": "Phi, Phi_q, nu and gamma in one go.",
    "observe": "Outputs y, y_dot and y_ddot in one go.",
    "forward_dynamics": "Accelerations and multipliers in one go.",
}
"""What the kernels of several quantities give."""

CIRCULAR = ("cos", "sin")
"""Functions of an angle whose fast form does not reach all angles."""


def evaluator(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return a function that evaluates quantities at a point, and the one for a strip."""
    places = places_of_angles(code, _results(listing))
    head = ["", f"// {ABOUT.get(name) or quantity_named(name).about}"]
    if not places:
        return [*head, *_plain(name, WRITE.evaluation(code, listing, printer))]
    nodes = list(code.nodes)
    for node, k in places.items():
        nodes[node] = ("input", f"at->of_angles[{k}][lane]")
    names = {node: name for node, name in listing.names.items() if node not in places}
    angles = _angles(code, listing, places, nodes, _Printer(C, nodes, names, code.program.name))
    rest = _only(listing, nodes, _results(listing))
    body = WRITE.evaluation(code, rest, _Printer(C, nodes, listing.names, code.program.name))
    return [*head, *_angles_at(name, angles), "", *_point_function(name, body), "", *_both(name)]


def places_of_angles(code: InlineProgram, wanted: Iterable[int]) -> dict[int, int]:
    """Return the cosines and sines that some nodes depend on, and where each is kept."""
    used = reachable(code.nodes, wanted)
    calls = (x for x in used if code.nodes[x][0] == "call" and code.nodes[x][1] in CIRCULAR)
    return {node: k for k, node in enumerate(sorted(calls))}


class _Printer(Printer):
    """Prints inputs without a name, which are places of cosines and sines, as what they are."""

    def _primary(self, kind: str, content: list[Any]) -> str:
        return str(content[0]) if kind == "input" else super()._primary(kind, content)


def _results(listing: Listing) -> list[int]:
    """Return the nodes of all entries that a function gives."""
    return [x.node for _, rows in listing.results for _, entries in rows for x in entries]


def _only(listing: Listing, nodes: Sequence[Node], wanted: Iterable[int]) -> Listing:
    """Return a listing with what some nodes need of it alone."""
    used = set(reachable(nodes, wanted))

    def kept(items: Iterable[Assignment]) -> tuple[Assignment, ...]:
        return tuple(x for x in items if x.node in used)

    frames = (replace(x, angle=None, values=kept(x.values)) for x in listing.frames)
    steps = ((section, kept(own)) for section, own in listing.steps)
    return replace(
        listing,
        frames=tuple(x for x in frames if x.values),
        steps=tuple(x for x in steps if x[1]),
        inputs=frozenset(nodes[x][1] for x in used if nodes[x][0] == "input"),
    )


def _angles(
    code: InlineProgram,
    listing: Listing,
    places: Iterable[int],
    nodes: Sequence[Node],
    printer: Printer,
) -> list[str]:
    """Return the statements that put cosines and sines in their places."""
    calls: dict[int, dict[str, int]] = {}
    for node in places:
        _, function, angle = code.nodes[node]
        calls.setdefault(angle, {})[function] = node
    needed = _only(listing, nodes, calls)
    values = [x for frame in needed.frames for x in frame.values]
    values += [x for _, own in needed.steps for x in own]
    lines = WRITE.inputs(code.program, needed)
    lines += [WRITE.time] if "t" in needed.inputs else []
    names = {x.node: x.name for x in values if nodes[x.node][0] != "input"}
    # A node stands behind those that it depends on.
    for node in sorted([*names, *(min(own.values()) for own in calls.values())]):
        if node in names:
            lines += WRITE.assigned(WRITE.value.format(names[node]), printer.definition(node))
            continue
        angle = code.nodes[node][2]
        own = [printer.text(x) for _, x in sorted(calls[angle].items())]
        given = printer.text(angle)
        if len(own) == 2:
            lines += WRITE.assigned("far", f"far | cos_sin({given}, exact, &{own[0]}, &{own[1]})")
        else:
            lines += WRITE.assigned(own[0], C.functions[code.nodes[node][1]].format(given))
    return lines


def _plain(name: str, body: list[str]) -> list[str]:
    return [*_point_function(name, body), "", *_strip_function(name)]


def _point_function(name: str, body: list[str]) -> list[str]:
    # A function of a whole point that is constant, or has no entry that varies, is possible.
    used = any("[lane]" in line for line in body)
    head = [f"_always_inline void {name}_at(strip *at, size_t lane)", "{"]
    return braced(head, body if used else ["(void)at, (void)lane;"])


def _angles_at(name: str, body: list[str]) -> list[str]:
    head = [f"_always_inline int64_t {name}_angles_at(strip *at, size_t lane, int exact)", "{"]
    return braced(head, ["int64_t far = 0;", *body, "return far;"])


def _both(name: str) -> list[str]:
    """Return the function for a strip. What is large is compiled once, whatever the angles are."""
    return [
        f"static void {name}_of_strip(strip *at, size_t count)",
        "{",
        "    int64_t far = 0;",
        "    const size_t all = _abreast(count);",
        "    for (size_t lane = 0; lane < all; lane++)",
        f"        far |= {name}_angles_at(at, lane, 0) & -(int64_t)(lane < count);",
        "    for (size_t lane = 0; far && lane < count; lane++)",
        f"        {name}_angles_at(at, lane, 1);",
        "    for (size_t lane = 0; lane < all; lane++)",
        f"        {name}_at(at, lane);",
        "}",
    ]


def _strip_function(name: str) -> list[str]:
    return [
        f"static void {name}_of_strip(strip *at, size_t count)",
        "{",
        "    const size_t all = _abreast(count);",
        "    for (size_t lane = 0; lane < all; lane++)",
        f"        {name}_at(at, lane);",
        "}",
    ]


def solve_functions(code: InlineProgram, listing: SolveListing) -> list[str]:
    """Return the functions that factor Phi_q and that solve Phi_q x = right at a point."""
    printer = Printer(C, listing.plan.nodes, listing.names)
    body = solution(replace(WRITE, element="{}[{}][lane]"), listing, printer, block_call)
    head = [
        "_always_inline void solve_at(double (*restrict F)[LANES],",
        "    double (*restrict right)[LANES], double (*restrict to)[LANES], size_t lane)",
        "{",
    ]
    solve = braced(head, body if listing.factors else ["(void)F;", *body])
    factor = _plain("factor", factorization(WRITE, code, listing, printer, block_call))
    return [
        *solve_statements.solve_functions(code, listing, factor, solve),
        "",
        "// What rates miss of Phi_q q_dot = nu and Phi_q q_ddot = gamma: sums of squares.",
        "_always_inline void missed_at(const strip *at, const double (*weight)[LANES],",
        "    double *by_velocity, double *by_acceleration, size_t lane)",
        "{",
        "    double velocity = 0, acceleration = 0, rest;",
        *(f"    {line}" for line in _missed(code)),
        "    *by_velocity = velocity;",
        "    *by_acceleration = acceleration;",
        "}",
    ]


def _missed(code: InlineProgram) -> list[str]:
    """Return the statements that add up what rates miss of each equation."""
    graph, names = Graph(), dict[int, str]()
    printer, places = Printer(C, graph.nodes, names), {x: k for k, x in enumerate(code.pattern())}

    def element(vector: str, k: int, entry: int | None = None) -> int:
        number = None if entry is None else code.number(entry)
        node = graph.input((vector, k)) if number is None else graph.const(number)
        if number is None:
            names[node] = WRITE.element.format(vector, k)
        return node

    lines = []
    for section in code.constraints:
        lines.append(f"// {title(section)}")
        for total, rate, right in (
            ("velocity", "q_dot", "nu"),
            ("acceleration", "q_ddot", "gamma"),
        ):
            missed = {x.row: element(right, x.row, x.node) for x in section.entries[right]}
            for x in section.entries["Phi_q"]:
                entry = element("Phi_q", places[x.row, x.column], x.node)
                term = graph.mul(entry, element(rate, x.column))
                missed[x.row] = graph.sub(missed[x.row], term)
            for row, node in missed.items():
                lines += WRITE.assigned("rest", printer.text(node))
                lines.append(f"{total} += weight[{row}][lane] * rest * rest;")
    return lines


def block_call(step: BlockCall, printer: Printer) -> list[str]:
    """Return the call that solves a block, with the names of the unknowns, or its determinant."""
    matrix = operands(step.matrix, printer)
    if not step.right:
        left = WRITE.value.format(step.names[0])
        return [f"{left} = block_determinant({step.size}, (const double[]){{", *matrix, "});"]
    vector = f"block_of_{step.names[0]}"
    return [
        f"double {vector}[{step.size}];",
        f"block_solve({step.size}, (const double[]){{",
        *matrix,
        "}, (const double[]){",
        *operands(step.right, printer),
        f"}}, {vector});",
        *(f"const double {name} = {vector}[{k}];" for k, name in enumerate(step.names)),
    ]
