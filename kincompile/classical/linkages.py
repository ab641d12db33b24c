"""Linkages of the literature as drawings, driven and with their lengths as parameters.

Each function returns a `Sketch`: ``kc.linkages.hoeken().mechanism()`` is a model that runs. Lengths
are parameters that are named by the joints they join, ``AB``, or as in the source. Joints O and C
are on the ground, P is the point that is watched, G the foot of a leg.
"""

from __future__ import annotations

import math
from typing import Any

from kincompile.model.expressions import deg, pi, t
from kincompile.model.sketch import Sketch


def hoeken(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Hoeken's linkage: P goes along y = 4 while the crank makes the first half turn.

    It is off the straight line by 0.00975 of a crank of 1, over a stroke of 4.

    Parameters
    ----------
    scale
        Factor of all lengths; the crank O A is 1.
    length_unit
        Unit of length.

    Notes
    -----
    Proportions 1 : 2 : 2.5 : 2.5 : 5 of crank, ground, coupler, rocker and A P, as in Norton,
    Design of Machinery, straight-line mechanisms. The linkage is a cognate of `chebyshev`.
    """
    s = _sketch("hoeken", length_unit)
    s.ground(O=(0, 0), C=(s.length("OC", 2 * scale), 0))
    _joints(s, scale, A=(0, 1), B=(2, 2.5), P=(4, 4))
    s.link("crank", "O A", s.length("OA", scale))
    s.link("coupler", "A B P", AB=s.length("AB", 2.5 * scale), P=(s.length("AP", 5 * scale), 0))
    s.link("rocker", "C B", s.length("CB", 2.5 * scale))
    s.drive("crank", pi / 2 + 2 * pi * t)
    return s


def chebyshev(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Chebyshev's linkage: the middle P of the coupler goes along y = 4 for half its turn.

    The coupler, the shortest link, makes a turn. P is off the straight line by 0.00975 over a
    stroke of 4 in the first half.

    Parameters
    ----------
    scale
        Factor of all lengths; the coupler is 2.
    length_unit
        Unit of length.

    Notes
    -----
    Proportions 4 : 5 : 2 : 5 of ground, rocker, coupler and rocker, which are crossed: P. L.
    Chebyshev, Theorie des mecanismes connus sous le nom de parallelogrammes, 1854.
    """
    s = _sketch("chebyshev", length_unit)
    s.ground(O=(0, 0), C=(s.length("OC", 4 * scale), 0))
    _joints(s, scale, A=(4, 3), B=(4, 5), P=(4, 4))
    rocker, coupler = s.length("OA", 5 * scale), s.length("AB", 2 * scale)
    s.link("left_rocker", "O A", rocker)
    s.link("right_rocker", "C B", rocker)
    s.link("coupler", "A B P", AB=coupler, P=(coupler / 2, 0))
    s.drive("coupler", pi / 2 + 2 * pi * t)
    return s


def watt(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Watt's linkage: the middle P of the coupler goes along x = 0, a rocker 20 deg a side.

    Near the middle P is off the line by y^5/(4 OA^3 AB), at the ends by 0.006 over a stroke of 1.4.

    Parameters
    ----------
    scale
        Factor of all lengths; the coupler is 1.
    length_unit
        Unit of length.

    Notes
    -----
    James Watt's patent of 1784: equal rockers, which are parallel, and square to the coupler, in
    the middle. Any lengths do; 2 : 1 are those of many drawings.
    """
    s = _sketch("watt", length_unit)
    rocker, coupler = s.length("OA", 2 * scale), s.length("AB", scale)
    s.ground(O=(-rocker, coupler / 2), C=(rocker, -coupler / 2))
    _joints(s, scale, A=(-0.12, -0.18), B=(0.12, -1.15), P=(0, -0.67))
    s.link("left_rocker", "O A", rocker)
    s.link("right_rocker", "C B", rocker)
    s.link("coupler", "A B P", AB=coupler, P=(coupler / 2, 0))
    s.drive("left_rocker", 20 * deg * (2 * t - 1))
    return s


def roberts(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Roberts's linkage: P, the tip of the coupler, goes along the ground from O to C.

    P is on the line at both ends and in the middle, and elsewhere off by up to 0.0136. The driver
    is ``P.x``, so that its range holds for all lengths.

    Parameters
    ----------
    scale
        Factor of all lengths; the ground O C is 2.
    length_unit
        Unit of length.

    Notes
    -----
    Richard Roberts's proportions: A B is half of O C, and the four legs O A, A P, P B, B C are
    equal and longer than that half: 0.6 of O C here.
    """
    s = _sketch("roberts", length_unit)
    ground, leg = s.length("OC", 2 * scale), s.length("OA", 1.2 * scale)
    s.ground(O=(0, 0), C=(ground, 0))
    _joints(s, scale, A=(0.5, 1.09), B=(1.5, 1.09), P=(1, 0))
    s.link("left_rocker", "O A", leg)
    s.link("right_rocker", "C B", leg)
    s.link("coupler", "A B P", AB=ground / 2, AP=leg, BP=leg)
    s.drive("P.x", ground * t)
    return s


def evans(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Evans's grasshopper linkage: P goes along x = 0 through the pivot O of the crank.

    With a slider along y = 0 in place of the rocker C B the line would be exact, Scott Russell's; a
    longer rocker, with C as far below that line, brings it nearer. With the lengths here P is off
    by 0.0055 over a stroke of 2.

    Parameters
    ----------
    scale
        Factor of all lengths; the crank is 1.
    length_unit
        Unit of length.

    Notes
    -----
    Crank, both halves A B and A P of the beam and rocker are equal, the ground O C is twice as
    long and 30 degrees below the line: the example of the Ch Mechanism Toolkit, SoftIntegration.
    """
    s = _sketch("evans", length_unit)
    s.ground(O=(0, 0), C=(s.length("C_x", math.sqrt(3) * scale), -s.length("C_y", scale)))
    _joints(s, scale, A=(0.87, -0.5), B=(1.73, 0), P=(0, -1))
    beam = s.length("AB", scale)
    s.link("crank", "O A", s.length("OA", scale))
    s.link("beam", "B A P", BA=beam, P=(beam + s.length("AP", scale), 0))
    s.link("rocker", "C B", s.length("CB", scale))
    s.drive("crank", 30 * deg * (2 * t - 1))
    return s


def peaucellier(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return Peaucellier's cell: P goes exactly along a straight line.

    D goes on a circle through O, and O D * O P = OA^2 - AP^2, so that x = (OA^2 - AP^2)/(2 OC).

    Parameters
    ----------
    scale
        Factor of all lengths; the ground O C is 1.5.
    length_unit
        Unit of length.

    Notes
    -----
    C.-N. Peaucellier, 1864. Any lengths do for which the rhombus can reach: arms of 5, sides of 3
    and the crank C D, as long as O C, of 1.5; the crank turns by 80 degrees to either side.
    """
    s = _sketch("peaucellier", length_unit)
    crank = s.length("OC", 1.5 * scale)
    arm, side = s.length("OA", 5 * scale), s.length("AP", 3 * scale)
    s.ground(O=(0, 0), C=(crank, 0))
    _joints(s, scale, D=(1.76, -1.48), A=(4.7, -0.9), B=(2.38, -4.38), P=(5.33, -4.47))
    s.link("crank", "C D", crank)
    for joint, name in (("A", "upper"), ("B", "lower")):
        s.link(f"{name}_arm", f"O {joint}", arm)
        s.link(f"{name}_inner", f"D {joint}", side)
        s.link(f"{name}_outer", f"{joint} P", side)
    s.drive("crank", 80 * deg * (2 * t - 1))
    s.point("P")
    return s


def dwell_six_bar(scale: float = 1.0, *, length_unit: str = "m") -> Sketch:
    """Return a six-bar whose output rests for 126 degrees of the crank, within 0.1 degrees.

    The coupler point P of a crank-rocker goes along an arc of a circle about D while the crank
    turns from 120 to 247 degrees, so that the rod P D holds the output E D; then this swings by
    36.1 degrees.

    Parameters
    ----------
    scale
        Factor of all lengths; the crank is 1.
    length_unit
        Unit of length.

    Notes
    -----
    The construction of the textbooks, such as Norton, Design of Machinery, linkages with dwells. A
    coupler as long as the rocker and as B P makes the curve of P symmetric, so that the circle of
    least squares about its axis is near for long. Dimensions ours.
    """
    s = _sketch("dwell_six_bar", length_unit)
    pivot = s.length("E_x", 9.26 * scale), s.length("E_y", 8.5 * scale)
    s.ground(O=(0, 0), C=(s.length("OC", 3.5 * scale), 0), E=pivot)
    _joints(s, scale, A=(1, 0), B=(2.25, 4.32), P=(5.99, 6.83), D=(7.85, 10.57))
    equal = s.length("AB", 4.5 * scale)
    s.link("crank", "O A", s.length("OA", scale))
    s.link("coupler", "A B P", AB=equal, BP=equal, AP=s.length("AP", 8.457 * scale))
    s.link("rocker", "C B", equal)
    s.link("rod", "P D", s.length("PD", 4.175 * scale))
    s.link("output", "E D", s.length("ED", 2.5 * scale))
    s.drive("crank", 2 * pi * t)
    s.point("P")
    return s


def klann(scale: float = 1.0, *, length_unit: str = "mm") -> Sketch:
    """Return Joe Klann's leg: the foot G of a turn of the crank strides and is lifted.

    Parameters
    ----------
    scale
        Factor of all lengths; the crank A C is 17.5.
    length_unit
        Unit of length.

    Notes
    -----
    The linkage of US patent 6,260,862, with lengths as published at boim.com/Walkin8r.
    """
    s = _sketch("klann", length_unit, end=4.0)
    lower, upper = (s.length(name, value * scale) for name, value in (("BH", 23.7), ("DE", 34.1)))
    s.ground(A=(0, 0), B=(-38.8 * scale, -12.5 * scale), D=(-14.6 * scale, 41.9 * scale))
    _joints(s, scale, C=(17, 0), H=(-20, 4), F=(-55, 12), E=(-40, 65), G=(-40, -40))
    s.link("crank", "A C", s.length("AC", 17.5 * scale))
    s.link("connecting_rod", "C F H", **_lengths(s, scale, CF=73.4, CH=38.8, FH=35.2))
    s.link("lower_rocker", "B H", lower)
    s.link("upper_rocker", "D E", upper)
    s.link("leg", "E F G", **_lengths(s, scale, EF=57.7, FG=59.0, EG=111.7))
    s.drive("crank", -pi / 2 * t)
    return s


def jansen(scale: float = 1.0, *, length_unit: str = "mm") -> Sketch:
    """Return Theo Jansen's leg: the foot G of a turn of the crank steps nearly level.

    Parameters
    ----------
    scale
        Factor of all lengths; the crank m is 15.
    length_unit
        Unit of length.

    Notes
    -----
    The eleven numbers a to k that Theo Jansen has published for his Strandbeest, and l and m.
    """
    s = _sketch("jansen", length_unit)
    published = {
        "a": 38.0, "l": 7.8, "m": 15.0, "j": 50.0, "k": 61.9, "b": 41.5, "d": 40.1, "e": 55.8,
        "c": 39.3, "f": 39.4, "g": 36.7, "h": 65.7, "i": 49.0,
    }  # fmt: skip
    n = _lengths(s, scale, **published)
    s.ground(O=(0, 0), B=(-n["a"], -n["l"]))
    _joints(s, scale, A=(15, 0), C=(-20, 30), D=(-70, 15), E=(-25, -45), F=(-60, -30), G=(-30, -95))
    s.link("crank", "O A", n["m"])
    s.link("upper_rod", "A C", n["j"])
    s.link("lower_rod", "A E", n["k"])
    s.link("plate", "B C D", BC=n["b"], BD=n["d"], CD=n["e"])
    s.link("rocker", "B E", n["c"])
    s.link("side_rod", "D F", n["f"])
    s.link("leg", "E F G", EF=n["g"], FG=n["h"], EG=n["i"])
    s.drive("crank", 2 * pi * t)
    return s


def _sketch(name: str, length_unit: str, end: float = 1.0) -> Sketch:
    return Sketch(name, length_unit=length_unit, end=end, points=361)


def _joints(s: Sketch, scale: float, **places: tuple[float, float]) -> None:
    """Draw joints where they are, roughly, at the start."""
    s.joints(**{name: (x * scale, y * scale) for name, (x, y) in places.items()})


def _lengths(s: Sketch, scale: float, **lengths: float) -> dict[str, Any]:
    """Declare lengths as parameters and return them by name."""
    return {name: s.length(name, value * scale) for name, value in lengths.items()}
