"""Examples whose bodies have masses."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

import kincompile as kc

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def heavy_examples() -> list[tuple[str, Any]]:
    """Return the examples that are mechanisms, with seeded masses, centres and gravity."""
    found = []
    for path in sorted(EXAMPLES.glob("*.toml")):
        model = kc.read_model(path)
        if isinstance(model, kc.Mechanism):
            found.append((path.stem, heavy(model)))
    return found


def heavy(model: kc.Mechanism) -> kc.Mechanism:
    """Return a mechanism with masses of its bodies, in its own size."""
    rng = np.random.default_rng(len(model.name))
    numbers = [
        float(x) for body in model.bodies for x in body.guess[:2] if isinstance(x, int | float)
    ]
    size = max(map(abs, numbers), default=1.0) or 1.0
    model.gravity = (0.4, -9.81)
    model.bodies[:] = [
        dataclasses.replace(
            body,
            mass=float(rng.uniform(0.5, 3)),
            inertia=float(rng.uniform(0.05, 0.3) * size**2),
            centre=tuple((rng.uniform(-0.5, 0.5, 2) * size).tolist()),
        )
        for body in model.bodies
    ]
    return model
