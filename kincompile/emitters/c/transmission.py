"""A transmission in C: one .c and one .h file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.c.functions import WRITE
from kincompile.emitters.c.march import CSolver
from kincompile.emitters.c.target import elementary
from kincompile.emitters.constants import items
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.reader import transmission

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.emitters.transmission import Transmission
    from kincompile.solver.nodes import Text, Type

RESERVED = ("s", "b", "pose")
"""Names that the functions use besides those of the target."""

RARE = ("follow", "begin")
"""Functions that few calls reach."""

STATEMENTS = WRITE.of_pose("{}[{}]", "{}[{}][{}]")


class _Solver(CSolver):
    """Prints the text with numbers as the sizes of arrays; the state is in the header."""

    def __init__(self, text: Text, name: str, sizes: Mapping[str, int]) -> None:
        super().__init__(text, name)
        self.sizes = sizes
        self.state = self.struct(text.structs["Transmission"])
        self.state[-1] = f"}} {name}_state;"
        self.structs = {**text.structs}

    def linkage(self, name: str) -> str:
        """Return what stands before a function.

        Inlined, a call keeps its pose in registers: a sixth of the time of a small loop. The way in
        parts, which is seldom gone, stays apart.
        """
        return "static " if name in RARE else "static inline "

    def kind(self, base: str) -> str:
        """Return the type of a base."""
        return f"{self.name}_state" if base == "Transmission" else super().kind(base)

    def dims(self, kind: Type) -> str:
        """Return the sizes of an array, of which C has none without entries."""
        return "".join(f"[{max(self.sizes[x], 1)}]" for x in kind.dims)

    def text(self) -> str:
        """Return the pose and the functions."""
        parts = [self.struct(self.structs["Pose"]), ["{evaluate}"]]
        parts += [self.function(x) for x in self.functions.values()]
        return "\n".join(line for lines in parts for line in [*lines, ""])


def files(of: Transmission) -> Mapping[str, str]:
    """Return the source and the header."""
    solver = _Solver(transmission(), of.name, of.sizes)
    name = f"{of.name}_transmission"
    called = of.listing.functions
    body = of.evaluation(STATEMENTS, "{}->{}")
    about = "\n".join(f"// {line}".rstrip() for line in of.about())
    evaluated = fill(
        "c/evaluate.c.jinja",
        {
            "state": f"{of.name}_state",
            "body": indented(body),
            "given": [f"{vector}[{k}]" for vector, k in of.of.read.values() if vector != "p"],
            "found": list(_written(body)),
        },
    )
    data = {
        "header": about,
        "name": of.name,
        "NAME": of.name.upper(),
        "file": name,
        "sizes": indented(f"{x} = {n}," for x, n in of.sizes.items()),
        "numbers": indented((f"#define {x} {value!r}" for x, value in NUMBERS.items()), 0),
        "tables": "\n".join(
            f"static const int {x}[] = {{ {', '.join(items(own, ('0', '1'))) or '0'} }};"
            for x, own in of.tables.items()
        ),
        "elementary": elementary(of.of.code.program, called, 0),
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
