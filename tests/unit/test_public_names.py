"""The public names of the package, whatever is imported first."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "first", ["kc.Mechanism", "kc.compile", "__import__('kincompile.emit.target')"]
)
def test_that_emit_is_the_function_and_not_the_subpackage(first: str) -> None:
    code = f"import kincompile as kc; {first}; print(kc.emit.__module__)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "kincompile.compiler"
