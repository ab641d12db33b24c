"""Points and outputs in every target, against closed forms and SymPy's derivatives."""

import json
import re
from itertools import chain, pairwise

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import outputs
from kincompile.names import rate

from .conftest import NODE, OCTAVE, in_node, run_octave

NAMES = ("outputs", "outputs_dot", "outputs_ddot", "outputs_q")


def slider_crank():
    """Return a slider-crank with points and one output of each kind."""
    m = kc.Mechanism("observed")
    rod_length = m.parameter("L", 0.26, unit="m")
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (0.1, 0, 0))
    pin, end = m.point("P", crank, (0.06, 0)), m.point("E", rod, (rod_length / 2, 0.01))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-0.06, 0)))
    m.add(kc.Revolute("B", pin, rod, (-rod_length / 2, 0)))
    m.add(kc.AbsoluteY("C", end, 0.02))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    m.output("stroke", end.x - pin.x + kc.t**2, "m")
    m.output("speed", outputs.speed(end), "m/s")
    m.output("pull", outputs.acceleration(end), "m/s^2")
    m.output("ratio", outputs.velocity_ratio(end.x, crank.phi), "m")
    m.output("mu", outputs.transmission_angle((0, 0), pin, end), "rad")
    m.output("turned", outputs.angle(crank, rod), "rad")
    m.output("seen", outputs.angle((pin, end), rod), "rad")
    m.output("reach", outputs.distance(end, (0.1, -0.2)), "m")
    m.output("fixed", rod_length / 2, "m")
    return m


@pytest.fixture(scope="module")
def model():
    return slider_crank()


@pytest.fixture(scope="module")
def states():
    rng = np.random.default_rng(7)
    q, q_dot, q_ddot = rng.uniform(-1, 1, (3, 5, 6))
    return q, q_dot, q_ddot, rng.uniform(0, 1, 5), np.array([0.3])


@pytest.fixture(scope="module")
def expected(model, states):
    """Return the outputs and what SymPy derives from them; NaN for what needs a third rate of q."""
    system = model.system()
    names = [item.name for item in system.coordinates]
    orders = [[sympy.Symbol(rate(name, k)) for name in names] for k in range(4)]
    third = set(orders[3])

    def along(y):
        rates = (zip(*pair, strict=True) for pair in pairwise(orders))
        return y.diff(kc.t) + sum(y.diff(x) * x_dot for x, x_dot in chain(*rates))

    def known(y):
        return sympy.nan if third & y.free_symbols else y

    y = [item.expression for item in system.outputs]
    y_dot = [along(item) for item in y]
    derived = {
        "outputs": y,
        "outputs_dot": [known(item) for item in y_dot],
        "outputs_ddot": [known(along(item)) for item in y_dot],
        "outputs_q": [[item.diff(x) for x in orders[0]] for item in y],
    }
    symbols = [*orders[0], *orders[1], *orders[2], kc.t, sympy.Symbol("L")]
    rows = [
        [*q, *q_dot, *q_ddot, t, *states[4]]
        for q, q_dot, q_ddot, t in zip(*states[:4], strict=True)
    ]
    found = {}
    for name, expressions in derived.items():
        function = sympy.lambdify(symbols, expressions, "math", cse=True)
        found[name] = np.array([function(*row) for row in rows], dtype=float)
    return found


def assert_same(found, expected):
    for name in NAMES:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-12, atol=1e-12)


def in_module(module, states):
    return {name: getattr(module, name)(*states) for name in NAMES}


@pytest.mark.parametrize(
    ("target", "form"), [("numpy", "inline"), ("numpy", "grouped"), ("c", "inline")]
)
def test_that_outputs_and_their_rates_are_what_sympy_derives(
    target, form, model, states, expected, quick_compiler
):
    module = kc.compile(model, target=target, form=form)
    assert_same(in_module(module, states), expected)
    together = module.observe(*states)
    for name, found in zip(NAMES, together, strict=False):
        np.testing.assert_allclose(found, expected[name], rtol=1e-12, atol=1e-12)
    q, q_dot, q_ddot, t, p = states
    at_point = in_module(module, (q[2], q_dot[2], q_ddot[2], float(t[2]), p))
    assert_same(at_point, {name: values[2] for name, values in expected.items()})


@pytest.mark.skipif(NODE is None, reason="there is no node")
def test_that_javascript_gives_them(model, states, expected, tmp_path):
    kc.emit(model, "javascript").write(tmp_path)
    rows = json.dumps([[part[k].tolist() for part in states[:4]] for k in range(5)])
    p = json.dumps(states[4].tolist())
    values = ", ".join(f"m.{name}(q, v, a, t, {p})" for name in NAMES)
    text = in_node(
        tmp_path, {"observed": "m"}, f"JSON.stringify({rows}.map(([q, v, a, t]) => [{values}]))"
    )
    parts = zip(*json.loads(text), strict=True)
    found = {name: np.array(values, dtype=float) for name, values in zip(NAMES, parts, strict=True)}
    assert_same(found, expected)


def test_that_the_header_of_c_has_places_by_name(model):
    module, header = kc.compile(model), kc.emit(model, "c").files[f"{model.name}.h"]
    found = dict(re.findall(r"(\w+_[QPY]_\w+) = (\d+),", header))
    names = {"Q": module.COORDINATES, "P": module.PARAMETERS, "Y": module.OUTPUTS}
    assert found == {
        f"{model.name.upper()}_{kind}_{name}": str(k)
        for kind, own in names.items()
        for k, name in enumerate(own)
    }


@pytest.mark.skipif(OCTAVE is None, reason="there is no octave-cli")
def test_that_octave_gives_them(model, states, expected, tmp_path):
    kc.emit(model, "octave").write(tmp_path)
    lines = []
    for k in range(5):
        q, v, a, t = (json.dumps(part[k].tolist()) for part in states[:4])
        lines.append(f"q = {q}'; v = {v}'; a = {a}'; t = {t}; p = {states[4].tolist()};")
        lines += [f"show('{name}', observed_{name}(q, v, a, t, p)');" for name in NAMES]
    rows = run_octave(tmp_path, lines)
    found = {name: np.array(values) for name, values in rows.items()}
    found["outputs_q"] = found["outputs_q"].reshape(5, -1, 6)
    assert_same(found, expected)


def test_that_a_point_moves_as_its_body_turns_it(model, states):
    """Velocity r_dot + B s phi_dot, and acceleration with B s phi_ddot - A s phi_dot^2."""
    module = kc.compile(model)
    q, q_dot, q_ddot, _, p = states
    at, rates, second = module.observe(*states)
    s = np.array([p[0] / 2, 0.01])
    c, n = np.cos(q[:, 5]), np.sin(q[:, 5])
    turned = np.stack((c * s[0] - n * s[1], n * s[0] + c * s[1]), axis=-1)
    across = np.stack((-turned[:, 1], turned[:, 0]), axis=-1)
    w, w_dot = q_dot[:, 5:], q_ddot[:, 5:]
    place = [module.OUTPUTS.index(name) for name in ("x_E", "y_E")]
    np.testing.assert_allclose(at[:, place], q[:, 3:5] + turned, atol=1e-15)
    np.testing.assert_allclose(rates[:, place], q_dot[:, 3:5] + across * w, atol=1e-14)
    whole = q_ddot[:, 3:5] + across * w_dot - turned * w**2
    np.testing.assert_allclose(second[:, place], whole, atol=1e-14)


def test_that_a_module_without_outputs_has_none():
    module = kc.compile(kc.read_model("examples/four_bar.py"))
    assert not {"OUTPUTS", "observe", *NAMES} & vars(module).keys()
    assert "observe" not in kc.emit(kc.read_model("examples/four_bar.py"), "c").source


def test_that_what_is_wrong_with_outputs_is_said_at_once():
    m = slider_crank()
    m.point("Z", "wheel", (0, 0))
    m.point("Y", "rod", (kc.t, 0))
    m.output("stroke", 1)
    m.output("bad", outputs.rate(outputs.rate(outputs.rate(m.bodies[0].x))), 'a"b')
    m.output("odd", sympy.Symbol("nobody"))
    with pytest.raises(kc.ModelError) as caught:
        m.system()
    text = "\n".join(caught.value.problems)
    for part in (
        "point 'Z': there is no body 'wheel'",
        "point 'Y': t depends on t; an attribute is fixed in its body",
        "are named 'stroke'",
        "would be a third derivative; rates go to the second",
        "the unit of output 'bad'",
        "output 'odd' contains nobody",
    ):
        assert part in text, part
