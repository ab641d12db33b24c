"""A model from a file; the suffix says how to read it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.model.python_file import read_python

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

_READERS: dict[str, Callable[[Path, bytes], Mechanism | ConstraintSystem]] = {".py": read_python}


def read_model(path: str | os.PathLike[str]) -> Mechanism | ConstraintSystem:
    """Read the model in a file.

    Parameters
    ----------
    path
        ``.py``: a Python file, which is run, with one `Mechanism` or `ConstraintSystem` at module
        level (of several: the one called `mechanism`, `system` or `m`, in this order).

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or its suffix is another.
    ModelError
        If it does not hold one model, or running it fails; the message has file and line.
    """
    file = Path(path)
    content = _content(file)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"cannot read a model from {file}: a model is a Python file, ending in "
            f"{' or '.join(_READERS)}"
        )
    return reader(file, content)


def _content(file: Path) -> bytes:
    """Return the bytes of a file."""
    try:
        return file.read_bytes()
    except FileNotFoundError:
        near = [file.with_name(file.name + suffix) for suffix in _READERS]
        hint = next((f"did you mean {path}?" for path in near if path.is_file()), "check the path")
        raise InputError(f"cannot read {file}: there is no such file; {hint}") from None
    except IsADirectoryError:
        raise InputError(f"cannot read {file}: it is a folder; give a file in it") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read {file}: {reason}; check the path") from error
