"""`kincompile draw`: the ending of a file decides what is drawn, `--time` which time."""

from xml.etree import ElementTree as ET

import pytest

MOTION = "{http://www.w3.org/2000/svg}animateTransform"


def described(path):
    """Return what an SVG says is in it, and whether it moves."""
    root = ET.parse(path).getroot()
    (text,) = [item.text for item in root if item.get("id") == "description"]
    return text, next(root.iter(MOTION), None) is not None


def test_that_a_motion_is_drawn_and_one_time_of_it(kincompile, pendulum, tmp_path):
    picture = tmp_path / "a.svg"
    done = kincompile("draw", pendulum, "-o", picture)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", f"Wrote {picture}\n")
    words = "1 body, bob; constraints pin, motor."
    assert described(picture) == (f"pendulum in motion from t = 0 to 2 s: {words}", True)
    # 0.7 is none of the five times from 0 to 2
    assert kincompile("draw", pendulum, "-o", picture, "--time", "0.7").exit_code == 0
    assert described(picture) == (f"pendulum at t = 0.7 s: {words}", False)


def test_that_a_time_of_a_motion_backwards_is_drawn(kincompile, pendulum, tmp_path):
    picture = tmp_path / "a.svg"
    options = ("--start", "2", "--end", "-1", "--time", "0.7")
    done = kincompile("draw", pendulum, "-o", picture, *options)
    assert done.exit_code == 0, done.stderr
    assert "at t = 0.7 s" in described(picture)[0]


def test_that_parameters_times_and_the_trace_are_as_told(kincompile, pendulum, tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = tmp_path / "a.dxf"
    options = ("--set", "length=2", "--end", "1", "--points", "11", "--trace", "bob")
    assert kincompile("draw", pendulum, "-o", drawing, *options).exit_code == 0
    (path,) = ezdxf.readfile(drawing).modelspace().query('LWPOLYLINE[layer=="paths"]')
    assert len(path) == 11
    assert all(abs(x * x + y * y - 4) < 1e-12 for x, y in path.get_points("xy"))


def test_that_an_animation_is_written_as_matplotlib_does(kincompile, pendulum, tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    options = ("--end", "0.1", "--points", "2")
    assert kincompile("draw", pendulum, "-o", tmp_path / "a.gif", *options).exit_code == 0
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF89a")


STOPS = """
import kincompile as kc

m = kc.Mechanism("stops", end=2.0, points=21)
bar = m.body("bar", guess=(0.5, 0.8, 1))
m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
m.add(kc.AbsoluteX("pull", bar, (1, 0), 1 + kc.t))
"""


def test_that_what_was_found_is_drawn(kincompile, tmp_path):
    model, picture = tmp_path / "stops.py", tmp_path / "a.svg"
    model.write_text(STOPS, encoding="utf-8")
    done = kincompile("draw", model, "-o", picture)
    assert (done.exit_code, "Error: stops: Lock-up at t = 1" in done.stderr) == (3, True)
    assert "in motion from t = 0 to 0.9 s" in described(picture)[0]
    assert kincompile("draw", model, "-o", picture, "--time", "0.5").exit_code == 3
    assert "at t = 0.5 s" in described(picture)[0]
    picture.unlink()
    done = kincompile("draw", model, "-o", picture, "--time", "1.5")
    assert (done.exit_code, picture.exists()) == (3, False)
    assert "Error: stops: Lock-up at t = " in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("{pendulum}", "-o", "a.png"),
            "cannot write a.png: end its name in .dxf, .gif, .glb, .mp4 or",
        ),
        (("{pendulum}", "-o", "{folder}"), "end its name in .dxf, .gif, .glb, .mp4 or .svg"),
        (("{pendulum}", "-o", "{folder}/d.svg"), "it is a folder. Give the name of a file in it."),
        (("{pendulum}", "-o", "no/a.svg"), "the folder no does not exist"),
        (("{pendulum}", "-o", "a.gif", "--time", "1"), "a.gif of one time: end its name in .svg"),
        (("{pendulum}", "-o", "a.svg", "--time", "3"), "the motion goes from t = 0 to 2; give a"),
        (("{pendulum}", "-o", "a.svg", "--time", "nan"), "the motion goes from t = 0 to 2; give a"),
        (("{pendulum}", "-o", "a.svg", "--trace", "bib"), "nothing called 'bib' to trace; did you"),
        (("{pendulum}", "-o", "a.svg", "--set", "lenght=2"), "did you mean 'length'"),
        (("{pendulum}", "-o", "a.svg", "--true-size"), "--true-size is for an .svg of one time"),
        (("{stopping}", "-o", "a.svg", "--end", "1"), "stops has no bodies, so there is nothing"),
        (("{pendulum}",), "Missing option '-o'"),
        (("{folder}", "-o", "a.svg"), "folder"),
    ],
)
def test_that_wrong_usage_is_told(
    kincompile, pendulum, stopping, tmp_path, monkeypatch, arguments, message
):
    folder = tmp_path / "folder"
    (folder / "d.svg").mkdir(parents=True)
    monkeypatch.chdir(folder)
    names = {"pendulum": pendulum, "stopping": stopping, "folder": folder}
    done = kincompile("draw", *(part.format(**names) for part in arguments))
    assert (done.exit_code, message in done.stderr) == (2, True), done.stderr
    assert [path.name for path in folder.iterdir()] == ["d.svg"]
