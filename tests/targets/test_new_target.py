"""A new target is a folder and a line in the table: here plain Python, which needs no NumPy."""

import sys
from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import numpy as np

import kincompile as kc
from kincompile.emitters.printer import ATOM, ELEMENTARY, POWER, Dialect
from kincompile.emitters.registry import TARGETS, Listed
from kincompile.emitters.statements import Statements
from kincompile.emitters.target import Target
from kincompile.quantities import OF_EQUATIONS, Quantity, singles

WRITE = Statements("#", "{}", "{}[{}]", "{}[{}][{}]", continued=" \\", ending="")


def function(name, code, listing, printer):
    """Return the lines of a function of one point."""
    rates = "q_dot, " if name == "gamma" else ""
    n, m = len(code.program.coordinates), len(code.program.equations)
    zeros = f"[[0.0] * {n} for _ in range({m})]" if name == "Phi_q" else f"[0.0] * {m}"
    body = WRITE.inputs(code.program, listing) + WRITE.frames(listing, printer)
    body += [*WRITE.steps(listing, printer), f"{name} = {zeros}"]
    body += [*WRITE.results(name, code, printer), f"return {name}"]
    return [f"def {name}(q, {rates}t, p):", *(f"    {line}" for line in body)]


SPLINE = """
def spline(table, order, angle):
    breaks, pieces = table
    angle = breaks[0] + (angle - breaks[0]) % (breaks[-1] - breaks[0])
    k = sum(start <= angle for start in breaks[:-1]) - 1
    powers, value = pieces[k], 0.0
    for _ in range(order):
        powers = [(len(powers) - 1 - i) * a for i, a in enumerate(powers[:-1])]
    for a in powers:
        value = value * (angle - breaks[k]) + a
    return value
"""


def files(code, functions, called):
    """Return the one file."""
    lines = ["from math import *", *(line for own in functions.values() for line in own), SPLINE]
    tables = code.program.tables.items()
    lines += [f"{name} = {table.breaks}, {table.coefficients}" for name, table in tables]
    return {f"{code.program.name}.py": "\n".join(lines) + "\n"}


class Plain:
    """The target, which may be a module as well."""

    DIALECT = Dialect(
        "plain", {name: f"{name}({{}})" for name in ELEMENTARY},
        square=("{}**2", (ATOM,), POWER), select="({1} if {0} else {2})",
    )  # fmt: skip
    RESERVED: tuple[str, ...] = ("q", "q_dot", "t", "p", "pi", "spline", *ELEMENTARY)
    function, files = staticmethod(function), staticmethod(files)

    def evaluators(self, given: Sequence[Quantity]) -> Mapping[str, tuple[str, ...]]:
        """Return a function for each quantity."""
        return singles(given)


PLAIN: Target = Plain()


def test_that_a_new_target_is_a_line_in_the_table(example, monkeypatch):
    monkeypatch.setitem(sys.modules, "plain.target", PLAIN)
    monkeypatch.setitem(TARGETS, "plain", Listed("plain", (".py",)))
    names: dict[str, object] = {}
    exec(kc.emit(example.model, "plain").source, names)
    module, found = example.module, SimpleNamespace(**names)
    q, q_dot = np.random.default_rng(1).uniform(0.1, 1, (2, module.N_COORDINATES))
    rest = 0.3, module.DEFAULTS.tolist()
    for name, expected in zip(singles(OF_EQUATIONS), module.kinematics(q, q_dot, 0.3), strict=True):
        rates = [q_dot.tolist()] if name == "gamma" else []
        values = getattr(found, name)(q.tolist(), *rates, *rest)
        np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-13)
