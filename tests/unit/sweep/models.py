"""Mechanisms whose motion is known in closed form."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import kincompile as kc

TIMES = np.linspace(0.0, 2.0, 9)


def crank(name: str = "crank") -> kc.Mechanism:
    """A crank of length a that turns with omega, and a point at its end: x = a cos(omega t)."""
    m = kc.Mechanism(name, end=2.0, points=9)
    a, omega = m.parameter("a", 0.5, unit="m"), m.parameter("omega", 1.0, unit="rad/s")
    body = m.body("arm", guess=(0.5, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), body, (-a, 0)))
    m.add(kc.AbsoluteAngle("motor", body, omega * kc.t))
    m.point("tip", body, (0, 0))
    return m


def folding(name: str = "folding") -> kc.Mechanism:
    """A crank of length 1 and a rod b whose end is on the x-axis: sin(angle) = -sin(0.3 + t)/b."""
    m = kc.Mechanism(name, end=0.1, points=5)
    b = m.parameter("b", 1.0)
    one, two = m.body("one", guess=(0, 0, 0.3)), m.body("two", guess=(1, 0.3, -0.3))
    m.add(kc.Revolute("A", m.ground, (0, 0), one, (0, 0)))
    m.add(kc.Revolute("B", one, (1, 0), two, (0, 0)))
    m.add(kc.AbsoluteY("slide", two, (b, 0), 0))
    m.add(kc.AbsoluteAngle("motor", one, 0.3 + kc.t))
    m.output("angle", two.phi, unit="rad")
    return m


def files_of(folder: Path) -> dict[str, bytes]:
    """Return the bytes of all files of a folder by name."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def processes(count: int) -> ProcessPoolExecutor:
    """Return a pool of fresh processes: a fork of one with threads, as Zarr has, is warned of."""
    return ProcessPoolExecutor(count, get_context("forkserver"))
