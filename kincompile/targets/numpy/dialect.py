"""How Python writes expressions; the module gives the names, for a point and for a batch."""

from kincompile.targets.printer import ATOM, ELEMENTARY, POWER, Dialect, Operation

NUMPY = Dialect(
    "NumPy",
    {name: f"{name}({{}})" for name in ELEMENTARY},
    square=Operation("{}**2", (ATOM,), POWER),
    select="where({}, {}, {})",
)
