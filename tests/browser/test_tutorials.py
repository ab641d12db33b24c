"""The tutorials as notebooks: they follow from the pages, run, and print what the pages say."""

import doctest
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from docs.builders import notebooks

EXECUTE = """
import sys
import nbclient, nbformat
book = nbformat.read(sys.argv[1], 4)
nbclient.NotebookClient(book, timeout=120, kernel_name="python3").execute()
nbformat.write(book, sys.argv[2])
"""
FOLDERS = (
    "HOME", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "IPYTHONDIR",
    "MPLCONFIGDIR",
)  # fmt: skip


def test_that_the_notebooks_are_those_of_the_tutorials() -> None:
    for name, text in notebooks.notebooks().items():
        kept = (notebooks.FOLDER / name).read_text(encoding="utf-8")
        assert kept == text, "make pictures writes it anew"


def printed(cell: dict[str, Any]) -> str:
    """Return what a cell wrote to its streams."""
    text = "".join("".join(item["text"]) for item in cell["outputs"] if "text" in item)
    return re.sub(r"\x1b\[[\d;]*m", "", text).replace("\r\n", "\n")


@pytest.mark.slow
@pytest.mark.parametrize("name", notebooks.TUTORIALS)
def test_that_a_tutorial_prints_what_it_says(name: str, tmp_path: Path) -> None:
    for package in ("nbclient", "ipykernel"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    done = tmp_path / "done.ipynb"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [sys.executable, "-c", EXECUTE, str(notebooks.FOLDER / f"{name}.ipynb"), str(done)],
        env={**os.environ, **dict.fromkeys(FOLDERS, str(tmp_path)), "PATH": path, "COLUMNS": "200"},
        cwd=tmp_path, check=True, timeout=200,
    )  # fmt: skip
    book = json.loads(done.read_text(encoding="utf-8"))
    checker, wrong = doctest.OutputChecker(), []
    expected = notebooks.cells(name)
    assert len(expected) == len(book["cells"])
    for cell, run in zip(expected, book["cells"], strict=True):
        if cell.output is not None and not checker.check_output(
            cell.output, printed(run), doctest.ELLIPSIS
        ):
            wrong.append(f"{cell.source}\nwritten:\n{cell.output}\nprinted:\n{printed(run)}")
    assert wrong == []
    assert sum(cell.output is not None for cell in expected) >= 5
