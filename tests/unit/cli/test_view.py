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
    assert "Error: stops failed at t = " in done.stderr


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
