"""M and Q by hand: right answers accepted, slips found and named."""

import pytest
import sympy

import kincompile as kc


@pytest.fixture(scope="module")
def pendulum():
    """Return a pendulum whose centre of mass is not its origin, on a spring with a damper."""
    m = kc.Mechanism("pendulum")
    m.gravity = (0, -9.81)
    bob = m.body("bob", (1, 0, 0), mass=2, inertia=0.3, centre=(0.2, 0.1))
    m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
    k = m.parameter("k", 50.0)
    m.add(kc.Spring("spring", m.ground, (0, 2), bob, (0.5, 0), k, 0.3, 4))
    m.add(kc.FollowerForce("push", bob, (0.4, 0.1), (3, kc.t)))
    return m


BY_HAND = {
    "M": """[[2, 0, -2*(0.2*sin(phi1) + 0.1*cos(phi1))],
             [0, 2, 2*(0.2*cos(phi1) - 0.1*sin(phi1))],
             [-0.4*sin(phi1) - 0.2*cos(phi1), 0.4*cos(phi1) - 0.2*sin(phi1), 0.3 + 2*0.05]]""",
    "Q": """[w^2*(0.4*c - 0.2*s) - f*dx/l + 3*c - t*s,
             w^2*(0.4*s + 0.2*c) - 19.62 - f*dy/l + 3*s + t*c,
             -19.62*(0.2*c - 0.1*s) - f*(dy*0.5*c - dx*0.5*s)/l + 0.4*t - 0.1*3]""",
}
ALIASES = {
    "w": "phi1d", "c": "cos(phi1)", "s": "sin(phi1)",
    "dx": "x1 + 0.5*c", "dy": "y1 + 0.5*s - 2", "l": "sqrt(dx^2 + dy^2)",
    "ld": "(dx*(x1d - 0.5*s*w) + dy*(y1d + 0.5*c*w))/l", "f": "k*(l - 0.3) + 4*ld",
}  # fmt: skip
"""M and Q of the pendulum from free bodies, with the names of a student."""


def kinds(report, label):
    """Return kinds and texts of the diagnoses of an entry."""
    (entry,) = (item for item in report.entries if item.label == label)
    return [(item.kind, item.text) for item in entry.diagnoses]


def test_that_what_free_bodies_give_is_accepted(pendulum):
    report = kc.compare(pendulum, **BY_HAND, aliases=ALIASES)
    assert report.verdict.value == "equal"
    assert len(report.entries) == 12
    assert [entry.label for entry in report.entries][:2] == [
        "M[x_bob, x_bob]", "M[x_bob, y_bob]",
    ]  # fmt: skip
    assert kc.compare(pendulum, M=pendulum.M, Q=pendulum.Q).equal
    module = kc.compile(pendulum)
    assert kc.compare(pendulum, M=module.M, Q=lambda q, v, t, p: module.Q(q, v, t, p)).equal


def test_that_loads_are_compared_beside_the_equations(pendulum):
    report = kc.compare(pendulum, Phi=-pendulum.Phi, Phi_q=-pendulum.Phi_q, Q=pendulum.Q)
    assert report.equal
    assert report.quantities == ("Phi", "Phi_q", "Q")
    assert [item.kind for item in report.conventions] == ["row sign"]
    wrong = kc.compare(pendulum, Phi=pendulum.Phi, Q=-pendulum.Q)
    assert [entry.quantity for entry in wrong.different] == ["Q"] * 3


@pytest.mark.parametrize(
    ("old", "new", "label", "text"),
    [
        ("- 19.62 - f", "+ 19.62 - f", "Q[y_bob]", "Mass 'bob': gravity has the wrong sign in Q."),
        ("w^2*", "0*", "Q[x_bob]", "terms with rates of Mass 'bob' are missing in Q."),
        ("- f*dx/l", "+ f*dx/l", "Q[x_bob]", "what Spring 'spring' adds to Q has the wrong sign."),
        ("- f*dx/l", "", "Q[x_bob]", "what Spring 'spring' adds to Q is missing."),
        ("+ t*c", "", "Q[y_bob]", "a term is missing."),
        ("+ t*c", "+ 5*t*c", "Q[y_bob]", "a term is 5 times what it should be."),
        ("+ t*c", "+ t*c*exp(x1)", "Q[y_bob]", "no fault of the catalogue fits; the difference"),
        ("0.3 + 2*0.05", "0.3", "M[phi_bob, phi_bob]", "Mass 'bob': centre is counted as zero"),
        ("0.3 + 2*0.05", "2*0.05", "M[phi_bob, phi_bob]", "Mass 'bob': inertia is counted as zero"),
        ("+ 0.4*t - 0.1*3", "", "Q[phi_bob]", "FollowerForce 'push': point is counted as zero"),
        ("+ 0.4*t - 0.1*3", "- 0.4*t + 0.1*3", "Q[phi_bob]", "FollowerForce 'push': point has the"),
    ],
)
def test_that_a_slip_is_named(pendulum, old, new, label, text):
    name = label[0]
    written = BY_HAND[name].replace(old, new)
    assert written != BY_HAND[name]
    report = kc.compare(pendulum, **{name: written}, aliases=ALIASES)
    assert not report.equal
    texts = [diagnosis for _, diagnosis in kinds(report, label)]
    assert any(item.startswith(text) for item in texts), texts


def test_that_aliases_of_a_slip_are_named(pendulum):
    for name, value, text in (
        ("f", "k*l + 4*ld", "Spring 'spring': free_length is counted as zero in Q."),
        ("f", "k*(l - 0.3) - 4*ld", "Spring 'spring': damping has the wrong sign in Q."),
    ):
        report = kc.compare(pendulum, Q=BY_HAND["Q"], aliases={**ALIASES, name: value})
        for entry in report.entries:
            assert [item.text for item in entry.diagnoses] == [text]
    half = kc.compare(pendulum, M=pendulum.M / 2)
    assert kinds(half, "M[x_bob, x_bob]")[0][1] == "M is half what it should be."


@pytest.mark.slow
def test_that_numbers_may_stand_for_parameters(pendulum):
    with_numbers = pendulum.Q.subs(sympy.Symbol("k"), 50)
    report = kc.compare(pendulum, Q=with_numbers)
    assert report.equal
    assert report.verdict.value == "equal up to convention"
    assert not kc.compare(pendulum, Q=with_numbers, strict=True).equal


def test_that_a_hand_file_has_m_and_q(pendulum, tmp_path):
    lines = [f"{name} = {value}" for name, value in (ALIASES | BY_HAND).items()]
    path = tmp_path / "ada.txt"
    path.write_text("\n".join(lines), encoding="utf-8")
    assert kc.compare_file(pendulum, path).equal


def test_what_of_loads_is_refused(pendulum):
    with pytest.raises(kc.InputError, match="M has 2 columns; expected 3, as many as rows"):
        kc.compare(pendulum, M="[[1, 0], [0, 1], [0, 0]]")
    with pytest.raises(kc.InputError, match=r"Q has 2 rows; expected 3, one for each of: x_bob"):
        kc.compare(pendulum, Q="[1, 2]")
    with pytest.raises(kc.InputError, match="M and Q are those of the whole system, not of 'pin'"):
        kc.compare(pendulum, Q=pendulum.Q, constraint="pin")
    with pytest.raises(kc.InputError, match=r"there is nothing to compare: .*Phi, Phi_q, .*M, Q"):
        kc.compare(pendulum)
    bare = kc.Mechanism("bare")
    bar = bare.body("bar")
    bare.add(kc.Revolute("O", bare.ground, (0, 0), bar, (0, 0)))
    with pytest.raises(kc.InputError, match="bare has no masses and no forces"):
        kc.compare(bare, M="[1]")
