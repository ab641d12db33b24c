"""What the text of the solver may say: its types, sizes, tables, criteria and words."""

from __future__ import annotations

from dataclasses import dataclass

from kincompile.solver.nodes import BOOL, COUNT, INT, LANE, REAL, Type

LANES_OF_REALS = Type("real", (LANE,))

TYPES = {
    "Real": REAL,
    "Int": INT,
    "Count": COUNT,
    "Bool": BOOL,
    "Lane": LANES_OF_REALS,
    "LaneInt": Type("int", (LANE,)),
    "LaneBool": Type("bool", (LANE,)),
    "Vector": Type("real", ("any",)),
    "Table": Type("real", ("any", "any")),
    "Block": Type("real", ("any", "any", "any")),
}
"""Annotations. ``Row[N]``, ``Rows[N]`` and ``Vector[Int]`` are read beside them."""

SIZES = ("N", "M", "K", "LANES", "NONZEROS", "BLOCKS", "NORMAL", "U", "X", "ONE")
"""Coordinates, equations, parameters, points at once, entries of Phi_q, blocks of its solve, those
of a triangle of normal equations; inputs and outputs of a transmission; 1."""

ROOM = ("TALL", "WIDE")
"""Rows and columns of a matrix of least squares: M + N, the equations and what bends a step, and
N + 1, with a right side."""

STATUSES = {
    "CONVERGED": 0, "NOT_CONVERGED": 1, "SINGULAR": 2, "NOT_FINITE": 3, "NOT_REACHED": 4,
    "LOCK_UP": 7,
}  # fmt: skip
"""What becomes of a point, and the numbers that say so in all languages."""

CRITERIA = (
    "AGREEMENT", "BEFORE", "BEFORE_LOCK_UP", "FARTHEST", "GROWN", "GROWTH", "KINK", "LEFT",
    "NEARLY_SINGULAR", "RESIDUAL_FACTOR", "ROUNDING", "SHORTER", "SMALL_ERROR", "SMALLEST_PART",
    "SMOOTH", "SOLVED", "TOO_NEAR",
)  # fmt: skip
COUNTS = ("MAX_CORRECTIONS", "MAX_SUBSTEPS")
"""The numbers of `criteria` that the march judges by; and the whole ones."""

START_CRITERIA = (
    "AS_NEAR", "ASTRAY", "BEND", "FAR", "FOLDED", "LARGEST_ANGLE", "LONGEST_P", "MIRROR_STEP",
    "MIRRORED", "NEAR_ANGLE", "NEAR_PART", "NUDGE", "SAME_POSITION", "SETTLED", "SHORTEST_STEP",
    "STEEP", "SUFFICIENT", "THROWN", "WILD",
)  # fmt: skip
START_COUNTS = ("MOST_MIRRORED", "RESTARTS")
"""Those that the start judges by besides."""

SETS_CRITERIA = ("ASSEMBLES", "FALLING", "STATIONARY", "TOO_STEEP")
SETS_COUNTS = ("INVERSE_ITERATIONS",)
LINE_CRITERIA = ("FIRST_DIFFERENCE", "SECOND_DIFFERENCE")
"""Those that attempts of many sets are judged by besides; and steps along a line of parameters."""

LANES_CRITERIA = ("ON_CURVE",)
LANES_COUNTS = ("CURVE_CORRECTIONS",)
"""Those that points on curves between others are judged by."""

CAREFUL_COUNTS = ("MAX_ITERATIONS", "PATIENCE")
CAREFUL_CRITERIA = ("ALLOWED_PART", "LARGE_ERROR", "SINGULAR_SENSITIVITY", "TINY")
"""Those that the careful march judges by besides; and STEEP."""

TRANSMISSION_COUNTS = ("MAX_CORRECTIONS", "MAX_ITERATIONS", "MAX_SUBSTEPS")
TRANSMISSION_CRITERIA = (
    "KINK", "LARGE_ERROR", "LAST_CORRECTION", "LONGEST_PART", "NEARLY_SINGULAR", "NEAR_ANGLE",
    "SMALLEST_PART",
    "SMALL_ERROR", "SMOOTH", "SOLVED", "STEEPEST",
)  # fmt: skip
"""Those that a transmission judges by."""

CAREFUL, ABREAST = CHOICES = ("IS_CAREFUL", "HAS_LANES")
"""Choose, where the text is read, which of two marches it is, and whether that takes many points at
once, which pays for a coarse march with curves between."""

TABLES = {
    "ANGULAR": Type("bool", ("N",)),
    "IS_REDUNDANT": Type("bool", ("M",)),
    "PROBE": Type("real", ("most",)),
    "PATTERN": Type("int", ("NONZEROS", "two")),
    "MAY_TURN": Type("bool", ("N",)),
    "COVER": Type("int", ("N",)),
    "IS_ANGLE": Type("bool", ("U",)),
}
"""Which coordinates are angles, which equations repeat others, numbers without a pattern (as many
as there are coordinates or equations), the row and column of each entry of Phi_q; which coordinates
are angles or may be, and of each the first of its body's Euler parameters (N: not one); which
inputs of a transmission are angles."""

CONSTANTS = (
    dict.fromkeys((*SIZES, *ROOM, *STATUSES, *COUNTS, *START_COUNTS, *CAREFUL_COUNTS), INT)
    | dict.fromkeys((*SETS_COUNTS, *LANES_COUNTS), INT)
    | dict.fromkeys((*CRITERIA, *START_CRITERIA, *CAREFUL_CRITERIA, *TRANSMISSION_CRITERIA), REAL)
    | dict.fromkeys((*SETS_CRITERIA, *LANES_CRITERIA), REAL)
    | dict.fromkeys(("NOTHING", "INFINITE", "TURN"), REAL)
    | TABLES
)
"""Names that have one value. `NOTHING` is not a number, `TURN` a whole turn."""


@dataclass(frozen=True, slots=True)
class Word:
    """What a call of a word takes and gives.

    `takes` has a type for each argument: a name of `TYPES`, of a struct, or of several: "number"
    and "rows" are any of the kind, and "same" is as the first argument. `gives` is such a name.
    A word that is lanewise is called for as many lanes as a function that is. `changes` are the
    numbers of the arguments that it changes.
    """

    takes: tuple[str, ...]
    gives: str = ""
    is_lanewise: bool = False
    changes: tuple[int, ...] = ()


KERNELS = ("position", "factor", "nu", "gamma", "constants")
"""Phi and Phi_q, the factors of Phi_q, the right sides, the entries of Phi_q that never change."""


WORDS = {
    # of the mechanism: what kernels compute at points, and x of Phi_q x = b
    **dict.fromkeys(KERNELS, Word(("Point",), is_lanewise=True, changes=(0,))),
    "solve": Word(("Point", "rows"), "Rows[N]", is_lanewise=True),
    # what velocity and acceleration miss of their equations: sums of squares with weights
    "missed": Word(("Point", "rows", "Lane", "Lane"), is_lanewise=True, changes=(2, 3)),
    # of a transmission: correction, slopes, outputs, J at a pose
    "evaluate": Word(("Transmission", "Pose"), changes=(1,)),
    # of numbers
    "abs": Word(("number",), "same"),
    "finite": Word(("number",), "truth"),
    "floor": Word(("number",), "same"),
    "single": Word(("number",), "same"),
    "sqrt": Word(("number",), "same"),
    "max": Word(("number", "same"), "same"),
    "min": Word(("number", "same"), "same"),
    # of lanes: whether it holds for any, a part of a vector from a place on, a lane as a good point
    # and back for lanes from one to before another, the points, without what kernels computed
    "any_lane": Word(("LaneBool",), "Bool", is_lanewise=True),
    "part": Word(("Vector", "Count"), "Lane"),
    "take_up": Word(("State", "Point", "Count"), changes=(0,)),
    "put_at": Word(("Point", "State", "Count", "Count"), changes=(0,)),
    "keep": Word(("Point", "Point"), changes=(0,)),
    # of parameters: the line to those of a table, from a variant on, whose part is now the time
    "lead": Word(("Point", "Table", "Count"), is_lanewise=True, changes=(0,)),
    # of arrays: a copy; the first lanes of rows into a block, at a time, from a variant on
    "copied": Word(("array",), "same"),
    "store": Word(("Block", "rows", "Count", "Count", "Count"), changes=(0,)),
}
"""Words that are called. ``where``, ``row(N)``, ``rows(N)`` and ``lanes`` are read beside them."""
