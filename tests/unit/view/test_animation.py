"""`kc.animate`: frames are positions of the solution, at the right tempo, in a whole file."""

import dataclasses
import stat
import sys
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.view.animation import frame_rows
from kincompile.view.shapes import HUES

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.animation import AbstractMovieWriter, PillowWriter
from matplotlib.colors import to_rgba
from PIL import Image, ImageSequence

BODY = HUES["light"]
"""Colours of bodies, those of the page."""


@pytest.fixture(scope="module")
def arm():
    """A bar of 2 m about its end, turned by t^2."""
    m = kc.Mechanism("arm")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t**2))
    return m


@pytest.fixture(scope="module")
def motion(arm):
    return kc.solve(kc.compile(arm), np.linspace(0, 1, 5))


@pytest.fixture(scope="module")
def stops():
    """A bar whose end is pulled along x beyond its reach, from t = 1 on."""
    m = kc.Mechanism("stops")
    bar = m.body("bar", guess=(0.5, 0.8, 1))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteX("pull", bar, (1, 0), 1 + kc.t))
    return kc.solve(kc.compile(m), np.linspace(0, 2, 21))


class Recorder(AbstractMovieWriter):
    """Keeps what the axes show at each frame, instead of writing it."""

    def __init__(self):
        super().__init__()
        self.bars, self.titles = [], []

    def setup(self, fig, outfile, dpi=None):
        self.fig = fig

    def grab_frame(self, **savefig_kwargs):
        (ax,) = self.fig.axes
        bar: Any
        bar, *_ = [area for area in ax.patches if to_rgba(BODY[0])[:3] == area.get_facecolor()[:3]]
        self.bars.append(bar.get_xy()[:-1])
        self.titles.append(ax.get_title(loc="left"))

    def finish(self):
        """Nothing was begun."""


def recorded(animation):
    recorder = Recorder()
    animation.save("unused", writer=recorder)
    return recorder


def test_that_a_frame_is_a_position_of_the_solution(motion):
    shown = recorded(kc.animate(motion))
    assert shown.titles == [f"arm   t = {t:.2f} s" for t in motion.t]
    tips = np.stack((np.cos(motion.t**2), np.sin(motion.t**2)), axis=-1)
    for bar, tip in zip(shown.bars, tips, strict=True):
        np.testing.assert_allclose(bar.mean(axis=0), np.array(tip) / 2, atol=1e-9)
        along = np.array(tip) / np.hypot(*tip)
        across = (bar @ (-along[1], along[0])).max()
        np.testing.assert_allclose((bar @ along).max(), np.hypot(*tip) + across, rtol=1e-2)


def test_that_a_gif_has_every_frame_at_the_tempo_of_the_motion(motion, tmp_path):
    path = kc.animate(
        motion, tmp_path / "arm.gif", seconds=0.3
    )  # 60 ms, which the writer would round to 59
    assert path == tmp_path / "arm.gif"
    with Image.open(path) as gif:
        assert len(list(ImageSequence.Iterator(gif))) == 5
        assert gif.info["duration"] == 60
    assert [item.name for item in tmp_path.iterdir()] == ["arm.gif"]


def test_that_the_pixels_of_a_gif_show_the_bar(motion, tmp_path):
    """Level at first, and 1 rad at last: where the bar was there is background."""
    with Image.open(kc.animate(motion, tmp_path / "arm.gif")) as gif:
        frames = []
        for k in (0, 4):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB"), dtype=int))
    blue = [frame[..., 2] - frame[..., 0] > 80 for frame in frames]
    height = [np.ptp(np.nonzero(pixels)[0]) for pixels in blue]
    # Level it is as high as it is wide, two sizes: a twenty-fifth of the diagonal.
    assert height[0] < 30 < 100 < height[1]


@pytest.mark.parametrize(
    ("points", "duration", "seconds", "frames", "interval"),
    [
        (161, 8.0, None, 161, 50),
        (1001, 5.0, None, 125, 40),
        (11, 0.001, None, 11, 180),
        (5001, 3600.0, None, 500, 40),
        (101, 1.0, 3.0, 75, 40),
    ],
)
def test_the_tempo(arm, points, duration, seconds, frames, interval):
    solution = kc.solve(kc.compile(arm), np.linspace(0, duration, points) / max(duration, 1))
    slower = dataclasses.replace(solution, t=np.linspace(0, duration, points))
    rows, found = frame_rows(slower, seconds)
    assert (len(rows), found) == (frames, interval)
    assert (rows[0], rows[-1]) == (0, points - 1)
    assert np.ptp(np.diff(rows)) <= 1


def test_that_frames_are_equally_spaced_in_time_whatever_the_grid(arm):
    t = np.concatenate((np.linspace(0, 0.1, 100), np.linspace(0.2, 1, 5)))
    rows, _ = frame_rows(kc.solve(kc.compile(arm), t), 0.4)
    np.testing.assert_allclose(t[rows], np.linspace(0, 1, 10), atol=0.1)


def test_that_frames_are_of_good_points_wherever_the_others_are(motion):
    status = np.array([int(kc.Status.SINGULAR), 0, int(kc.Status.SINGULAR), 0, 0])
    rows, _ = frame_rows(dataclasses.replace(motion, status=status), None)
    assert rows.tolist() == [1, 3, 4]


def test_that_failed_points_are_left_out_and_counted(stops):
    assert not stops.success
    titles = recorded(kc.animate(stops)).titles
    good = np.count_nonzero(stops.status == 0)
    assert len(titles) == good < 21
    assert titles[0].endswith(f"({21 - good} of 21 points have no solution)")


def test_that_a_trace_is_the_path_of_a_point(motion):
    animation = kc.animate(motion, trace=["bar"])
    path = plt.gca().lines[-1]
    np.testing.assert_array_equal(path.get_xdata(), motion["x_bar"])
    np.testing.assert_array_equal(path.get_ydata(), motion["y_bar"])
    recorded(animation)


def test_that_mp4_goes_through_ffmpeg(motion, tmp_path, monkeypatch):
    """A stand-in for ffmpeg: copies the raw frames that it is given to the file it must write."""
    stand_in = tmp_path / "ffmpeg"
    stand_in.write_text('#!/bin/sh\nfor word do last="$word"; done\ncat > "$last"\n')
    stand_in.chmod(stand_in.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", str(stand_in))
    path = kc.animate(motion, tmp_path / "arm.mp4")
    assert path.stat().st_size == 5 * 640 * 480 * 4


def test_that_missing_ffmpeg_says_what_to_install(motion, tmp_path, monkeypatch):
    monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", "/nowhere/ffmpeg")
    with pytest.raises(kc.UnsupportedError, match=r"ffmpeg is not installed.*apt-get.*\.gif"):
        kc.animate(motion, tmp_path / "arm.mp4")
    assert list(tmp_path.iterdir()) == []


def test_that_a_writer_that_fails_leaves_the_old_file(motion, tmp_path, monkeypatch):
    path = tmp_path / "arm.gif"
    path.write_text("old")

    def fail(self):
        raise OSError("disk full")

    monkeypatch.setattr(PillowWriter, "finish", fail)
    with pytest.raises(OSError, match="disk full"):
        kc.animate(motion, path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["arm.gif"]


def test_that_another_suffix_or_folder_is_refused(motion, tmp_path):
    with pytest.raises(
        kc.InputError, match=r"arm\.avi: end its name in \.gif, \.mp4, \.glb or \.svg"
    ):
        kc.animate(motion, "arm.avi")
    with pytest.raises(kc.InputError, match=r"the folder .* does not exist"):
        kc.animate(motion, tmp_path / "nowhere" / "arm.gif")


def test_that_a_loaded_module_needs_the_model(arm, tmp_path):
    kc.emit(arm).write(tmp_path)
    (path,) = tmp_path.glob("*.py")
    solution = kc.solve(kc.load(path), [0.0, 0.5])
    with pytest.raises(kc.InputError, match=r"loaded from a file.*model=m"):
        kc.animate(solution)
    kc.animate(solution, tmp_path / "arm.gif", model=arm)


def test_that_another_model_is_refused(motion, example_named):
    with pytest.raises(kc.InputError, match="four_bar is not the model of this solution of arm"):
        kc.animate(motion, model=example_named("four_bar").model)


def test_that_what_cannot_be_shown_is_refused(arm, motion, example_named):
    plt.close("all")  # of other tests
    module = kc.compile(arm)
    nothing = kc.solve(example_named("problem_3_5_6").module, [0.0, 0.1])
    with pytest.raises(kc.InputError, match="has no bodies"):
        kc.animate(nothing)
    variants = kc.solve(module, [0.0, 0.1], np.zeros((2, 1, 0)))
    with pytest.raises(kc.InputError, match="these are 2 variants"):
        kc.animate(variants)
    with pytest.raises(kc.InputError, match=r"seconds is -1.*above 0"):
        kc.animate(motion, seconds=-1)
    with pytest.raises(kc.InputError, match=r"nothing called 'baar' .* mean 'bar'\?"):
        kc.animate(motion, trace=["baar"])
    assert plt.get_fignums() == []


def test_that_a_motion_without_a_position_says_why(example_named):
    m = kc.Mechanism("apart")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteX("far", bar, (1, 0), 5 + kc.t))
    solution = kc.solve(kc.compile(m), [0.0, 1.0])
    with pytest.raises(kc.InputError, match=r"apart has no position.*apart failed at t = 0"):
        kc.animate(solution)


def test_that_missing_matplotlib_is_named(motion, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(kc.UnsupportedError, match=r"matplotlib is not .*'\.\[plot\]'"):
        kc.animate(motion)
