"""A time grid through `solve` is read from top to bottom, and not by going from file to file."""

import sys
from pathlib import Path
from types import FrameType

import numpy as np

import kincompile as kc

PACKAGE = str(Path(kc.__file__).parent)

RETURNS = 27
"""How often control may come back to a file that it has been in, by a call or a return: each way
from one file to another counts once. That is measured. Twelve files need eleven, from each back
to its caller; the others are files that several ask, such as scales and linear systems."""


def file_of(frame: FrameType | None) -> str | None:
    """Return the file of the package that a frame, or the nearest one that called it, is in."""
    while frame is not None and not frame.f_code.co_filename.startswith(PACKAGE):
        frame = frame.f_back
    return frame.f_code.co_filename if frame else None


def test_few_files_are_returned_to_on_the_way_through_a_grid(example_named):
    module, solve, t = example_named("four_bar").module, kc.solve, np.linspace(0, 4, 1000)
    moves: dict[tuple[str, str], None] = {}  # in their order
    here = ""

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal here
        if event not in {"call", "return"} or not frame.f_code.co_filename.startswith(PACKAGE):
            return
        there = file_of(frame if event == "call" else frame.f_back)
        if there is not None and there != here:
            moves.setdefault((here, there))
            here = there

    solve(module, t)  # what is done once a module is not on the way
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        solve(module, t + 0.1)  # from another start than the one that the module keeps
    finally:
        sys.setprofile(before)
    stays = [there for _, there in moves]
    assert len(set(stays)) > 11
    walk = " > ".join(Path(file).stem for file in stays)
    assert len(stays) - len(set(stays)) <= RETURNS, walk
