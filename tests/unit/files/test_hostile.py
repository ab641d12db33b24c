"""Hostile files: each is refused with a message, in bounded time and memory, whatever it holds."""

import os
import runpy
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from tests.pendulum import pendulum

READ = """
import os, resource, runpy, sys
from pathlib import Path
import kincompile as kc

hostile = runpy.run_path(sys.argv[1])
pend = kc.Mechanism("pendulum")
bob = pend.body("bob", guess=(1, 0, 0))
pend.add(kc.Revolute("pin", bob, (-1, 0), pend.ground, (0, 0)))
pend.add(kc.AbsoluteAngle("motor", bob, kc.t**2))
pend.system()


def read(path):
    if "HAND_FILES" in path.name:
        kc.compare_file(pend, path)
    else:
        (kc.read_analysis if path.suffix == ".acf" else kc.read)(path)


for kind in ("MODELS", "HAND_FILES"):
    for number, (ending, content, message) in enumerate(hostile[kind].values()):
        path = Path(f"{kind}_{number}.{ending}")
        path.write_text(content(), encoding="utf-8")
        # A process for each, so that none has the memory of another.
        child = os.fork()
        if not child:
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
            try:
                read(path)
                told = "it was read"
            except BaseException as error:
                is_ours = isinstance(error, kc.KincompileError)
                told = str(error) if is_ours else type(error).__name__ + " came through"
            Path(f"{kind}_{number}.told").write_text(told, encoding="utf-8")
            os._exit(0)
        os.waitpid(child, 0)
        path.unlink()
"""
SECONDS, BYTES = 15, 1_500_000_000
HOSTILE = Path(__file__).with_name("hostile.py")
CASES: dict[str, Any] = runpy.run_path(str(HOSTILE))


@cache
def told(folder: Path) -> Path:
    """Read the hostile files, each in a process of bounded time and memory."""
    folder = folder / "hostile"
    folder.mkdir()
    script = READ.replace("SECONDS", str(SECONDS)).replace("BYTES", str(BYTES))
    command = [sys.executable, "-c", script, str(HOSTILE)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=570)
    return folder


def cases() -> list[Any]:
    """Return kind and number of each case."""
    return [
        pytest.param(kind, number, id=f"{kind}: {name}")
        for kind in ("MODELS", "HAND_FILES")
        for number, name in enumerate(CASES[kind])
    ]


@pytest.mark.parametrize(("kind", "number"), cases())
@pytest.mark.slow
def test_that_a_hostile_file_is_refused_in_bounded_time_and_memory(
    tmp_path_factory: pytest.TempPathFactory, kind: str, number: int
) -> None:
    message = list(CASES[kind].values())[number][2]
    answer = told(tmp_path_factory.getbasetemp()) / f"{kind}_{number}.told"
    assert answer.exists(), f"more than {SECONDS} s"
    found = answer.read_text(encoding="utf-8")
    assert any(part in found for part in message.split("|")), found[:2000]
    assert len(found) < 50_000


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
@pytest.mark.parametrize("name", ["m.toml", "m.json", "m.adm", "m.acf", "m.py", "hand.txt"])
@pytest.mark.parametrize("kind", ["pipe", "link to a device"])
def test_that_only_regular_files_are_read(tmp_path: Path, name: str, kind: str) -> None:
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(kc.InputError, match=r"it is a (pipe or a device|link)"):
        read(path)


def read(path: Path) -> object:
    """Read a file of any kind."""
    if path.suffix == ".txt":
        return kc.compare_file(pendulum(), path)
    return kc.read_analysis(path) if path.suffix == ".acf" else kc.read_model(path)


def test_that_a_hand_file_is_no_link_and_a_model_may_be_one(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("password = x\nline of a secret", encoding="utf-8")
    (tmp_path / "hand.txt").symlink_to(tmp_path / "secret")
    with pytest.raises(kc.InputError, match=r"it is a link; give the file itself") as caught:
        kc.compare_file(pendulum(), tmp_path / "hand.txt")
    assert "password" not in str(caught.value)
    (tmp_path / "a.toml").write_text(pendulum().to_toml(), encoding="utf-8")
    (tmp_path / "b.toml").symlink_to(tmp_path / "a.toml")
    assert kc.read(tmp_path / "b.toml").name == "pendulum"
