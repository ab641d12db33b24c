"""docs/outputs.md: its programs run, and its table is what they print."""

import math
import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "outputs.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def run():
    """Run the programs of the page from top to bottom; return their names and what they print."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    printed = []
    names = {"print": lambda *given: printed.append(str(*given))}
    for program in re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S):
        exec(compile(program, "docs/outputs.md", "exec"), names)
    return names, "\n".join(printed)


@pytest.mark.slow
def test_that_the_table_is_what_is_printed(run):
    (text,) = re.findall(r"^```text\n(.*?)^```", PAGE, re.M | re.S)
    assert run[1].splitlines() == text.splitlines()


def test_that_the_time_ratio_is_that_of_the_closed_form(run):
    lag = 2 * math.asin(100 / 450)
    ratio = run[0]["solution"].measures()["feed"].time_ratio
    assert ratio == pytest.approx((math.pi + lag) / (math.pi - lag), rel=1e-9)
    assert f"{ratio:.6f}" in PAGE
