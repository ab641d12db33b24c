"""A transmission in C: one .c and one .h file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from kincompile.emitters.c.functions import WRITE
from kincompile.emitters.c.march import CSolver
from kincompile.emitters.c.one import BYTES, bytes_of, in_real, needs_of, numbers, operations
from kincompile.emitters.c.target import elementary
from kincompile.emitters.constants import items
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.reader import transmission

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.emitters.target import Start
    from kincompile.emitters.transmission import Transmission
    from kincompile.solver.nodes import Text

RESERVED = ("s", "b", "pose")
"""Names that the functions use besides those of the target."""

RARE = ("follow", "begin")
"""Functions that few calls reach."""

STATEMENTS = WRITE.of_pose("{}[{}]", "{}[{}][{}]")


class _Solver(CSolver):
    """Prints the text with numbers as the sizes of arrays; the state is in the header."""

    def __init__(self, text: Text, name: str, sizes: Mapping[str, int]) -> None:
        super().__init__(text, name, sizes)
        self.state = self.struct(text.structs["Transmission"])

    def linkage(self, name: str) -> str:
        """Return what stands before a function.

        Inlined, a call keeps its pose in registers: a sixth of the time of a small loop. The way in
        parts, which is seldom gone, stays apart.
        """
        return "static " if name in RARE else "static inline "

    def kind(self, base: str) -> str:
        """Return the type of a base."""
        return f"{self.name}_state" if base == "Transmission" else super().kind(base)

    def text(self) -> str:
        """Return the pose and the functions."""
        parts = [self.struct(self.structs["Pose"]), ["{evaluate}"]]
        parts += [self.function(x) for x in self.functions.values()]
        return "\n".join(line for lines in parts for line in [*lines, ""])


@dataclass(frozen=True, slots=True)
class One:
    """A transmission in C for one point at a time, with numbers of a type."""

    start: Start

    RESERVED = RESERVED

    def files(self, of: Transmission) -> Mapping[str, str]:
        """Return the source and the header."""
        return {x: in_real(self.start.real, text) for x, text in _files(of, self.start).items()}

    def needs(self, of: Transmission) -> str:
        """Return how large a state is, and how many operations a correction takes."""
        state = transmission().structs["Transmission"]
        nodes = [
            item.node for section in of.of.code.sections for item in section.entries["outputs"]
        ]
        size = bytes_of(state, of.sizes, BYTES[self.start.real])
        return needs_of(of.name, size, operations(of.of.code.nodes, nodes))


def _numbers(start: Start | None) -> Iterable[str]:
    """Return the definitions of criteria."""
    if start is None:
        return (f"#define {x} {value!r}" for x, value in NUMBERS.items())
    return numbers(start.real, NUMBERS)


def files(of: Transmission) -> Mapping[str, str]:
    """Return the source and the header."""
    return _files(of, None)


def _files(of: Transmission, start: Start | None) -> Mapping[str, str]:
    """Return the source and the header; for one point at a time where a start is given."""
    is_one = start is not None
    solver = _Solver(transmission(), of.name, of.sizes)
    name = f"{of.name}_transmission"
    called = of.listing.functions
    body = of.evaluation(replace(STATEMENTS, pair=()) if is_one else STATEMENTS, "{}->{}")
    about = "\n".join(f"// {line}".rstrip() for line in of.about())
    evaluated = fill(
        "c/evaluate.c.jinja",
        {
            "state": f"{of.name}_state",
            "body": indented(body),
            "given": [f"{vector}[{k}]" for vector, k in of.of.read.values() if vector != "p"],
            "found": list(_written(body)),
            "is_one": is_one,
        },
    )
    data = {
        "header": about,
        "name": of.name,
        "NAME": of.name.upper(),
        "file": name,
        "sizes": indented(f"{x} = {n}," for x, n in of.sizes.items()),
        "numbers": indented(_numbers(start), 0),
        "tables": "\n".join(
            f"static const int {x}[] = {{ {', '.join(items(own, ('0', '1'))) or '0'} }};"
            for x, own in of.tables.items()
        ),
        "elementary": elementary(of.of.code.program, called, 0, is_fast=not is_one),
        "is_one": is_one,
        "solver": solver.text().replace("{evaluate}", evaluated.strip("\n")),
        "size": repr(of.of.size),
        **{x: _array(getattr(of, x)) for x in ("p", "u", "q")},
    }
    head = {
        "header": about,
        "name": of.name,
        "NAME": of.name.upper(),
        "state": "\n".join(solver.state),
        "statuses": indented(f"{of.name.upper()}_{x} = {n}," for x, n in statuses().items()),
        "inputs": len(of.of.inputs),
        "outputs": len(of.of.outputs),
        "is_one": is_one,
    }
    return {
        f"{name}.c": fill("c/transmission.c.jinja", data),
        f"{name}.h": fill("c/transmission.h.jinja", head),
    }


def _written(body: Sequence[str]) -> Iterator[str]:
    """Yield the entries of a pose that statements assign to."""
    for line in body:
        entry, is_one, _ = line.removeprefix("b->").partition(" = ")
        if is_one and line.startswith("b->"):
            yield entry


def _array(values: tuple[float, ...]) -> str:
    return "\n".join(f"    {line}" for line in wrapped(items(map(float, values)) or ["0.0"]))
