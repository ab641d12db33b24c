"""Modules of `templates/view` in node, one by one, as they are written."""

import json
import shutil
import subprocess
from typing import Any

import pytest

from kincompile.report.templates import template_root

NODE = shutil.which("node") or shutil.which("nodejs")
WORLDS = {2: "plane", 3: "space"}


def in_node(program: str, given: Any = None, dimension: int = 2) -> Any:
    """Return what a program with imports from './name.js' gives `tell`; it has `given`."""
    if NODE is None:
        pytest.skip("node is not installed (Debian: nodejs)")
    text = "const tell = value => console.log(JSON.stringify(value));\n"
    done = subprocess.run(
        [NODE, "--input-type=module", f"--conditions={WORLDS[dimension]}", "-"],
        input=f"{text}const given = {json.dumps(given)};\n{program}",
        cwd=str(template_root() / "view"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)
