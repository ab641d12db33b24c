"""Four-bars of a mechanism of the plane: four bodies, one of them the ground, on four pins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import sympy

from kincompile.model.expressions import as_sympy, evaluate
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.model.system import ConstraintSystem

    Pin = tuple[str, Mapping[str, tuple[Any, ...]]]


class FourBarLoop(NamedTuple):
    """Pins O, A, B, C, ground, crank, coupler and rocker, and what drives one of the links."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    lengths: tuple[sympy.Expr | float, ...]
    driver: str
    driven: str


def four_bar_loops(system: ConstraintSystem) -> tuple[FourBarLoop, ...]:
    """Return the four-bars of a mechanism; of the links on the ground a driven one is the crank."""
    drivers, ground, of = _turned(system), system.ground.name, _pins_of(system)
    found = [
        _loop(pins, links, drivers)
        for first in of.get(ground, ())
        for pins, links in _around(of, (first,), (ground,))
    ]
    chosen: dict[frozenset[str], FourBarLoop] = {}
    for item in found:  # each is found from both sides
        if item.driven == item.links[1] or frozenset(item.links) not in chosen:
            chosen[frozenset(item.links)] = item
    return tuple(chosen.values())


def four_bars_at(
    system: ConstraintSystem, loops: Iterable[FourBarLoop], p: Iterable[float]
) -> list[tuple[object, ...]]:
    """Return four-bars of a mechanism with parameters p, as `FourBarType` takes them."""
    names = [item.name for item in system.parameters]
    values = {name: float(x) for name, x in zip(names, p, strict=True)}
    return [
        (
            item.joints, item.links, tuple(evaluate(x, values) or 0.0 for x in item.lengths),
            system.length_unit, item.driver, item.driven,
        )
        for item in loops
    ]  # fmt: skip


def _loop(pins: tuple[Pin, ...], links: tuple[str, ...], drivers: Mapping[str, str]) -> FourBarLoop:
    """Return a four-bar with its lengths as expressions."""
    lengths = []
    for k, body in enumerate(links):
        (x, y), (u, v) = pins[k - 1][1][body], pins[k][1][body]
        square = (as_sympy(u) - as_sympy(x)) ** 2 + (as_sympy(v) - as_sympy(y)) ** 2
        lengths.append(sympy.sqrt(square))
    driven = next((name for name in (links[1], links[3], links[2]) if name in drivers), "")
    joints = tuple(name for name, _ in pins)
    return FourBarLoop(joints, links, tuple(lengths), drivers.get(driven, ""), driven)


def _around(
    of: Mapping[str, Sequence[Pin]], pins: tuple[Pin, ...], links: tuple[str, ...]
) -> Iterator[tuple[tuple[Pin, ...], tuple[str, ...]]]:
    """Yield four pins and four links, the last pin on the ground again, that begin with these."""
    if len(pins) == 4:
        yield pins, links
        return
    is_last = len(pins) == 3
    for body in pins[-1][1]:
        for pin in of[body] if body not in links else ():
            if pin not in pins and (links[0] in pin[1]) == is_last:
                yield from _around(of, (*pins, pin), (*links, body))


def _pins_of(system: ConstraintSystem) -> dict[str, list[Pin]]:
    """Return the pins of bodies by their names: of each a joint, and its place on every body."""
    found: list[Pin] = []
    for item in system.constraints:
        if not isinstance(item, Joint) or item.type_name != "Revolute":
            continue
        if set(item.points) != {"s_i", "s_j"} or len(item.points["s_i"]) != 2:
            continue  # in space
        points = (tuple(item.points[which]) for which in ("s_i", "s_j"))
        ends = dict(zip((body.name for body in item.bodies), points, strict=True))
        same = [pin for pin in found if ends.items() & pin[1].items()]
        for pin in same:  # of three bodies on one pin
            found.remove(pin)
            ends = {**pin[1], **ends}
        found.append((same[0][0] if same else item.name, ends))
    of: dict[str, list[Pin]] = {}
    for pin in found:
        for body in pin[1]:
            of.setdefault(body, []).append(pin)
    return of


def _turned(system: ConstraintSystem) -> dict[str, str]:
    """Return the driver of each body that is turned against the ground."""
    return {
        body: item.name
        for item in system.constraints
        if isinstance(item, Joint) and item.is_driver
        if any(x.symbol == "C" and x.unit == "rad" for x in item.written.arguments().values())
        for moving in [{body.name for body in item.bodies} - {system.ground.name}]
        if len(moving) == 1
        for body in moving
    }
