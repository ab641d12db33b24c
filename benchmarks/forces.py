"""What inverse dynamics costs beside the kinematics, and beside CasADi and plain C.

``python -m benchmarks.forces`` takes the motion of a four-bar with masses, 10,000 points, to the
multipliers of Phi_q^T lambda = Q - M q_ddot. `kc.forces` gives reactions, torque, power and what
shakes the ground as well; the peers give the multipliers, from a motion that they are given. The
limit is 0.6 times the kinematics of the same target.
"""

from __future__ import annotations

import dataclasses
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import machine
from benchmarks.linkages import FOUR_BAR, POINTS, Linkage
from benchmarks.peers import casadi_peer, plain_c
from benchmarks.peers.common import Skipped, compiled_c, derived, pointer
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Peer = Callable[[], Array]

ROUNDS = 15
GRAVITY = 9.81
CENTRE = (0.11, 0.02)
"""Centre of mass of every body in its frame."""

CASADI, GENERATED, PLAIN = "CasADi, map", "CasADi, map, generated C", "plain C, LU"


def masses(linkage: Linkage) -> list[tuple[float, float]]:
    """Return mass and inertia of each body."""
    return [(1 + k / 2, 0.02 + k / 100) for k in range(len(linkage.bodies))]


def heavy(linkage: Linkage) -> kc.Mechanism:
    """Return the mechanism with masses."""
    m = linkage.mechanism()
    m.gravity = (0, -GRAVITY)
    m.bodies[:] = [
        dataclasses.replace(body, mass=mass, inertia=inertia, centre=CENTRE)
        for body, (mass, inertia) in zip(m.bodies, masses(linkage), strict=True)
    ]
    return m


def sides(linkage: Linkage, library: Any, q: Any, q_dot: Any, q_ddot: Any) -> list[Any]:
    """Return Q - M q_ddot by the accelerations of the centres of mass, in full coordinates."""
    found: list[Any] = []
    for k, (mass, inertia) in enumerate(masses(linkage)):
        phi, w, alpha = q[3 * k + 2], q_dot[3 * k + 2], q_ddot[3 * k + 2]
        c, s = library.cos(phi), library.sin(phi)
        x, y = c * CENTRE[0] - s * CENTRE[1], s * CENTRE[0] + c * CENTRE[1]
        force_x = -mass * (q_ddot[3 * k] - alpha * y - w**2 * x)
        force_y = -mass * (q_ddot[3 * k + 1] + alpha * x - w**2 * y + GRAVITY)
        found += [force_x, force_y, x * force_y - y * force_x - inertia * alpha]
    return found


def by_casadi(linkage: Linkage, motion: tuple[Array, ...], t: Array, *, is_compiled: bool) -> Peer:
    """Return what gives the multipliers by CasADi's own derivatives."""
    Phi, q, time, p = casadi_peer.equations(linkage)
    casadi = casadi_peer.casadi
    rates = [casadi.SX.sym(name, q.numel()) for name in ("q_dot", "q_ddot")]
    parts = (casadi.vertsplit(item) for item in (q, *rates))
    side = casadi.vertcat(*sides(linkage, casadi, *parts))
    inputs = [q, *rates, time, p]
    both = casadi.Function("both", inputs, [casadi.jacobian(Phi, q).T, side])
    symbols = [casadi.MX.sym(f"x{k}", item.numel()) for k, item in enumerate(inputs)]
    solved = casadi.Function("forces", symbols, [casadi.solve(*both(*symbols))]).map(t.size)
    function = casadi_peer.external(solved) if is_compiled else solved
    values = np.repeat(linkage.values[:, np.newaxis], t.size, axis=1)
    given = (*(part.T for part in motion), t[np.newaxis], values)
    return lambda: np.asarray(function(*given).full().T)


def by_plain_c(linkage: Linkage, motion: tuple[Array, ...], t: Array) -> Peer:
    """Return what gives the multipliers by C that SymPy prints, and a plain LU."""
    d = derived(linkage)
    n = len(d.equations.q)
    q_ddot = [sympy.Symbol(f"a{k}") for k in range(n)]
    side = sides(linkage, sympy, d.equations.q, d.equations.q_dot, q_ddot)
    places = {symbol: sympy.Symbol(f"w[{n + k}]") for k, symbol in enumerate(q_ddot)}
    side = [item.xreplace(places) for item in side]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = plain_c.equations(d) + "\n" + plain_c.function("forces", side, d.Phi_q.T.flat(), d)
        (folder / "equations.h").write_text(text, encoding="utf-8")
        for program in ("plain.c", "plain_forces.c"):
            own = plain_c.PROGRAM.with_name(program).read_text(encoding="utf-8")
            (folder / program).write_text(own, encoding="utf-8")
        library = compiled_c(folder / "plain_forces.c")
    q, q_dot, second = motion
    rates = np.hstack((q_dot, second))
    given = (t, linkage.values, *map(np.ascontiguousarray, (q, rates)))
    found = np.empty(q.shape)

    def multipliers() -> Array:
        library.run_forces(t.size, *map(pointer, (*given, found)))
        return found

    return multipliers


def peers(linkage: Linkage, motion: tuple[Array, ...], t: Array) -> Iterator[tuple[str, Peer]]:
    """Yield the contenders that are installed."""
    for name, build in (
        (CASADI, partial(by_casadi, is_compiled=False)),
        (GENERATED, partial(by_casadi, is_compiled=True)),
        (PLAIN, by_plain_c),
    ):
        try:
            yield name, build(linkage, motion, t)
        except Skipped as reason:
            print(f"{name}: {reason}")


def measure(linkage: Linkage) -> list[Target]:
    """Print the table of a linkage; return what was to be reached."""
    t = linkage.times(POINTS)
    modules = {target: kc.compile(heavy(linkage), target) for target in ("numpy", "c")}
    solutions = {target: kc.solve(module, t) for target, module in modules.items()}
    one = solutions["numpy"]
    others = dict(peers(linkage, (one.q, one.q_dot, one.q_ddot), t))
    known = kc.forces(one).multipliers
    for name, multipliers in others.items():
        off = np.abs(multipliers() - known).max() / np.abs(known).max()
        assert off < 1e-11, f"{name} differs by {off:.1e}"
    calls: dict[str, Callable[[], object]] = dict(others)
    for target, module in modules.items():
        calls[f"kinematics, {target}"] = partial(kc.solve, module, t)
        calls[f"forces, {target}"] = partial(kc.forces, solutions[target])
    times = in_turn(calls, calls=1, rounds=ROUNDS)
    rows = [[name, f"{1e3 * x.median:.2f} ({1e3 * x.least:.2f})"] for name, x in times.items()]
    print_table(f"{linkage.name}, {POINTS} points", ("contender", "ms, median (least)"), rows)
    least = {name: item.least for name, item in times.items()}
    return [
        Target(
            f"{linkage.name}, {target}: time by kinematics",
            least[f"forces, {target}"] / least[f"kinematics, {target}"], "at most", 0.6,
        )
        for target in modules
    ]  # fmt: skip


def main() -> None:
    """Measure and print."""
    before = machine.load()
    targets = measure(FOUR_BAR)
    print_targets("Inverse dynamics: what was to be reached, ratios of the least times", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


if __name__ == "__main__":
    main()
