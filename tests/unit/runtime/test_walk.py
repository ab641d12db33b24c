"""A time grid through `solve` is read from top to bottom, and not by going from file to file."""

import itertools
import sys
from pathlib import Path
from types import FrameType

import numpy as np

import kincompile as kc

RUNTIME = Path(kc.__file__).parent / "runtime"

RETURNS = 8
"""How often the first call of a function may be in a file that was left before."""


def test_few_files_are_returned_to_on_the_way_through_a_grid(example_named):
    module, solve = example_named("four_bar").module, kc.solve  # its files are loaded here
    functions: dict[object, str] = {}

    def note(frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(RUNTIME)) and code.co_name[0] != "<":
            functions.setdefault(code, code.co_filename)

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        solve(module, np.linspace(0, 4, 1000))
    finally:
        sys.setprofile(before)
    stays = [file for file, _ in itertools.groupby(functions.values())]
    assert len(functions) > 50
    assert len(stays) - len(set(stays)) <= RETURNS
