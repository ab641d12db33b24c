"""Which links of a four-bar turn wholly, by Grashof's rule.

The shortest link turns wholly against all others where, with any other one, it is shorter than the
other two together: s + l < p + q. For each link as the shortest these are three conditions that are
linear in the lengths (`room`), so that a search can keep them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from kincompile.criteria import SAME
from kincompile.errors import InputError
from kincompile.names import ROLES, TRIPLE, listed
from kincompile.runtime.engine.code import FOUR_BARS
from kincompile.tables import table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.runtime.engine.code import Array, Compiled

T = TypeVar("T", bound="HasLinks")

CHANGE = "change point"
"""Where s + l = p + q."""


class HasLinks(Protocol):
    """A four-bar of a model, or with its lengths."""

    @property
    def links(self) -> tuple[str, ...]:
        """Names of ground, crank, coupler and rocker."""


def room(lengths: Sequence[Any], shortest: int) -> list[Any]:
    """Return p + q - s - l for each other link as l: positive where the shortest turns wholly.

    Of ground, crank, coupler and rocker; numbers, or expressions.
    """
    around = lengths[0] + lengths[1] + lengths[2] + lengths[3]
    others = (x for k, x in enumerate(lengths) if k != shortest)
    return [around - 2 * (lengths[shortest] + other) for other in others]


def non_grashof(lengths: Sequence[Any]) -> Any:
    """Return a smooth number that is positive where no link turns wholly: a length.

    The product of the three differences of pairs of links is positive of a Grashof linkage, after
    Bottema and McCarthy (Geometric Design of Linkages, 2000).
    """
    ground, crank, coupler, rocker = lengths
    first = ground - crank + rocker - coupler
    second = ground - crank - rocker + coupler
    third = rocker + coupler - ground - crank
    return -first * second * third / (ground + crank + coupler + rocker) ** 2


def margin_of(lengths: Sequence[float]) -> float:
    """Return p + q - s - l of a four-bar: negative where no link turns wholly."""
    return float(min(room(lengths, list(lengths).index(min(lengths)))))


@dataclass(frozen=True, slots=True)
class FourBarType:
    """The Grashof type of four links on four pins, one of them the ground.

    Attributes
    ----------
    joints, links : tuple of str
        Pins O, A, B, C, and ground, crank, coupler, rocker, of which the crank is the driven one.
    lengths : tuple of float
        Of the links [unit].
    unit : str
        Of lengths.
    driver : str
        What drives the crank, or else another of the links; "" where nothing does.
    driven : str
        The link that it drives.
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    lengths: tuple[float, ...]
    unit: str
    driver: str
    driven: str

    @property
    def margin(self) -> float:
        """By how much Grashof's condition is met: p + q - s - l [unit]."""
        return margin_of(self.lengths)

    @property
    def shortest(self) -> str:
        """The shortest link; of equal ones the first."""
        return self.links[self.lengths.index(min(self.lengths))]

    @property
    def type(self) -> str:
        """One of `ROLES`, ``"triple-rocker"`` or ``"change point"``."""
        if abs(self.margin) <= SAME * sum(self.lengths):
            return CHANGE
        return ROLES[self.links.index(self.shortest)] if self.margin > 0 else TRIPLE

    @property
    def full(self) -> tuple[str, ...]:
        """The links that turn wholly against the ground."""
        if self.type in (CHANGE, TRIPLE):
            return ()
        least = self.links.index(self.shortest)
        return self.links[1:] if least == 0 else (self.shortest,)

    def __str__(self) -> str:
        """Return one sentence."""
        low, most = min(self.lengths), max(self.lengths)
        sums = f"s + l = {low + most:.6g}, p + q = {sum(self.lengths) - low - most:.6g} {self.unit}"
        return (
            f"four-bar {' '.join(self.joints)}: {self.type}, {self.shortest} is the shortest, "
            f"{sums}; against {self.links[0]} {listed(self.full)} can turn wholly{self._said()}"
        )

    def _said(self) -> str:
        """Say what that means for the driver."""
        if not self.driver or self.type == CHANGE:
            return ""
        can = "can" if self.driven in self.full else "cannot"
        return f", and {self.driver} {can} make a turn in it"

    def as_dict(self) -> dict[str, Any]:
        """Return all of it for JSON."""
        return {
            "joints": self.joints, "links": dict(zip(self.links, self.lengths, strict=True)),
            "type": self.type, "shortest": self.shortest, "margin": self.margin,
            "turns": self.full, "driver": self.driver,
        }  # fmt: skip


def four_bar_with(found: Sequence[T], link: str | None) -> T:
    """Return the one four-bar, or the one that has a link.

    Raises
    ------
    InputError
        If there are none or several.
    """
    own = [item for item in found if link is None or link in item.links]
    if len(own) == 1:
        return own[0]
    with_it = "" if link is None else f" with the link {link!r}"
    loops = "; ".join(", ".join(item.links) for item in found) or "none"
    raise InputError(
        f"There are {len(own)} four-bars{with_it}. Name a link that one of them has; the links of "
        f"the four-bars are: {loops}."
    )


def four_bar_types(code: Compiled, p: Array) -> tuple[FourBarType, ...]:
    """Return the types of all four-bars with parameters p; none are known of a module from a file.

    Links without length make none.
    """
    if FOUR_BARS not in code.makers:
        return ()
    found = (FourBarType(*item) for item in code.request(FOUR_BARS)(p))
    return tuple(item for item in found if min(item.lengths) > 0)


def four_bar_table(found: Sequence[FourBarType]) -> list[str]:
    """Return the lines of the table of four-bars."""
    rows = []
    for item in found:
        turns = listed(item.full) if item.type != CHANGE else "-"
        cells = (item.type, item.shortest, f"{item.margin:.6g} {item.unit}".rstrip(), turns)
        rows.append([" ".join(item.joints), *cells])
    header = ("four-bar", "Grashof type", "shortest", "p + q - s - l", "turns wholly")
    return table(header, rows, right=header[3:4]) if rows else []
