"""`kc.page` and `kc.gallery`: what the page is given, its size, what it is made of."""

import base64
import dataclasses
import json
import pickle
import re

import numpy as np
import pytest

import kincompile as kc
from kincompile import compiler
from kincompile.report.templates import template_root
from kincompile.view.editor import MODULES
from kincompile.view.modules import WORLDS, modules_of
from kincompile.view.page import STYLES


def data_of(html):
    """Return the data inside a page, its arrays as numbers."""
    (text,) = re.findall(
        r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL
    )
    data = json.loads(text)
    numbers = {
        name: np.frombuffer(base64.b64decode(array), dtype="<f8")
        for name, array in data["arrays"].items()
    }
    return data, numbers


def pendulum(name="pendulum", driver=kc.t, **grid):
    m = kc.Mechanism(name, **{"end": 2.0, "points": 5, **grid})
    length = m.parameter("length", 1.0, unit="m")
    bob = m.body("bob", guess=(1, 0, 0.5))
    m.add(kc.Revolute("pin", bob, (-length, 0), m.ground, (0, 0)))
    if driver is not None:
        m.add(kc.AbsoluteAngle("motor", bob, driver))
    return m


@pytest.mark.every(5)
def test_that_a_page_has_the_numbers_of_the_solution(example):
    page = kc.page(example.model, example.solution)
    data, arrays = data_of(page.html)
    solution = example.solution
    assert [item["name"] for item in data["coordinates"]] == list(solution.coordinates)
    np.testing.assert_array_equal(arrays["t"], solution.t)
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_array_equal(
            arrays[name].reshape(solution.q.shape), getattr(solution, name)
        )
    assert data["status"] == solution.status.tolist()
    assert page.success is solution.success
    assert page.message == solution.message


def test_that_residual_condition_and_determinant_are_those_of_the_module(example_named):
    example = example_named("four_bar")
    _, arrays = data_of(kc.page(example.model, example.solution).html)
    solution, module = example.solution, example.module
    Phi = module.Phi(solution.q, solution.t)
    rows = [(0, 2), (2, 4), (4, 6), (6, 8), (8, 9)]  # four pins and a motor
    residual = np.stack([np.sqrt(np.sum(Phi[:, a:b] ** 2, axis=1)) for a, b in rows], axis=-1)
    np.testing.assert_allclose(arrays["residual"].reshape(residual.shape), residual, rtol=1e-12)
    Phi_q = module.Phi_q(solution.q, solution.t)
    np.testing.assert_allclose(arrays["determinant"], np.linalg.det(Phi_q), rtol=1e-12)
    np.testing.assert_array_equal(arrays["condition"], solution.condition)


def test_that_without_a_solution_the_model_is_solved_over_its_own_times():
    data, arrays = data_of(kc.page(pendulum()).html)
    np.testing.assert_array_equal(arrays["t"], [0, 0.5, 1, 1.5, 2])
    np.testing.assert_allclose(arrays["q"].reshape(5, 3)[:, 2], arrays["t"], atol=1e-12)
    assert data["success"]


def test_that_times_and_parameters_can_be_chosen():
    data, arrays = data_of(kc.page(pendulum(), t=[0.0, 1.0], p={"length": 2.0}).html)
    positions = arrays["q"].reshape(2, 3)
    np.testing.assert_allclose(positions[:, 0], 2 * np.cos([0, 1]), atol=1e-12)
    (parameter,) = data["parameters"]
    assert parameter == {
        "name": "length", "value": 2.0, "unit": "m", "default": 1.0, "low": 0.5, "high": 2.0,
    }  # fmt: skip
    (link,) = (mark for mark in data["drawing"]["marks"] if mark["kind"] == "hull")
    assert link["points"] == [[-2, 0], [0, 0]]


def test_that_a_page_starts_where_its_motion_started():
    m = pendulum(driver=kc.t + 0.25)
    assert data_of(kc.page(m).html)[0]["start"] == [1, 0, 0.5]
    solution = kc.solve(kc.compile(m), [0.0, 1.0], guess={"bob.phi": 0.25})
    assert data_of(kc.page(m, solution).html)[0]["start"] == solution.q[0].tolist()


def test_that_the_ends_of_sliders_contain_the_value():
    def ends(default, value=None, **options):
        m = kc.Mechanism("ends")
        m.parameter("a", default, **options)
        m.add(kc.AbsoluteAngle("motor", m.body("bob"), kc.t))
        m.add(kc.Revolute("pin", m.ground, (0, 0), "bob", (0, 0)))
        p = {} if value is None else {"a": value}
        (item,) = data_of(kc.page(m, p=p).html)[0]["parameters"]
        return item["low"], item["high"]

    assert ends(2.0) == (1, 4)
    assert ends(-2.0) == (-4, -1)
    assert ends(0.0) == (-1, 1)
    assert ends(2.0, 7.0) == (1, 7)
    assert ends(2.0, range=(1.5, 3)) == (1.5, 3)
    assert ends(2.0, 1.0, range=(1.5, 3)) == (1, 3)


def test_that_the_guess_and_what_it_violates_are_given_where_nothing_can_be_compiled():
    page = kc.page(pendulum(driver=None))
    data, arrays = data_of(page.html)
    assert not page.success
    assert "1 more equation is needed" in page.message
    assert data["guess"] == [1, 0, 0.5]
    # The pin's point (-1, 0) on the bob is at (1 - cos 0.5, -sin 0.5).
    expected = np.hypot(1 - np.cos(0.5), np.sin(0.5))
    np.testing.assert_allclose(data["guessResidual"], [expected], rtol=1e-12)
    assert data["guessResidual"][0] > data["violated"]
    assert np.isnan(arrays["q"]).all()


def test_that_the_guess_is_in_the_picture_where_no_position_was_found():
    m = pendulum("far", driver=None)
    far = m.body("far", guess=(50, 60, 0))
    m.add(kc.Distance("tie", m.ground, (0, 0), far, (0, 0), 1))
    left, right, low, high = data_of(kc.page(m).html)[0]["extent"]
    assert left < 0
    assert right > 50
    assert high > 60
    assert low < 0


def test_that_failed_points_have_their_status_and_events_their_time(example_named):
    example = example_named("problem_3_5_6")
    solution = kc.solve(example.module, np.linspace(0, 6, 61))
    data, arrays = data_of(kc.page(example.model, solution).html)
    assert not data["success"]
    assert set(data["status"]) > {0}
    (event,) = data["events"]
    assert (event["kind"], event["t"]) == ("lock-up", pytest.approx(4.5, abs=1e-6))
    # At the lock-up itself there is a position, and no velocity.
    failed = np.array(data["status"]) != 0
    assert np.isnan(arrays["q_dot"].reshape(61, -1)[failed]).all()
    assert np.isnan(arrays["q"].reshape(61, -1)[failed][1:]).all()
    first = data["sentences"][str(data["status"][int(np.argmax(failed))])]
    assert first.startswith("SINGULAR: Phi_q is singular here")


def test_that_equations_without_bodies_have_a_page(example_named):
    data, arrays = data_of(kc.page(example_named("problem_3_5_6").model).html)
    assert data["drawing"]["bodies"] == []
    assert arrays["q"].size == 3 * arrays["t"].size


def test_that_variants_are_refused(example_named):
    module = example_named("four_bar").module
    many = kc.solve(module, [0, 1], np.tile(module.DEFAULTS, (2, 1, 1)))
    with pytest.raises(kc.InputError, match="holds 2 variants, and a page shows one motion"):
        kc.page(example_named("four_bar").model, many)


def test_that_a_motion_of_another_model_is_refused(example_named):
    solution = example_named("four_bar").solution
    with pytest.raises(kc.InputError, match="is one of four_bar, whose coordinates are not those"):
        kc.page(pendulum(), solution)


def test_that_a_motion_from_another_process_has_a_page_without_residuals(example_named):
    example = example_named("slider_crank")
    copy = pickle.loads(pickle.dumps(example.solution))
    _, arrays = data_of(kc.page(example.model, copy).html)
    assert set(arrays) == {"t", "q", "q_dot", "q_ddot"}


def test_that_a_thousand_frames_of_the_wrecker_boom_are_small(example_named):
    page = kc.page(example_named("wrecker_boom").model, t=np.linspace(0, 8, 1000))
    assert page.success
    assert len(page.html.encode()) < 3_000_000


def test_that_a_page_asks_for_nothing():
    html = kc.page(pendulum()).html
    assert re.findall(r'(?:src|href)="(?!data:)[^"]*"', html) == []
    assert re.findall(r"url\(|@import|fetch\(|XMLHttpRequest|import\(", html) == []


def test_that_text_cannot_end_the_script_it_is_in(example_named):
    example = example_named("four_bar")
    evil = "</script><script>alert(1)</script>"
    solution = dataclasses.replace(example.solution, message=evil)
    html = kc.page(example.model, solution).html
    assert evil not in html
    assert data_of(html)[0]["message"] == evil


def test_that_every_script_and_style_sheet_is_used():
    folder = template_root() / "view"
    here = {item.name for item in folder.iterdir() if item.name.endswith((".js", ".css"))}
    others = {"gallery.js", "gallery.css", "watch.js", "editor.css", *MODULES}  # of other pages
    used = {*STYLES, *(name for dimension in WORLDS for name in modules_of("start.js", dimension))}
    assert here == used | others
    assert "EventSource" not in kc.page(pendulum()).html


def test_that_a_page_has_a_cam_by_table_as_a_function(example_named):
    page = kc.page(example_named("cam_by_table").model, transmission=(["motor"], ["follower.y"]))
    assert page.success
    assert "spline(rho_j_contact, 1, " in page.html
    assert "const transmitted = null;" in kc.page(pendulum()).html


def test_that_a_page_says_why_a_mechanism_is_no_function_as_code(monkeypatch, example_named):
    def refuse(*given, **options):
        raise kc.UnsupportedError("too <large>")

    monkeypatch.setattr(compiler, "transmission_files", refuse)
    page = kc.page(example_named("cam_by_table").model, transmission=(["motor"], ["follower.y"]))
    assert 'const transmitted = {"reason": "too \\u003clarge>"};' in page.html


def test_that_a_page_shows_itself_in_a_frame_of_a_notebook():
    page = kc.page(pendulum())
    frame = page._repr_html_()
    assert frame.startswith("<iframe srcdoc=")
    assert frame.count('"') == 6  # nothing of the page ends the attribute
    assert repr(page).startswith("<Page of 'pendulum': 0.")


def test_that_a_gallery_links_its_pages_and_thins_their_motion(tmp_path):
    pages = [kc.page(pendulum("one", points=500)), kc.page(pendulum("two"))]
    paths = kc.gallery(pages).write(tmp_path / "gallery")
    assert [path.name for path in paths] == ["one.html", "two.html", "index.html"]
    index = paths[-1].read_text(encoding="utf-8")
    assert re.findall(r'href="(\w+\.html)"', index) == ["one.html", "two.html"]
    first = re.findall(r'<script type="application/json">(.*?)</script>', index)[0]
    assert 100 <= len(base64.b64decode(json.loads(first)["arrays"]["t"])) / 8 <= 120
    assert paths[0].read_text(encoding="utf-8") == pages[0].html


def test_that_two_pages_of_one_name_are_refused():
    page = kc.page(pendulum())
    with pytest.raises(kc.InputError, match=r"two pages would be written to pendulum\.html"):
        kc.gallery([page, page])
    with pytest.raises(kc.InputError, match=r"index\.html"):
        kc.gallery([kc.page(pendulum("index"))])


def test_that_a_gallery_is_not_written_into_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(kc.InputError, match="cannot make the folder"):
        kc.gallery([kc.page(pendulum())]).write(tmp_path / "file" / "below")
