"""The steps that are recorded while differentiating, and what a page makes of them."""

import re
from typing import Any

import pytest

import kincompile as kc
from kincompile.calculus.expressions import ONE, VectorSymbol
from kincompile.derive.derivation import derive
from kincompile.derive.partials import coefficient, partials
from kincompile.derive.rules import Rule, along
from kincompile.model.resolve import Joint
from kincompile.report.document import CrossReference, Display, Table

TITLES = (
    "1. The joint and its attributes", "2. The constraint in vectors", "3. The rules used",
    "4. The blocks of the Jacobian in vectors", "5. The right side of the velocity equation",
    "6. The right side of the acceleration equation, term by term",
    "7. Written out in sines and cosines", "8. Placement by row and column offset", "9. In numbers",
)  # fmt: skip


def rules_of(kind: type[Any]) -> dict[str, set[Rule]]:
    """Return the rules that fired for Phi_q, for gamma and for Phi_t."""
    blocks, rows = derive(kind.template()), partials(kind.template())
    return {
        "Phi_q": {s.rule for row in rows for item in row for s in item.steps},
        "gamma": {s.rule for b in blocks for steps in b.gamma_steps for s in steps},
        "Phi_t": {s.rule for b in blocks for s in b.Phi_t_steps},
    }


def test_that_a_revolute_joint_uses_both_rules_of_rotation() -> None:
    rules = rules_of(kc.Revolute)
    assert rules["Phi_q"] == {Rule.SUM, Rule.PRODUCT, Rule.A_TO_B, Rule.CONSTANT, Rule.COORDINATE}
    assert Rule.B_TO_A in rules["gamma"]
    assert Rule.B_TO_A not in rules["Phi_q"]


def test_that_only_a_value_of_time_uses_the_rule_of_drivers() -> None:
    assert Rule.DRIVER in rules_of(kc.Distance)["Phi_t"]
    assert Rule.CHAIN in rules_of(kc.Distance)["Phi_t"]  # of C^2
    assert Rule.DRIVER not in rules_of(kc.Revolute)["Phi_t"]


def test_that_a_profile_uses_its_own_rule() -> None:
    assert Rule.PROFILE in rules_of(kc.PointFollower)["Phi_q"]
    assert Rule.PROFILE not in rules_of(kc.Revolute)["Phi_q"]


def test_that_every_recorded_step_is_right_and_the_last_is_the_result(gallery: Any) -> None:
    templates = {item.template for item in gallery.system().constraints if isinstance(item, Joint)}
    for template in templates:
        for Phi, row in zip(template.Phi, partials(template), strict=True):
            for item in row:
                assert item.steps[-1].expression == Phi
                assert item.steps[-1].derivative == item.entry
                for step in item.steps:
                    assert step.derivative == again(step.expression, item.coordinate)


def again(expression: Any, coordinate: Any) -> Any:
    """Differentiate once more, with nobody looking."""
    if not isinstance(coordinate, VectorSymbol):
        return along(expression, {coordinate: ONE})
    change = VectorSymbol("change")
    return coefficient(along(expression, {coordinate: change}), change)


def test_that_every_joint_has_nine_steps_in_three_levels(gallery: Any, sections_of: Any) -> None:
    sections = {item.anchor: item for item in sections_of(kc.derivation(gallery))}
    for constraint in gallery.system().constraints:
        steps = sections[f"constraint-{constraint.name}"].sections
        assert len(steps) == 9
        levels = {step.level for step in steps}
        if isinstance(constraint, Joint):
            assert tuple(step.title[0] for step in steps) == TITLES
            assert levels == {"", "vector", "expanded", "numeric"}
        else:
            assert levels == {"", "expanded", "numeric"}


def test_that_a_constraint_and_levels_can_be_chosen(gallery: Any, sections_of: Any) -> None:
    derivation = kc.derivation(gallery, constraint="slide", levels=("vector",))
    sections = sections_of(derivation)
    assert [item.anchor for item in derivation.sections] == ["unknowns", "constraints"]
    assert {item.level for item in sections} == {"", "vector"}
    (slide,) = derivation.sections[1].sections
    assert slide.anchor == "constraint-slide"
    assert len(slide.sections) == 6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"constraint": "slid"}, "no constraint 'slid'; did you mean 'slide'"),
        ({"levels": ("vectors",)}, "no level vectors; levels are: vector, expanded, numeric"),
        ({"levels": ()}, "no level left; levels are: vector, expanded, numeric"),
    ],
)
def test_that_an_unknown_choice_is_refused(gallery: Any, options: Any, message: str) -> None:
    with pytest.raises(kc.InputError, match=message):
        kc.derivation(gallery, **options)


@pytest.mark.slow
def test_that_links_lead_somewhere_at_every_level(gallery: Any) -> None:
    for level in ("vector", "expanded", "numeric"):
        text = kc.derivation(gallery, levels=(level,)).to_html()
        links = set(re.findall(r'href="#([^"]*)"', text))
        assert links <= set(re.findall(r'id="([^"]*)"', text))


@pytest.mark.slow
def test_that_only_a_prescribed_angle_is_folded_away(gallery: Any, sections_of: Any) -> None:
    derivation = kc.derivation(gallery)
    folded = {item.anchor for item in sections_of(derivation) if item.is_folded}
    assert folded == {"constraint-aphi", "constraint-rphi"}
    assert derivation.to_html().count("<details><summary><h3>") == 2


@pytest.mark.slow
def test_that_every_entry_has_a_line_with_code_and_number(gallery: Any, sections_of: Any) -> None:
    derivation = kc.derivation(gallery)
    lines = derivation.source.splitlines()
    displays = {
        block.anchor: block
        for section in sections_of(derivation)
        for block in section.blocks
        if isinstance(block, Display) and block.anchor
    }
    module_pattern = {f"Phi_q-{row}-{column}" for row, column in pattern(gallery)}
    assert module_pattern <= displays.keys()
    names = [item.name for item in gallery.system().coordinates]
    equations = gallery.system().equations
    for row, column in pattern(gallery):
        source = displays[f"Phi_q-{row}-{column}"].source
        assert source is not None
        line = lines[source.number - 1]
        if not source.text.startswith("_CONSTANTS"):
            # A long element of the tuple is continued; its comment stands at its end.
            assert source.text.endswith(f"# {equations[row]} by {names[column]}")
            assert line.strip() in source.text


def pattern(model: Any) -> list[tuple[int, int]]:
    return list(kc.inspect(model).pattern)


def test_that_every_link_has_a_target(gallery: Any, sections_of: Any) -> None:
    sections = sections_of(kc.derivation(gallery))
    anchors = [section.anchor for section in sections]
    anchors += [
        block.anchor
        for section in sections
        for block in section.blocks
        if isinstance(block, Display) and block.anchor
    ]
    assert len(anchors) == len(set(anchors))
    links = [
        run.anchor
        for section in sections
        for block in section.blocks
        if isinstance(block, Table)
        for row in block.rows
        for cell in row
        for run in cell
        if isinstance(run, CrossReference)
    ]
    assert links
    assert set(links) <= set(anchors)


@pytest.mark.parametrize("name", ["wrecker_boom", "cam_flat_follower", "problem_3_5_6"])
def test_that_an_example_has_all_parts(name: str, example_named: Any, sections_of: Any) -> None:
    anchors = {item.anchor for item in sections_of(kc.derivation(example_named(name).model))}
    parts = {"unknowns", "offsets", "pattern", "mobility", "arrays", "jacobian", "newton", "rates"}
    assert parts <= anchors
