"""The mirror: random mechanisms with masses and loads, beside a second implementation by hand.

Off the manifold but where p^T p = 1, at seeded states: constraints and their derivatives, masses,
forces, accelerations, multipliers, and the equations of sensitivities.
"""

from contextlib import suppress
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings

import kincompile as kc
from kincompile import spatial
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.loads import LOADS
from kincompile.runtime.load import from_source
from kincompile.space.loads import LOADS as LOADS_IN_SPACE
from tests.mirror import Mirror, exact, moved, slope
from tests.targets.test_random_mechanisms import SPATIAL, is_usable, mechanisms

P, TIME = np.array([0.9, 0.35]), 0.3
ILL = 1e6
"""Condition of the equations of motion from which on they are not compared."""


def states(module, columns):
    """Return seeded q and q_dot, with Euler parameters of length one."""
    random = np.random.default_rng(31)
    q, q_dot = random.normal(size=(2, columns))
    for _, first, count in module.BODIES:
        if count == 7:
            q[first + 3 : first + 7] /= np.linalg.norm(q[first + 3 : first + 7])
    return q, q_dot


def off(found, known, digits):
    """Compare with the size of the whole; return the number of entries and the largest error."""
    known = np.asarray(known).astype(float)
    size = 1 + np.max(np.abs(known), initial=0.0)
    error = np.max(np.abs(np.asarray(found) - known), initial=0.0) / size
    assert error < digits, (found, known)
    return known.size


def force_along(mirror, s, name, way, h):
    """Return Q at a state that is changed by h along a way."""
    return mirror.Q(moved(s, **{name: way * h}))


def compare(model):
    """Compare all that a mechanism is compiled to; return the number of entries."""
    module = from_source(kc.emit(model).source, "random")
    mirror, (q, q_dot) = Mirror(model, module), states(module, module.N_COORDINATES)
    s = SimpleNamespace(q=exact(q), q_dot=exact(q_dot), t=exact(TIME)[()], p=exact(P))
    Phi, Phi_q, nu, gamma = mirror.kinematics(s)
    M, Q = mirror.M(s), mirror.Q(s)
    entries = sum(
        off(found, known, digits)
        for found, known, digits in zip(
            module.kinematics(q, q_dot, TIME, P), (Phi, Phi_q, nu, gamma),
            (1e-13, 1e-13, 1e-13, 1e-12), strict=True,
        )
    )  # fmt: skip
    entries += off(module.M(q, TIME, P), M, 1e-13) + off(module.Q(q, q_dot, TIME, P), Q, 1e-12)
    way = np.random.default_rng(5).normal(size=q.size)
    for name in ("q", "q_dot"):
        known = slope(partial(force_along, mirror, s, name, exact(way)))
        found = getattr(module, f"Q_{name}")(q, q_dot, TIME, P) @ way
        entries += off(found, known, 1e-11)
    whole = np.block([[np.array(M, float), np.array(Phi_q, float).T],
                      [np.array(Phi_q, float), np.zeros((len(Phi), len(Phi)))]])  # fmt: skip
    if np.linalg.cond(whole) < ILL:
        with suppress(kc.StructuralError):  # equations that contradict each other where they hold
            moving = from_source(kc.emit(model, dynamics=True).source, "moving")
            found = moving.forward_dynamics(q, q_dot, TIME, P)
            for ours, theirs in zip(found, mirror.dynamics(s), strict=True):
                entries += off(ours, theirs, 1e-16 * ILL)
    return entries


def compare_sensitivities(model):
    """Compare the rows that give q_p, q_dot_p and q_ddot_p; return the number of entries."""
    module = from_source(kc.emit(model, sensitivities=["L"]).source, "random")
    mirror = Mirror(model, kc.compile(model))
    q, q_dot = states(module, module.N_COORDINATES)
    s = SimpleNamespace(q=exact(q), q_dot=exact(q_dot), t=exact(TIME)[()], p=exact(P))
    known = mirror.kinematics(s, lambda at: mirror.by_parameter(at, 0))
    found = module.kinematics(q, q_dot, TIME, P)
    digits = (1e-13, 1e-13, 1e-13, 1e-12)
    return sum(off(*item) for item in zip(found, known, digits, strict=True))


class FoundError(Exception):
    """A mechanism is found, and no more are drawn."""


def first_of(in_space, kind, load, number):
    """Return a seeded mechanism of several constraints, one of them of a type."""
    found: list[object] = []

    @seed(number)
    @settings(max_examples=40, suppress_health_check=list(HealthCheck), phases=[Phase.generate])
    @given(mechanisms(in_space=in_space, first=kind, load=load))
    def look(model):
        if len(model.constraints) > 1 and is_usable(model):
            found.append(model)
            raise FoundError

    with suppress(FoundError):
        look()
    assert found, kind
    return found[0]


PLANES = pytest.mark.parametrize("in_space", [False, True], ids=["plane", "space"])


def each(in_space):
    """Return a mechanism for each type of constraint, and each load several times."""
    types = SPATIAL if in_space else CONSTRAINTS
    loads = [*(LOADS_IN_SPACE if in_space else LOADS).values()]
    return [(kind, loads[k % len(loads)], k) for k, kind in enumerate(types.values())]


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@PLANES
def test_the_mirror_of_one_mechanism(in_space, record):
    kind, load = (spatial.RevoluteCylindrical, spatial.FollowerTorque) if in_space else (
        kc.RackAndPinion, kc.SliderFriction)  # fmt: skip
    record(tried=compare(first_of(in_space, kind, load, 7 if in_space else 3)), wrong=0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@PLANES
def test_the_mirror_of_every_type(in_space, record):
    record(tried=sum(compare(first_of(in_space, *item)) for item in each(in_space)), wrong=0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@PLANES
def test_the_mirror_of_sensitivities(in_space, record):
    # With loads no freedom is held that nothing sees: the mirror has no such rows.
    record(
        tried=sum(compare_sensitivities(first_of(in_space, *item)) for item in each(in_space)),
        wrong=0,
    )
