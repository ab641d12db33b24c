import errno
import stat
from pathlib import Path

import pytest

from kincompile.errors import InputError
from kincompile.writing import write_atomically


def test_text_and_bytes_arrive_as_given(tmp_path):
    text = write_atomically(tmp_path / "a.txt", "Φ\nq\n")
    assert text.read_bytes() == "Φ\nq\n".encode()
    assert write_atomically(str(tmp_path / "b.bin"), b"\x00\xff").read_bytes() == b"\x00\xff"


def test_an_existing_file_is_replaced_and_nothing_else_is_left(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o640)
    write_atomically(path, "new")
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_has_the_usual_permissions(tmp_path):
    usual = tmp_path / "usual"
    usual.touch()
    ours = write_atomically(tmp_path / "ours", "")
    assert ours.stat().st_mode == usual.stat().st_mode


def test_a_symbolic_link_stays_a_link(tmp_path):
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_the_old_file_survives_a_failure(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def full(self: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match=r"cannot write .*a\.txt: No space left.*Free some space"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_file_survives_an_interruption(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted(self: Path, target: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, "new")
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match=r"the folder .*missing does not exist\. Create it first"):
        write_atomically(tmp_path / "missing" / "a.txt", "")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"it is a folder\. Give the name of a file in it"):
        write_atomically(tmp_path, "")


def test_a_file_in_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InputError, match=r"a is a file, not a folder\. Choose another folder"):
        write_atomically(tmp_path / "a" / "b.txt", "")


def test_a_folder_without_permission_is_named(tmp_path, monkeypatch):
    # Run by an administrator, no folder refuses.
    def refused(self: Path, target: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "replace", refused)
    monkeypatch.chdir(tmp_path)
    for path in (tmp_path / "a.txt", "a.txt"):
        with pytest.raises(InputError, match=rf"no permission to write in {tmp_path}\. Choose a"):
            write_atomically(path, "")
