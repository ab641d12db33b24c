"""How C writes expressions of doubles; names that are not of math.h are the template's."""

from kincompile.emitters.printer import ELEMENTARY, Dialect

C = Dialect(
    "C",
    {name: f"{name}({{}})" for name in ELEMENTARY}
    # These two say by `far` that an angle is out of their reach.
    | {"atan2": "angle_of({})"}
    | {"cos": "cosine({}, exact, &far)", "sin": "sine({}, exact, &far)"},
    pi="_pi",
    nan="NAN",
    table="spline(&{}, {}, {})",
    signs={"&": "&&", "|": "||"},
    # C divides integers to integers.
    number=lambda value: repr(float(value)),
)
