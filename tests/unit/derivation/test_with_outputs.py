"""Points and outputs leave the derivation of the constraints as it is."""

import re

import kincompile as kc


def derived(with_outputs: bool) -> str:
    m = kc.Mechanism("crank")
    crank = m.body("crank", guess=(1, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    if with_outputs:
        m.point("P", crank, (1, 0))
        m.output("square", crank.phi**2, "rad^2")
    return re.sub(r"[Ll]ine \d+", "line", kc.derivation(m).to_markdown())


def test_that_a_point_changes_nothing_but_the_numbers_of_lines():
    assert derived(with_outputs=True) == derived(with_outputs=False)
