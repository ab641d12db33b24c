"""Hostile files: each is refused with a message, in bounded time and memory, whatever it holds."""

import os
import runpy
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from tests.bounded import read_bounded
from tests.pendulum import pendulum

SECONDS = 15
HOSTILE = Path(__file__).with_name("hostile.py")
CASES: dict[str, Any] = runpy.run_path(str(HOSTILE))


@cache
def told(folder: Path) -> dict[str, tuple[str, str, float]]:
    """Read the hostile files, each in a process of bounded time and memory."""
    folder = folder / "hostile"
    folder.mkdir()
    for kind in ("MODELS", "HAND_FILES"):
        for number, (ending, content, _) in enumerate(CASES[kind].values()):
            (folder / f"{kind}_{number}.{ending}").write_text(content(), encoding="utf-8")
    return read_bounded(folder, SECONDS)


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
    ending, _, message = list(CASES[kind].values())[number]
    verdict, found, _ = told(tmp_path_factory.getbasetemp())[f"{kind}_{number}.{ending}"]
    assert verdict in ("read", "refused"), verdict
    assert any(part in found for part in message.split("|")), found[:2000]


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
