"""CONTRIBUTING.md: its joint works, and its files exist."""

import re
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^ *```python\n(.*?)^ *```", PAGE, re.MULTILINE | re.DOTALL)


def test_that_the_joint_of_the_page_works():
    names: dict[str, Any] = {"__name__": "elliptic_slot"}
    exec(textwrap.dedent(BLOCKS[0]), names)
    slot = names["EllipticSlot"]
    m = kc.Mechanism("slot", end=2.0, points=11)
    pin = m.body("pin", guess=(0, 1, 0))
    m.add(slot("slot", m.ground, (0, 0), pin, (0, 0), (1, 0), 2.0, 1.0))
    m.add(kc.AbsoluteAngle("upright", pin, 0))
    m.add(kc.AbsoluteX("motor", pin, (0, 0), kc.t / 2))
    solution = kc.solve(kc.compile(m), np.linspace(0, 2, 11))
    x, y = solution["x_pin"], solution["y_pin"]
    np.testing.assert_allclose(y, np.sqrt(1 - (x / 2) ** 2), rtol=1e-12)
    assert kc.verify(m).passed
    assert "along\n    Semi-axis along axis_i [length]" in str(slot.__doc__)


def test_that_the_test_of_the_page_passes_and_can_fail():
    names: dict[str, Any] = {}
    exec(BLOCKS[1], names)
    name, test = next((x, names[x]) for x in names if x.startswith("test_"))
    test()
    exec(BLOCKS[1].replace("4 * t**2", "5 * t**2"), names)
    with pytest.raises(AssertionError, match="Mismatched"):
        names[name]()


def test_that_the_files_of_the_page_exist():
    paths = re.findall(r"`((?:kincompile|tests|templates)/[\w/.]+)`", PAGE)
    assert len(paths) > 5
    assert [path for path in paths if not (ROOT / path).exists()] == []
