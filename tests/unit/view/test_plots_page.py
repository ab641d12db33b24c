"""docs/plots.md: its programs run from top to bottom, and its picture is that of the last one."""

import re
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from PIL import Image

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.mark.slow
def test_that_the_programs_run_and_draw_the_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "plots.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for program in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(compile(program, "plots.md", "exec"), names)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "arm.glb", "arm.svg", "motion.png", "plots.png", "pose.svg", "slider_crank.gif",
        "slider_crank.svg",
    ]  # fmt: skip
    kept = DOCS / "images" / "plots.png"
    assert kept.stat().st_size < 60_000
    with Image.open(tmp_path / "plots.png") as drawn, Image.open(kept) as shown:
        assert drawn.size == shown.size
