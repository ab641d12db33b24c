"""How JavaScript writes expressions; `square` and `spline` are the template's."""

from kincompile.emitters.printer import ELEMENTARY, Dialect

JAVASCRIPT = Dialect(
    "JavaScript",
    {name: f"Math.{name}({{}})" for name in ELEMENTARY},
    pi="Math.PI",
    signs={"&": "&&", "|": "||", "==": "===", "!=": "!=="},
)
