"""`kincompile equilibrium`: where loads let a model rest."""

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli

MODEL = """
import kincompile as kc

lamp = kc.Mechanism("lamp")
lamp.gravity = (0, -9.81)
k = lamp.parameter("k", 60.0)
arm = lamp.body("arm", (0, 0, 0.2), mass=2, inertia=0.2, centre=(0.5, 0))
lamp.add(kc.Revolute("O", lamp.ground, (0, 0), arm, (0, 0)))
lamp.add(kc.Spring("spring", lamp.ground, (0, 1.2), arm, (1, 0), k, 0.4))
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "lamp.py"
    path.write_text(MODEL)
    return path


def run(*arguments):
    return CliRunner().invoke(cli, [str(item) for item in arguments])


@pytest.mark.slow
def test_that_it_lists_the_position_and_whether_it_is_stable(model):
    done = run("equilibrium", model)
    assert done.exit_code == 0, done.stderr
    heading, _, _, kind, *rows = done.stdout.splitlines()
    assert heading == "lamp: 1 equilibrium at t = 0"
    assert kind.split() == ["stable"]
    assert rows[2].split() == ["phi_arm", "rad", "1.18716"]
    done = run("equilibrium", model, "--all", "--set", "k=30")
    found = kc.equilibria(kc.compile(kc.read_model(model)), p={"k": 30.0})
    assert done.stdout.startswith(f"lamp: {len(found)} equilibria at t = 0")
    assert [item.stability[0] for item in found] == done.stdout.splitlines()[3].split()


def test_that_a_file_has_the_reactions(model, tmp_path):
    done = run("equilibrium", model, "-o", tmp_path / "rest.csv")
    assert done.exit_code == 0
    head, row = (tmp_path / "rest.csv").read_text().splitlines()
    numbers = dict(zip(head.split(","), row.split(","), strict=True))
    assert float(numbers["F_y_O [N]"]) == pytest.approx(17.390749728785)
    done = run("equilibrium", model, "--all", "-o", tmp_path / "rest.csv")
    assert (done.exit_code, "leave one of them out" in done.stderr) == (2, True)


def test_that_nothing_to_rest_on_is_an_error(tmp_path):
    path = tmp_path / "falls.py"
    path.write_text(MODEL + "lamp.body('stone', (3, 0, 0), mass=1, inertia=1)\n")
    done = run("equilibrium", path)
    assert (done.exit_code, "the loads on stone are not balanced" in done.stderr) == (3, True)
    path.write_text(MODEL + "lamp.body('loose', (3, 0, 0))\n")
    done = run("equilibrium", path)
    assert (done.exit_code, "nothing acts on loose" in done.stderr) == (2, True)
    assert not done.stdout
