"""Hostile files as data: small ones that once took all time or memory, and a few like them.

`MODELS` and `HAND_FILES` have the ending, a function that gives the content, and a part of the
message that refuses it; "" where the file may be good.
"""

from collections.abc import Callable

Case = tuple[str, Callable[[], str], str]

TOML = 'kincompile = 1\nname = "m"\nbodies = [{ name = "b" }]\n'
CONSTRAINT = (
    '[[constraints]]\ntype = "Revolute"\nname = "A{k}"\ni = "b"\npoint_i = [0, 0]\n'
    'j = "ground"\npoint_j = [0, 0]\n'
)


def drawing(links: int, joints: int) -> str:
    """Return a drawing of long links, each of other joints in another order."""
    names = [f"J{k}" for k in range(joints)]
    places = ", ".join(f"{name} = [{k}, {k * k % 7}]" for k, name in enumerate(names))
    parts = [f'{{link="L{k}", joints="{" ".join(names)}"}}' for k in range(links)]
    return (
        f'kincompile = 1\nname = "m"\n[sketch]\njoints = {{{places}}}\nparts = [{", ".join(parts)}]'
    )


def doubled(formula: str, count: int = 22, last: str = "gamma = [a{k}, 0, 0]") -> str:
    """Return aliases each of which holds the one before twice."""
    lines = ["a0 = x_bob + sin(phi_bob)"]
    lines += [f"a{k} = " + formula.replace("a", f"a{k - 1}") for k in range(1, count)]
    return "\n".join([*lines, last.format(k=count - 1)])


def chain(count: int, kind: str = "revolute", loop: str = "") -> str:
    """Return a robot of links in a row."""
    links = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
        for k in range(count)
    )
    return f"<robot>{links}{joints}{loop}</robot>"


FAR = (
    '<loop type="fixed"><predecessor link="l0"><origin xyz="1000 0 0"/></predecessor>'
    '<successor link="l290"/></loop>'
)

MODELS: dict[str, Case] = {
    "XML bomb": ("urdf", lambda: '<!DOCTYPE a [<!ENTITY b "c">' + "".join(
        f'<!ENTITY b{k} "&b{k - 1};&b{k - 1};">' for k in range(1, 99)) + "]><a>&b98;</a>",
        "a document type"),
    "XML entity": ("xml", lambda: '<!DOCTYPE a [<!ENTITY b SYSTEM "/dev/zero">]><a>&b;</a>',
        "a document type"),
    "deep XML": ("urdf", lambda: "<a>" * 10**6, "nested too deeply"),
    "deep MJCF": ("xml", lambda: "<mujoco><worldbody>" + "<body>" * 10**5, "nested too deeply"),
    "many elements": ("urdf", lambda: "<robot>" + "<a/>" * 10**6, "more than 100,000 elements"),
    "many attributes": ("urdf", lambda: "<a " + " ".join(
        f'a{k}=""' for k in range(500000)) + "/>", "more than 100,000 elements"),
    "long number": ("urdf", lambda: chain(1).replace("1 0 0", "9" * 7 * 10**6), "give 3 numbers"),
    "many numbers": ("urdf", lambda: chain(1).replace("1 0 0", "1 " * 10**6), "give 3 numbers"),
    "long names": ("urdf", lambda: chain(3).replace("l1", "l" * 10**6), ""),
    "many links of a robot": ("urdf", lambda: chain(4000, "fixed"), "at most 3000"),
    "many joints": ("urdf", lambda: chain(301), "301 joints that move; at most 3000 and 300"),
    "a chain that does not close": ("urdf", lambda: chain(290, loop=FAR), "cannot be closed"),
    "a chain": ("urdf", lambda: chain(290), ""),
    "a chain of MJCF": ("xml", lambda: "<mujoco><worldbody>" + '<body><joint name="{}"/>'.join(
        [""] * 100) + "</body>" * 99 + "</worldbody></mujoco>", ""),
    "XML bytes": ("urdf", lambda: "\0" * 10**6, "this is not XML"),
    "long links": ("toml", lambda: drawing(300, 30), ""),
    "many links": ("toml", lambda: drawing(50000, 2), "at most 300 parts"),
    "a long link": ("toml", lambda: drawing(1, 900), "at most 30 joints"),
    "dotted key": ("toml", lambda: "a" + ".a" * 40000 + " = 1", "has more than 4 parts"),
    "dotted key with blanks": ("toml", lambda: "a" + " . a" * 40000 + "=1", "more than 4 parts"),
    "dotted key in quotes": ("toml", lambda: "'a'" + ".'a'" * 40000 + " = 1", "more than 4 parts"),
    "dotted table": ("toml", lambda: "[a" + ".a" * 40000 + "]", "has more than 4 parts"),
    "dotted tables": ("toml", lambda: "[[a" + ".a" * 40000 + "]]", "has more than 4 parts"),
    "dotted inline": ("toml", lambda: "x = {a" + ".a" * 40000 + " = 1}", "more than 4 parts"),
    "long key": ("toml", lambda: TOML + "a" * 7 * 10**6 + " = 1", "no such field"),
    "long word": ("toml", lambda: "a" * 7 * 10**6, "this is not TOML"),
    "many keys": ("toml", lambda: TOML + "".join(f"a{k} = 1\n" for k in range(100000)), "more"),
    "many tables": ("toml", lambda: "".join(f"[a{k}]\n" for k in range(600000)), "500,000 values"),
    "many lists": ("toml", lambda: "a = [" + "[],\n" * 600000 + "]", "500,000 values"),
    "deep lists": ("toml", lambda: "a = " + "[" * 10**5, "nested too deeply"),
    "deep tables": ("toml", lambda: "a = " + "{a=" * 10**5, "nested too deeply"),
    "unclosed text": ("toml", lambda: "a = '''" + "x" * 7 * 10**6, "never closed"),
    "unclosed texts": ("toml", lambda: 'a = """' + '\\"""' * 10**6, "never closed"),
    "quotes": ("toml", lambda: "'" * 3 * 10**6, "this is not TOML"),
    "many digits": ("toml", lambda: "a = " + ("9" * 999 + "_") * 7000, "thousands of digits"),
    "unknown bodies": ("toml", lambda: TOML + "".join(
        CONSTRAINT.format(k=k).replace('"b"', f'"c{k}"') for k in range(5000)), "there is no body"),
    "many constraints": ("toml", lambda: TOML + "".join(
        CONSTRAINT.format(k=k) for k in range(60000)), "500,000 values"),
    "JSON lists": ("json", lambda: "[" * 7 * 10**6, "500,000 values"),
    "JSON deep": ("json", lambda: "[" * 10**5 + "]" * 10**5, "nested too deeply"),
    "JSON objects": ("json", lambda: '{"a":' * 10**5 + "1" + "}" * 10**5, "nested too deeply"),
    "JSON values": ("json", lambda: "[" + "1," * 3 * 10**6 + "1]", "500,000 values"),
    "JSON key": ("json", lambda: '{"kincompile": 1, "' + "k" * 10**6 + '": 1}', "no such field"),
    "JSON text": ("json", lambda: '"' + '\\"' * 3 * 10**6, "this is not JSON"),
    "JSON name": ("json", lambda: '{"kincompile": 1, "name": "' + "k" * 7 * 10**6 + '"}',
                  "7000000 characters"),
    "JSON digits": ("json", lambda: "[" + "9" * 7 * 10**6 + "]", "thousands of digits"),
    "adm digits": ("adm", lambda: "[" + "9" * 7 * 10**6, "not JSON|thousands of digits"),
    "adm fractions": ("adm", lambda: "[" + "9" * 39 + " " * 10**6 + "/", "this is not JSON"),
    "adm blanks": ("adm", lambda: " " * 10**6, "this is not JSON"),
    "adm text": ("adm", lambda: '"' + '\\"' * 3 * 10**6, "this is not JSON"),
    "acf lists": ("acf", lambda: "[" * 10**6, "500,000 values"),
}  # fmt: skip

HAND_FILES: dict[str, Case] = {
    "doubled product": ("txt", lambda: doubled("a*cos(a)"), "more than 20,000 parts"),
    "doubled sum": ("txt", lambda: doubled("sin(a)+cos(a)"), "more than 20,000 parts"),
    "doubled in TOML": ("toml", lambda: 'gamma = "[a21, 0, 0]"\n[aliases]\n' + "".join(
        f'{line.replace(" = ", " = QQ")}"\n'.replace("QQ", '"')
        for line in doubled("a*cos(a)", last="b = 1").splitlines()), "more than 20,000 parts"),
    "deep aliases": ("txt", lambda: doubled("sin(a)", 500), "more than 120 levels"),
    "wide aliases": ("txt", lambda: doubled("sin(a)+cos(a)", 11) + "".join(
        f"\nb{k} = a10 + {k}" for k in range(900)), "more than 1,000,000"),
    "many aliases": ("txt", lambda: "nu = [0, 0, 0]\n" + "".join(
        f"a{k} = 1\n" for k in range(80000)), "at most 1000 are read"),
    "same alias": ("txt", lambda: "a = 1\n" * 150000, "given twice"),
    "many entries": ("txt", lambda: "gamma = [" + "1," * 100000 + "1]", "100001 rows; expected 3"),
    "many rows": ("txt", lambda: "Phi_q = [" + "1;" * 100000 + "1]", "100001 rows; expected 3"),
    "many in JSON": ("json", lambda: '{"gamma": [' + "1," * 200000 + "1]}", "200001 rows"),
    "too many in TOML": ("toml", lambda: "gamma = [" + "1," * 100000 + "1]", "100001 rows"),
    "many cells": ("txt", lambda: "Phi_q = [" + ("[" + "1," * 299 + "1],\n") * 300 + "]",
                   "300 rows; expected 3"),
    "unclosed text": ("txt", lambda: "gamma = '''" + "x" * 9 * 10**5, "quotes ' are never closed"),
    "unclosed bracket": ("txt", lambda: "gamma = [[" + "x," * 150000, "is never closed"),
    "blanks": ("txt", lambda: "gamma = [" + "x " * 150000 + "]", "150000 rows; expected 3"),
    "one line": ("txt", lambda: "gamma = " + "x" * 9 * 10**5, "3 rows|characters|rows; expected 3"),
    "lines": ("txt", lambda: "gamma\n" * 150000, "expected 'name = value'"),
    "line ends": ("txt", lambda: "\n" * 900000, "compares nothing"),
    "too large": ("txt", lambda: "#" * 1000001, "more than 1,000,000 bytes"),
    "dotted key": ("toml", lambda: "a" + ".a" * 40000 + " = 1", "has more than 4 parts"),
    "deep JSON": ("json", lambda: "[" * 10**5, "nested too deeply"),
}  # fmt: skip
