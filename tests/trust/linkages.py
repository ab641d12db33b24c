"""Random linkages with a position in which each of them is assembled, by plane geometry."""

from dataclasses import dataclass

import numpy as np

import kincompile as kc


@dataclass
class Linkage:
    """A crank with dyads on it, in a position in which it is assembled.

    `place`, `turn` and `size` say where in the world it stands, how it is turned and how long its
    unit is; `q` (n,) are the coordinates, `lengths` (n,) the length of the body of each.
    """

    mechanism: kc.Mechanism
    q: np.ndarray
    lengths: np.ndarray

    @property
    def angles(self):
        return np.arange(self.q.size) % 3 == 2

    def guess(self, rng, degrees=30.0, part=0.1):
        """Return a guess within so many degrees and so large a part of the lengths."""
        angle, length = np.deg2rad(degrees), part * self.lengths
        return self.q + np.where(self.angles, angle, length) * rng.uniform(-1, 1, self.q.size)


class Draught:
    """Puts bars between points of the plane."""

    def __init__(self, name, place=(0.0, 0.0), turn=0.0, size=1.0):
        self.mechanism, self.size, self.turn = kc.Mechanism(name), size, turn
        self._place = np.array(place) * size
        self._axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        self._q, self._lengths = [], []

    def point(self, point):
        return tuple(self._place + self._axes @ (self.size * np.asarray(point)))

    def bar(self, name, first, last):
        """Add a bar between two points; return it, and half of its length."""
        d = np.subtract(last, first)
        angle, length = float(np.arctan2(d[1], d[0])) + self.turn, self.size * float(np.hypot(*d))
        position = (*self.point((np.add(first, last)) / 2), angle)
        self._q += position
        self._lengths += [length] * 3
        return self.mechanism.body(name, guess=position), length / 2

    def linkage(self):
        return Linkage(self.mechanism, np.array(self._q), np.array(self._lengths))


def meeting(first, last, one, other, side=1.0):
    """Return where two bars meet that begin at two points."""
    d = np.subtract(last, first)
    distance = np.hypot(*d)
    along = (one**2 - other**2 + distance**2) / (2 * distance)
    across = side * np.sqrt(one**2 - along**2)
    return first + (along * d + across * np.array([-d[1], d[0]])) / distance


def four_bar(lengths=(0.3, 1.0, 0.8, 1.1), start=1.0, drive=None, **where):
    """Return crank, coupler, rocker and ground, the crank driven from an angle by `drive`."""
    crank, coupler, rocker, ground = lengths
    draught = Draught("four_bar", **where)
    foot, other_foot = np.zeros(2), np.array([ground, 0.0])
    end = crank * np.array([np.cos(start), np.sin(start)])
    head = meeting(end, other_foot, coupler, rocker)
    m = draught.mechanism
    ends = {"crank": (foot, end), "coupler": (end, head), "rocker": (other_foot, head)}
    (one, a), (two, b), (three, c) = (draught.bar(name, *points) for name, points in ends.items())
    m.add(kc.Revolute("A", m.ground, draught.point(foot), one, (-a, 0)))
    m.add(kc.Revolute("B", one, (a, 0), two, (-b, 0)))
    m.add(kc.Revolute("C", two, (b, 0), three, (c, 0)))
    m.add(kc.Revolute("D", three, (-c, 0), m.ground, draught.point(other_foot)))
    m.add(kc.AbsoluteAngle("motor", one, start + draught.turn + (kc.t if drive is None else drive)))
    return draught.linkage()


def random_linkage(rng, dyads):
    """Return a driven crank with dyads of two bars and three pins, one on the other."""
    draught = Draught("random")
    m = draught.mechanism
    angle, length = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 1.0)
    end = length * np.array([np.cos(angle), np.sin(angle)])
    body, half = draught.bar("crank", (0, 0), end)
    m.add(kc.Revolute("pin", m.ground, (0, 0), body, (-half, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t + angle))
    at = (half, 0.0)
    for k in range(dyads):
        foot = rng.uniform(-2, 2, 2)
        d = float(np.hypot(*(foot - end)))
        one = rng.uniform(0.5, 1.5) * max(d, 0.5)
        other = rng.uniform(abs(d - one) + 0.15 * d, d + one - 0.15 * min(d, one))
        head = meeting(end, foot, one, other, rng.choice([-1, 1]))
        first, a = draught.bar(f"first{k}", end, head)
        second, b = draught.bar(f"second{k}", foot, head)
        m.add(kc.Revolute(f"a{k}", body, at, first, (-a, 0)))
        m.add(kc.Revolute(f"b{k}", first, (a, 0), second, (b, 0)))
        m.add(kc.Revolute(f"c{k}", second, (-b, 0), m.ground, tuple(foot)))
        # The next dyad begins beside the first bar of this one.
        beside = rng.uniform(-0.3, 0.3, 2) * one
        along = (head - end) / one
        end = (end + head) / 2 + beside[0] * along + beside[1] * np.array([-along[1], along[0]])
        body, at = first, tuple(beside)
    return draught.linkage()


def dead_centre(lengths=(0.3, 1.0, 0.8, 1.1)):
    """Return a four-bar whose rocker is driven, where crank and coupler are in line."""
    crank, coupler, rocker, ground = lengths
    draught, other_foot = Draught("dead_centre"), np.array([ground, 0.0])
    m = draught.mechanism
    head = meeting(np.zeros(2), other_foot, crank + coupler, rocker)
    end = crank / (crank + coupler) * head
    ends = {"crank": (np.zeros(2), end), "coupler": (end, head), "rocker": (other_foot, head)}
    (one, a), (two, b), (three, c) = (draught.bar(name, *points) for name, points in ends.items())
    m.add(kc.Revolute("A", m.ground, (0, 0), one, (-a, 0)))
    m.add(kc.Revolute("B", one, (a, 0), two, (-b, 0)))
    m.add(kc.Revolute("C", two, (b, 0), three, (c, 0)))
    m.add(kc.Revolute("D", three, (-c, 0), m.ground, (ground, 0)))
    m.add(kc.AbsoluteAngle("motor", three, kc.t + draught.linkage().q[8]))
    return draught.linkage()


def peaucellier(arm=15.0, side=6.0, crank=5.0):
    """Return Peaucellier's inversor, whose crank turns by t / 5 and locks it at 2 acos(0.9)."""
    draught = Draught("peaucellier")
    m, pivot = draught.mechanism, np.array([crank, 0.0])
    end = np.array([2 * crank, 0.0])
    up, down = (meeting(np.zeros(2), end, arm, side, s) for s in (1, -1))
    pencil = up + down - end
    ends = {
        "OA": ((0, 0), up), "OC": ((0, 0), down), "AB": (up, end), "CB": (down, end),
        "AP": (up, pencil), "CP": (down, pencil), "crank": (pivot, end),
    }  # fmt: skip
    bars = {name: draught.bar(name, *points) for name, points in ends.items()}

    def pin(name, one, other):
        (i, at), (j, there) = ((bars[bar][0], (s * bars[bar][1], 0)) for bar, s in (one, other))
        m.add(kc.Revolute(name, i, at, j, there))

    for name, bar, point in (("O1", "OA", (0, 0)), ("O2", "OC", (0, 0)), ("O3", "crank", pivot)):
        m.add(kc.Revolute(name, m.ground, tuple(point), bars[bar][0], (-bars[bar][1], 0)))
    pin("A1", ("OA", 1), ("AB", -1))
    pin("C1", ("OC", 1), ("CB", -1))
    pin("B1", ("AB", 1), ("crank", 1))
    pin("B2", ("CB", 1), ("crank", 1))
    pin("A2", ("OA", 1), ("AP", -1))
    pin("C2", ("OC", 1), ("CP", -1))
    pin("P", ("AP", 1), ("CP", 1))
    m.add(kc.AbsoluteAngle("motor", bars["crank"][0], kc.t / 5))
    return draught.linkage()
