"""How Octave and MATLAB write expressions; `either` and `in_reals` are the template's."""

from kincompile.targets.printer import ATOM, ELEMENTARY, POWER, Dialect, Operation

# Complex for some real numbers, where the other targets have NaN.
PARTIAL = ("asin", "acos", "acosh", "atanh", "log", "sqrt", "pow")

NAMES = {name: name for name in ELEMENTARY} | {"pow": "power"}
"""Octave's names of the elementary functions."""


def dialect(mechanism: str) -> Dialect:
    """Return the language; a table is a function whose name begins with the mechanism's."""
    return Dialect(
        "Octave",
        {
            name: f"in_reals({own}({{}}))" if name in PARTIAL else f"{own}({{}})"
            for name, own in NAMES.items()
        },
        square=Operation("{}^2", (ATOM,), POWER),
        select="either({}, {}, {})",
        table=f"{mechanism}_{{}}({{}}, {{}})",
        signs={"&": "&&", "|": "||", "!=": "~="},
    )
