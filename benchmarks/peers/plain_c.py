"""Plain C: SymPy's cse printed as C, dense LU with partial pivoting, gcc -O3 (plain.c)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import sympy

from benchmarks.peers.common import (
    Analysis,
    Motion,
    Skipped,
    Vector,
    compiled_c,
    derived,
    empty_motion,
    pointer,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.linkages import Linkage
    from benchmarks.textbook import Derived

PROGRAM = Path(__file__).with_name("plain.c")
ARGUMENTS = "const double *q, const double *w, double t, const double *p, double *b, double *A"


class PlainC:
    """The compiled program of a mechanism."""

    def __init__(self, linkage: Linkage) -> None:
        self._n, self._p = len(linkage.guess), linkage.values
        self._guess = np.array(linkage.guess)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            text = equations(derived(linkage))
            (folder / "equations.h").write_text(text, encoding="utf-8")
            program = folder / PROGRAM.name
            program.write_text(PROGRAM.read_text(encoding="utf-8"), encoding="utf-8")
            self._library = compiled_c(program)

    def analysis(self, *, is_predicted: bool) -> Analysis:
        """Return the whole analysis with the linkage's own parameters."""

        def analyse(t: Vector) -> Motion:
            return self._run(t, self._p[np.newaxis], is_predicted, (t.size, self._n), "run")

        return analyse

    def variants(self, t: Vector, p: Vector) -> Motion:
        """Solve parameter sets (B, k); the motion has the shape (B, N, n)."""
        return self._run(t, p, True, (len(p), t.size, self._n), "run_variants")

    def _run(
        self, t: Vector, p: Vector, is_predicted: bool, shape: tuple[int, ...], name: str
    ) -> Motion:
        motion = empty_motion(*shape)
        counts = (len(p), t.size) if name == "run_variants" else (t.size,)
        inputs = [pointer(array) for array in (t, p, self._guess)]
        outputs = [pointer(array) for array in motion]
        failed = getattr(self._library, name)(*counts, *inputs, int(is_predicted), *outputs)
        if failed:
            raise Skipped(f"{failed} points did not converge")
        return motion


def equations(d: Derived) -> str:
    """Return the C functions position, velocity and acceleration."""
    e = d.equations
    sides = {"position": e.Phi, "velocity": d.nu, "acceleration": d.gamma}
    functions = [function(name, side.flat(), d.Phi_q.flat(), d) for name, side in sides.items()]
    return "\n".join((f"#define N {len(e.q)}", f"#define K {len(e.p)}", *functions))


def function(
    name: str, side: Sequence[sympy.Expr], entries: Sequence[sympy.Expr], d: Derived
) -> str:
    """Return a C function that puts a right side into b and the entries of a matrix into A."""
    symbols = {
        symbol: sympy.Symbol(f"{array}[{k}]")
        for array, vector in (("q", d.equations.q), ("w", d.equations.q_dot), ("p", d.equations.p))
        for k, symbol in enumerate(vector)
    }
    shared, reduced = sympy.cse([*side, *entries])
    places = [f"b[{k}]" for k in range(len(side))] + [f"A[{k}]" for k in range(len(entries))]
    values = [_printed(expression.xreplace(symbols)) for expression in reduced]
    lines = [f"const double {s} = {_printed(x.xreplace(symbols))};" for s, x in shared]
    # The right-hand side may lie where the rates are read: all is computed before it is written.
    lines += [f"const double r{k} = {value};" for k, value in enumerate(values)]
    lines += [f"{place} = r{k};" for k, place in enumerate(places)]
    return f"static void {name}({ARGUMENTS})\n{{\n" + "\n".join(lines) + "\n}"


def _printed(expression: sympy.Expr) -> str:
    return str(sympy.ccode(expression))
