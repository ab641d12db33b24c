"""What mechanisms, systems, modules, solutions and derivations show in a notebook."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import sympy

import kincompile as kc


def parsed(html: str) -> ET.Element:
    """Return HTML that is well-formed as XML too."""
    return ET.fromstring(f"<div>{html}</div>")


def cells(html: str) -> list[list[str]]:
    return [[cell.text or "" for cell in row] for row in parsed(html).iter("tr")]


def test_that_a_mechanism_shows_its_constraints(example_named: Any) -> None:
    model = example_named("four_bar").model
    rows = cells(model._repr_html_())
    assert len(rows) == 6
    assert rows[2] == ["2", "B", "Revolute", "crank (a/2, 0) - coupler (-b/2, 0)", "Haug 3.3.10"]
    assert rows[5][2] == "AbsoluteAngle (driver)"
    assert model.system()._repr_html_() == model._repr_html_()


def test_that_a_mechanism_shows_its_equations_in_latex(example_named: Any) -> None:
    text = example_named("problem_3_5_6").model._repr_latex_()
    assert text.startswith(r"$\displaystyle \Phi = \left[\begin{matrix}")
    assert r"\sin{\left(\phi_{3} \right)}" in text


def test_that_many_equations_are_not_written_out() -> None:
    m = kc.Mechanism("chain")
    for k in range(9):
        m.add(kc.Revolute(f"A{k}", m.body(f"b{k}"), (0, 0), m.ground, (k, 0)))
        m.add(kc.AbsoluteAngle(f"angle{k}", f"b{k}", 0))
    assert m._repr_latex_() is None


def test_that_an_unfinished_mechanism_shows_what_is_missing() -> None:
    m = kc.Mechanism("unfinished")
    m.add(kc.Revolute("A", "nobody <i>", (0, 0), m.ground, (0, 0)))
    html = m._repr_html_()
    assert "not usable yet" in html
    assert "there is no body" in html
    assert "<i>" not in html
    assert m._repr_latex_() is None


def test_that_a_relation_in_an_equation_is_escaped() -> None:
    x = sympy.Symbol("x")
    step = sympy.Piecewise((kc.t**2, kc.t < 1), (2 * kc.t - 1, True))
    s = kc.ConstraintSystem("pieces", [x], [x - step])
    assert "t &lt; 1" in s._repr_html_()
    parsed(s._repr_html_())


def test_that_a_module_shows_its_coordinates(example_named: Any) -> None:
    module = example_named("four_bar").module
    html = module._repr_html_()
    assert "9 coordinates, 9 equations, 25 entries of Phi_q, 5 parameters" in html
    assert cells(html)[3] == ["2", "phi_crank", "rad", "0"]


def test_that_a_solution_shows_ends_and_extremes(example_named: Any) -> None:
    example = example_named("simple_pendulum")
    solution = kc.solve(example.module, np.linspace(0, 1, 5))
    rows = cells(solution._repr_html_())
    assert rows[0][2:4] == ["t = 0", "t = 1"]
    angle = rows[3]
    assert angle[0].startswith("phi")
    assert [float(x) for x in angle[2:]] == [1.5708, 7.85398, 1.5708, 7.85398]


def test_that_a_failed_solution_shows_itself_too(example_named: Any) -> None:
    solution = kc.solve(example_named("problem_3_5_6").module, np.linspace(0, 6, 13))
    assert not solution.success
    assert "nan" in solution._repr_html_()
    parsed(solution._repr_html_())


def test_that_a_derivation_shows_itself_in_a_frame(example_named: Any) -> None:
    html = kc.derivation(example_named("simple_pendulum").model)._repr_html_()
    frame = parsed(html).find("iframe")
    assert frame is not None
    assert frame.attrib["srcdoc"].startswith("<!DOCTYPE html>")


def test_that_results_over_a_motion_are_tables_in_print_and_in_a_notebook() -> None:
    m = kc.Mechanism("pendulum")
    length = m.parameter("L", 0.5, unit="m")
    rod = m.body("rod", (0.5, 0, 0), mass=1.0, inertia=0.1)
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (-length, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    m.gravity = (0, -9.81)
    solution = kc.solve(kc.compile(m), [0.0, 0.1])
    forces = kc.forces(solution)
    for found in (forces, forces.measures(), kc.sensitivities(solution, "L")):
        header, *rows = cells(found._repr_html_())
        headline, titles, *lines = str(found).splitlines()
        assert headline.startswith("pendulum: ")
        assert titles.split() == " ".join(header).split()
        assert [line.split() for line in lines] == [[x for x in row if x] for row in rows]
        assert rows


def test_that_everything_public_is_short_in_a_list_and_whole_in_print(example_named: Any) -> None:
    model, module = example_named("four_bar").model, example_named("four_bar").module
    folding = example_named("problem_3_5_6")
    event = kc.solve(folding.module, np.linspace(0, 6, 61)).events[0]
    shown = {
        "<Report: four_bar, equal>": kc.compare(model, nu=model.nu),
        "<Inspection: ": kc.inspect(model),
        "<Verification: four_bar, 6 generic and ": kc.verify(module),
        "<NewtonResult: CONVERGED after ": kc.newton(module, 0.0, module.GUESS),
        "<Emitted: four_bar as four_bar.py>": kc.emit(model),
        "<lock-up at t = ": event,
        "<Body: crank with x_crank, y_crank, phi_crank, guess (": model.bodies[0],
        "<Revolute B: crank, (a/2, 0), coupler, (-b/2, 0)>": model.constraints[1],
    }
    for start, item in shown.items():
        assert repr(item).startswith(start)
        assert len(repr(item)) < 250
        assert len(repr(item)) - 2 <= len(str(item)) + 40
        assert "<" + "dataclass" not in str(item)
        parsed(item._repr_html_())
    assert str(kc.verify(module)).startswith("Verification of four_bar")
    assert "|correction|" in str(kc.newton(module, 0.0, module.GUESS))
    assert "Verdict: equal." in str(kc.compare(model, nu=model.nu))
    assert str(event) == event.message
