import csv
import json
import math
import re

import numpy as np
import pytest

import kincompile as kc


def rows_of(path):
    """Return the rows by the names of their columns, without the units."""
    with path.open(encoding="utf-8", newline="") as file:
        titles, *rows = csv.reader(file)
    names = [title.partition(" [")[0] for title in titles]
    return [dict(zip(names, row, strict=True)) for row in rows]


def test_that_the_summary_is_data_where_no_file_is_written(kincompile, pendulum):
    done = kincompile("run", pendulum)
    assert (done.exit_code, done.stderr) == (0, "")
    lines = [line.split() for line in done.stdout.splitlines()]
    phi = next(line for line in lines if line and line[0] == "phi_bob")
    # phi = 0.5 + 2 t over t = 0 ... 2
    assert phi == ["phi_bob", "rad", "0.5", "0", "4.5", "2", "2", "0"]
    assert "5 points from t = 0 to 2: 5 CONVERGED" in done.stdout


def test_that_the_summary_is_a_message_where_a_file_is_written(kincompile, pendulum, tmp_path):
    done = kincompile("run", pendulum, "-o", tmp_path / "out.csv")
    assert (done.exit_code, done.stdout) == (0, "")
    assert "5 CONVERGED" in done.stderr
    assert done.stderr.endswith(f"Wrote {tmp_path / 'out.csv'}\n")


def test_that_the_numbers_in_the_csv_are_the_motion(kincompile, pendulum, tmp_path):
    kincompile("run", pendulum, "-o", tmp_path / "out.csv")
    rows = rows_of(tmp_path / "out.csv")
    t = np.array([float(row["t"]) for row in rows])
    np.testing.assert_array_equal(t, [0, 0.5, 1, 1.5, 2])
    angle = 0.5 + 2 * t
    columns = {"x_bob": np.cos(angle), "x_bob_dot": -2 * np.sin(angle), "phi_bob_dot": 2 + 0 * t}
    for name, expected in columns.items():
        found = [float(row[name]) for row in rows]
        np.testing.assert_allclose(found, expected, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("suffix", [".npz", ".json", ".CSV"])
def test_that_every_format_is_written(kincompile, pendulum, tmp_path, suffix):
    path = tmp_path / f"out{suffix}"
    assert kincompile("run", pendulum, "-o", path).exit_code == 0
    if suffix == ".npz":
        with np.load(path) as arrays:
            assert arrays["q"].shape == (5, 3)
    elif suffix == ".json":
        assert json.loads(path.read_text(encoding="utf-8"))["success"] is True
    else:
        assert len(rows_of(path)) == 5


def test_that_options_come_before_the_time_grid_of_the_model(kincompile, pendulum, tmp_path):
    kincompile("run", pendulum, "--end", "-1", "--points", "3", "-o", tmp_path / "out.csv")
    assert [row["t"] for row in rows_of(tmp_path / "out.csv")] == ["0.0", "-0.5", "-1.0"]


def test_that_one_point_is_the_time_zero(kincompile, pendulum):
    done = kincompile("run", pendulum, "--points", "1")
    assert (done.exit_code, "1 point from t = 0 to 0" in done.stdout) == (0, True)


def test_that_a_parameter_is_set_and_the_last_one_counts(kincompile, pendulum, tmp_path):
    settings = ("--set", "length=2", "--set", "length = 3e0")
    assert kincompile("run", pendulum, *settings, "-o", tmp_path / "out.csv").exit_code == 0
    row = rows_of(tmp_path / "out.csv")[0]
    assert float(row["x_bob"]) == pytest.approx(3 * np.cos(0.5))


def test_that_a_failed_run_writes_what_was_found_and_says_where_it_ended(
    kincompile, stopping, tmp_path
):
    done = kincompile("run", stopping, "-o", tmp_path / "out.csv")
    assert (done.exit_code, done.stdout) == (3, "")
    assert "Error: stops: Lock-up at t = 1: " in done.stderr
    assert "3 CONVERGED" in done.stderr
    assert "2 NOT_REACHED" in done.stderr
    rows = rows_of(tmp_path / "out.csv")
    assert [row["status"] for row in rows][:3] == ["0", "0", "0"]
    assert [row["x"] for row in rows][3:] == ["nan", "nan", "nan"]
    assert float(rows[1]["x"]) == pytest.approx(np.sqrt(0.6))


def test_that_the_summary_of_a_failed_run_is_still_data(kincompile, stopping):
    done = kincompile("run", stopping)
    assert done.exit_code == 3
    assert "3 CONVERGED" in done.stdout
    assert done.stderr.startswith("Error: stops: Lock-up at t = 1: ")


def test_that_a_run_without_any_position_has_a_summary(kincompile, tmp_path):
    (tmp_path / "model.py").write_text(
        "import kincompile as kc\n"
        "x = kc.Mechanism('nowhere').parameter('x')\n"
        "system = kc.ConstraintSystem('nowhere', [x], [x**2 + 1 + kc.t**2], guess=(1,))\n"
    )
    done = kincompile("run", tmp_path / "model.py", "-o", tmp_path / "out.json")
    assert done.exit_code == 3
    assert "100 NOT_REACHED, 1 NOT_ASSEMBLED" in done.stderr
    assert json.loads((tmp_path / "out.json").read_text())["q"] == [[None]] * 101


def test_that_a_result_replaces_an_existing_file_whole_or_not_at_all(
    kincompile, pendulum, tmp_path
):
    path = tmp_path / "out.csv"
    path.write_text("precious")
    assert kincompile("run", pendulum, "--set", "size=1", "-o", path).exit_code == 2
    assert path.read_text() == "precious"
    assert kincompile("run", pendulum, "-o", path).exit_code == 0
    assert len(rows_of(path)) == 5


@pytest.mark.parametrize("output", ["no/out.csv", "out.xlsx"])
def test_that_an_output_which_cannot_be_written_is_refused_before_the_work(
    kincompile, tmp_path, output
):
    (tmp_path / "model.py").write_text("raise AssertionError('too early')\n")
    done = kincompile("run", tmp_path / "model.py", "-o", tmp_path / output)
    assert done.exit_code == 2
    assert done.stderr.startswith("Error: cannot write ")


def test_that_the_motion_is_never_written_over_the_model(kincompile, pendulum, tmp_path):
    model = tmp_path / "model.json"
    model.write_text(kc.read_model(pendulum).to_json())
    text = model.read_text()
    done = kincompile("run", model, "-o", model)
    assert (done.exit_code, model.read_text()) == (2, text)
    assert done.stderr == f"Error: {model} is the model itself; give another name to write to\n"


def test_that_a_warning_is_a_message_without_a_line_of_code(process, pendulum):
    with pendulum.open("a") as file:
        file.write(
            'mechanism.add(kc.Revolute("pin2", bob, (-length, 0), mechanism.ground, (0, 0)))'
        )
    done = process("run", pendulum)
    assert done.returncode == 0
    assert done.stderr.startswith("Warning: 'pendulum' has redundant equations: ")
    assert "pin2" in done.stderr
    assert ".py" not in done.stderr


PARALLELOGRAM = """
import kincompile as kc

m = kc.Mechanism("parallelogram", end=6.0, points=61)
i, j = m.body("i", guess=(0, 0, 1)), m.body("j", guess=(0.5, 0.8, 0))
k = m.body("k", guess=(2, 0, 1))
m.add(kc.Revolute("A", m.ground, (0, 0), i, (0, 0)))
m.add(kc.Revolute("B", i, (1, 0), j, (0, 0)))
m.add(kc.Revolute("C", j, (2, 0), k, (1, 0)))
m.add(kc.Revolute("D", m.ground, (2, 0), k, (0, 0)))
m.add(kc.AbsoluteAngle("motor", i, 1 + kc.t))
"""


@pytest.mark.slow
def test_that_a_motion_goes_through_a_bifurcation_where_it_is_told_to(process, tmp_path):
    model, table, page = (tmp_path / name for name in ("model.py", "motion.csv", "page.html"))
    model.write_text(PARALLELOGRAM)
    stopped = process("run", model)
    assert stopped.returncode == 3
    assert "--through smooth, follows the smooth branch" in stopped.stderr
    for command, output in (("run", table), ("view", page)):
        done = process(command, model, "--through", "smooth", "-o", output)
        assert (done.returncode, output.exists()) == (0, True)
        assert "Warning: parallelogram goes through a bifurcation at t = 2.14159265" in done.stderr
    # Opposite sides stay parallel.
    for row in rows_of(table):
        assert float(row["phi_k"]) == pytest.approx(1 + float(row["t"]), abs=1e-9)


def test_that_a_sweep_says_why_each_variant_ended(kincompile, tmp_path):
    """A crank of four bars that can go round up to a length of 1.5, and not beyond."""
    path = tmp_path / "bars.toml"
    path.write_text(BARS)
    done = kincompile("run", path, "--sweep", "r=1.4:2.2:3")
    head, *rows = done.stdout.splitlines()
    assert head.split()[:5] == ["r", "[m]", "points", "found", "tip"]
    assert [row.split()[0] for row in rows] == ["1.4", "1.8", "2.2"]
    assert rows[0].split()[1:4] == ["41", "of", "41"]
    assert int(rows[2].split()[1]) < int(rows[1].split()[1]) < 41
    first, *reasons = done.stderr.splitlines()
    assert (done.exit_code, first) == (3, "Error: 2 of 3 variants ended before the last time.")
    assert [line.split(":")[0] for line in reasons] == ["r = 1.8 m", "r = 2.2 m"]
    assert all("Lock-up at t = " in line for line in reasons)


BARS = """
kincompile = 1
name = "bars"
analysis = { end = 1.0, points = 41 }
outputs = [{ name = "tip", expression = "y_B", unit = "m" }]
[sketch]
lengths = { r = 1.0 }
ground = { O = [0, 0], C = [4, 0] }
joints = { A = [1, 0], B = [4, 3] }
parts = [
    { link = "crank", joints = "O A", length = "r" },
    { link = "coupler", joints = "A B", length = 3.5 },
    { link = "rocker", joints = "C B", length = 2 },
    { drive = "crank", value = "2*pi*t" },
]
"""


def test_that_outputs_come_before_coordinates(kincompile, tmp_path):
    path = tmp_path / "bars.toml"
    path.write_text(BARS)
    done = kincompile("run", path, "--points", "5")
    titles = [line.split()[0] for line in done.stdout.splitlines() if line]
    assert [x for x in titles if x in ("output", "coordinate", "driver")] == [
        "output", "coordinate", "driver",
    ]  # fmt: skip


def test_that_a_message_has_degrees_where_they_are_asked_for(kincompile, tmp_path):
    path = tmp_path / "bars.toml"
    path.write_text(BARS)
    options = ("run", path, "--set", "r=1.8", "--points", "41")
    in_radians, in_degrees = kincompile(*options), kincompile(*options, "--deg")
    ranges = [
        re.search(r"it can be (\S+) (rad|deg) at least, (\S+) (rad|deg) at most", done.stderr)
        for done in (in_radians, in_degrees)
    ]
    (low, unit, high, _), (low_deg, unit_deg, high_deg, _) = (
        found.groups() for found in ranges if found
    )
    assert (unit, unit_deg) == ("rad", "deg")
    assert float(low_deg) == pytest.approx(math.degrees(float(low)), rel=1e-3)
    assert float(high_deg) == pytest.approx(math.degrees(float(high)), rel=1e-3)
    # The law of cosines: A is at its farthest from C when coupler and rocker are in line.
    at_most = math.acos((1.8**2 + 4**2 - 5.5**2) / (2 * 1.8 * 4))
    assert float(high) == pytest.approx(at_most, rel=1e-3)
    assert " rad" not in in_degrees.stderr


def test_that_a_name_with_another_ending_is_no_name_of_a_page(kincompile, tmp_path):
    path = tmp_path / "bars.toml"
    path.write_text(BARS)
    done = kincompile("view", path, "-o", tmp_path / "bars.png")
    assert (done.exit_code, done.stderr) == (
        2,
        f"Error: {tmp_path / 'bars.png'} is not the name of a page: end it in .html, or name a "
        "folder\n",
    )
    assert [item.name for item in tmp_path.iterdir()] == ["bars.toml"]


def test_that_a_failure_is_said_in_three_lines_and_its_residuals_on_request(kincompile, tmp_path):
    path = tmp_path / "bars.toml"
    path.write_text(BARS)
    said = kincompile("run", path, "--set", "r=1.8", "--deg").stderr
    what, limit, remedy = said.splitlines()
    assert what.startswith("Error: bars: Lock-up at t = ")
    assert re.fullmatch(
        r"  drive_crank is .* deg; it can be -139.9 deg at least, 139.9 deg at most .*", limit
    )
    assert remedy.startswith("  End the motion before this time")
    whole = kincompile("run", path, "--set", "r=1.8", "--deg", "-v").stderr
    assert whole.startswith(said.rstrip())
    assert "The equations with the largest residuals" in whole
    assert " rad" not in whole


FOUR_BAR = """
import kincompile as kc
s = kc.Sketch("four_bar", length_unit="mm", end=1.0, points=7)
s.ground(O=(0, 0), C=(100, 0))
s.joints(A=(44, 42), B=({B}))
s.link("crank", "O A", s.length("r", 50))
s.link("coupler", "A B", s.length("a", 125))
s.link("rocker", "C B", s.length("b", 125))
s.drive("crank", 2 * kc.pi * kc.t)
m = s.mechanism()
"""


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    "command", [("run",), ("run", "--sweep", "a=120:130:3"), ("view", "-o"), ("draw", "-o"),
                ("sweep", "--processes", "1", "--target", "numpy", "--sweep", "a=120:130:3")],
)  # fmt: skip
def test_that_a_start_on_another_branch_than_drawn_is_said_once(kincompile, tmp_path, command):
    """B is drawn left of the line from A to C; at t = 0 Newton's method ends right of it."""
    path = tmp_path / "four_bar.py"
    for place, count in (("174, -31", 1), ("120, 120", 0)):
        path.write_text(FOUR_BAR.replace("{B}", place))
        name, *options = command
        output = [tmp_path / ("a.html" if name == "view" else "a.svg")] * ("-o" in options)
        done = kincompile(name, path, *options, *output)
        said = "(B is drawn left of the line A C, and found right of it)"
        assert (done.exit_code, done.stderr.count(said)) == (0, count)
        assert done.stderr.count("Warning: The position at t = 0 is on another branch") == count


def test_that_paths_and_dwells_are_asked_for(kincompile, pendulum):
    """The bob's origin stands still; its angle rises by 2 rad/s to 4.5 rad."""
    done = kincompile("run", pendulum, "--dwell", "bob.phi=30", "--deg")
    assert done.exit_code == 0, done.stderr
    last = done.stdout.splitlines()[-2:]
    assert last[0].startswith("phi_bob is within 30 of 257.831 deg for 0.261799 s, from t = 1.7382")
    assert last[1].startswith("phi_bob is within 30 of 28.6479 deg for 0.261799 s, from t = 0 to")
    done = kincompile("run", pendulum, "--straight", "bob=0.5:1", "--circle", "bob")
    straight, circle = done.stdout.splitlines()[-2:]
    assert straight.startswith("bob keeps within ")
    assert "of the line through" in straight
    assert "from t = 0.5 to 1;" in straight
    assert "of the circle of radius" in circle


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        ("--straight", "bob=0.5", "give it as P=FROM:TO"),
        ("--dwell", "bob.phi", "give it as NAME=TOL"),
        ("--circle", "leg", "leg"),
    ],
)
def test_what_cannot_be_asked_for(kincompile, pendulum, option, text, words):
    done = kincompile("run", pendulum, option, text)
    assert done.exit_code != 0
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_that_no_zero_has_a_sign(kincompile, tmp_path):
    path, out = tmp_path / "four_bar.py", tmp_path / "out.csv"
    path.write_text(FOUR_BAR.replace("{B}", "120, 120"))
    assert kincompile("run", path, "-o", out).exit_code == 0
    solution = kc.solve(kc.compile(kc.read_model(path)), np.linspace(0, 1, 7))
    zeros = solution.q_dot[solution.q_dot == 0]
    assert np.signbit(zeros).any()
    assert "-0.0" not in re.split(r"[,\n]", out.read_text())
    assert [float(row["phi_rocker"]) for row in rows_of(out)] == solution["phi_rocker"].tolist()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "Joint motor leaves its limit of 2 rad at t = 1; it is 4.5 rad at t = 2."),
        (
            ["--deg"],
            "Joint motor leaves its limit of 114.6 deg at t = 1; it is 257.8 deg at t = 2.",
        ),
    ],
    ids=["rad", "deg"],
)
@pytest.mark.filterwarnings("always")
def test_that_a_warning_has_the_unit_of_angles_that_is_asked_for(
    kincompile, pendulum, options, said
):
    limit = 'mechanism.limit("motor", greatest=2)\n'
    pendulum.write_text(pendulum.read_text("utf-8") + limit, encoding="utf-8")
    done = kincompile("run", pendulum, *options)
    assert f"Warning: pendulum: {said}\n" in done.stderr
