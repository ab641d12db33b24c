"""A model from a file; the suffix decides how it is read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.files.adm_file import read_acf, read_adm
from kincompile.files.content import file_content
from kincompile.files.model_file import read_data_model
from kincompile.files.python_file import read_python
from kincompile.names import escaped

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from kincompile.files.adm_file import AnalysisSettings
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

_DATA: dict[str, Callable[[Path, bytes], Mechanism | ConstraintSystem]] = {
    ".toml": read_data_model,
    ".json": read_data_model,
    ".adm": read_adm,
}
_READERS: Mapping[str, Callable[[Path, bytes], Mechanism | ConstraintSystem]] = {
    ".py": read_python,
    **_DATA,
}


def read_model(path: str | os.PathLike[str]) -> Mechanism | ConstraintSystem:
    """Read the model in a file.

    Parameters
    ----------
    path
        ``.py``: a Python file, which is run, with one `Mechanism` or `ConstraintSystem` at module
        level (of several: the one called `mechanism`, `system` or `m`, in this order). ``.toml``,
        ``.json``, ``.adm``: a data file, as for `read`.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or its suffix is another.
    ModelError
        If it does not hold one model, or running it fails; the message has file and line.
    """
    return _read(Path(path), _READERS, "a Python file, ending in .py, or a data file, ending in")


def read(path: str | os.PathLike[str]) -> Mechanism | ConstraintSystem:
    """Read the model in a data file, which cannot run code.

    Parameters
    ----------
    path
        ``.toml`` or ``.json``: a model as `Mechanism.to_toml` and `Mechanism.to_json` write it.
        ``.adm``: a model of simEngine2D.

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
    return _read(Path(path), _DATA, "a data file, ending in")


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
    readers: Mapping[str, Callable[[Path, bytes], Mechanism | ConstraintSystem]],
    what: str,
) -> Mechanism | ConstraintSystem:
    reader = readers.get(file.suffix.lower())
    content = file_content(file, endings=_READERS)
    if reader is None:
        raise InputError(
            f"cannot read a model from {escaped(file)}: a model is {what} {' or '.join(_DATA)}"
        )
    return reader(file, content)
