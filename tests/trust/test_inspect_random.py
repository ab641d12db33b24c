"""Inspection of random linkages, most of them wrong in some way, against NumPy's rank."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc


def random_linkage(seed):
    """Return up to four bodies with random constraints, too few or too many, some written twice."""
    random = np.random.default_rng(seed)
    m = kc.Mechanism(f"random{seed}")
    count = int(random.integers(1, 5))
    bodies = [m.ground]
    bodies += [m.body(f"body{k}", guess=random.uniform(-2, 2, 3).tolist()) for k in range(count)]

    def point():
        return tuple(random.uniform(-1, 1, 2).tolist())

    for k in range(int(random.integers(1, 3 * count + 2))):
        first, second = (bodies[k] for k in random.choice(count + 1, 2, replace=False))
        one, value = bodies[int(random.integers(1, count + 1))], float(random.uniform(0.3, 1.5))
        places = (first, point(), second, point())
        makers: list[Any] = [
            lambda name, places=places: kc.Revolute(name, *places),
            lambda name, places=places: kc.Revolute(name, *places),
            lambda name, a=places, v=value: kc.Translational(name, *a[:2], (1, v), *a[2:], (1, 0)),
            lambda name, a=places, v=value: kc.Distance(name, *a, v),
            lambda name, a=places, v=value: kc.RelativeAngle(name, a[0], a[2], v),
            lambda name, b=one, v=value: kc.AbsoluteAngle(name, b, v + kc.t),
            lambda name, b=one, v=value: kc.AbsoluteAngle(name, b, v),
            lambda name, b=one, v=value: kc.AbsoluteX(name, b, point(), v),
        ]
        constraint = makers[int(random.integers(len(makers)))](f"joint{k}")
        m.add(constraint)
        if random.uniform() < 0.15:
            m.add(dataclasses.replace(constraint, name=f"again{k}"))
    return m


def rank_by_numpy(model, q):
    system = model.system()
    Phi_q = sympy.lambdify([*system.q, kc.t], system.Phi_q.tolist(), "numpy")
    matrix = np.array(Phi_q(*q, 0.0), dtype=float)
    return int(np.linalg.matrix_rank(matrix, tol=1e-7 * float(np.linalg.norm(matrix))))


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.slow
def test_a_random_linkage(seed):
    model = random_linkage(seed)
    found = kc.inspect(model)
    dependent = (*found.redundant, *found.conflicting)
    assert found.rank + len(dependent) == len(found.equations)
    assert found.rank <= found.structural_rank
    assert bool(found.missing_drivers) == bool(found.free) == bool(found.degrees_of_freedom)
    assert all(item.remedy in found.to_text() for item in found.surpluses)
    if not found.is_assembled:
        assert "cannot be assembled" in found.to_text()
        return
    assert rank_by_numpy(model, found.nearest) == found.rank
    # Where the others hold, what is redundant holds as well, and a joint that conflicts does not.
    residuals = dict(zip(found.equations, map(abs, found.residuals), strict=True))
    drivers = {item.name for item in found.constraints if item.is_driver}
    assert all(residuals[name] < 1e-7 for name in found.redundant)
    assert all(residuals[name] > 1e-9 for name in found.conflicting if name not in drivers)


@pytest.mark.every(5)
@pytest.mark.parametrize("seed", [0, 2, 3, 4, 5, 8, 14, 15, 16, 21, 28, 31, 38])
def test_that_drivers_asked_for_and_surpluses_taken_away_make_a_mechanism(seed):
    """After both there are as many equations as coordinates, all of them independent."""
    model = random_linkage(seed)
    found = kc.inspect(model)
    assert found.is_assembled
    at = dict(zip((item.name for item in found.coordinates), found.nearest, strict=True))
    system = model.system()
    kept = [
        kc.Equation(
            item.constraint, *(system.Phi[system.equations.index(name)] for name in item.others)
        )
        for item in found.surpluses
        if item.others
    ]
    taken = {item.constraint for item in found.surpluses}
    model.constraints[:] = [item for item in model.constraints if item.name not in taken] + kept
    for k, item in enumerate(found.missing_drivers):
        letter = {"AbsoluteX": "x", "AbsoluteY": "y", "AbsoluteAngle": "phi"}[item.kind]
        motion = at[f"{letter}_{item.drives}"] + kc.t / 7
        place = () if letter == "phi" else ((0, 0),)
        model.add(getattr(kc, item.kind)(f"driver{k}", item.drives, *place, motion))
    after = kc.inspect(model)
    assert after.surpluses == after.missing_drivers == ()
    assert after.rank == len(after.equations) == len(after.coordinates)
