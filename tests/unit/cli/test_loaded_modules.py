"""A command loads what it uses: start-up is a large part of a short command."""

import subprocess
import sys

import pytest

import kincompile as kc
from kincompile.cli import COMMANDS

PROGRAM = """
import sys
import kincompile.cli
kincompile.cli.cli(sys.argv[1:], standalone_mode=False)
print("\\nLOADED", *sys.modules)
"""

PAGES = "kincompile.view kincompile.derivations kincompile.checker kincompile.verification"
LARGE = "kincompile.ir.grouping kincompile.emitters.numpy.grouped"
EXTRA = "rich platformdirs matplotlib scipy kincompile.runtime.native"
OTHERS = (
    "kincompile.emitters.c kincompile.emitters.octave kincompile.emitters.javascript "
    "kincompile.emitters.rust"
)
LANGUAGES = f"{OTHERS} kincompile.solver"  # a NumPy file ends with the march of the solver's text
EMITTING = "kincompile.compiler kincompile.ir kincompile.emitters jinja2"
RANK = "kincompile.ir.redundancy kincompile.structure.rank kincompile.structure.report"

TASKS = """
[tolerance]
parameters = { length = 0.01 }

[fit]
parameters = { length = [0.5, 2] }
samples = 4
starts = 1
targets = [{ value = "phi_bob", values = [0.1], times = [0.1], within = 9 }]
"""
SPACE = (
    "kincompile.space kincompile.spatial kincompile.view.solids kincompile.view.solid_joints "
    "kincompile.view.solid_shapes kincompile.view.solid_picture kincompile.view.gltf"
)

NOT_LOADED = {
    "assemblies MODEL": (
        f"{EXTRA} {LARGE} {LANGUAGES} kincompile.derivations kincompile.checker "
        "kincompile.verification"
    ),
    "compile MODEL -o -": f"{PAGES} {LARGE} {EXTRA} {OTHERS} {RANK} kincompile.runtime scipy",
    "compile MODEL -o - --target javascript": (
        f"{PAGES} {LARGE} {EXTRA} {RANK} kincompile.runtime kincompile.emitters.numpy "
        "kincompile.emitters.c kincompile.emitters.octave"
    ),
    "run MODEL": f"{PAGES} {LARGE} {EXTRA} {LANGUAGES} {RANK} scipy.sparse.csgraph",
    "simulate HEAVY": (
        "kincompile.derivations kincompile.checker kincompile.verification kincompile.view rich "
        f"platformdirs matplotlib sksundae {LANGUAGES}"
    ),
    "inspect MODEL": f"{PAGES} {EXTRA} {LANGUAGES} kincompile.emitters.numpy kincompile.runtime",
    "derive MODEL -o PAGE.html": (
        f"{EXTRA} {LARGE} kincompile.view.page kincompile.view.mechanism_plot kincompile.checker "
        "kincompile.verification"
    ),
    "draw MODEL -o DRAWING.svg": (
        f"{EXTRA} {LARGE} {LANGUAGES} kincompile.derivations kincompile.checker "
        f"kincompile.verification kincompile.view.page ezdxf watchfiles {SPACE}"
    ),
    "transmission MODEL --inputs motor --outputs bob.phi": (
        f"{PAGES} {LARGE} {LANGUAGES} rich platformdirs matplotlib"
    ),
    "view MODEL -o PAGE.html": (
        f"{EXTRA} {LARGE} {SPACE} kincompile.derivations kincompile.checker"
    ),
    "compare MODEL HAND": "rich platformdirs matplotlib kincompile.view kincompile.derivations",
    "editor MODEL -o PAGE.html": (
        f"{EXTRA} {LARGE} {RANK} {SPACE} kincompile.derivations kincompile.checker "
        "kincompile.verification"
    ),
    "equilibrium HEAVY": f"{PAGES} {LARGE} {EXTRA} {LANGUAGES} scipy.interpolate",
    "exercise MODEL -o FOLDER": f"{EXTRA} {LARGE} kincompile.view.page kincompile.verification",
    "mark KIT": "rich platformdirs matplotlib kincompile.view.page kincompile.verification",
    "sweep MODEL --sweep length=1:2:2 --target numpy --processes 1": (
        f"{LARGE} {LANGUAGES} {RANK} rich platformdirs matplotlib zarr pyarrow xarray scipy.stats "
        "kincompile.view.page kincompile.checker kincompile.verification"
    ),
    "tolerance TASK": (
        f"{LARGE} {RANK} rich platformdirs matplotlib kincompile.emitters.c "
        "kincompile.verification kincompile.checker"
    ),
    "fit TASK": (
        f"{LARGE} {RANK} rich platformdirs matplotlib kincompile.emitters.c "
        "kincompile.verification kincompile.checker"
    ),
    "convert MODEL -o TASK": f"{PAGES} {EXTRA} {EMITTING} kincompile.runtime",
    "schema": f"{PAGES} {EXTRA} {EMITTING} kincompile.runtime",
}


def loaded_by(arguments: list[str]) -> set[str]:
    """Return the modules that a process has loaded after a command."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.rpartition("\nLOADED")[2].split())


def test_that_every_command_is_here():
    assert {line.split()[0] for line in NOT_LOADED} == set(COMMANDS)


@pytest.mark.parametrize("line", NOT_LOADED)
@pytest.mark.slow
def test_that_a_command_loads_what_it_uses(line, pendulum, tmp_path):
    hand = tmp_path / "hand.txt"
    hand.write_text("nu = [0, 0, 2]\n", encoding="utf-8")
    places = {"MODEL": pendulum, "HAND": hand, "PAGE.html": tmp_path / "page.html"}
    places["HEAVY"] = tmp_path / "heavy.py"
    text = pendulum.read_text(encoding="utf-8").replace("0.5)", "0.5), mass=1, inertia=1")
    places["HEAVY"].write_text(text, encoding="utf-8")
    places |= {"DRAWING.svg": tmp_path / "drawing.svg"}
    places |= {"FOLDER": tmp_path / "new", "KIT": tmp_path / "kit"}
    task = tmp_path / "task.toml"
    task.write_text(kc.read_model(pendulum).to_toml() + TASKS, encoding="utf-8")
    places |= {"TASK": task}
    if "KIT" in line:
        kc.exercise(kc.read_model(pendulum)).write(places["KIT"])
    loaded = loaded_by([str(places.get(word, word)) for word in line.split()])
    assert "click" in loaded
    assert sorted(loaded & set(NOT_LOADED[line].split())) == []


def test_that_help_does_not_load_sympy():
    program = "import kincompile.cli as c, click; click.Context(c.cli); print(c.cli.get_help"
    program += "(click.Context(c.cli))); import sys; sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
