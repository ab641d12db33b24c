"""The recipe for PyTorch, run on what it asks of PyTorch: its CPU wheel is 500 MB and more."""

import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

import kincompile as kc

PAGE = Path(__file__).resolve().parents[3] / "docs" / "other_programs.md"


class Tensor(np.ndarray):
    """What the recipe asks of a tensor."""

    def detach(self):
        return self

    def numpy(self):
        return np.asarray(self)


def tensor(values):
    """Return an array as a tensor."""
    return np.asarray(values, dtype=float).view(Tensor)


def torch():
    """Return what stands for PyTorch."""
    module = ModuleType("torch")
    functions = SimpleNamespace(Function=type("Function", (), {}))
    vars(module).update(autograd=functions, from_numpy=tensor, einsum=np.einsum)
    return module


def test_that_the_recipe_has_the_gradient_of_differences(monkeypatch, example_named):
    monkeypatch.setitem(sys.modules, "torch", torch())
    text = PAGE.read_text(encoding="utf-8")
    (block,) = re.findall(
        r"<!-- file: torch_motion.py -->\n```python\n(.*?)^```", text, re.S | re.M
    )
    names: dict[str, Any] = {}
    exec(block, names)
    motion, module = names["Motion"], kc.compile(example_named("four_bar").model)
    times, given = np.linspace(0, 1, 5), (module, np.linspace(0, 1, 5), ["b", "c"])
    weights = np.random.default_rng(0).uniform(-1, 1, (5, 9))

    def cost(values):
        return float(np.sum(weights * motion.forward(SimpleNamespace(), tensor(values), *given)))

    context, values = SimpleNamespace(), np.array([26.0, 18.0])
    q = motion.forward(context, tensor(values), *given)
    np.testing.assert_array_equal(q, kc.solve(module, times, p={"b": 26.0, "c": 18.0}).q)
    found = motion.backward(context, tensor(weights))
    h = 1e-4 * np.eye(2)
    differences = [(cost(values + x) - cost(values - x)) / 2e-4 for x in h]
    np.testing.assert_allclose(found[0], differences, rtol=1e-7)
    assert found[1:] == (None, None, None)
