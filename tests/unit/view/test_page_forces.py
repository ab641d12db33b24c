"""Forces on a page: computed in the browser by the code that `kc.forces` compiles."""

import json
import shutil
import subprocess

import numpy as np
import pytest

import kincompile as kc
from kincompile.view.page_scripts import forces_script
from tests.unit.dynamics.test_inverse import four_bar, slider_crank, two_guides

NODE = shutil.which("node") or shutil.which("nodejs") or "node"


def in_node(script, *arguments):
    """Return what the forces of a page are at a state."""
    call = ", ".join(json.dumps(item) for item in arguments)
    text = f"{script}console.log(JSON.stringify([forces.OUTPUTS, forces.outputs({call})]));"
    done = subprocess.run([NODE, "-e", text], capture_output=True, text=True, check=True)
    names, values = json.loads(done.stdout)
    return dict(zip(names, values, strict=True))


@pytest.mark.parametrize("model", [slider_crank, four_bar])
def test_that_the_page_computes_what_the_runtime_does(model):
    m = model()
    solution = kc.solve(kc.compile(m), [0.0, 0.15])
    found = kc.forces(solution)
    state = (part[1].tolist() for part in (solution.q, solution.q_dot, solution.q_ddot))
    shown = in_node(forces_script(m), *state, 0.15, list(solution.parameters.values()))
    for name in found.names:
        assert shown[name] == pytest.approx(found.motion.observed.column(name, 0).values[1])
    np.testing.assert_allclose(
        [shown[f"lambda_{name.replace('.', '_')}"] for name in solution.equations],
        found.multipliers[1],
        rtol=1e-9,
        atol=1e-9,
    )


def test_that_there_are_no_forces_where_none_are_known():
    m = kc.Mechanism("bare")
    bar = m.body("bar")
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t))
    assert forces_script(m) == "const forces = null;\n"
    assert forces_script(two_guides()) == "const forces = null;\n"
    free = four_bar()
    free.constraints.pop()
    assert forces_script(free) == "const forces = null;\n"


def test_that_the_page_has_the_script_and_the_button():
    page = kc.page(slider_crank(), t=np.linspace(0, 0.5, 11))
    assert "const forces = (() => {" in page.html
    assert 'id="forces"' in page.html
    assert "const reactions = {" in page.html
