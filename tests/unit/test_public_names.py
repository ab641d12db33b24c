"""The public names of the package, whatever is imported first."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import kincompile as kc


@pytest.mark.parametrize(
    "first", ["kc.Mechanism", "kc.compile", "__import__('kincompile.targets.target')"]
)
def test_that_emit_is_the_function_and_not_the_subpackage(first: str) -> None:
    code = f"import kincompile as kc; {first}; print(kc.emit.__module__)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "kincompile.compiler"


def test_that_type_checkers_see_the_same_names_from_the_same_modules() -> None:
    stub = Path(str(kc.__file__)).with_suffix(".pyi")
    imports = [
        node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom)
    ]
    found = {alias.asname: (node.module, alias.name) for node in imports for alias in node.names}
    table = vars(kc)["_HOME"]
    assert found == {name: (module, name) for name, module in table.items()}, (
        "kincompile/__init__.pyi is not what the table in kincompile/__init__.py says: add or "
        "remove the names there too"
    )
