"""Zeros that hide a wrong answer: terms that cancel, of any size, and numbers that are rounded."""

ANGLE, X, Y = "phi_i", "x_i", "y_i"


def zeros(size, a=ANGLE, x=X, y=Y):
    """Return expressions that are zero everywhere, of terms of a size, by what they are."""
    four, twice, s = f"{1.234 * size:.3e}", f"{2.468 * size:.3e}", f"{size:.0e}"
    root = f"sqrt({x}^2 + {y}^2)"
    return {
        "double angle": f"{s}*(sin(2*{a}) - 2*sin({a})*cos({a}))",
        "Pythagoras": f"{s}*(sin({a})^2 + cos({a})^2 - 1)",
        "triple angle": f"{s}*(sin(3*{a}) - 3*sin({a}) + 4*sin({a})^3)",
        "half an angle": f"{s}*(2*cos({a}/2)^2 - 1 - cos({a}))",
        "a quotient": f"{s}*(tan({a})*cos({a}) - sin({a}))",
        "a square": f"{s}*(({x} + {y})^2 - {x}^2 - 2*{x}*{y} - {y}^2)",
        "a root": f"{s}*({root} - ({x}^2 + {y}^2)/{root})",
        "rounded numbers": f"{four}*sin(2*{a}) - {twice}*sin({a})*cos({a})",
        "rounded numbers of a circle": f"{four}*(sin({a})^2 + cos({a})^2) - {four}",
        "a rounded number in a sine": f"{s}*(sin(1.234*{a}) - sin(617/500*{a}))",
        "a product with zero": f"{four}*{x}*(1.000 - 1)*exp({y})",
        "nested": f"{x}*(1 + {s}*(sin({a})^2 + cos({a})^2 - 1)) - {x}",
        "nested twice": f"{x}*(({s}*sin({a})^2 + {s}*cos({a})^2 - {s})*{y} + sin({a}) - sin({a}))",
    }


SIZES = (1e3, 1e6, 1e9, 1e12, 1e15)
SMALL = (1.0, 10.0, 30.0, 1e3)
"""Sizes at which a right answer has to stay right."""
KINDS = tuple(zeros(1.0))
