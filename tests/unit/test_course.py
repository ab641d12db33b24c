"""The course kit: its lessons run, and what `make course` writes is whole."""

import re

import pytest

import kincompile as kc
from docs.builders import course

LESSONS = pytest.mark.parametrize("lesson", course.LESSONS)


def test_that_there_are_four_lessons_from_a_sketch_to_a_lock_up():
    assert [lesson[2:] for lesson in course.LESSONS] == [
        "pendulum", "problem_3_5_6", "example_3_7_5", "wrecker_boom",
    ]  # fmt: skip
    wanted = ["Sketch", "Constraints", "Motion", "Lock-up", "Questions", "Answers"]
    for lesson in course.LESSONS:
        headings = re.findall(r"^## (.*)$", course.text_of(lesson), re.MULTILINE)
        assert [item for item in headings if item in wanted] == wanted


def test_that_the_museum_has_slides_and_answers():
    text = course.text_of(course.MUSEUM)
    assert course.slides(course.MUSEUM).count("<section>") == text.count("\n## ") + 1
    questions, answers = text.split("## Questions")[1].split("## Answers")
    assert len(re.findall(r"^\d+\.", questions, re.M)) == len(re.findall(r"^\d+\.", answers, re.M))
    cases = re.findall(r"^## \d+\. .*\n\n\*(.*?)\*", text, re.MULTILINE)
    assert len(cases) == 8  # each with where it came from


@LESSONS
def test_that_slides_are_one_file_with_a_slide_for_each_heading(lesson):
    page = course.slides(lesson)
    assert page.count("<section>") == course.text_of(lesson).count("\n## ") + 1
    assert 'src="live.html"' in page
    assert re.findall(r'(?:src|href)="(?!data:|live\.html)', page) == []


@LESSONS
def test_that_as_many_questions_are_answered_as_are_asked(lesson):
    questions, answers = course.text_of(lesson).split("## Questions")[1].split("## Answers")
    numbers = [re.findall(r"^\d+\.", part, re.MULTILINE) for part in (questions, answers)]
    assert numbers[0] == numbers[1] != []


@pytest.mark.slow
def test_that_the_kit_is_whole_and_its_links_lead_somewhere(tmp_path):
    course.make([str(tmp_path / "course"), "--students", "2", "--seed", "5"])
    index = tmp_path / "course" / "index.html"
    links = re.findall(r'href="([^"]+)"', index.read_text(encoding="utf-8"))
    assert len(links) == 6 * len(course.LESSONS) + 3
    assert [link for link in links if not (index.parent / link).is_file()] == []
    assert "P1" in str(kc.mark(index.parent / course.MUSEUM / "exercise"))
    for lesson in course.LESSONS:
        (model,) = (index.parent / lesson).glob("*.py")
        assert kc.read_model(model).name == model.stem
        students = sorted((index.parent / lesson / "exercise" / "students").iterdir())
        assert [item.name for item in students] == ["01", "02"]
        marks = kc.mark(index.parent / lesson / "exercise")
        assert "not filled" in str(marks)
