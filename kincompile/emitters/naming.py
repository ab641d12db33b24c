"""Names in emitted code: the user's own where they can be, others beside them, none twice."""

from __future__ import annotations

import keyword
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


class NameTable:
    """Gives out names; the first who asks for a name gets it, later ones get it with a number."""

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
