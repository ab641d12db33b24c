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
from kincompile.quantities import TOGETHER, quantity_named

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

OF_ALL = TOGETHER["kinematics"]
"""The quantities whose cosines and sines are computed in one pass."""

CIRCULAR = ("cos", "sin")
"""Functions of an angle whose fast form does not reach all angles."""


def evaluator(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return a function that evaluates quantities at a point, and the one for a strip.

    Before it stands the pass over the angles: one for all quantities of kinematics, which others
    have too where it is all they need.
    """
    given = [quantity for quantity, _ in listing.results]
    own, places = angles_of(code, given), places_of_angles(code)
    nodes = list(code.nodes)
    for node in own:
        nodes[node] = ("input", f"at->of_angles[{places[node]}][lane]")
    rest = _only(listing, nodes, _results(listing))
    body = WRITE.evaluation(code, rest, _Printer(C, nodes, listing.names, code.program.name))
    about = ABOUT.get(name) or quantity_named(name).about
    point = ["", f"// {about}", *_point_function(name, body)]
    if name != "kinematics" and own <= angles_of(code, OF_ALL):
        return [*point, "", *_strip_function(name)]
    names = {node: name for node, name in listing.names.items() if node not in own}
    printer = _Printer(C, nodes, names, code.program.name)
    angles = _angles(code, listing, sorted(own), nodes, printer)
    if name == "kinematics":
        return [*_pass("angles", angles), *point, "", *_strip_function(name)]
    before = f"    angles_of_{name}_of_strip(at, count);"
    return [*_pass(f"angles_of_{name}", angles), *point, "", *_strip_function(name, before)]


def angles_of(code: InlineProgram, given: Iterable[str]) -> set[int]:
    """Return the cosines and sines that quantities depend on."""
    used = reachable(code.nodes, [x.node for quantity in given for x in code.entries(quantity)])
    return places_of_angles(code).keys() & used


def places_of_angles(code: InlineProgram) -> dict[int, int]:
    """Return all cosines and sines, and where each is kept."""
    calls = (k for k, x in enumerate(code.nodes) if x[0] == "call" and x[1] in CIRCULAR)
    return {node: k for k, node in enumerate(calls)}


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


def _point_function(name: str, body: list[str]) -> list[str]:
    # A function of a whole point that is constant, or has no entry that varies, is possible.
    used = any("[lane]" in line for line in body)
    head = [f"_always_inline void {name}_at(strip *at, size_t lane)", "{"]
    return braced(head, body if used else ["(void)at, (void)lane;"])


def _pass(name: str, body: list[str]) -> list[str]:
    """Return the functions that take cosines and sines of a point, and of a strip.

    What comes after them is compiled once, whatever the angles are.
    """
    head = [f"_always_inline int64_t {name}_at(strip *at, size_t lane, int exact)", "{"]
    start = ["", "// Cosines and sines.", *braced(head, ["int64_t far = 0;", *body, "return far;"])]
    whole = [
        f"static void {name}_of_strip(strip *at, size_t count)",
        "{",
        "    int64_t far = 0;",
        "    const size_t all = _abreast(count);",
        "    for (size_t lane = 0; lane < all; lane++)",
        f"        far |= {name}_at(at, lane, 0) & -(int64_t)(lane < count);",
        "    for (size_t lane = 0; far && lane < count; lane++)",
        f"        {name}_at(at, lane, 1);",
        "}",
    ]
    return [*start, "", *whole] if body else []


def _strip_function(name: str, *before: str) -> list[str]:
    return [
        f"static void {name}_of_strip(strip *at, size_t count)",
        "{",
        *before,
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
        "_always_inline void solve_at(double (*restrict Phi_q)[LANES],",
        "    double (*restrict F)[LANES], double (*restrict right)[LANES],",
        "    double (*restrict to)[LANES], size_t lane)",
        "{",
    ]
    solve = braced(head, ["(void)Phi_q, (void)F;", *body])
    body = factorization(WRITE, code, listing, printer, block_call)
    factor = [*_point_function("factor", body), "", *_strip_function("factor")]
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
