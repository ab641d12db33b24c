"""The sdist, the wheel and what pyproject.toml says about them."""

import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOT_SOURCE = shutil.ignore_patterns(
    ".*_cache", ".git", ".hypothesis", ".venv", "*.egg-info", "__pycache__", "build", "demo",
    "dist", "made", "site",
)  # fmt: skip

USER_SCRIPT = '''\
"""What a user does, in a folder of the user's own."""

import sys

import numpy as np

import kincompile as kc

assert kc.__file__.startswith(sys.prefix), f"not the installed package: {kc.__file__}"

mechanism = kc.Mechanism("pendulum")
L = mechanism.parameter("L", 0.5, unit="m")
bar = mechanism.body("bar", guess=(0.2, 0.1, 0.7))
mechanism.add(kc.Revolute("pivot", mechanism.ground, (0, 0), bar, (-L / 2, 0)))
mechanism.add(kc.AbsoluteAngle("motor", bar, kc.pi / 4 + 2 * kc.t))

t = np.linspace(0.0, 1.0, 5)
solution = kc.solve(kc.compile(mechanism), t)
assert solution.success, solution.message
angle = np.pi / 4 + 2 * t
expected = np.stack([0.25 * np.cos(angle), 0.25 * np.sin(angle), angle], axis=-1)
np.testing.assert_allclose(solution.q, expected, atol=1e-12)
'''

USE_OF_THE_EMITTED_MODULE = """\
import sys
import pendulum_kinematics as pendulum

assert pendulum.Phi_q(pendulum.GUESS, 0.0).shape == (3, 3)
assert "kincompile" not in sys.modules
"""


def setuptools_table() -> dict[str, Any]:
    """Return the table of pyproject.toml that tells setuptools what to ship."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        table: dict[str, Any] = tomllib.load(file)["tool"]["setuptools"]
    return table


def template_files() -> set[str]:
    """Return every file below templates/, relative to it."""
    folder = ROOT / "templates"
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def run(*command: str | Path, cwd: Path) -> None:
    """Run a command free of the Python environment around it; a failure shows its output."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in {"PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV"}
    }
    done = subprocess.run(
        command,
        cwd=cwd,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}"


def test_the_package_list_names_every_folder() -> None:
    folders = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in (ROOT / "kincompile").rglob("__init__.py")
    }
    table = setuptools_table()
    assert sorted(table["packages"]) == sorted({*folders, "kincompile._templates"})
    assert table["package-dir"] == {"kincompile._templates": "templates"}


def test_every_folder_with_a_module_is_a_package() -> None:
    folders = {path.parent for path in (ROOT / "kincompile").rglob("*.py")}
    assert [str(folder) for folder in folders if not (folder / "__init__.py").is_file()] == []


def test_every_template_is_package_data() -> None:
    patterns = setuptools_table()["package-data"]["kincompile._templates"]
    # The patterns are of one form, "any folder, this ending".
    endings = {pattern.removeprefix("**/*") for pattern in patterns}
    left_out = {name for name in template_files() if not name.endswith(tuple(endings))}
    assert template_files()
    assert left_out == set()


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the sdist from a copy of the checkout, and the wheel from the sdist: a release."""
    folder = tmp_path_factory.mktemp("release")
    shutil.copytree(ROOT, folder / "checkout", ignore=NOT_SOURCE)
    run(sys.executable, "-m", "build", "--outdir", folder, folder / "checkout", cwd=folder)
    return folder


@pytest.mark.slow
def test_the_sdist_holds_what_the_tests_need(distributions: Path) -> None:
    (sdist,) = distributions.glob("kincompile-*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {
            PurePosixPath(*PurePosixPath(member.name).parts[1:])
            for member in archive.getmembers()
            if member.isfile()
        }
    checkout = distributions / "checkout"
    wanted = {
        PurePosixPath(path.relative_to(checkout).as_posix())
        for folder in ("kincompile", "templates", "generated", "tests", "examples", "docs")
        for path in (checkout / folder).rglob("*")
        if path.is_file()
    }
    assert {name.parts[0] for name in wanted} >= {"templates", "generated", "tests", "examples"}
    assert wanted - names == set()


@pytest.mark.slow
def test_that_an_index_would_take_them(distributions: Path) -> None:
    pytest.importorskip("twine", reason="twine is not installed")
    files = [*distributions.glob("kincompile-*.whl"), *distributions.glob("kincompile-*.tar.gz")]
    assert len(files) == 2
    run(sys.executable, "-m", "twine", "check", "--strict", *files, cwd=distributions)


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_its_templates_alone(distributions: Path) -> None:
    (wheel,) = distributions.glob("kincompile-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "kincompile").rglob("*.py")}
    templates = {f"kincompile/_templates/{name}" for name in template_files()}
    data = {"kincompile/py.typed", "kincompile/__init__.pyi"}
    assert names == modules | templates | data


@pytest.mark.slow
def test_the_wheel_compiles_and_solves_outside_the_checkout(
    distributions: Path, tmp_path: Path
) -> None:
    (wheel,) = distributions.glob("kincompile-*.whl")
    environment = tmp_path / "environment"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    script = elsewhere / "pendulum.py"
    script.write_text(USER_SCRIPT, encoding="utf-8")
    run(sys.executable, "-m", "venv", environment, cwd=elsewhere)
    python = environment / "bin" / "python"
    constraints = ROOT / ".ci" / "constraints.txt"
    run(python, "-m", "pip", "install", "--quiet", "-c", constraints, wheel, cwd=elsewhere)
    run(python, script, cwd=elsewhere)

    # As the README says it: activate, then the command is there.
    activated = f". {environment}/bin/activate && kincompile --version"
    run("sh", "-c", activated, cwd=elsewhere)

    # The command, and what it wrote where kincompile is not needed any more.
    command = environment / "bin" / "kincompile"
    run(command, "compile", script, "-o", "pendulum_kinematics.py", cwd=elsewhere)
    run(python, "-c", USE_OF_THE_EMITTED_MODULE, cwd=elsewhere)
