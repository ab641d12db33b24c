"""How a mechanism or a system shows itself in a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import sympy

from kincompile.html import table_html
from kincompile.model.resolve import FreeEquation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.resolve import Joint

MOST_EQUATIONS = 24
"""Equations up to which Phi is written out."""

_HEADER = ("row", "constraint", "type", "between", "source")


def constraints_html(
    name: str, coordinates: int, constraints: Sequence[Joint | FreeEquation]
) -> str:
    """Return the constraints of a system as an HTML table."""
    rows, first = [], 0
    for item in constraints:
        rows.append((str(first), item.name, _kind(item), item.text, item.source))
        first += len(item.equation_names)
    return table_html(name, f"{coordinates} coordinates, {first} equations", _HEADER, rows)


def problems_html(name: str, problems: str) -> str:
    """Return the problems of an unfinished mechanism as HTML."""
    return f"<p><b>{escape(str(name))}</b>, not usable yet:</p><pre>{escape(problems)}</pre>"


def equations_latex(Phi: sympy.ImmutableDenseMatrix) -> str | None:
    """Return Phi = 0 in LaTeX, or None where there are too many equations to read."""
    if Phi.rows > MOST_EQUATIONS:
        return None
    return rf"$\displaystyle \Phi = {sympy.latex(Phi)} = 0$"


def _kind(item: Joint | FreeEquation) -> str:
    kind = "Equation" if isinstance(item, FreeEquation) else item.type_name
    return f"{kind} (driver)" if item.is_driver else kind
