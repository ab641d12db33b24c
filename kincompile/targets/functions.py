"""One function of the emitted module: which values get a name, in which order, what it returns."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.ir.graph import operands_of
from kincompile.names import rate
from kincompile.targets.naming import NameTable, content_name

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.ir.inline import Entry, InlineProgram, Section
    from kincompile.ir.program import Program

DEEPEST = 60
"""Operations within each other, a long sum's for instance, after which a value gets a name: neither
the printers nor the languages take any number of them."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """A value with a name."""

    node: int
    name: str


@dataclass(frozen=True, slots=True)
class Frame:
    """Cosine and sine of a body's angle, the cosine first; where only one is needed, that one."""

    angle: int
    values: tuple[Assignment, ...]


@dataclass(frozen=True, slots=True)
class Listing:
    """A function as straight-line code.

    Attributes
    ----------
    frames
        Body frames, first of all.
    steps
        Values that are used more than once, by the section that needs them first.
    results
        Quantity by quantity: the entries of each section, in order.
    inputs
        Names of the inputs that are read.
    functions
        Names of the elementary functions that are called.
    names
        Names of all named nodes, inputs included.
    """

    frames: tuple[Frame, ...]
    steps: tuple[tuple[Section, tuple[Assignment, ...]], ...]
    results: tuple[tuple[str, tuple[tuple[Section, tuple[Entry, ...]], ...]], ...]
    inputs: frozenset[str]
    functions: tuple[str, ...]
    names: Mapping[int, str]


def varying(inline: InlineProgram, section: Section, quantity: str) -> tuple[Entry, ...]:
    """Return the entries a function computes: of a matrix those that are not plain numbers."""
    entries = section.entries[quantity]
    if all(item.name != quantity or not item.is_matrix for item in quantities.QUANTITIES):
        return entries
    return tuple(entry for entry in entries if inline.number(entry.node) is None)


def schedule(
    inline: InlineProgram,
    computed: Sequence[str],
    input_names: Mapping[str, str],
    table: NameTable,
) -> Listing:
    """Arrange the code of a function.

    Parameters
    ----------
    computed
        The quantities that it returns.
    input_names
        Names of coordinates, rates and parameters in the target.
    table
        Names that are taken; this function's own names do not leave it.
    """
    table = table.copy()
    results = tuple(
        (name, tuple((section, varying(inline, section, name)) for section in inline.sections))
        for name in computed
    )
    outputs = [entry.node for _, rows in results for _, entries in rows for entry in entries]
    uses = _count_uses(inline, outputs)
    names = {
        node: input_names[operands[0]]
        for node in uses
        for operation, *operands in (inline.nodes[node],)
        if operation == "input"
    }
    inputs = frozenset(inline.nodes[node][1] for node in names)
    frames = _frames(inline, uses, table)
    names.update({item.node: item.name for frame in frames for item in frame.values})
    steps = []
    numbers = {node: content[1] for node in uses if (content := inline.nodes[node])[0] == "const"}
    for position, section in enumerate(inline.sections):
        own: list[Assignment] = []
        starts = [entry.node for _, rows in results for entry in rows[position][1]]
        depths: dict[int, int] = {}
        for node in _in_order(inline, starts, names):
            inner = (depths.get(k, 0) for k in operands_of(inline.nodes[node]) if k not in names)
            depths[node] = 1 + max(inner, default=0)
            is_wanted = uses[node] > 1 or depths[node] % DEEPEST == 0
            if is_wanted and node not in names and _deserves_name(inline, node):
                wanted = inline.hints.get(node) or content_name(inline.nodes[node], names, numbers)
                names[node] = table.take(wanted or f"{section.instance.name}_{len(own) + 1}")
                own.append(Assignment(node, names[node]))
        if own:
            steps.append((section, tuple(own)))
    functions = _functions(inline, uses, frames)
    return Listing(frames, tuple(steps), results, inputs, functions, names)


def inputs_read(program: Program, listing: Listing) -> Iterator[tuple[str, int, str]]:
    """Yield vector, place in it and name of each coordinate, rate and parameter that is read."""
    coordinates = [item.name for item in program.coordinates]
    vectors = {
        "q": coordinates,
        "q_dot": [rate(name) for name in coordinates],
        "p": [item.name for item in program.parameters],
    }
    for vector, members in vectors.items():
        for k, member in enumerate(members):
            if member in listing.inputs:
                yield vector, k, member


def _frames(inline: InlineProgram, uses: Counter[int], table: NameTable) -> tuple[Frame, ...]:
    by_angle: dict[int, list[Assignment]] = {}
    for node in sorted(uses):
        operation, *operands = inline.nodes[node]
        if operation == "call" and node in inline.hints:
            name = table.take(inline.hints[node])
            by_angle.setdefault(operands[1], []).append(Assignment(node, name))
    return tuple(Frame(angle, tuple(values)) for angle, values in by_angle.items())


def _functions(
    inline: InlineProgram, uses: Counter[int], frames: tuple[Frame, ...]
) -> tuple[str, ...]:
    """Return the names of the functions called; cosine and sine of a frame are one call."""
    pairs = [frame for frame in frames if len(frame.values) == 2]
    shared = {item.node for frame in pairs for item in frame.values}
    nodes = [inline.nodes[node] for node in uses if node not in shared]
    called = {node[1] for node in nodes if node[0] == "call"}
    called |= {"where" for node in nodes if node[0] == "select"}
    return tuple(sorted(called | ({"cos_sin"} if pairs else set())))


def _count_uses(inline: InlineProgram, outputs: Iterable[int]) -> Counter[int]:
    """Count how often each value is used; a changed sign is no value of its own."""
    uses = [0] * len(inline.nodes)
    for node in outputs:
        uses[node] += 1
    for node in range(len(uses) - 1, -1, -1):
        if uses[node]:
            content = inline.nodes[node]
            weight = uses[node] if content[0] == "neg" else 1
            for operand in operands_of(content):
                uses[operand] += weight
    return Counter({node: count for node, count in enumerate(uses) if count})


def _in_order(inline: InlineProgram, starts: Iterable[int], known: Mapping[int, str]) -> list[int]:
    """Return what the starts depend on, operands before their users, down to what has a name."""
    order: dict[int, None] = {}
    stack = [(node, False) for node in reversed(list(starts))]
    while stack:
        node, done = stack.pop()
        if done:
            order[node] = None
        elif node not in order and node not in known:
            stack.append((node, True))
            stack += [(operand, False) for operand in reversed(operands_of(inline.nodes[node]))]
    return list(order)


def _deserves_name(inline: InlineProgram, node: int) -> bool:
    """Return whether a value costs anything.

    An input, a number, a number times pi and a changed sign do not.
    """
    operation = inline.nodes[node][0]
    if operation in ("input", "const", "pi", "neg"):
        return False
    return any(inline.nodes[k][0] not in ("const", "pi") for k in operands_of(inline.nodes[node]))
