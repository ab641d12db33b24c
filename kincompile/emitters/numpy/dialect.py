"""How Python writes expressions; the module gives the names, for a point and for a batch."""

from kincompile.emitters.printer import ATOM, ELEMENTARY, POWER, Dialect

NUMPY = Dialect(
    "NumPy",
    {name: f"{name}({{}})" for name in ELEMENTARY},
    nan="nan",
    square=("{}**2", (ATOM,), POWER),
    select="where({}, {}, {})",
)
