import pytest

import kincompile as kc


@pytest.mark.parametrize("name", ["page.html", "page.htm"])
def test_that_a_page_is_written(kincompile, pendulum, tmp_path, name):
    done = kincompile("view", pendulum, "-o", tmp_path / name)
    assert (done.exit_code, done.stdout) == (0, "")
    assert done.stderr == f"Wrote {tmp_path / name}\n"
    html = (tmp_path / name).read_text(encoding="utf-8")
    assert html.startswith("<!DOCTYPE html>")
    assert "<title>pendulum</title>" in html


def test_that_options_choose_times_and_parameters(kincompile, pendulum, tmp_path):
    page = tmp_path / "page.html"
    options = ("--end", 1, "--points", 3, "--set", "length=2")
    assert kincompile("view", pendulum, "-o", page, *options).exit_code == 0
    html = page.read_text(encoding="utf-8")
    assert '"status":[0,0,0]' in html
    assert '{"name":"length","value":2.0,"unit":"m",' in html


def test_that_a_page_opens_in_degrees(kincompile, pendulum, tmp_path):
    for option, unit in (((), "rad"), (("--deg",), "deg")):
        page = tmp_path / f"{unit}.html"
        assert kincompile("view", pendulum, "-o", page, *option).exit_code == 0
        assert f'"angleUnit":"{unit}"' in page.read_text(encoding="utf-8")
    with pytest.raises(kc.InputError, match="angle_unit is 'gon': angles are shown in 'rad' or"):
        kc.page(kc.read_model(pendulum), angle_unit="gon")


def test_that_several_models_go_into_a_folder_with_an_index(
    kincompile, pendulum, stopping, tmp_path
):
    folder = tmp_path / "gallery"
    done = kincompile("view", pendulum, stopping, "-o", folder)
    assert sorted(path.name for path in folder.iterdir()) == [
        "index.html", "pendulum.html", "stops.html",
    ]  # fmt: skip
    assert done.exit_code == 3  # the second stops
    assert "Error: stops: Lock-up at t = " in done.stderr


def test_that_a_motion_that_stops_is_shown_as_far_as_it_goes(kincompile, stopping, tmp_path):
    done = kincompile("view", stopping, "-o", tmp_path / "page.html")
    assert done.exit_code == 3
    assert "Wrote" in done.stderr
    assert '"status":[0,0,' in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_that_a_mechanism_that_cannot_be_compiled_has_a_page_of_its_guess(kincompile, tmp_path):
    model = tmp_path / "free.py"
    model.write_text(
        "import kincompile as kc\n"
        'm = kc.Mechanism("free")\n'
        'm.add(kc.Revolute("pin", m.body("bob"), (-1, 0), m.ground, (0, 0)))\n'
    )
    done = kincompile("view", model, "-o", tmp_path / "page.html")
    assert done.exit_code == 3
    assert "1 more equation is needed" in done.stderr
    assert (tmp_path / "page.html").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("{model}",), "Missing option '-o'"),
        (("-o", "page.html"), "Missing argument 'MODEL...'"),
        (("{model}", "{model}", "-o", "page.html"), "2 pages do not go into one file"),
        (("{model}", "{model}", "-o", "{folder}"), "two pages would be written to pendulum.html"),
        (("{model}", "-o", "no/such/page.html"), "the folder no/such does not exist"),
        (("{model}", "-o", "{folder}", "--set", "lenght=2"), "did you mean 'length'"),
        (("{model}", "-o", "{folder}", "--end", "nan"), "give a finite time"),
    ],
)
def test_that_wrong_usage_is_told(kincompile, pendulum, tmp_path, arguments, message):
    names = {"model": pendulum, "folder": tmp_path / "folder"}
    done = kincompile("view", *(part.format(**names) for part in arguments))
    assert done.exit_code == 2
    assert message in done.stderr
    assert not (tmp_path / "folder").exists()


def test_that_a_page_is_not_written_under_the_name_of_something_else(pendulum, tmp_path):
    page = kc.page(kc.read_model(pendulum))
    with pytest.raises(kc.InputError, match=r"cannot write .*page\.png: end its name in \.html"):
        page.write(tmp_path / "page.png")
    assert not (tmp_path / "page.png").exists()


FREE = (
    "import kincompile as kc\n"
    'm = kc.Mechanism("free")\n'
    'bob = m.body("bob", guess=(1, 0, 0.5))\n'
    'm.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))\n'
)


def test_that_a_transmission_has_a_page_without_a_driver(kincompile, tmp_path):
    model, page = tmp_path / "free.py", tmp_path / "page.html"
    model.write_text(FREE)
    done = kincompile("view", model, "--transmission", "bob.phi:bob.x,bob.y", "-o", page)
    assert (done.exit_code, done.stderr) == (0, f"Wrote {page}\n")
    html = page.read_text(encoding="utf-8")
    assert '"inputs":[{"name":"phi_bob","unit":"rad"}]' in html
    assert '"outputs":[{"name":"x_bob","unit":"m"},{"name":"y_bob","unit":"m"}]' in html
    assert "const free_transmission = " in html
    done = kincompile("view", model, "--transmission", "bob.phi:bob.z", "-o", page)
    assert done.exit_code == 2
    assert "free has no coordinate, output or point 'bob.z'" in done.stderr
    done = kincompile("view", model, "--transmission", "bob.phi", "-o", page)
    assert "--transmission bob.phi is not of the form INPUTS:OUTPUTS" in done.stderr


def test_that_the_table_of_a_file_names_the_transmission_of_its_page(kincompile, tmp_path):
    model, page = tmp_path / "free.toml", tmp_path / "page.html"
    scope: dict[str, kc.Mechanism] = {}
    exec(FREE, scope)
    table = '\n[transmission]\ninputs = ["bob.phi"]\noutputs = ["bob.x"]\n'
    model.write_text(scope["m"].to_toml() + table)
    assert kincompile("view", model, "-o", page).exit_code == 0
    assert '"outputs":[{"name":"x_bob","unit":"m"}]' in page.read_text(encoding="utf-8")
    given = ("--transmission", "bob.phi:bob.y")
    assert kincompile("view", model, *given, "-o", page).exit_code == 0
    assert '"outputs":[{"name":"y_bob","unit":"m"}]' in page.read_text(encoding="utf-8")


def test_that_watching_passes_the_options_of_its_call_on(kincompile, pendulum, monkeypatch):
    given = []
    monkeypatch.setattr("kincompile.cli.view.follow", lambda *call: given.append(call))
    options = ("--set", "length=2", "--set", "omega=3", "--transmission", "a, b:c", "--deg")
    assert kincompile("view", pendulum, "--watch", *options).exit_code == 0
    assert kincompile("view", pendulum, "--watch").exit_code == 0
    (model, passed), (_, usual) = given
    assert model == str(pendulum)
    own = {"--deg", "--set=length=2", "--set=omega=3", "--transmission=a,b:c"}
    assert set(passed) - set(usual) == own
