"""The runtime is on its own side of the wall."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
from kincompile.runtime import load
from kincompile.runtime.results import write as results
from kincompile.runtime import solve
module = load.load(sys.argv[1])
solution = solve.solve(module, [0, 1])
assert solution.success
results.write(solution, sys.argv[2])
foreign = {"sympy", "mpmath", "scipy", "jinja2", "click", "rich"} & set(sys.modules)
assert not foreign, foreign
"""


def test_a_module_is_solved_without_sympy(tmp_path):
    module = Path(__file__).parent / "modules" / "problem_3_5_6.py"
    output = tmp_path / "motion.csv"
    subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM, module, output],
        check=True,
        timeout=60,
        cwd=Path(__file__).parents[3],
    )
    assert output.exists()
