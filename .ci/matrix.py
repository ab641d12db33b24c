"""`make matrix`: what is released, in clean environments, with the oldest and newest it allows.

The sdist and the wheel are built, and twine looks at them. For every Python that is here the wheel
is installed twice: with the oldest versions that pyproject.toml allows and that have wheels, and
with the newest. In each the quick tests of the sdist run on the installed files. A Python that is
missing is named, and its versions are looked for; only what fails is a failure. MATRIX_TESTS gives
arguments of pytest, for a part of the tests.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

PYTHONS = ("3.11", "3.12", "3.13")
RESOLUTIONS = {"oldest": "lowest-direct", "newest": "highest"}
EXTRAS = ("test", "plot", "sweep", "dxf", "watch", "stiff", "jax", "robots")
ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "matrix"
UV = Path(sys.executable).with_name("uv")


def main() -> int:
    """Build, install and test; return how many steps failed, at most 1."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    run(sys.executable, "-m", "build", "--outdir", FOLDER, ROOT)
    (wheel,), (sdist,) = FOLDER.glob("*.whl"), FOLDER.glob("*.tar.gz")
    run(sys.executable, "-m", "twine", "check", "--strict", wheel, sdist)
    lines = []
    for version in PYTHONS:
        python = interpreter(version)
        for name, resolution in RESOLUTIONS.items():
            say(f"Python {version}, {name} dependencies")
            wanted = resolve(version, name, resolution)
            what = "missing" if python is None else "passed"
            if wanted is None:
                what = "FAILED: no such set of wheels"
            elif python is not None and not tested(python, wheel, sdist, wanted):
                what = "FAILED"
            lines.append(f"Python {version}, {name} dependencies: {what}")
    say("\n".join(lines))
    return int(any("FAILED" in line for line in lines))


def say(text: str) -> None:
    """Print a heading before what a process prints."""
    print(f"== {text}", flush=True)


def run(*command: str | Path, cwd: Path | None = None) -> None:
    """Run a command, without what would import another kincompile; a failure is an error."""
    around = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run(command, cwd=cwd, check=True, env=around)


def interpreter(version: str) -> str | None:
    """Return a Python of a version that is on the PATH, or that uv or pyenv has; fetch none."""
    asked = [str(UV), "python", "find", "--system", "--no-python-downloads", version]
    found = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    pyenv = Path(os.environ.get("PYENV_ROOT", "~/.pyenv")).expanduser()
    kept = sorted(map(str, pyenv.glob(f"versions/{version}.*/bin/python{version}")))
    # Being on the PATH is not enough: version managers put shims there for any version.
    return next((one for one in (f"python{version}", str(found), *kept) if runs(one)), None)


def runs(python: str) -> bool:
    """Say whether a name or path is a Python that starts."""
    if not python or shutil.which(python) is None:
        return False
    return subprocess.call([python, "-c", ""], stderr=subprocess.DEVNULL) == 0


def resolve(version: str, name: str, resolution: str) -> Path | None:
    """Write the versions that an environment gets; None where there is no such set of wheels."""
    wanted = FOLDER / f"{version}-{name}.txt"
    extras = [word for extra in EXTRAS for word in ("--extra", extra)]
    options = ["--quiet", "--no-header", "--no-annotate", "--only-binary", ":all:"]
    wheels = ["--python-version", version, "--resolution", resolution]
    found = subprocess.run(
        [UV, "pip", "compile", *options, *wheels, *extras, "pyproject.toml", "-o", str(wanted)],
        cwd=ROOT,
        check=False,
    )
    return wanted if found.returncode == 0 else None


def tested(python: str, wheel: Path, sdist: Path, wanted: Path) -> bool:
    """Say whether the tests of an sdist pass on the installed files of a wheel."""
    environment = wanted.with_suffix("")
    own = environment / "bin" / "python"
    run(UV, "venv", "--quiet", "--python", python, environment)
    install = (UV, "pip", "install", "--quiet", "--python", own)
    run(*install, "--only-binary", ":all:", "--requirements", wanted)
    run(*install, "--no-deps", wheel)
    with tarfile.open(sdist) as archive:
        archive.extractall(environment, filter="data")
    (tests,) = environment.glob("kincompile-*")
    # What the tests import, and the sources that they read, are the installed files.
    (installed,) = environment.glob("lib/python*/site-packages/kincompile")
    shutil.rmtree(tests / "kincompile")
    (tests / "kincompile").symlink_to(installed, target_is_directory=True)
    # Old packages use what newer ones beside them deprecate.
    options = ["--numprocesses=auto", "--dist=loadfile", "-W", "ignore::DeprecationWarning"]
    chosen = shlex.split(os.environ.get("MATRIX_TESTS", ""))
    try:
        run(own, "-m", "pytest", "-q", *options, *chosen, cwd=tests)
    except subprocess.CalledProcessError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
