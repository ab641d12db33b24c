"""The public names of the package, whatever is imported first."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import kincompile as kc
from docs.builders import api
from docs.builders.places import DOCS
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.space.catalogue import CONSTRAINTS as IN_SPACE


@pytest.mark.parametrize(
    "first", ["kc.Mechanism", "kc.compile", "__import__('kincompile.emitters.target')"]
)
def test_that_emit_is_the_function_and_not_the_subpackage(first: str) -> None:
    code = f"import kincompile as kc; {first}; print(kc.emit.__module__)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "kincompile.compiler"


def test_that_type_checkers_see_the_constraint_types_of_the_catalogue() -> None:
    stub = Path(str(kc.__file__)).with_suffix(".pyi").read_text()
    assert "from kincompile.model.catalogue import *" in stub
    assert all(getattr(kc, name) is kind for name, kind in CONSTRAINTS.items())


def test_that_all_public_names_are_listed_and_can_be_had() -> None:
    assert set(kc.__dir__()) < {*kc.__all__, "__version__"}
    assert set(CONSTRAINTS) < set(kc.__all__)
    assert all(hasattr(kc, name) for name in kc.__all__)


def test_that_completion_shows_what_is_typed_and_not_what_calls_return() -> None:
    shown = set(dir(kc))
    assert {"Mechanism", "Sketch", "Revolute", "compile", "solve", "inspect", "page", "t"} <= shown
    hidden = set(kc.__all__) - shown
    assert {"Solution", "InputError", "AssemblyWarning", "Fit"} <= hidden
    assert all(isinstance(getattr(kc, name), type) for name in hidden)
    assert not any(name.endswith(("Error", "Warning")) for name in shown)


def test_that_the_page_of_stability_follows_from_the_names() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert page == api.page(), "python -m docs.builders api writes it anew"
    rows = re.findall(r"^\| `(\w+)` \| (.+) \| (stable|provisional) \|$", page, re.MULTILINE)
    plane, _, space = page.partition("## In space")
    assert {name for name, _, _ in rows if f"| `{name}` |" in plane} == set(kc.__all__)
    assert all(f"| `{name}` |" in space for name in IN_SPACE)


@pytest.mark.parametrize("wrong", ["Revolut", "solv", "Mechansim"])
def test_that_a_misspelt_name_is_answered_with_the_right_one(wrong: str) -> None:
    with pytest.raises(AttributeError, match=r"did you mean '\w+'\?"):
        getattr(kc, wrong)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Pin", "Revolute"),
        ("PinJoint", "Revolute"),
        ("Slot", "RevoluteTranslational"),
        ("Slider", "Translational"),
        ("Prismatic", "Translational"),
        ("Cylinder", "Distance"),
        ("Weld", "RelativeAngle"),
        ("Motor", "AbsoluteAngle"),
        ("Rack", "RackAndPinion"),
    ],
)
def test_that_a_name_of_engineers_is_answered_with_the_type(name: str, kind: str) -> None:
    with pytest.raises(AttributeError, match=rf"did you mean '{kind}', known as .*\?"):
        getattr(kc, name)


@pytest.mark.parametrize("name", ["solve", "Solution", "InputError", "nonsense", "_private"])
def test_that_names_of_the_runtime_do_not_load_sympy(name: str) -> None:
    code = f"import kincompile as kc, sys; hasattr(kc, {name!r}); print('sympy' in sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "False"


def test_that_no_folder_and_no_module_hides_a_public_name() -> None:
    files = {item.stem for item in Path(str(kc.__file__)).parent.iterdir()} - {"__init__"}
    assert len(files) > 30
    assert files.isdisjoint(kc.__all__)


def test_that_modules_are_imported_by_their_whole_names() -> None:
    code = (
        "import kincompile.checker.matching as a, kincompile.sweeps.plan as b, "
        "kincompile.derivations.derivation as c, kincompile.verification.verify as d; "
        "import kincompile as kc; "
        "print(a.__name__, *map(callable, (kc.compare, kc.sweep, kc.derivation, kc.verify)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.split() == ["kincompile.checker.matching", *["True"] * 4]
