"""Numbers of drawings that know how they come from parameters, and the page's code for them."""

import copy
import json
import shutil
import subprocess

import numpy as np
import pytest
import sympy

from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.view.live_numbers import LiveNumber, length_of, live_places
from kincompile.view.page_scripts import function_text

NODE = shutil.which("node") or shutil.which("nodejs")
AT = {"a": 0.7, "b": -1.3}
OTHERS = {"a": 2.1, "b": 0.4}


def live(expression, values=AT):
    graph = Graph()
    node = Converter(graph, graph.input).convert(expression)
    return LiveNumber.of(float(expression.subs(values)), graph, node)


def pair():
    graph = Graph()
    return [LiveNumber.of(AT[name], graph, graph.input(name)) for name in AT]


COMBINED = {
    "sum": lambda a, b: a + b,
    "sum with a number": lambda a, b: 2.5 + a + 1,
    "difference": lambda a, b: a - b,
    "difference from a number": lambda a, b: 1 - b,
    "product": lambda a, b: a * b,
    "multiple": lambda a, b: 3 * a,
    "quotient": lambda a, b: a / b,
    "sign": lambda a, b: -b,
    "size": lambda a, b: abs(b),
    "length": lambda a, b: length_of(a, b) * 1.0,
    "length beside a number": lambda a, b: length_of(3.0, b) + 0.0,
}


def in_node(text, expression):
    script = f"const square = x => x * x;\n{text}console.log(JSON.stringify({expression}));"
    done = subprocess.run([str(NODE), "-e", script], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)")
def test_that_what_is_computed_with_them_is_computed_again_in_javascript():
    numbers = [combine(*pair()) for combine in COMBINED.values()]
    for number, combine in zip(numbers, COMBINED.values(), strict=True):
        assert number == pytest.approx(combine(*AT.values()), rel=1e-15)
        assert isinstance(number, LiveNumber)
        text = function_text("f", [number], list(AT), [])
        for values in (AT, OTHERS):
            (found,) = in_node(text, f"f(0, {list(values.values())})")
            assert found == pytest.approx(combine(*values.values()), rel=1e-15)


@pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)")
def test_that_names_of_parameters_may_be_words_of_the_language():
    number = live(sympy.Symbol("p") * sympy.cos(sympy.Symbol("class")), {"p": 2, "class": 1})
    text = function_text("f", [number], ["class", "p"], [])
    assert in_node(text, "f(0, [0.5, 3])") == pytest.approx([3 * np.cos(0.5)])


def test_that_arrays_know_nothing():
    a, _ = pair()
    for values in (a * np.arange(3.0), np.arange(3.0) * a, a + np.arange(3.0)):
        assert type(values) is np.ndarray


def test_that_copies_are_found_with_their_places():
    a, b = pair()
    data = copy.deepcopy({"one": [1.0, (a, 2.0)], "two": {"three": b}})
    assert [place for place, _ in live_places(data)] == [("one", 1, 0), ("two", "three")]
    assert [number.node for _, number in live_places(data)] == [a.node, b.node]
