"""A motion as an animation: by matplotlib to be shown, or written as GIF or MP4; or as SVG."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError, UnsupportedError, package_of_extra
from kincompile.names import listed
from kincompile.runtime.results.columns import TIME_UNIT
from kincompile.view.drawing import drawing
from kincompile.view.mechanism_plot import axes_of, draw, write_names
from kincompile.view.svg import Timing, as_svg
from kincompile.view.traces import described, moving_system, traced_places
from kincompile.view.worlds import in_view
from kincompile.writing import require_writable, write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping

    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import FramePoint

WRITERS: Mapping[str, str] = {".gif": "pillow", ".mp4": "ffmpeg"}
"""Matplotlib's writer for each kind of file."""

GLB = ".glb"
"""Ending of glTF in one binary file."""

FRAMES_IN_SPACE = 60
"""Frames of an SVG in space, about: it has all paths of each, a megabyte together."""

SVG = ".svg"
"""Ending of what is written without matplotlib."""

WHAT = "an animation shows"
"""For messages."""

FRAME_RATE = 25
"""Largest number of frames a second."""

TICK = 10
"""Unit in which GIF counts the time of a frame [ms]."""

SHORTEST, LONGEST = 2.0, 20.0
"""Limits of the playing time, which otherwise is that of the motion [s]."""


def animate(
    solution: Solution,
    path: str | os.PathLike[str] | None = None,
    *,
    model: Mechanism | ConstraintSystem | None = None,
    seconds: float | None = None,
    trace: Iterable[str] | None = None,
) -> FuncAnimation | Path:
    """Animate a motion.

    Parameters
    ----------
    solution
        The motion of one set of parameters. Points without a solution are left out.
    path : path-like, optional
        File to write, whole or not at all: ``.svg``, which moves in a browser and needs no
        matplotlib, ``.gif``, or ``.mp4``, which needs ffmpeg; of a motion in space ``.glb``, which
        programs for 3-D open (glTF 2.0 with a keyframe at each point).
    model
        The mechanism; needed only for a solution of a module that was loaded from a file.
    seconds
        Playing time; without, that of the motion, but at least 2 s and at most 20 s. A ``.glb`` has
        the times of the motion.
    trace
        Names of points, bodies and constraints: points, origins and places that leave a line.
        Without, the points of the model do.

    Returns
    -------
    matplotlib.animation.FuncAnimation or pathlib.Path
        The animation, to be kept as long as it plays (in a notebook, by
        ``IPython.display.HTML(animation.to_jshtml())``); with `path`, the file written.

    Raises
    ------
    InputError
        If there is nothing to show, or the file cannot be written.
    UnsupportedError
        If matplotlib, or for MP4 ffmpeg, is not installed.
    """
    if path is not None and Path(path).suffix.lower() in (SVG, GLB):
        return _written_alone(solution, Path(path), model, seconds, trace)
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import animation
        from matplotlib import pyplot as plt
    if path is not None:
        _require_writer(Path(path), animation.writers.is_available)
    system = moving_system(solution, model, WHAT)
    rows, interval = frame_rows(solution, seconds)
    drawn = drawing(system, solution.parameters, solution.q[solution.good])
    traced = traced_places(drawn, trace)
    figure = plt.figure(layout="constrained")
    ax = axes_of(figure, drawn)
    show = _first_frame(ax, system, drawn, solution, rows, traced)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # one layout serves all frames
    # Half a millisecond more, as the writer of GIF rounds down.
    moving = animation.FuncAnimation(figure, show, frames=len(rows), interval=interval + 0.5)
    if path is None:
        return moving
    try:
        return _written(moving, Path(path))
    finally:
        plt.close(figure)


def _first_frame(
    ax: Axes,
    system: ConstraintSystem,
    drawn: Drawing,
    solution: Solution,
    rows: NDArray[np.intp],
    traced: Iterable[FramePoint],
) -> Callable[[int], None]:
    """Draw the first frame, and return what shows another one."""
    positions = solution.q[solution.good]
    move = draw(ax, system, drawn, positions)
    for point in traced:
        ax.plot(*point.at(positions).T, color="0.5", linewidth=1, zorder=1)
    named = write_names(ax, drawn, {dot.name: dot.place for dot in drawn.dots}, positions)
    captions = _captions(solution, rows)

    def show(frame: int) -> None:
        move(solution.q[rows[frame]])
        named(solution.q[rows[frame]])
        ax.set_title(captions[frame], loc="left")

    show(0)
    return show


def frame_rows(solution: Solution, seconds: float | None) -> tuple[NDArray[np.intp], int]:
    """Return the points that are shown: those nearest to equally spaced times.

    Returns
    -------
    rows : ndarray of int
        Indices of points with a solution, one a frame.
    interval : int
        Time from frame to frame [ms], a multiple of `TICK`.
    """
    good = np.flatnonzero(solution.good)
    t = solution.t[good]
    length = _playing_time(t, seconds)
    count = max(min(good.size, round(length * FRAME_RATE)), 1)
    interval = max(round(1000 * length / count / TICK) * TICK, TICK)
    shown = [int(np.abs(t - time).argmin()) for time in np.linspace(t[0], t[-1], count)]
    return good[shown], interval


def _playing_time(t: NDArray[np.float64], seconds: float | None) -> float:
    """Return how long an animation of these times lasts [s]."""
    duration = abs(float(t[-1] - t[0]))
    length = min(max(duration, SHORTEST), LONGEST) if seconds is None else float(seconds)
    if not (math.isfinite(length) and length > 0):
        raise InputError(f"seconds is {seconds!r}: give the length of the animation, above 0.")
    return length


def _written_alone(
    solution: Solution,
    path: Path,
    model: Mechanism | ConstraintSystem | None,
    seconds: float | None,
    trace: Iterable[str] | None,
) -> Path:
    """Write a motion to a file that needs no matplotlib."""
    require_writable(path)
    system = moving_system(solution, model, WHAT)
    shapes = drawing(system, solution.parameters, solution.q[solution.good])
    places = traced_places(shapes, trace)
    if path.suffix.lower() == SVG:
        return write_atomically(path, _svg_of(solution, shapes, places, seconds))
    if not shapes.is_spatial:
        raise InputError(
            f"cannot write {path}: {solution.name} moves in a plane, and {GLB} is for motions in "
            f"space; end its name in {listed((SVG, *WRITERS))}"
        )
    return write_atomically(path, _glb_of(solution, shapes, places, seconds, system.length_unit))


def _svg_of(
    solution: Solution, shapes: Drawing, places: Iterable[FramePoint], seconds: float | None
) -> str:
    """Return a motion as SVG; of one in the plane browsers draw what is between its frames."""
    q, t = solution.q[solution.good], solution.t[solution.good]
    length = _playing_time(t, seconds)
    most = length * FRAME_RATE
    if shapes.is_spatial:
        most = min(most, FRAMES_IN_SPACE)
    step = max(1, round(t.size / most))
    rows = np.append(np.arange(0, t.size - 1, step), t.size - 1)
    timing = Timing(length, (t[rows] - t[0]) / ((t[-1] - t[0]) or 1.0))
    description = described(shapes, f"in motion from t = {t[0]:g} to {t[-1]:g} {TIME_UNIT}")
    paths = [place.at(solution.q) for place in places]
    return as_svg(shapes, q[rows], description, paths=paths, timing=timing)


def _glb_of(
    solution: Solution,
    shapes: Drawing,
    places: Iterable[FramePoint],
    seconds: float | None,
    length_unit: str,
) -> bytes:
    """Return a motion in space as glTF, with a keyframe at each point that was found."""
    q, t = solution.q[solution.good], solution.t[solution.good]
    elapsed = np.abs(t - t[0])
    if seconds is not None and t.size > 1:
        elapsed *= _playing_time(t, seconds) / elapsed[-1]
    paths = [place.at(q) for place in places]
    file: bytes = in_view("gltf").as_glb(shapes, elapsed, q, length_unit, paths)
    return file


def _require_writer(path: Path, is_available: Callable[[str], bool]) -> None:
    """Check that the file can be written, before the frames are drawn."""
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        known = ", ".join((*WRITERS, GLB))
        raise InputError(f"cannot write {path}: end its name in {known} or {SVG}.")
    if not is_available(writer):
        raise UnsupportedError(
            f"cannot write {path}: {writer} is not installed. Install it (apt-get install ffmpeg, "
            "brew install ffmpeg, or from ffmpeg.org), or write a .gif, which needs nothing more."
        )
    require_writable(path)


def _captions(solution: Solution, rows: NDArray[np.intp]) -> list[str]:
    """Return the caption of each frame; points without a solution are counted in it."""
    duration = float(np.ptp(solution.t)) or 1.0
    digits = max(0, 2 - math.floor(math.log10(duration)))
    failed = np.count_nonzero(solution.status)
    gaps = f"   ({failed} of {solution.t.size} points have no solution)" if failed else ""
    return [f"{solution.name}   t = {t:.{digits}f} {TIME_UNIT}{gaps}" for t in solution.t[rows]]


def _written(moving: FuncAnimation, path: Path) -> Path:
    """Write all frames to a temporary file, and move that to its path."""
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder, f"animation{path.suffix.lower()}")
        moving.save(draft, writer=WRITERS[draft.suffix])
        return write_atomically(path, draft.read_bytes())
