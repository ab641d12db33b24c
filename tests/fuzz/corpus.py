"""Broken and hostile files, made from good ones by a seeded generator."""

import random
from pathlib import Path

import kincompile as kc

ROOT = Path(__file__).resolve().parents[2]

HOSTILE = (
    "__import__('os').system('touch CANARY')", "open('CANARY','w')", "().__class__.__bases__[0]",
    "exec('1')", "lambda: 0", "[x for x in ()]", "t.__class__", "f'{t}'", "globals()", "9**9**9",
    "2**64**64", "((((t))))" * 40, "(" * 3000, "t**t**t**t", "1e999", "0/0", "sqrt(-1)", "log(0)",
    "-" * 5000 + "t", "+".join(["sin(t)"] * 900), "t=1", "t:=1", "import os",
    "system('touch CANARY')",
    "eval('1')", "NaN", "Infinity", "1_000", "0x10", "1j", "True", "None", "a.b", "t;t", "t\x00t",
    "\u202et", "\u03c0*t", "sin(" * 61 + "t" + ")" * 61, "tan(pi/2)", "gamma(t)",
    "factorial(10**9)",
    "exp(exp(exp(exp(9))))", "(t+1)**64*(t+2)**64", "Piecewise((t, t < 1), (2, True))",
    "Piecewise((t, t**9 < t), (t, True))", "atan2(0, 0)", "asin(2)", "1/(t-t)", "sin(10**300)",
    "(1e300*t)**64", "sqrt(sqrt(sqrt(2+sqrt(3))))**63", "pi**64**0.5", "(2+sqrt(3))**64",
    "cos(1)**64-sin(1)**64", "exp(-exp(64))", "acosh(cos(1))", "asin(sin(9**64))",
)  # fmt: skip

TOKENS = (
    *'{}[],:"=#\n\\. +-*/^()', "null", "true", "NaN", "-Infinity", "1e999", "187/255", "[[", "]]",
    '"""', "'''", "\x00", "\xff", "[[constraints]]", '"name"', "kincompile = 1", "{" * 400,
    "[" * 2000,
    "9" * 5000, "a." * 300,
)  # fmt: skip

PARTS = (
    "t", "x", "pi", "2", "0.5", "sin(", "sqrt(", "atan2(", ")", ",", "+", "-", "*", "/", "^", "**",
    " ", "(", "1e308", "log(", "Piecewise((", "<", "True", "and", "0", "10", "64",
)  # fmt: skip


def seeds():
    """Return the good files by ending."""
    found: dict[str, list[str]] = {"toml": [], "json": [], "adm": [], "acf": []}
    for path in sorted((ROOT / "examples").glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        found["toml"].append(text)
        found["json"].append(kc.read(path).to_json())
    for path in sorted((ROOT / "tests" / "files" / "simengine2d").iterdir()):
        if path.suffix[1:] in found:
            found[path.suffix[1:]].append(path.read_text(encoding="utf-8"))
    return found


def expressions(rng, count):
    """Yield texts of expressions, hostile ones among them."""
    for _ in range(count):
        if rng.random() < 0.3:
            yield mutated(rng, rng.choice(HOSTILE).encode("utf-8")).decode("utf-8", "replace")
        else:
            yield "".join(rng.choice(PARTS) for _ in range(rng.randint(1, 25)))


def files(rng, count):
    """Yield (ending, bytes)."""
    good = seeds()
    for _ in range(count):
        ending = rng.choice(("toml", "toml", "json", "json", "adm", "adm", "acf"))
        text = rng.choice(good[ending])
        if rng.random() < 0.35:
            yield ending, with_hostile_formula(rng, text).encode("utf-8", "surrogatepass")
        else:
            yield ending, mutated(rng, text.encode())


def with_hostile_formula(rng, text):
    """Put a hostile text in the place of a formula, a name or a number."""
    hostile = rng.choice(HOSTILE).replace("\\", "").replace('"', "").replace("\x00", "")
    pieces = text.split('"')
    if rng.random() < 0.7 and len(pieces) > 3:
        pieces[rng.randrange(1, len(pieces) - 1, 2)] = hostile
        return '"'.join(pieces)
    places = [k for k, character in enumerate(text) if character.isdigit()]
    k = rng.choice(places)
    return f'{text[:k]}"{hostile}"{text[k + 1 :]}'


def mutated(rng: random.Random, content: bytes) -> bytes:
    """Change bytes, cut, repeat, or insert tokens."""
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        k = rng.randrange(len(data) + 1)
        match rng.randrange(6):
            case 0 if data:
                data[min(k, len(data) - 1)] = rng.randrange(256)
            case 1:
                data[k:k] = rng.choice(TOKENS).encode("latin-1")
            case 2:
                del data[k : k + rng.randint(1, 40)]
            case 3:
                data[k:k] = data[k : k + rng.randint(1, 200)]
            case 4:
                del data[k:]
            case _:
                other = rng.randrange(len(data) + 1)
                data[k : k + 3] = data[other : other + 3]
    return bytes(data)
