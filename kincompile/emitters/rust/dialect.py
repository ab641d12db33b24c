"""How Rust writes expressions; `square` and `spline` are the template's."""

from kincompile.emitters.printer import ELEMENTARY, Dialect

RUST = Dialect(
    "Rust",
    {name: f"f64::{name}({{}})" for name in ELEMENTARY}
    | {"pow": "f64::powf({})", "log": "f64::ln({})"},
    pi="std::f64::consts::PI",
    nan="f64::NAN",
    select="(if {} {{ {} }} else {{ {} }})",
    table="spline(&{}, {}, {})",
    signs={"&": "&&", "|": "||"},
    number=lambda value: repr(float(value)),
)
