"""Loops as functions: emitted C beside plain C by hand, 20,000 points along a smooth path.

`python -m benchmarks.transmission` prints the time of x, J and J^T tau of a point, in one call for
the path and in one for each point, in one call of the NumPy module, and the ratio to the peer, in
one run: a crank-rocker and a delta in closed form, an ankle by Newton's method. Then with more than
is needed, beside the leanest model: a joint that is there twice, and cylinders and rods as bodies.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import machine
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn
from kincompile import spatial
from kincompile.spatial import outputs

if TYPE_CHECKING:
    from collections.abc import Callable

PEERS = Path(__file__).with_name("peers") / "transmissions.c"
POINTS, ROUNDS = 20_000, 40
LIMIT, ONE_CALL, FULL, IN_NUMPY = 1.0, 1.5, 1.5, 4.0
KINDS = "batch", "follow", "by_hand"
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math")

# Follows a path from the position of the model, or by hand; returns how many points failed.
FOLLOW = """
int batch_{name}(long count, const double *u, const double *tau, double *x, double *J, double *e)
{{
    {name}_state s;
    if ({name}_start(&s) != 0)
        return (int)count;
    return (int)(count - {name}_transmission_batch(&s, count, u, tau, x, J, e, 0));
}}

int follow_{name}(long count, const double *u, const double *tau, double *x, double *J, double *e)
{{
    {name}_state s;
    int failed = {name}_start(&s) != 0;
    for (long k = 0; k < count; k++) {{
        failed += {name}_transmission(&s, u + {n} * k, x + {m} * k, J + {mn} * k) != 0;
        {name}_effort(J + {mn} * k, tau + {m} * k, e + {n} * k);
    }}
    return failed;
}}

int by_hand_{name}(long count, const double *u, const double *tau, double *x, double *J, double *e)
{{
    for (long k = 0; k < count; k++) {{
        peer_{peer}(u + {n} * k, x + {m} * k, J + {mn} * k);
        for (int j = 0; j < {n}; j++) {{
            double sum = 0;
            for (int i = 0; i < {m}; i++)
                sum += J[{mn} * k + {n} * i + j] * tau[{m} * k + i];
            e[{n} * k + j] = sum;
        }}
    }}
    return 0;
}}
"""


@dataclass(frozen=True, slots=True)
class Case:
    """A mechanism, its inputs and outputs, a path (N, n), and the name of its leanest model."""

    peer: str
    model: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    path: Any


def main() -> None:
    """Measure and print."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        print("skipped: there is no C compiler")
        return
    before, rows, targets = machine.load(), [], []
    batches: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, case in cases().items():
            calls = calls_of(name, case, compiler, Path(folder))
            calls["numpy"] = in_numpy(case)
            found = in_turn(calls, calls=1, rounds=ROUNDS)
            times = [1e9 / POINTS * found[x].least for x in (*KINDS, "numpy")]
            rows.append([name, *(f"{x:.0f}" for x in times)])
            batches[name] = times[0]
            if name != case.peer:
                part = times[0] / batches[case.peer]
                targets.append(Target(f"{name}: a batch, x {case.peer}", part, "at most", FULL))
                continue
            batch, single, _, arrays = (x / times[2] for x in times)
            targets.append(Target(f"{name}: a batch, x plain C", batch, "at most", LIMIT))
            targets.append(Target(f"{name}: call by call, x plain C", single, "at most", ONE_CALL))
            targets.append(Target(f"{name}: NumPy, x plain C", arrays, "at most", IN_NUMPY))
    head = "loop", "emitted C, a batch", "call by call", "by hand", "NumPy, a batch"
    print_table("x, J and J^T tau, ns a point", head, rows)
    print_targets("Loops as functions: what was to be reached", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def calls_of(name: str, case: Case, compiler: str, folder: Path) -> dict[str, Callable[[], object]]:
    """Return what follows a path by emitted code, two ways, and by hand, which agree."""
    emitted = kc.emit(case.model, "c", transmission=(case.inputs, case.outputs))
    emitted.write(folder)
    n, m = case.path.shape[1], len(case.outputs)
    peer = f"void peer_{case.peer}(const double *, double *, double *);"
    head = f'#include "{name}_transmission.h"\n{peer}\n'
    text = head + FOLLOW.format(name=name, peer=case.peer, n=n, m=m, mn=m * n)
    (folder / f"{name}_follow.c").write_text(text, encoding="utf-8")
    sources = [str(folder / f"{name}_follow.c"), str(folder / f"{name}_transmission.c"), str(PEERS)]
    library = folder / f"{name}.so"
    command = [
        compiler,
        "-std=gnu99",
        *FLAGS,
        "-shared",
        "-fPIC",
        *sources,
        "-o",
        str(library),
        "-lm",
    ]
    subprocess.run(command, check=True)
    loaded = ctypes.CDLL(str(library))
    tau = np.tile(np.linspace(1.0, 2.0, m), (POINTS, 1))
    found, calls = [], []
    for kind in KINDS:
        room = [np.empty((POINTS, size)) for size in (m, m * n, n)]
        given = [ctypes.c_void_p(a.ctypes.data) for a in (case.path, tau, *room)]
        calls.append(partial(getattr(loaded, f"{kind}_{name}"), POINTS, *given))
        found.append((room, calls[-1]()))
    *mine, (theirs, _) = found
    for ours, failed in mine:
        assert failed == 0, f"{failed} points of {name} failed"
        for here, there in zip(ours[1:], theirs[1:], strict=True):
            np.testing.assert_allclose(here, there, rtol=0, atol=1e-9 * np.abs(there).max())
    kept.append((case, tau, found))
    return dict(zip(KINDS, calls, strict=True))


def in_numpy(case: Case) -> Callable[[], object]:
    """Return what follows a path by the emitted NumPy module, in one call."""
    module: dict[str, Any] = {}
    exec(kc.emit(case.model, transmission=(case.inputs, case.outputs)).source, module)
    tau = np.tile(np.linspace(1.0, 2.0, len(case.outputs)), (POINTS, 1))

    def follow() -> None:
        state, _ = module["start"]()
        _, slopes, status = module["transmission_batch"](state, case.path)
        module["effort"](slopes, tau)
        assert not status.any()

    return follow


kept: list[object] = []
"""Arrays that are written to as long as the calls are made."""


def cases() -> dict[str, Case]:
    """Return the mechanisms, by the names of their peers."""
    turn = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
    crank = 1.5 + turn[:, np.newaxis]
    legs = 0.2251 + 0.02 * np.sin(np.outer(turn, (1, 2)))
    arms = 0.6 + 0.4 * np.sin(np.outer(turn, (1, 2, 3)) + np.arange(3.0))
    turning = ("motor",), ("phi_rocker",), crank
    tilting = ("left", "right"), ("pitch", "roll"), legs
    return {
        "crank_rocker": Case("crank_rocker", crank_rocker("crank_rocker"), *turning),
        "ankle": Case("ankle", ankle("ankle"), *tilting),
        "delta": Case("delta", delta(), ("t1", "t2", "t3"), ("x", "y", "z"), arms),
        "joint_twice": Case("crank_rocker", crank_rocker("joint_twice"), *turning),
        "ankle_with_rods": Case("ankle", ankle("ankle_with_rods"), *tilting),
    }


def crank_rocker(name: str) -> kc.Mechanism:
    """Return a crank-rocker whose crank turns fully."""
    m = kc.Mechanism(name)
    crank, rocker = m.body("crank", (0, 0, 1.5)), m.body("rocker", (0.13, 0, 1.74))
    coupler = m.body("coupler", (0, 0.04, 0.33))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (0.04, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (0.12, 0), rocker, (0.08, 0)))
    m.add(kc.Revolute("D", m.ground, (0.13, 0), rocker, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1.5))
    if name == "joint_twice":
        m.add(kc.Revolute("again", crank, (0.04, 0), coupler, (0, 0)))
    return m


def ankle(name: str) -> spatial.Mechanism:
    """Return an ankle on two linear actuators, behind the shank."""
    m = spatial.Mechanism(name)
    foot = m.body("foot", (0, 0, 0))
    m.add(spatial.Universal("cross", m.ground, (0, 0, 0), (0, 1, 0), foot, (0, 0, 0), (1, 0, 0)))
    at, down = (0, 0, 0), (0, 0, -1)
    for leg, side in (("left", 1), ("right", -1)):
        top, ball = (-0.045, side * 0.036, 0.24), (-0.052, side * 0.034, 0.015)
        if name == "ankle":
            m.add(spatial.Distance(leg, m.ground, top, foot, ball, 0.2251))
            continue
        cylinder, rod = m.body(f"cylinder_{leg}", top), m.body(f"rod_{leg}", ball)
        m.add(spatial.Spherical(f"top_{leg}", m.ground, top, cylinder, at))
        m.add(spatial.Spherical(f"ball_{leg}", foot, ball, rod, at))
        ends = cylinder, at, down, (1, 0, 0), rod, at, down, (0, 1, 0)
        m.add(spatial.Translational(f"slide_{leg}", *ends))
        m.add(spatial.RelativeTranslation(leg, cylinder, at, down, rod, at, 0.2251))
    x, y = foot.direction((1, 0, 0)), foot.direction((0, 1, 0))
    m.output("pitch", outputs.angle((1, 0, 0), x, about=(0, 1, 0)), "rad")
    m.output("roll", outputs.angle((0, 1, 0), y, about=x), "rad")
    return m


def delta() -> kc.ConstraintSystem:
    """Return a delta by the equations of its three rods: the platform does not turn."""
    base, arm, rod, top = 0.2, 0.25, 0.5, 0.05
    x, y, z = place = sympy.symbols("x y z")
    motors = sympy.symbols("t1:4")
    equations = []
    for k, motor in enumerate(motors):
        turn = 2 * sympy.pi * k / 3
        out = base - top + arm * sympy.cos(motor)
        elbow = (out * sympy.cos(turn), out * sympy.sin(turn), -arm * sympy.sin(motor))
        equations.append(sum((a - b) ** 2 for a, b in zip(place, elbow, strict=True)) - rod**2)
    return kc.ConstraintSystem(
        "delta", (x, y, z, *motors), equations, guess=(0, 0, -0.5, 0.6, 0.6, 0.6)
    )


if __name__ == "__main__":
    main()
