"""Run the exhaustive part of this folder and write its counts into docs/adversary.md."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.adversary.table import DOCS, table_of, with_table


def main() -> int:
    """Run the tests; where all pass, write the table. Return their exit code."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "ADVERSARY_REPORT": folder}
        # A busy machine makes nothing wrong: what hangs is stopped after an hour.
        options = ["-m", "slow", "-q", "--numprocesses=auto", "--timeout=3600"]
        places = [str(Path(__file__).parent), "tests/unit/compare/test_compare_corpora.py"]
        command = [sys.executable, "-m", "pytest", *options, *places]
        code = subprocess.run(command, env=environment, check=False).returncode
        if code == 0:
            document = DOCS.read_text(encoding="utf-8")
            DOCS.write_text(with_table(document, table_of(Path(folder))), encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main())
