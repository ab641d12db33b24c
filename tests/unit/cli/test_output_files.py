"""What is known about an output file before the work begins; tests/unit/runtime has the writing."""

import os
import threading

import pytest

from kincompile.errors import InputError
from kincompile.writing import require_writable, write_atomically


def test_that_a_new_or_existing_file_may_be_written(tmp_path):
    (tmp_path / "old").touch()
    require_writable(tmp_path / "old")
    require_writable(tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("folder", "it is a folder"),
        ("no/file", "does not exist"),
        ("old/file", "is a file, not a folder"),
        ("x" * 300, "name too long"),
    ],
)
def test_that_what_cannot_be_written_is_refused(tmp_path, name, reason):
    (tmp_path / "old").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=f"(?i)cannot write .*{reason}"):
        require_writable(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_that_a_pipe_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write_atomically(pipe, "text")
    reader.join(timeout=60)
    assert received == [b"text"]
    assert pipe.is_fifo()
