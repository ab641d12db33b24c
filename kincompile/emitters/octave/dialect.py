"""How Octave and MATLAB write expressions; `either` and `in_reals` are the template's."""

from kincompile.emitters.printer import ATOM, ELEMENTARY, POWER, Dialect

# Complex for some real numbers, where the other targets have NaN.
PARTIAL = ("asin", "acos", "acosh", "atanh", "log", "sqrt", "pow")

NAMES = {name: name for name in ELEMENTARY} | {"pow": "power"}
"""Octave's names of the elementary functions."""

OCTAVE = Dialect(
    "Octave",
    {name: f"{own}({{}})" for name, own in NAMES.items()}
    | {name: f"in_reals({NAMES[name]}({{}}))" for name in PARTIAL},
    square=("{}^2", (ATOM,), POWER),
    select="either({}, {}, {})",
    table="{mechanism}_{}({}, {})",
    signs={"&": "&&", "|": "||", "!=": "~="},
)
