"""Writing files so that a reader never meets a half-written one."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def write_atomically(
    path: str | os.PathLike[str], content: str | bytes, *, is_private: bool = False
) -> Path:
    """Write `content` to `path` in one step: the old file stays whole until the new one is.

    The content goes to a temporary file in the same folder, which then replaces `path`. Text is
    written as UTF-8 with the line ends as given, so the bytes are the same on every system. A
    device or a pipe, such as /dev/stdout, is written to as it is: it must not be replaced.

    Parameters
    ----------
    path : path-like
        The file to write; an existing one is replaced and keeps its permissions.
    content : str or bytes
        The whole content.
    is_private : bool
        Whether only the owner may read or write the file, whatever the umask. A link is then
        replaced by the file.

    Returns
    -------
    pathlib.Path
        The path written.

    Raises
    ------
    InputError
        When the file cannot be written: says which, why, and what to do.
    """
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    require_writable(target)
    try:
        if _is_device(target):
            target.write_bytes(data)
        else:
            _replace(target, data, is_private)
    except OSError as error:
        raise InputError(_explanation(target, error)) from error
    return target


def require_writable(path: str | os.PathLike[str]) -> None:
    """Refuse a file that cannot be written, before the work whose result it is to hold.

    Raises
    ------
    InputError
        As `write_atomically`, as far as it can be known beforehand.
    """
    target = Path(path)
    try:
        _require_place(target)
    except OSError as error:
        raise InputError(_explanation(target, error)) from error


def _require_place(target: Path) -> None:
    """Raise the error that writing `target` would raise, as far as it can be known."""
    if target.is_dir():
        raise IsADirectoryError
    folder = target.resolve().parent
    if _is_device(target):
        return
    if not folder.exists():
        raise FileNotFoundError
    if not folder.is_dir():
        raise NotADirectoryError
    if not os.access(folder, os.W_OK):
        raise PermissionError


def _replace(target: Path, data: bytes, is_private: bool) -> None:
    """Write a temporary neighbour of `target` and move it into place."""
    # Through a symbolic link, so that the link itself stays.
    destination = target if is_private else target.resolve()
    temporary = destination.with_name(f".{destination.name}.{os.urandom(4).hex()}")
    try:
        temporary.touch(0o600 if is_private else 0o666, exist_ok=False)
        temporary.write_bytes(data)
        if is_private:
            temporary.chmod(0o600)
        elif destination.exists():
            temporary.chmod(destination.stat().st_mode & 0o7777)
        temporary.replace(destination)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _is_device(target: Path) -> bool:
    return target.exists() and not target.is_file()


def _explanation(target: Path, error: OSError) -> str:
    """Say which file could not be written, why, and what to do."""
    folder = target.parent if target.parent.name else target.parent.resolve()
    if isinstance(error, IsADirectoryError):
        remedy = "it is a folder. Give the name of a file in it."
    elif isinstance(error, FileNotFoundError):
        remedy = f"the folder {folder} does not exist. Create it first, or choose another folder."
    elif isinstance(error, NotADirectoryError):
        remedy = f"{folder} is a file, not a folder. Choose another folder."
    elif isinstance(error, PermissionError):
        remedy = f"no permission to write in {folder}. Choose a folder you may write to."
    else:
        remedy = f"{error.strerror or error}. Free some space, or choose another name or folder."
    return f"cannot write {target}: {remedy}"


def write_folder(folder: str | os.PathLike[str], files: Callable[[], Mapping[str, str]]) -> Path:
    """Write files by their paths to a new folder, whole or not at all, and return the folder."""
    target = Path(folder)
    require_new_folder(target)
    try:
        draft = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.resolve().parent))
        try:
            for path, content in files().items():
                file = draft / path
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content.encode())
            draft.chmod(0o755)
            draft.replace(target)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror}; name another one") from error
    return target


def require_new_folder(folder: Path) -> None:
    """Refuse a folder that exists and is not empty, or whose place does not exist."""
    if folder.is_dir() and not any(folder.iterdir()):
        return
    if folder.exists():
        raise InputError(f"{folder} exists: name a new folder, so that no hand-in is overwritten")
    if not folder.resolve().parent.is_dir():
        raise InputError(f"cannot write {folder}: the folder {folder.parent} does not exist")
