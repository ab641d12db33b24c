"""A transmission in Octave, which is MATLAB too: a function, and one for paths."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.constants import items
from kincompile.emitters.lines import indented
from kincompile.emitters.octave.loops import nodes_in
from kincompile.emitters.octave.march import OctaveSolver
from kincompile.emitters.octave.target import WRITE, called_in, require_short, splines_of
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.nodes import Index
from kincompile.solver.reader import transmission
from kincompile.solver.vocabulary import STATUSES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.emitters.octave.loops import Entries
    from kincompile.emitters.transmission import Transmission
    from kincompile.solver.nodes import For

RESERVED = ("s", "b", "x", "state", "status")
"""Names that the functions use besides those of the target."""


class _Solver(OctaveSolver):
    """Prints the text; loops over entries of a matrix, a row of which is no column, stay loops."""

    def at_once_of(self, node: For) -> Entries | None:
        """Return the entries of a loop that is written without one; None of another."""
        found = (x for x in nodes_in(node.body) if isinstance(x, Index))
        return None if any(len(x.indices) > 1 for x in found) else super().at_once_of(node)


def files(of: Transmission) -> Mapping[str, str]:
    """Return the .m files; refuse names longer than MATLAB reads."""
    name = f"{of.name}_transmission"
    path, tables = f"{name}_batch", splines_of(of.of.code.program)
    require_short([path, *of.listing.names.values(), *tables])
    body = of.evaluation(WRITE, first=1)
    solver = _Solver(transmission(), {**of.sizes, **STATUSES, **NUMBERS})
    data = {
        "header": "\n".join(f"% {line}".rstrip() for line in of.about()),
        "name": name,
        **{x: "; ".join(items(map(float, getattr(of, x)))) for x in ("p", "u", "q")},
        "size": repr(of.of.size),
        "tables": "\n".join(
            f"s.{x} = [{'; '.join(items(map(bool, own)))}];" for x, own in of.tables.items()
        ),
        "statuses": ", ".join(f"{n} {x}" for x, n in statuses().items()),
        "body": indented(body, 0),
        "functions": called_in("\n".join(body)) + "".join(f"\n{x}" for x in tables.values()),
        "solver": solver.text(),
    }
    ends = {"name": name, "inputs": len(of.of.inputs), "outputs": len(of.of.outputs)}
    batch = fill("octave/transmission_batch.m.jinja", ends)
    return {
        f"{name}.m": fill("octave/transmission.m.jinja", data).rstrip("\n") + "\n",
        f"{path}.m": batch,
    }
