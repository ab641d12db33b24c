"""kincompile: a symbolic-to-numeric compiler for the kinematics of mechanisms.

    import kincompile as kc

Public names are loaded when they are first used, so that the runtime works without SymPy being
imported.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from kincompile.names import suggestion

_PUBLIC = {
    "kincompile.compiler": ("compile", "emit", "inspect"),
    "kincompile.files.files": ("read", "read_analysis", "read_model"),
    "kincompile.model.file_format": ("model_schema",),
    "kincompile.model.mechanism": ("Mechanism",),
    "kincompile.model.system": ("ConstraintSystem",),
    "kincompile.model.equation": ("Equation",),
    "kincompile.model.absolute": ("AbsoluteX", "AbsoluteY", "AbsoluteAngle", "AbsoluteDistance"),
    "kincompile.model.relative": ("RelativeX", "RelativeY", "RelativeAngle", "Distance"),
    "kincompile.model.joints": (
        "Revolute", "Translational", "RevoluteTranslational", "TranslationalDistance",
    ),
    "kincompile.model.gears": ("Gear", "RackAndPinion"),
    "kincompile.model.cams": ("CamFollower", "CamFlatFollower", "PointFollower"),
    "kincompile.model.expressions": ("t", "pi", "alpha"),
    "kincompile.runtime.load": ("load",),
    "kincompile.runtime.results.write": ("write",),
    "kincompile.runtime.newton": ("newton",),
    "kincompile.runtime.singular.assemblies": ("assemblies",),
    "kincompile.runtime.singular.events": ("Event",),
    "kincompile.runtime.solve": ("solve",),
    "kincompile.runtime.results.solution": ("Solution",),
    "kincompile.runtime.status": ("Status",),
    "kincompile.compare.compare": ("compare", "compare_file"),
    "kincompile.verify.verify": ("verify",),
    "kincompile.derivation.derivation": ("derivation",),
    "kincompile.view.animation": ("animate",),
    "kincompile.view.gallery": ("gallery",),
    "kincompile.view.mechanism_plot": ("plot_mechanism",),
    "kincompile.view.page": ("page",),
    "kincompile.view.sparsity_plot": ("plot_sparsity",),
    "kincompile.errors": (
        "KincompileError", "ModelError", "StructuralError", "UnsupportedError", "TemplateError",
        "ContractError", "InputError", "SolveError", "InternalError",
        "SingularConfigurationWarning", "BranchSwitchWarning", "RedundantConstraintWarning",
    ),
}  # fmt: skip
_HOME = {name: module for module, names in _PUBLIC.items() for name in names}
_WITHOUT_SYMPY = ("kincompile.runtime", "kincompile.errors")

__all__ = sorted(_HOME)
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(
            f"module 'kincompile' has no attribute {name!r}{suggestion(name, _HOME)}"
        )
    module = _HOME[name]
    if not module.startswith(_WITHOUT_SYMPY):
        # The compiling side is loaded as a whole at its first use, so that no later call pays for
        # an import.
        import_module("kincompile.compiler")
        if "IPython" in sys.modules:
            import_module("kincompile.view.notebook")
    value = globals()[name] = getattr(import_module(module), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


class _Package(ModuleType):
    """The package; importing the subpackage `emit` does not hide the public name `emit`."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
