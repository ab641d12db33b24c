"""docs/joints.md and its pictures, from the catalogue of constraint types."""

from __future__ import annotations

import inspect
import re
from typing import TYPE_CHECKING, cast

import numpy as np
import sympy

import kincompile as kc
from docs.builders.places import DOCS
from docs.builders.space import alone
from kincompile.derivations.slides import ATTRIBUTES
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.report.document import Figure
from kincompile.report.figure import standalone_svg
from kincompile.space.catalogue import CONSTRAINTS as IN_SPACE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile import spatial
    from kincompile.derivations.derivation import Derivation
    from kincompile.model.constraint import Constraint

BEGIN, END = "<!-- catalogue -->\n", "<!-- end of catalogue -->\n"
SPACE, END_OF_SPACE = "<!-- catalogue of space -->\n", "<!-- end of catalogue of space -->\n"
"""What stands between these lines of the page is written here."""

PICTURED = {name: kind for name, kind in IN_SPACE.items() if not kind.is_own}
"""The types in space but the norm of a body, which has no vectors."""


def catalogue_text() -> str:
    """Return the part of the page that follows from the catalogue: a table, a section a type."""
    table = ["| Constraint | known as | arguments after the name | equations |", "| --- " * 4 + "|"]
    for name, kind in CONSTRAINTS.items():
        arguments = ", ".join(kind.arguments())
        rows = max(len(kind.row_names), 1)
        table.append(f"| [`{name}`](#{name.lower()}) | {kind.known_as} | {arguments} | {rows} |")
    table.append(
        "| `Equation` | free equation | one or more SymPy expressions, each = 0 | one each |"
    )
    sections = "\n".join(line for kind in CONSTRAINTS.values() for line in _section(kind))
    return "\n".join(table) + f"\n\n{sections}"


def pictures() -> dict[str, str]:
    """Return the picture of each type by the name of its file."""
    plane = {f"joint_{name}.svg": mechanism_of(kind) for name, kind in CONSTRAINTS.items()}
    space = {f"space_{name}.svg": alone(kind) for name, kind in PICTURED.items()}
    return {name: _picture(_derivation(m)) for name, m in (plane | space).items()}


def _section(kind: type[Constraint]) -> Iterator[str]:
    """Yield what is said of a type."""
    name = kind.__name__
    first, *rest = inspect.cleandoc(str(kind.__doc__)).partition("\n\nParameters")[0].split("\n\n")
    yield from (f"## {name}", "", first, *rest, "")
    yield from (f"Known as: {kind.known_as}. In the textbook: {kind.source}.", "")
    yield from (f"![{name} with the vectors of its equation](images/joint_{name}.svg)", "")
    yield from (_equation(_derivation(mechanism_of(kind))), "")
    yield from (kind.positive, "")
    yield from ("```python", *kind.use, "```", "")


def mechanism_of(kind: type[Constraint]) -> kc.Mechanism:
    """Return a mechanism with one constraint, written as its two lines say."""
    m = kc.Mechanism(kind.__name__)
    exec("\n".join(kind.use), {"kc": kc, "m": m, "sympy": sympy})
    return m


def assembled(m: kc.Mechanism | spatial.Mechanism) -> dict[str, float]:
    """Return the position nearest to the guess at which the constraint holds."""
    module = kc.compile(m)
    q = module.GUESS.copy()
    for _ in range(50):
        Phi, Phi_q = module.position(q, 0.0)
        q -= np.linalg.pinv(Phi_q) @ Phi
    if not np.abs(module.Phi(q, 0.0)).max() < 1e-12:
        raise ValueError(f"{m.name} cannot be assembled from the guess of its two lines")
    return dict(zip(module.COORDINATES, q.tolist(), strict=True))


def _derivation(m: kc.Mechanism | spatial.Mechanism) -> Derivation:
    (constraint,) = m.constraints
    found = kc.derivation(m, assembled(m), constraint=constraint.name, levels=("vector",))
    return cast("Derivation", found)


def _picture(derivation: Derivation) -> str:
    """Return the figure of the joint, the first of its steps."""
    (chapter,) = derivation.sections[1].sections
    blocks = chapter.sections[ATTRIBUTES - 1].blocks
    (figure,) = (item for item in blocks if isinstance(item, Figure))
    return standalone_svg(figure.picture)


def _equation(derivation: Derivation) -> str:
    """Return the constraint in vectors, as GitHub reads formulas."""
    step = re.search(r"^#### 2\..*?(?=^#### 3\.)", derivation.to_markdown(), re.M | re.S)
    assert step is not None
    written = re.findall(r"^```math\n.*?^```$", step[0], re.M | re.S)
    return "\n\n".join(item for item in written if "math\n\\dot" not in item)


def page() -> str:
    """Return the page, with what follows from the catalogue."""
    text = (DOCS / "joints.md").read_text(encoding="utf-8")
    for begin, written, end in (
        (BEGIN, catalogue_text(), END),
        (SPACE, f"{space_table()}\n{space_gallery()}", END_OF_SPACE),
    ):
        before, rest = text.split(begin)
        text = before + begin + written + end + rest.split(end)[1]
    return text


def space_table() -> str:
    """Return the table of the types in space."""
    rows = [
        "| Constraint | what it is | arguments after the name | equations |",
        "| --- " * 4 + "|",
    ]
    for name, kind in IN_SPACE.items():
        what = inspect.cleandoc(str(kind.__doc__)).partition("\n")[0]
        arguments = ", ".join(kind.arguments())
        rows.append(f"| `{name}` | {what} | {arguments} | {max(len(kind.row_names), 1)} |")
    return "\n".join(rows) + "\n"


def space_gallery() -> str:
    """Return the types in space, each with its equations and the vectors in them."""
    lines = []
    for name, kind in PICTURED.items():
        rows = inspect.cleandoc(str(kind.Phi.__doc__)).partition("\n")[0].removeprefix("Return ")
        shown = f"![spatial.{name} with the vectors of its equations](images/space_{name}.svg)"
        lines += [f"### spatial.{name}", "", f"Phi: {rows}", "", shown, ""]
    return "\n".join(lines)
