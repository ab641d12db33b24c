"""Files read by processes of bounded time and memory, one each, so that none has another's."""

import functools
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

BYTES = 1_500_000_000
LONGEST = 50_000
ADDITIONS, NOMINAL = 5_000_000, 0.25
"""So many additions in Python, and the processor time that they took where the budgets were set."""


@functools.cache
def pace() -> float:
    """Return how slow this processor is, 1 or more: one that others share is four times as slow.

    Twice what was measured, since its pace changes while it reads.
    """
    started, total = time.process_time(), 0
    for k in range(ADDITIONS):
        total += k
    return max(1.0, 2 * (time.process_time() - started) / NOMINAL)


READ = f"""
import json, os, resource, sys, time
from pathlib import Path
import kincompile as kc
from tests.pendulum import pendulum

folder, seconds, most = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
model = pendulum()
model.system()


def read(path):
    if path.suffix == ".txt" or path.name.startswith("HAND_FILES"):
        kc.compare_file(model, path)
    else:
        (kc.read_analysis if path.suffix == ".acf" else kc.read)(path)


for path in sorted(Path(folder).iterdir()):
    told, its = os.pipe()
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        started, verdict, text = time.process_time(), "read", "it was read"
        try:
            read(path)
        except kc.KincompileError as error:
            text = str(error)
            verdict = "refused" if len(text) < {LONGEST} else "a message without end"
        except BaseException as error:
            verdict = text = type(error).__name__
        # Its beginning and its end: a pipe holds 64 KiB until it is read.
        answer = [verdict, text[:5_000] + text[5_000:][-5_000:], time.process_time() - started]
        os.write(its, json.dumps(answer).encode())
        os._exit(0)
    os.close(its)
    os.waitpid(child, 0)
    answer = os.read(told, 65_536)
    os.close(told)
    print(json.dumps([path.name, *(json.loads(answer) if answer else ["no end", "", seconds])]))
"""


def read_bounded(
    folder: Path, seconds: int, most: int = BYTES
) -> dict[str, tuple[str, str, float]]:
    """Return of each file in a folder, by name: the verdict, the message and the seconds.

    The seconds that a file may take are those of a processor at its nominal pace.
    """
    root = str(Path(__file__).parents[1])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", READ, str(folder), str(math.ceil(seconds * pace())), str(most)],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path},
        capture_output=True, text=True, check=True, timeout=870,
    )  # fmt: skip
    answers: list[Any] = [json.loads(line) for line in done.stdout.splitlines()]
    return {name: (verdict, text, used) for name, verdict, text, used in answers}
