"""Every formula of the textbook's catalogue, typed in as a hand file, is judged right.

The formulas are those of Haug, chapter 3, in components; `A(v, b)` writes A_b v, `B(v, b)` B_b v.
"""

from pathlib import Path
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.checker.comparison import Verdict
from kincompile.checker.report import Report

Pair = tuple[str, str]


def A(v: Pair, b: str) -> Pair:  # noqa: N802
    return (
        f"(({v[0]})*cos(phi_{b}) - ({v[1]})*sin(phi_{b}))",
        f"(({v[0]})*sin(phi_{b}) + ({v[1]})*cos(phi_{b}))",
    )


def R(v: Pair) -> Pair:  # noqa: N802
    return f"(-{v[1]})", v[0]


def B(v: Pair, b: str) -> Pair:  # noqa: N802
    return R(A(v, b))


def dot(u: Pair, v: Pair) -> str:
    return f"({u[0]}*{v[0]} + {u[1]}*{v[1]})"


def times(k: str, v: Pair) -> Pair:
    return f"({k}*{v[0]})", f"({k}*{v[1]})"


def plus(*vectors: Pair) -> Pair:
    return f"({' + '.join(v[0] for v in vectors)})", f"({' + '.join(v[1] for v in vectors)})"


def minus(u: Pair, v: Pair) -> Pair:
    return f"({u[0]} - {v[0]})", f"({u[1]} - {v[1]})"


def A_ij(v: Pair) -> Pair:
    """Write A_i^T A_j v."""
    c, s = "cos(phi_j - phi_i)", "sin(phi_j - phi_i)"
    return f"({c}*({v[0]}) - {s}*({v[1]}))", f"({s}*({v[0]}) + {c}*({v[1]}))"


def B_ij(v: Pair) -> Pair:
    return R(A_ij(v))


r_i, r_j, rd_i, rd_j = ("x_i", "y_i"), ("x_j", "y_j"), ("x_id", "y_id"), ("x_jd", "y_jd")
s_i, s_j, v_i, v_j = ("0.25", "(-0.15)"), ("(-0.35)", "0.45"), ("0.6", "0.9"), ("(-0.4)", "0.7")
s_Q, c = ("1.05", "0.2"), ("0.15", "0.6")
d = minus(plus(r_j, A(s_j, "j")), plus(r_i, A(s_i, "i")))
dd = minus(plus(rd_j, times("w_j", B(s_j, "j"))), plus(rd_i, times("w_i", B(s_i, "i"))))
acc = minus(times("w_j^2", A(s_j, "j")), times("w_i^2", A(s_i, "i")))
L_i = "sqrt(0.6^2 + 0.9^2)"
ALIASES = "w_i = phi_i_dot\nw_j = phi_jd\nw = w_j - w_i\n"
DRIVER = "C = 2 + 0.3*sin(2*t)\nCd = 0.6*cos(2*t)\nCdd = -1.2*sin(2*t)\n"


def row(*entries: str | Pair) -> list[str]:
    return [item for entry in entries for item in ([entry] if isinstance(entry, str) else entry)]


def absolute(e: Pair) -> dict[str, Any]:
    point = plus(r_i, A(s_i, "i"))
    return {
        "Phi": [f"{dot(e, point)} - C"],
        "Phi_q": [row(e, dot(e, B(s_i, "i")))],
        "nu": ["Cd"],
        "gamma": [f"{dot(e, A(s_i, 'i'))}*w_i^2 + Cdd"],
    }


def relative(e: Pair) -> dict[str, Any]:
    return {
        "Phi": [f"{dot(e, d)} - C"],
        "Phi_q": [
            row(times("(-1)", e), f"-{dot(e, B(s_i, 'i'))}", e, dot(e, B(s_j, "j"))),
        ],
        "nu": ["Cd"],
        "gamma": [f"{dot(e, acc)} + Cdd"],
    }


def distance(by: str, at: Pair, rate: Pair, centripetal: Pair, two: bool) -> dict[str, Any]:
    own = row(times(f"{by}2", at), f"{by}2*{dot(at, B(s_i, 'i'))}")
    other = row(times("2", at), f"2*{dot(at, B(s_j, 'j'))}") if two else []
    return {
        "Phi": [f"{dot(at, at)} - C^2"],
        "Phi_q": [own + other],
        "nu": ["2*C*Cd"],
        "gamma": [
            f"-2*{dot(rate, rate)} + 2*{dot(at, centripetal)} + 2*Cd^2 + 2*C*Cdd",
        ],
    }


def angle(offset: str = "") -> dict[str, Any]:
    return {
        "Phi": [f"phi_j - phi_i{offset} - C"],
        "Phi_q": [["0", "0", "-1", "0", "0", "1"]],
        "nu": ["Cd"],
        "gamma": ["Cdd"],
    }


def translational(second: str) -> dict[str, Any]:
    between = minus(r_j, r_i)
    B_v, A_v = B(v_i, "i"), A(v_i, "i")
    turned = dot(v_i, A_ij(v_j))
    by_i = f"-{dot(A_v, between)} - {dot(v_i, A_ij(s_j))}"
    Phi = [
        f"{dot(B_v, between)} - {dot(v_i, B_ij(s_j))} - {dot(v_i, (s_i[1], f'(-{s_i[0]})'))}",
        f"-{dot(v_i, B_ij(v_j))}",
    ]
    gamma = (
        f"-({dot(v_i, B_ij(s_j))}*w^2 - {dot(B_v, between)}*w_i^2 "
        f"- 2*{dot(A_v, minus(rd_j, rd_i))}*w_i)"
    )
    return {
        "Phi": Phi,
        "Phi_q": [
            row(times("(-1)", B_v), by_i, B_v, dot(v_i, A_ij(s_j))),
            ["0", "0", f"-{turned}", "0", "0", turned],
        ],
        "nu": ["0", "0"],
        "gamma": [gamma, second],
    }


def along() -> dict[str, Any]:
    between, rates = minus(r_j, r_i), minus(rd_j, rd_i)
    by_j = dot(v_i, B_ij(s_j))
    by_i = f"{dot(B(v_i, 'i'), between)} - {by_j}"
    entries = row(times("(-1)", A(v_i, "i")), by_i, A(v_i, "i"), by_j)
    inner = (
        f"{dot(v_i, A_ij(s_j))}*w^2 + {dot(A(v_i, 'i'), between)}*w_i^2 "
        f"- 2*{dot(B(v_i, 'i'), rates)}*w_i"
    )
    return {
        "Phi": [f"{dot(A(v_i, 'i'), d)}/{L_i} - C"],
        "Phi_q": [[f"({entry})/{L_i}" for entry in entries]],
        "nu": ["Cd"],
        "gamma": [f"({inner})/{L_i} + Cdd"],
    }


def beside() -> dict[str, Any]:
    first = translational("0")
    return {
        "Phi": [f"({first['Phi'][0]})/{L_i} - C"],
        "Phi_q": [[f"({entry})/{L_i}" for entry in first["Phi_q"][0]]],
        "nu": ["Cd"],
        "gamma": [f"({first['gamma'][0]})/{L_i} + Cdd"],
    }


def gear() -> dict[str, Any]:
    theta = "((0.5*(phi_i + 0.2) + 0.8*(phi_j - 0.3) - 0.8*pi)/1.3)"
    rate = "((0.5*w_i + 0.8*w_j)/1.3)"
    u = (f"cos{theta}", f"sin{theta}")
    p = R(u)
    return {
        "Phi": [dot(d, p)],
        "Phi_q": [
            row(
                times("(-1)", p),
                f"-{dot(B(s_i, 'i'), p)} - {dot(d, u)}*0.5/1.3",
                p,
                f"{dot(B(s_j, 'j'), p)} - {dot(d, u)}*0.8/1.3",
            )
        ],
        "nu": ["0"],
        "gamma": [f"{dot(acc, p)} + 2*{dot(dd, u)}*{rate} + {dot(d, p)}*{rate}^2"],
    }


def rack() -> dict[str, Any]:
    v = minus(s_Q, s_i)
    line, length = A(v, "i"), "sqrt(0.8^2 + 0.35^2)"
    normal, B_v, B_turned = R(line), B(v, "i"), R(B(v, "i"))
    alpha = "(phi_i + 0.2 - phi_j + 0.3 + 3*pi/2)"

    def parts(s: Pair) -> tuple[Pair, Pair, Pair]:
        at = minus(plus(r_j, A(s_j, "j")), plus(r_i, A(s, "i")))
        rate = minus(plus(rd_j, times("w_j", B(s_j, "j"))), plus(rd_i, times("w_i", B(s, "i"))))
        return at, rate, minus(times("w_j^2", A(s_j, "j")), times("w_i^2", A(s, "i")))

    (d1, dd1, acc1), (d2, dd2, acc2) = parts(s_Q), parts(s_i)
    return {
        "Phi": [f"{dot(d1, line)} - {length}*0.8*{alpha}", f"{dot(d2, normal)} - {length}*0.8"],
        "Phi_q": [
            row(
                times("(-1)", line),
                f"{dot(d1, B_v)} - {dot(line, B(s_Q, 'i'))} - {length}*0.8",
                line,
                f"{dot(line, B(s_j, 'j'))} + {length}*0.8",
            ),
            row(
                times("(-1)", normal),
                f"{dot(d2, B_turned)} - {dot(normal, B(s_i, 'i'))}",
                normal,
                dot(normal, B(s_j, "j")),
            ),
        ],
        "nu": ["0", "0"],
        "gamma": [
            f"{dot(line, acc1)} - 2*w_i*{dot(dd1, B_v)} + {dot(d1, line)}*w_i^2",
            f"{dot(normal, acc2)} - 2*w_i*{dot(dd2, B_turned)} + {dot(d2, normal)}*w_i^2",
        ],
    }


def contact(b: str) -> tuple[Pair, Pair, Pair, Pair, str]:
    """Write a, g, h, k and the rate of a profile rho_b at its contact parameter."""
    name = "al_i" if b == "i" else "al_j"
    rho = {
        "i": [
            "(1 + 0.3*cos(AL) + 0.1*sin(2*AL))",
            "(-0.3*sin(AL) + 0.2*cos(2*AL))",
            "(-0.3*cos(AL) - 0.4*sin(2*AL))",
            "(0.3*sin(AL) - 0.8*cos(2*AL))",
        ],
        "j": ["(0.7 + 0.2*cos(3*AL))", "(-0.6*sin(3*AL))", "(-1.8*cos(3*AL))", "(5.4*sin(3*AL))"],
    }[b]
    r0, r1, r2, r3 = (item.replace("AL", name) for item in rho)
    u = (f"cos({name})", f"sin({name})")
    p = R(u)
    a = times(r0, u)
    g = plus(times(r1, u), times(r0, p))
    h = plus(times(f"({r2} - {r0})", u), times(f"2*{r1}", p))
    k = plus(times(f"({r3} - 3*{r1})", u), times(f"(3*{r2} - {r0})", p))
    return a, g, h, k, f"ad_{b}"


def cam() -> dict[str, Any]:
    (a_i, g_i, h_i, k_i, ad_i), (a_j, g_j, h_j, k_j, ad_j) = contact("i"), contact("j")
    p_i, p_j = plus(s_i, a_i), plus(s_j, a_j)

    def second(p: Pair, g: Pair, h: Pair, b: str) -> Pair:
        w, ad = f"w_{b}", f"ad_{b}"
        first = minus(times(f"{w}^2", A(p, b)), times(f"2*{w}*{ad}", B(g, b)))
        return minus(first, times(f"{ad}^2", A(h, b)))

    gap = minus(second(p_i, g_i, h_i, "i"), second(p_j, g_j, h_j, "j"))
    Phi = minus(plus(r_i, A(p_i, "i")), plus(r_j, A(p_j, "j")))
    bi, bj, gi, gj = B(p_i, "i"), B(p_j, "j"), A(g_i, "i"), A(g_j, "j")
    turned = dot(g_i, A_ij(g_j))
    gamma3 = (
        f"-({dot(g_i, B_ij(g_j))}*w^2 + 2*w*{ad_i}*{dot(h_i, A_ij(g_j))} "
        f"+ 2*w*{ad_j}*{dot(g_i, A_ij(h_j))} - {ad_i}^2*{dot(k_i, B_ij(g_j))} "
        f"- 2*{ad_i}*{ad_j}*{dot(h_i, B_ij(h_j))} - {ad_j}^2*{dot(g_i, B_ij(k_j))})"
    )
    rows = [
        [
            str(int(k == 0)),
            str(int(k == 1)),
            bi[k],
            str(-int(k == 0)),
            str(-int(k == 1)),
            f"-{bj[k]}",
            gi[k],
            f"-{gj[k]}",
        ]
        for k in (0, 1)
    ]
    third = ["0", "0", f"-{turned}", "0", "0", turned]
    third += [f"-{dot(h_i, B_ij(g_j))}", f"-{dot(g_i, B_ij(h_j))}"]
    return {
        "Phi": [*Phi, dot(R(gi), gj)],
        "Phi_q": [*rows, third],
        "nu": ["0", "0", "0"],
        "gamma": [*gap, gamma3],
    }


def flat() -> dict[str, Any]:
    a_i, g, h, k, ad = contact("i")
    p = plus(s_i, a_i)
    n = A(R(v_j), "j")
    at = minus(plus(r_j, A(s_j, "j")), plus(r_i, A(p, "i")))
    moving = plus(rd_i, times("w_i", B(p, "i")), times(ad, A(g, "i")))
    rate = minus(plus(rd_j, times("w_j", B(s_j, "j"))), moving)
    inner = plus(
        minus(times("w_j^2", A(s_j, "j")), times("w_i^2", A(p, "i"))),
        times(f"2*w_i*{ad}", B(g, "i")),
        times(f"{ad}^2", A(h, "i")),
    )
    slip = plus(times("w_i", B(g, "i")), times(ad, A(h, "i")))
    gamma2 = (
        f"{dot(n, A(g, 'i'))}*(w_i^2 + w_j^2) - {dot(n, A(k, 'i'))}*{ad}^2 "
        f"- 2*{dot(n, B(h, 'i'))}*w_i*{ad} - 2*w_j*{dot(R(n), slip)}"
    )
    return {
        "Phi": [dot(n, at), dot(n, A(g, "i"))],
        "Phi_q": [
            row(
                times("(-1)", n),
                f"-{dot(n, B(p, 'i'))}",
                n,
                f"{dot(R(n), at)} + {dot(n, B(s_j, 'j'))}",
                f"-{dot(n, A(g, 'i'))}",
            ),
            ["0", "0", dot(n, B(g, "i")), "0", "0", dot(R(n), A(g, "i")), dot(n, A(h, "i"))],
        ],
        "nu": ["0", "0"],
        "gamma": [f"{dot(n, inner)} - 2*w_j*{dot(R(n), rate)} + w_j^2*{dot(n, at)}", gamma2],
    }


def pin() -> dict[str, Any]:
    a_j, g, h, _, ad = contact("j")
    p = plus(s_j, a_j)
    Phi = minus(plus(r_i, A(s_i, "i")), plus(r_j, A(p, "j")))
    bi, bj, gj = B(s_i, "i"), B(p, "j"), A(g, "j")
    gamma = plus(
        minus(times("w_i^2", A(s_i, "i")), times("w_j^2", A(p, "j"))),
        times(f"2*w_j*{ad}", B(g, "j")),
        times(f"{ad}^2", A(h, "j")),
    )
    return {
        "Phi": list(Phi),
        "Phi_q": [
            ["1", "0", bi[0], "-1", "0", f"-{bj[0]}", f"-{gj[0]}"],
            ["0", "1", bi[1], "0", "-1", f"-{bj[1]}", f"-{gj[1]}"],
        ],
        "nu": ["0", "0"],
        "gamma": list(gamma),
    }


def revolute() -> dict[str, Any]:
    bi, bj = B(s_i, "i"), B(s_j, "j")
    gamma = minus(times("w_i^2", A(s_i, "i")), times("w_j^2", A(s_j, "j")))
    return {
        "Phi": list(times("(-1)", d)),
        "Phi_q": [
            ["1", "0", bi[0], "-1", "0", f"-{bj[0]}"],
            ["0", "1", bi[1], "0", "-1", f"-{bj[1]}"],
        ],
        "nu": ["0", "0"],
        "gamma": list(gamma),
    }


X, Y = ("1", "0"), ("0", "1")
to_c = minus(plus(r_i, A(s_i, "i")), c)
to_c_rate = plus(rd_i, times("w_i", B(s_i, "i")))
FORMULAS = {
    "ax": absolute(X),
    "ay": absolute(Y),
    "aphi": {"Phi": ["phi_i - C"], "Phi_q": [["0", "0", "1"]], "nu": ["Cd"], "gamma": ["Cdd"]},
    "ad": distance("", to_c, to_c_rate, times("w_i^2", A(s_i, "i")), two=False),
    "rx": relative(X),
    "ry": relative(Y),
    "rphi": angle(),
    "rd": distance("-", d, dd, acc, two=True),
    "revolute": revolute(),
    "translational": translational(f"-{dot(v_i, B_ij(v_j))}*w^2"),
    "rt": beside(),
    "tdd": along(),
    "rrd": angle(" - 0.5"),
    "gear": gear(),
    "rack": rack(),
    "cam": cam(),
    "flat": flat(),
    "pin": pin(),
}

C = 2 + 0.3 * sympy.sin(2 * kc.t)
P_i, P_j, V_i, V_j, Q, GROUND = (
    (0.25, -0.15),
    (-0.35, 0.45),
    (0.6, 0.9),
    (-0.4, 0.7),
    (1.05, 0.2),
    (0.15, 0.6),
)
RHO_I = 1 + 0.3 * sympy.cos(kc.alpha) + 0.1 * sympy.sin(2 * kc.alpha)
RHO_J = 0.7 + 0.2 * sympy.cos(3 * kc.alpha)


def mechanism(kind: str) -> kc.Mechanism:
    m = kc.Mechanism("catalogue")
    i, j = m.body("i", guess=(0.3, -0.7, 0.4)), m.body("j", guess=(1.1, 0.5, -0.9))
    m.add(
        {
            "ax": lambda: kc.AbsoluteX("K", i, P_i, C),
            "ay": lambda: kc.AbsoluteY("K", i, P_i, C),
            "aphi": lambda: kc.AbsoluteAngle("K", i, C),
            "ad": lambda: kc.AbsoluteDistance("K", i, P_i, GROUND, C),
            "rx": lambda: kc.RelativeX("K", i, P_i, j, P_j, C),
            "ry": lambda: kc.RelativeY("K", i, P_i, j, P_j, C),
            "rphi": lambda: kc.RelativeAngle("K", i, j, C),
            "rd": lambda: kc.Distance("K", i, P_i, j, P_j, C),
            "revolute": lambda: kc.Revolute("K", i, P_i, j, P_j),
            "translational": lambda: kc.Translational("K", i, P_i, V_i, j, P_j, V_j),
            "rt": lambda: kc.RevoluteTranslational("K", i, P_i, V_i, j, P_j, C),
            "tdd": lambda: kc.TranslationalDistance("K", i, P_i, V_i, j, P_j, C),
            "rrd": lambda: kc.RelativeAngle("K", i, j, C + 0.5),
            "gear": lambda: kc.Gear("K", i, P_i, 0.5, 0.2, j, P_j, 0.8, -0.3),
            "rack": lambda: kc.RackAndPinion("K", i, P_i, Q, 0.2, j, P_j, 0.8, -0.3),
            "cam": lambda: kc.CamFollower("K", i, P_i, RHO_I, j, P_j, RHO_J),
            "flat": lambda: kc.CamFlatFollower("K", i, P_i, RHO_I, j, P_j, V_j),
            "pin": lambda: kc.PointFollower("K", i, P_i, j, P_j, RHO_J),
        }[kind]()
    )
    return m


def hand_text(kind: str, formulas: dict[str, Any]) -> str:
    lines = ['constraint = "K"', ALIASES]
    if "C" in str(formulas.get("Phi", "C")):
        lines.append(DRIVER)
    contacts = {"cam": ("alpha_i_K", "alpha_j_K"), "flat": ("alpha_K", ""), "pin": ("", "alpha_K")}
    for b, name in zip("ij", contacts.get(kind, ("", "")), strict=True):
        if name:
            lines.append(f"al_{b} = {name}\nad_{b} = {name}_dot")
    for name, value in formulas.items():
        rows = value if name == "Phi_q" else [[item] for item in value]
        text = ",\n  ".join(f"[{', '.join(entries)}]" for entries in rows)
        lines.append(f"{name} = [{text}]")
    return "\n".join(lines) + "\n"


def checked(kind: str, formulas: dict[str, Any], folder: Path) -> Report:
    file = folder / f"{kind}.txt"
    file.write_text(hand_text(kind, formulas))
    report: Report = kc.compare_file(mechanism(kind), file)
    return report


@pytest.mark.every(5)
@pytest.mark.parametrize("kind", FORMULAS)
def test_that_a_textbook_formula_is_equal(kind: str, tmp_path: Path) -> None:
    report = checked(kind, FORMULAS[kind], tmp_path)
    assert report.quantities == ("Phi", "Phi_q", "nu", "gamma")
    assert [entry.label for entry in report.entries if entry.verdict is not Verdict.EQUAL] == []
    assert report.conventions == ()


@pytest.mark.parametrize("kind", [pytest.param("cam", marks=pytest.mark.slow), "flat", "pin"])
@pytest.mark.slow
def test_that_a_fault_in_the_formulas_of_a_cam_is_named(kind: str, tmp_path: Path) -> None:
    gamma = [f"2*({row})" for row in FORMULAS[kind]["gamma"]]
    report = checked(kind, {"Phi_q": FORMULAS[kind]["Phi_q"], "gamma": gamma}, tmp_path)
    assert {entry.quantity for entry in report.different} == {"gamma"}
    for entry in report.different:
        assert "factor 2 or 1/2" in [item.kind for item in entry.diagnoses]


def test_that_the_printed_gamma_of_the_translational_joint_holds_on_the_manifold_only(
    tmp_path: Path,
) -> None:
    report = checked("translational", translational("0"), tmp_path)
    (entry,) = (entry for entry in report.entries if entry.verdict is not Verdict.EQUAL)
    assert (entry.label, entry.verdict) == ("gamma[K.parallel]", Verdict.MANIFOLD)
    assert report.verdict == "equal on the manifold"
    assert report.equal


def test_that_the_first_row_left_zero_is_wrong_on_the_manifold_too(tmp_path: Path) -> None:
    formulas = translational("0")
    formulas["gamma"][0] = "0"
    report = checked("translational", formulas, tmp_path)
    assert [entry.label for entry in report.different] == ["gamma[K.normal]"]
    assert [item.kind for item in report.different[0].diagnoses] == ["left zero"]
