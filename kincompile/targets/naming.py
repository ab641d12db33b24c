"""Names in emitted code: the user's own where they can be, others beside them, none twice."""

from __future__ import annotations

import keyword
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from kincompile.ir.graph import Constant


class NameTable:
    """Gives out names; the first who asks for a name gets it, later ones get it with a number.

    Parameters
    ----------
    reserved
        Names that the target or its template uses.
    """

    def __init__(self, reserved: Iterable[str]) -> None:
        self._taken = set(reserved)

    def take(self, wanted: str) -> str:
        """Return a free name, as close to the wanted one as possible."""
        name = wanted
        if name in self._taken or keyword.iskeyword(name):
            name = f"{wanted}_"
        number = 2
        while name in self._taken:
            name, number = f"{wanted}_{number}", number + 1
        self._taken.add(name)
        return name

    def copy(self) -> NameTable:
        """Return a table in which the same names are taken."""
        return NameTable(self._taken)


def content_name(
    node: tuple[object, ...], names: Mapping[int, str], numbers: Mapping[int, Constant]
) -> str | None:
    """Return a name that says what a small node is.

    It is `a_2` for a/2, `sin_theta`, `a_c_crank` for a c_crank; None for a larger node.
    """
    match node:
        case ("div", int(a), int(b)) if a in names and isinstance(numbers.get(b), int):
            return f"{names[a]}_{numbers[b]}"
        case ("square", int(a)) if a in names:
            return f"{names[a]}_sq"
        case ("call", str(function), int(a)) if a in names:
            return f"{function}_{names[a]}"
        case ("mul", int(a), int(b)) if a in names and b in names:
            name = f"{names[a]}_{names[b]}"
            spoken = not (names[a][-1].isdigit() or names[b][-1].isdigit())
            return name if spoken and len(name) <= MOST_CHARACTERS else None
    return None


MOST_CHARACTERS = 24
