"""A model from a file; the suffix decides how it is read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.errors import InputError
from kincompile.files.adm_file import read_acf, read_adm
from kincompile.files.content import file_content
from kincompile.files.model_file import read_data_model
from kincompile.files.python_file import read_python
from kincompile.names import escaped, listed

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.files.adm_file import AnalysisSettings
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def _read_robot(path: Path, content: bytes, **given: Any) -> Mechanism:
    from kincompile.files.robots.read_robot import read_robot  # SciPy

    return read_robot(path, content, **given)


_DATA: dict[str, Callable[..., Mechanism | ConstraintSystem]] = {
    ".toml": read_data_model,
    ".json": read_data_model,
    ".adm": read_adm,
    ".urdf": _read_robot,
    ".xml": _read_robot,
}
_READERS: Mapping[str, Callable[..., Mechanism | ConstraintSystem]] = {
    ".py": read_python,
    **_DATA,
}


def read_model(path: str | os.PathLike[str]) -> Mechanism | ConstraintSystem:
    """Read the model in a file.

    Parameters
    ----------
    path
        ``.py``: a Python file, which is run, with one `Mechanism` or `ConstraintSystem` at module
        level (of several: the one called `mechanism`, `system` or `m`, in this order). Others are
        data files, as for `read`.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or its suffix is another.
    ModelError
        If it does not hold one model, or running it fails; the message has file and line.
    """
    return _read(Path(path), _READERS, "a Python file, ending in .py, or a data file, ending in")


def read(
    path: str | os.PathLike[str],
    *,
    loops: str | os.PathLike[str] | None = None,
    motors: Sequence[str] | None = None,
    pose: Mapping[str, Any] | None = None,
) -> Mechanism | ConstraintSystem:
    """Read the model in a data file, which cannot run code.

    Parameters
    ----------
    path
        ``.toml`` or ``.json``: a model as `Mechanism.to_toml` and `Mechanism.to_json` write it.
        ``.adm``: a model of simEngine2D. ``.urdf`` or ``.xml``: a robot, as URDF or MJCF; it
        becomes a `spatial.Mechanism` whose loops are closed.
    loops
        Of a URDF its sidecar, in YAML. Without, and without loops in the file, one of the same name
        that ends in ``.yaml``.
    motors
        Of a robot the joints that are driven, by their names in the file. Each is a parameter with
        the joint's name.
    pose
        Of a robot values of joints by their names: where the search for closed loops begins. Motors
        are led to their values. Hinges are in radians, slides in metres; a ball has (w, x, y, z).

    Returns
    -------
    Mechanism or ConstraintSystem
        A mechanism where the file has no coordinates of its own.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or its suffix is another.
    ModelError
        If it is not a model; every problem with line and field.
    """
    named = {"loops": loops, "motors": motors, "pose": pose}
    given = {key: item for key, item in named.items() if item is not None}
    if given and _DATA.get(Path(path).suffix.lower()) is not _read_robot:
        raise InputError(
            f"{listed(given)}: only a robot, a file ending in .urdf or .xml, is read with these; "
            f"leave them out for {escaped(path)}"
        )
    return _read(Path(path), _DATA, "a data file, ending in", **given)


def read_analysis(path: str | os.PathLike[str]) -> AnalysisSettings:
    """Read the time grid in an ``.acf`` file of simEngine2D.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or its suffix is another.
    ModelError
        If it is not such a file; every problem with line and field.
    """
    file = Path(path)
    if file.suffix.lower() != ".acf":
        raise InputError(
            f"cannot read an analysis from {escaped(file)}: one is a file ending in .acf"
        )
    return read_acf(file, file_content(file))


def _read(
    file: Path,
    readers: Mapping[str, Callable[..., Mechanism | ConstraintSystem]],
    what: str,
    **given: Any,
) -> Mechanism | ConstraintSystem:
    reader = readers.get(file.suffix.lower())
    content = file_content(file, endings=_READERS)
    if reader is None:
        raise InputError(
            f"cannot read a model from {escaped(file)}: a model is {what} {' or '.join(_DATA)}"
        )
    return reader(file, content, **given)
