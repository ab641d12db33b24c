"""What every test of the adversary suite shares: it writes down its counts."""

import json
import os
import time
from pathlib import Path

import pytest


@pytest.fixture
def record(request, tmp_path):
    """Return a function that notes what was tried, and what was wrong, gave up or took longest.

    Where ADVERSARY_REPORT names a folder, the counts go there: `python -m tests.adversary` makes
    the table of docs/adversary.md of them. Else they stay in the folder of the test.
    """
    folder = Path(os.environ.get("ADVERSARY_REPORT", tmp_path))
    started = time.process_time()

    def record(*, tried, wrong, gave_up=0, slowest=None):
        seconds = time.process_time() - started
        counts = {
            "test": request.node.name, "tried": tried, "wrong": int(wrong), "gave_up": int(gave_up),
            "slowest": seconds / max(tried, 1) if slowest is None else slowest, "total": seconds,
        }  # fmt: skip
        name = "".join(c if c.isalnum() else "_" for c in request.node.name)
        (folder / f"{request.path.stem}.{name}.json").write_text(json.dumps(counts))

    return record
