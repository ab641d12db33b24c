"""R0: rows by an exclusive prefix scan, columns by body, and what is missing for an analysis."""

import numpy as np
import pytest

import kincompile as kc


def lecture_example() -> kc.Mechanism:
    """Return the four constraints on three bodies of the source lecture's offset example."""
    m = kc.Mechanism("offsets")
    body_1, body_2, body_3 = (m.body(f"body_{k}", guess=(k, 0.5 * k, 0.1 * k)) for k in (1, 2, 3))
    m.add(kc.Revolute("revolute", body_2, (0.4, 0.1), body_1, (0.3, -0.2)))
    m.add(kc.Distance("distance", body_1, (0.2, 0.6), m.ground, (0.7, 0.5), 1.5))
    m.add(kc.Translational("slide", body_3, (0.1, 0.2), (1, 2), body_2, (0.3, 0.4), (2, 1)))
    m.add(kc.AbsoluteAngle("orientation", body_3, 0.3))
    return m


def test_that_row_offsets_are_the_prefix_scan_of_the_equation_counts():
    system = lecture_example().system()
    # The well-known slide prints 5 for the last.
    assert [offset + 1 for offset in system.row_offsets] == [1, 3, 4, 6]
    assert [len(item.equation_names) for item in system.constraints] == [2, 1, 2, 1]


def test_that_the_quantities_have_six_rows_and_nine_columns():
    m = lecture_example()
    assert m.Phi.shape == m.nu.shape == m.gamma.shape == (6, 1)
    assert m.Phi_q.shape == (6, 9)


def test_that_each_constraint_fills_its_own_block():
    blocks = np.zeros((6, 9), dtype=bool)
    for rows, columns in [
        ((1, 2), (4, 6)), ((1, 2), (1, 3)),  # revolute: body 2, body 1
        ((3, 3), (1, 3)),  # distance: body 1
        ((4, 5), (7, 9)), ((4, 5), (4, 6)),  # translational: body 3, body 2
        ((6, 6), (7, 9)),  # orientation: body 3
    ]:  # fmt: skip
        blocks[rows[0] - 1 : rows[1], columns[0] - 1 : columns[1]] = True
    Phi_q = lecture_example().Phi_q
    filled = np.array([[Phi_q[row, column] != 0 for column in range(9)] for row in range(6)])
    assert not np.any(filled & ~blocks)
    for block in [
        filled[:2, 3:6], filled[:2, :3], filled[2:3, :3], filled[3:5, 6:], filled[3:5, 3:6],
        filled[5:, 6:],
    ]:  # fmt: skip
        assert block.any()


def test_that_the_compiler_asks_for_three_more_equations():
    with pytest.raises(kc.StructuralError, match=r"6 equations for 9 coordinates.*: 3 more"):
        kc.solve(kc.compile(lecture_example()), 0)


def test_that_three_drivers_make_it_complete():
    m = lecture_example()
    m.add(kc.AbsoluteAngle("turn_1", m.bodies[0], 0.2 + kc.t))
    m.add(kc.AbsoluteX("move_3", m.bodies[2], (0, 0), 3 + kc.t))
    m.add(kc.AbsoluteY("lift_3", m.bodies[2], (0, 0), 1.5))
    module = kc.compile(m)
    assert module.N_EQUATIONS == module.N_COORDINATES == 9
    assert module.EQUATIONS[:6] == (
        "revolute.x", "revolute.y", "distance", "slide.normal", "slide.parallel", "orientation",
    )  # fmt: skip
