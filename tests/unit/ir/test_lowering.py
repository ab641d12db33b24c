"""Kernels x instances: one kernel a type, rows by prefix scan, columns by body."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.kernels import constraint_kernel
from kincompile.ir.lower import lower
from kincompile.ir.program import Attribute, FrameEntry, Function, StateEntry
from kincompile.model.cams import PointFollower
from kincompile.model.joints import Revolute


@pytest.fixture
def chain() -> kc.Mechanism:
    m = kc.Mechanism("chain")
    L = m.parameter("L", 0.5)  # noqa: N806 - a length
    one, two = m.body("one"), m.body("two")
    m.add(kc.Revolute("A", m.ground, (0, 0), one, (-L, 0)))
    m.add(kc.AbsoluteAngle("motor", one, 2 * kc.t))
    m.add(kc.Revolute("B", one, (L, 0.1), two, (0, 0)))
    m.add(kc.Equation("free", two.x * sympy.sin(two.phi) - L))
    return m


def test_that_constraints_of_one_type_share_a_kernel(chain: kc.Mechanism) -> None:
    first, _, second, _ = lower(chain.system()).instances
    assert first.kernel is second.kernel
    assert first.kernel is constraint_kernel(Revolute.template())


def test_that_rows_follow_the_order_of_the_constraints(chain: kc.Mechanism) -> None:
    program = lower(chain.system())
    assert [item.first_row for item in program.instances] == [0, 2, 3, 5]
    assert program.equations == ("A.x", "A.y", "motor", "B.x", "B.y", "free")


def test_that_columns_follow_the_bodies_and_the_ground_has_none(chain: kc.Mechanism) -> None:
    columns = [item.columns for item in lower(chain.system()).instances]
    assert columns == [(None, None, None, 0, 1, 2), (0, 1, 2), (0, 1, 2, 3, 4, 5), (3, 5)]


def test_that_contact_parameters_are_columns_behind_the_bodies() -> None:
    m = kc.Mechanism("cams")
    cam, follower = m.body("cam"), m.body("follower")
    rho = 1 + 0.2 * sympy.cos(kc.alpha)
    m.add(kc.CamFollower("pair", cam, (0, 0), rho, follower, (0, 0), rho))
    m.add(kc.CamFlatFollower("flat", cam, (0, 0), rho, follower, (0, 0), (1, 0)))
    pair, flat = lower(m.system()).instances
    assert pair.columns == (0, 1, 2, 3, 4, 5, 6, 7)
    assert flat.columns == (0, 1, 2, 3, 4, 5, 8)
    assert [item.name for item in m.system().coordinates[6:]] == [
        "alpha_i_pair", "alpha_j_pair", "alpha_flat",
    ]  # fmt: skip


def test_that_body_frames_are_computed_once(chain: kc.Mechanism) -> None:
    code = inline(lower(chain.system()))
    called = [(node[1], code.nodes[node[2]]) for node in code.nodes if node[0] == "call"]
    assert len(called) == len(set(called))


def test_that_an_attribute_of_zero_costs_nothing() -> None:
    def size(point: tuple[float, float]) -> int:
        m = kc.Mechanism("size")
        m.add(kc.Revolute("A", m.ground, (0, 0), m.body("b"), point))
        return len(inline(lower(m.system())).nodes)

    assert size((0, 0)) < size((0.3, 0)) < size((0.3, 0.2))


def test_that_the_pattern_has_what_is_not_identically_zero(chain: kc.Mechanism) -> None:
    pattern = inline(lower(chain.system())).pattern()
    assert pattern == (
        (0, 0), (0, 2), (1, 1), (1, 2), (2, 2), (3, 0), (3, 2), (3, 3), (4, 1), (4, 2), (4, 4),
        (5, 3), (5, 5),
    )  # fmt: skip
    assert pattern == tuple(
        (row, column) for row in range(6) for column in range(6) if chain.Phi_q[row, column] != 0
    )


def test_that_the_fingerprint_follows_the_content(chain: kc.Mechanism) -> None:
    first = lower(chain.system()).fingerprint
    assert lower(chain.system()).fingerprint == first
    chain.parameter("unused", 1.0)
    assert lower(chain.system()).fingerprint != first


def test_that_the_interpreter_takes_batches_and_parameters(chain: kc.Mechanism) -> None:
    program = lower(chain.system())
    rng = np.random.default_rng(7)
    q, q_dot = rng.normal(size=(2, 3, 6))
    batch = interpret(program, q, q_dot, 0.3, np.array([0.8]))
    for k in range(3):
        single = interpret(program, q[k], q_dot[k], 0.3, np.array([0.8]))
        for found, expected in zip(batch, single, strict=True):
            np.testing.assert_array_equal(found[k], expected)
    assert not np.allclose(batch[0], interpret(program, q, q_dot, 0.3)[0])


def test_that_inputs_say_what_they_are_and_not_only_how_they_are_called() -> None:
    kernel = constraint_kernel(PointFollower.template())
    found = {item.name: item for item in kernel.inputs if not isinstance(item, str)}
    assert found["phi_j_dot"] == StateEntry(1, 2, 1, "phi_j_dot")
    assert found["cos_i"] == FrameEntry(0, 0, "cos_i")
    assert found["s_i_x"] == Attribute("s_i", 0, "s_i_x")
    assert found["rho_j_prime"] == Function("rho_j", 1, owner=2, body=1)
    assert found["alpha_j"] == StateEntry(2, 0, 0, "alpha_j")


def test_that_a_frame_is_a_kernel_bound_to_each_body(chain: kc.Mechanism) -> None:
    program = lower(chain.system())
    assert [(body.name, body.columns) for body in program.bodies] == [
        ("one", range(3)), ("two", range(3, 6)),
    ]  # fmt: skip
    for body in program.bodies:
        calls = [program.values[node] for node in body.entries]
        angle = program.values.index(("input", f"phi_{body.name}"))
        assert calls == [("call", "cos", angle), ("call", "sin", angle)]
        assert body.labels == (f"c_{body.name}", f"s_{body.name}")
