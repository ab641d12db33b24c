"""The text of the solver on NumPy, with the kernels of a compiled module."""

from types import SimpleNamespace

import numpy as np
import pytest

import kincompile as kc
from kincompile import criteria, quantities
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import problem
from kincompile.solver.words import Mechanism, on_numpy


def mechanism_of(module, lanes):
    """Return what the text must know of a module of NumPy, and how many points it takes at once."""
    own, nonzeros = module.LANES, vars(module)["_PHI_Q_NONZEROS"]

    def bound(kernel):
        return lambda *states: own[kernel](module.ARRAYS, *states)

    units = [module.UNITS[name] for name in module.COORDINATES]
    code, cover = code_of(module), np.full(module.N_COORDINATES, module.N_COORDINATES)
    cover[code.covers] = code.covers[:, :1]
    columns = [range(first, first + count) for _, first, count in module.BODIES]
    n, m = module.N_COORDINATES, module.N_EQUATIONS
    kernels = {name: bound(name) for name in ("position", "nu", "gamma", "factor", "solve")}
    with np.errstate(all="ignore"):
        _, determinants = kernels["factor"]([np.ones(1)] * len(nonzeros.places))
    return Mechanism(
        sizes={
            "N": n, "M": m, "K": len(module.PARAMETERS), "LANES": lanes,
            "NONZEROS": len(module.PATTERN), "BLOCKS": len(determinants),
        },
        tables={
            "ANGULAR": list(quantities.turning(units, columns)),
            "IS_REDUNDANT": [False] * m,
            "PROBE": criteria.probe_of(max(n, m)).tolist(),
            "PATTERN": module.PATTERN.tolist(),
            "MAY_TURN": code.may_turn.tolist(),
            "COVER": cover.tolist(),
        },
        kernels=kernels,
        varying=nonzeros.places,
        start=nonzeros.start,
    )  # fmt: skip


def start_of(module, t):
    """Return an assembled position at a time, and the size of the mechanism."""
    q = kc.solve(module, [t]).q[0]
    inputs = read_inputs(module, np.array([t]), None, None, criteria.TOLERANCE, 25)
    return q, problem(code_of(module), inputs.p, q, t).size


def rough_guesses(module, count):
    """Return guesses around the position at t = 0.

    Of every other one angles are turned by whole turns, of every third one the signs of Euler
    parameters are.
    """
    start = kc.solve(module, [0.0]).q[0]
    equations = problem(code_of(module), module.DEFAULTS, start.copy(), 0.0)
    rng = np.random.default_rng(7)
    guesses = start + equations.reference * rng.uniform(-0.8, 0.8, (count, start.size))
    turns = 2 * np.pi * rng.integers(-2, 3, guesses[::2].shape)
    guesses[::2] += equations.code.may_turn * turns
    for cover in equations.code.covers:
        guesses[np.ix_(range(0, count, 3), cover)] *= -1
    return guesses


def size_around(module, guess):
    """Return the size of a mechanism as the runtime finds it at a guess for t = 0."""
    oriented = read_inputs(module, np.zeros(1), None, guess, criteria.TOLERANCE, 25).guess
    return problem(code_of(module), module.DEFAULTS, oriented, 0.0).size


def marched(module, lanes, t, sets, *, together=False):
    """March by the text: one motion, or those of parameter sets together.

    Returns how many points, or sets, converged, and what was written: arrays whose last axis is
    the time, or the set after the time.
    """
    text = on_numpy(mechanism_of(module, lanes))
    guess, size = start_of(module, float(t[0]))
    n, shape = module.N_COORDINATES, (t.size, len(sets)) if together else (1, t.size)
    columns = np.transpose(sets) if together else np.repeat(np.transpose(sets), lanes, axis=1)
    guesses = np.repeat(guess[:, np.newaxis], columns.shape[1], axis=1)
    written = {name: np.full((n, *shape), np.nan) for name in ("q", "q_dot", "q_ddot")}
    said = {name: np.zeros(shape[0] * shape[1], int) for name in ("status", "iterations")}
    said["residual"] = np.full(shape[0] * shape[1], np.nan)
    variants = text.Variants(
        count=t.size, variants=len(sets) if together else 0, t=t, p=columns, guess=guesses,
        size=size, tolerance=criteria.TOLERANCE, max_iterations=25, **written, **said,
    )  # fmt: skip
    with np.errstate(all="ignore"):
        reached = (text.march_variants if together else text.march)(variants)
    rows = {name: array if together else array[:, 0] for name, array in written.items()}
    return reached, SimpleNamespace(**rows, **said)


@pytest.fixture(scope="session")
def march():
    """Return `marched`."""
    return marched
