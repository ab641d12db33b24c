"""The floors, the wall and the absence of cycles, read from the imports.

An import counts wherever it stands, under `TYPE_CHECKING` too: a type is a dependency like any
other.
"""

import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "kincompile"

# A module imports from lower floors or from its own folder: never from a room beside its own.
FLOORS = {
    "criteria": 0,
    "errors": 0,
    "names": 0,
    "html": 0,
    "quantities": 0,
    "tables": 0,
    "writing": 0,
    "solver": 1,
    "calculus": 1,
    "derive": 2,
    "model": 3,
    "report": 3,
    "space": 4,
    "files": 5,
    "structure": 5,
    "ir": 6,
    "checker": 7,
    "emitters": 7,
    "runtime": 7,
    "transmissions": 7,
    "further": 8,
    "compiler": 9,
    "spatial": 9,
    "classical": 10,
    "sweeps": 10,
    "verification": 10,
    "view": 10,
    "derivations": 11,
    "design": 11,
    "functions": 11,
    "exercises": 12,
    "__init__": 13,
    "cli": 14,
    "__main__": 15,
}
GROUND = {name for name, floor in FLOORS.items() if floor == 0}
# Beyond the wall: it stands on the ground floor alone.
RUNTIME = "runtime"

# Modules that may import kincompile inside a function. The lazy table of public names is what the
# package promises: `import kincompile` loads nothing, a name loads its module. The table of targets
# loads the modules of the one that is emitted, the command line the command that is called, and the
# compiler the stages that a model needs. The options of a motion are formulas: to read them takes
# SymPy, and to print a help does not; so do the tables of sweeps, tolerances and fits. Masses and
# forces are loaded where a mechanism has any, SciPy for a robot's file, the compiler where a
# mechanism is asked what it holds.
DEFERRED = {
    PACKAGE,
    "kincompile.cli",
    "kincompile.cli.compare",
    "kincompile.cli.fit",
    "kincompile.cli.motion",
    "kincompile.cli.shared",
    "kincompile.cli.sweep",
    "kincompile.cli.tolerance",
    "kincompile.cli.transmission",
    "kincompile.compiler",
    "kincompile.exercises.kit",
    "kincompile.files.dimensions",
    "kincompile.files.files",
    "kincompile.further",
    "kincompile.files.file_format",
    "kincompile.files.model_file",
    "kincompile.ir.lower",
    "kincompile.model.mechanism",
    "kincompile.model.resolve_loads",
    "kincompile.model.system",
    "kincompile.emitters.registry",
    "kincompile.view.worlds",
    "kincompile.ir.elimination",
}

Sources = Mapping[str, str]  # module name -> source


@cache
def package_sources() -> dict[str, str]:
    """Return the source of every module of the package, by dotted name."""
    sources = {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        sources[name] = path.read_text(encoding="utf-8")
    return sources


def subpackage_inits() -> list[Path]:
    """Return the `__init__.py` of every folder below the package's own."""
    every = set((ROOT / PACKAGE).glob("*/**/__init__.py"))
    return sorted(every - {ROOT / PACKAGE / "cli" / "__init__.py"})  # the program itself


def imported(node: ast.AST, importer: str, is_package: bool) -> Iterator[str]:
    """Yield the dotted names that an import statement mentions, with the members of a `from`."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        above = importer.split(".")[: len(importer.split(".")) - node.level + is_package]
        base = ".".join([*(above if node.level else []), *([node.module] if node.module else [])])
        yield from (f"{base}.{alias.name}" for alias in node.names)


def resolve(name: str, modules: Sources) -> str | None:
    """Return the module of the package that a dotted name means, or None for a foreign one."""
    if name.split(".")[0] != PACKAGE:
        return None
    while name not in modules and "." in name:
        name = name.rpartition(".")[0]
    return name


parsed = cache(ast.parse)
"""Every check reads all of the package."""


@cache
def imports_of(source: str, module: str) -> list[ast.Import | ast.ImportFrom]:
    """Return the import statements of a module, those in functions too."""
    nodes = ast.walk(parsed(source, module))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def import_graph(modules: Sources) -> dict[str, set[str]]:
    """Return, for every module, the modules of the package that it imports."""
    graph: dict[str, set[str]] = {}
    for module, source in modules.items():
        is_package = any(other.startswith(f"{module}.") for other in modules)
        names = {
            name
            for node in imports_of(source, module)
            for name in imported(node, module, is_package)
        }
        graph[module] = {found for name in names if (found := resolve(name, modules))} - {module}
    return graph


def part(module: str) -> str:
    """Return the folder or file directly below the package that a module belongs to."""
    return module.split(".")[1] if "." in module else "__init__"


def may_import(importer: str, target: str) -> bool:
    """Tell whether one part of the package may import another."""
    if importer == target or target in GROUND:
        return True
    if importer == RUNTIME or not {importer, target} <= FLOORS.keys():
        return False
    return FLOORS[target] < FLOORS[importer]


def floor_violations(modules: Sources) -> list[str]:
    """Return one sentence for every import that climbs a floor or crosses the wall."""
    return [
        f"{module} imports {target}"
        for module, targets in import_graph(modules).items()
        for target in sorted(targets)
        if not may_import(part(module), part(target))
    ]


def import_cycle(modules: Sources) -> list[str]:
    """Return the modules of one import cycle, or nothing."""
    try:
        graphlib.TopologicalSorter(import_graph(modules)).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def runtime_part(module: str) -> str:
    """Return the folder or file directly below the runtime that a module belongs to."""
    return ".".join(module.split(".")[:3])


def runtime_cycle(modules: Sources) -> list[str]:
    """Return the parts of the runtime that form a circle, a folder being one part, or nothing."""
    runtime = f"{PACKAGE}.{RUNTIME}."
    graph: dict[str, set[str]] = {}
    for module, targets in import_graph(modules).items():
        if module.startswith(runtime):
            parts = {runtime_part(target) for target in targets if target.startswith(runtime)}
            graph.setdefault(runtime_part(module), set()).update(parts - {runtime_part(module)})
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def is_deferred_import(node: ast.AST, module: str) -> bool:
    """Tell whether a node of a function imports from the package, or by a computed name."""
    if isinstance(node, ast.Call):
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        return name in {"import_module", "__import__"}
    relative = isinstance(node, ast.ImportFrom) and node.level > 0
    return relative or any(
        name.split(".")[0] == PACKAGE for name in imported(node, module, is_package=False)
    )


def deferred_imports(modules: Sources) -> list[str]:
    """Return one sentence for every import of the package that waits inside a function."""
    return sorted(
        {
            f"{module}, line {node.lineno}"
            for module, source in modules.items()
            if module not in DEFERRED
            for function in ast.walk(parsed(source, module))
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            for node in ast.walk(function)
            if isinstance(node, ast.stmt | ast.expr) and is_deferred_import(node, module)
        }
    )


def sympy_imports(modules: Sources) -> list[str]:
    """Return the modules of the runtime and the ground that import SymPy, in functions too."""
    return [
        module
        for module, source in modules.items()
        if part(module) in GROUND | {RUNTIME}
        for node in imports_of(source, module)
        for name in imported(node, module, is_package=False)
        if name.split(".")[0] == "sympy"
    ]


def test_every_part_of_the_package_has_a_floor() -> None:
    parts = {part(module) for module in package_sources()}
    assert parts == set(FLOORS)


def test_imports_go_down_and_do_not_cross_the_wall() -> None:
    assert floor_violations(package_sources()) == []


def test_a_module_is_read_by_name_at_the_border_alone() -> None:
    """Elsewhere its `Compiled` says what it has."""
    by_name = re.compile(r"\b(?:getattr|hasattr|vars)\([^()]*\bmodule\b|module\.__dict__")
    border = {"inputs", "load", "engine.code", "native.module"}
    above = {RUNTIME, "further", "compiler", "design", "sweeps", "verification", "view"}
    found = {
        name
        for name, source in package_sources().items()
        if by_name.search(source) and part(name) in above
    }
    assert found == {f"{PACKAGE}.{RUNTIME}.{name}" for name in border}


def test_there_is_no_import_cycle() -> None:
    assert import_cycle(package_sources()) == []


def test_the_folders_of_the_runtime_are_floors() -> None:
    assert runtime_cycle(package_sources()) == []


def test_no_import_of_the_package_waits_inside_a_function() -> None:
    assert deferred_imports(package_sources()) == []


def test_sympy_is_not_imported_beyond_the_wall() -> None:
    assert sympy_imports(package_sources()) == []


@pytest.mark.parametrize("path", subpackage_inits(), ids=lambda path: path.parent.name)
def test_a_subpackage_init_is_a_docstring_and_nothing_else(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "say what the folder is for"
    assert len(tree.body) == 1


def test_the_runtime_does_not_load_sympy() -> None:
    modules = [name for name in package_sources() if part(name) in {"__init__", RUNTIME, *GROUND}]
    assert any(part(name) == RUNTIME for name in modules)
    program = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    importlib.import_module(name)\n"
        "    if 'sympy' in sys.modules:\n"
        "        sys.exit(f'{name} loads SymPy')\n"
    )
    command = [sys.executable, "-c", program, *modules]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# The checks above say "nothing found"; these see to it that something would be.

CLEAN = {
    "kincompile": "def __getattr__(name):\n    return importlib.import_module(name)",
    "kincompile.errors": "",
    "kincompile.model": "",
    "kincompile.model.body": "from kincompile.errors import ModelError",
    "kincompile.emitters": "",
    "kincompile.emitters.c": "from kincompile.model import body",
    "kincompile.runtime": "",
    "kincompile.runtime.newton": "from kincompile.errors import SolveError\nimport numpy",
    "kincompile.derivations": "",
    "kincompile.view": "from kincompile.runtime import newton",
    "kincompile.cli": "import kincompile.emitters.c\nfrom kincompile.runtime import newton",
}


def test_a_clean_package_passes() -> None:
    assert floor_violations(CLEAN) == []
    assert import_cycle(CLEAN) == []
    assert deferred_imports(CLEAN) == []
    assert sympy_imports(CLEAN) == []


@pytest.mark.parametrize(
    ("module", "source", "violation"),
    [
        ("model.body", "from kincompile.emitters.c import emit", "kincompile.emitters.c"),
        ("model.body", "from ..emitters import c", "kincompile.emitters.c"),
        ("model", "from ..emitters import c", "kincompile.emitters.c"),
        ("model.body", "import kincompile as kc", "kincompile"),
        (
            "targets.c",
            "from kincompile.runtime.newton import solve",
            "kincompile.runtime.newton",
        ),
        ("targets.c", "def f():\n    import kincompile.cli", "kincompile.cli"),
        ("runtime.newton", "from kincompile.model.body import Body", "kincompile.model.body"),
        ("checker.forms", "from kincompile.runtime import newton", "kincompile.runtime.newton"),
        ("view.page", "from kincompile.derivations.steps import steps", "kincompile.derivations"),
        ("sweeps.page", "from kincompile.view.page import page", "kincompile.view"),
        ("design.fit", "from kincompile import compile", "kincompile"),
        ("exercises.kit", "from kincompile.cli import shared", "kincompile.cli"),
        ("errors", "from kincompile.model import body", "kincompile.model.body"),
    ],
)
def test_an_import_up_or_across_is_found(module: str, source: str, violation: str) -> None:
    planted = {**CLEAN, f"kincompile.{module}": source}
    assert floor_violations(planted) == [f"kincompile.{module} imports {violation}"]


def test_a_circle_between_folders_of_the_runtime_is_found() -> None:
    planted = {
        **CLEAN,
        "kincompile.runtime.march": "from kincompile.runtime.singular import signs",
        "kincompile.runtime.singular": "",
        "kincompile.runtime.singular.signs": "",
        "kincompile.runtime.singular.events": "from kincompile.runtime.march import State",
    }
    assert import_cycle(planted) == []
    circle = {"kincompile.runtime.march", "kincompile.runtime.singular"}
    assert set(runtime_cycle(planted)) == circle


def test_a_cycle_is_found_even_if_it_is_for_types_only() -> None:
    joint = "if TYPE_CHECKING:\n    from .body import Body"
    body = "from kincompile.model.joint import Joint"
    planted = {**CLEAN, "kincompile.model.joint": joint, "kincompile.model.body": body}
    assert set(import_cycle(planted)) == {"kincompile.model.joint", "kincompile.model.body"}


@pytest.mark.parametrize(
    "statement",
    [
        "from kincompile.errors import ModelError",
        "from . import mechanism",
        "import kincompile.errors",
        "importlib.import_module('kincompile.errors')",
    ],
)
def test_an_import_inside_a_function_is_found(statement: str) -> None:
    planted = {**CLEAN, "kincompile.model.body": f"def f():\n    {statement}"}
    assert deferred_imports(planted) == ["kincompile.model.body, line 2"]


def test_sympy_inside_a_function_of_the_runtime_is_found() -> None:
    planted = {**CLEAN, "kincompile.runtime.newton": "def f():\n    from sympy import sin"}
    assert sympy_imports(planted) == ["kincompile.runtime.newton"]


def test_that_few_thresholds_are_outside_of_the_criteria() -> None:
    """What is zero, converged or near singular is said in `criteria.py`, and once."""
    folders = ("runtime", "structure", "ir")
    found = [
        f"{name}: {line.strip()}"
        for name, source in package_sources().items()
        if part(name) in folders
        for line in source.splitlines()
        if re.search(r"= [0-9.]+e-[0-9]+", line)
    ]
    assert len(found) <= 21, found


def test_that_a_planar_model_imports_nothing_of_space() -> None:
    program = """
import sys
import kincompile as kc
m = kc.Mechanism("pendulum")
bar = m.body("bar", (0, 0, 0))
m.add(kc.Revolute("A", m.ground, (0, 0), bar, (0, 0)))
m.add(kc.AbsoluteAngle("motor", bar, kc.t))
kc.solve(kc.compile(m), [0, 1])
kc.page(m)
own = [name for name in sys.modules if name.startswith("kincompile.")]
print([name for name in own if "spac" in name or "spatial" in name or "orientation" in name])
"""
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"
