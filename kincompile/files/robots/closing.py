"""Where a robot's tree of links closes its loops: kinematics of the tree, and its starts.

The unknowns are the values of the joints: of a hinge an angle, of a universal joint two, of a ball
a rotation vector. Lengths count in metres beside angles in radians.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kincompile.files.robots.robot import placement, skew, turned

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.files.robots.robot import Array, Closure, Joint, Robot

CLOSED = 1e-11
"""Residual [m, rad] up to which the loops are closed."""
NEAR = 0.3
"""How far a joint may turn in one step of the way to asked values of the motors."""
LEAST_STEP = 1e-3
"""Least step of that way, as a part of it."""
STARTS = 12
"""Starts that are tried; the first is the pose itself, the others are beside it."""
STEPS, WORK = 100, 60_000
"""Steps from one start, and evaluations of a joint in all: a few seconds, then it is given up."""
INDEPENDENT = 1e-7
"""What of a direction is left where it is independent of others."""


class Tree:
    """Kinematics of the tree of a robot, with its loops."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.places: dict[str, slice] = {}
        size = 0
        for joint in robot.joints.values():
            if joint.freedoms:
                self.places[joint.name] = slice(size, size + joint.freedoms)
                size += joint.freedoms
        self.size = size
        self.left = WORK // max(size, 1)  # evaluations
        self._is_above = {
            link: self._mask(joint.name for joint in robot.above(link))
            for closure in robot.closures
            for link in closure.links
        }

    def _mask(self, names: Iterator[str]) -> Array:
        mask = np.zeros((self.size, 1))
        for name in names:
            if name in self.places:
                mask[self.places[name]] = 1
        return mask

    def names(self) -> list[str]:
        """Return the joint of each value."""
        joints = self.robot.joints
        return [name for name in self.places for _ in range(joints[name].freedoms)]

    def frames(self, x: Array) -> tuple[dict[str, Array], Array, Array]:
        """Return the placement of every link in the root, and the twist of each value.

        A twist is the angular velocity and the velocity of the point at the root's origin, two
        arrays (n, 3).
        """
        found = {self.robot.root: np.eye(4)}
        turns, slides = np.zeros((self.size, 3)), np.zeros((self.size, 3))
        for joint in self.robot.joints.values():
            here = found[joint.parent] @ joint.at
            if joint.freedoms:
                place = self.places[joint.name]
                here = _moved(joint, here, x[place], turns[place], slides[place])
            found[joint.child] = here @ _inverse(joint.on)
        return found, turns, slides

    def rows(self, x: Array) -> tuple[Array, Array]:
        """Return the residuals of loops and couplings, and their derivatives by the values."""
        self.left -= 1
        frames, turns, slides = self.frames(x)
        rows, slopes = [np.zeros(0)], [np.zeros((0, self.size))]
        for closure in self.robot.closures:
            sides = []
            for link, at in zip(closure.links, closure.at, strict=True):
                frame, mask = frames[link] @ at, self._is_above[link]
                spin = turns * mask
                sides.append((frame, spin, slides * mask + np.cross(spin, frame[:3, 3])))
            for row, slope in _closure_rows(closure, *sides):
                rows.append(np.atleast_1d(row))
                slopes.append(np.atleast_2d(slope.T))
        for coupling in self.robot.couplings:
            left, right = (self._sum(part) for part in (coupling.left, coupling.right))
            value, along = Polynomial(coupling.polynomial), right @ x
            rows.append(np.atleast_1d(left @ x - value(along)))
            slopes.append(np.atleast_2d(left - value.deriv()(along) * right))
        return np.concatenate(rows), np.concatenate(slopes)

    def _sum(self, factors: Mapping[str, float]) -> Array:
        row = np.zeros(self.size)
        for name, factor in factors.items():
            row[self.places[name]] += factor
        return row

    def limits(self) -> tuple[Array, Array]:
        """Return the least and the greatest of each value."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        for name, place in self.places.items():
            joint = self.robot.joints[name]
            if joint.is_limited:
                low[place], high[place] = joint.limits
        return low, high

    def closed(self, x: Array, free: Array, limits: tuple[Array, Array] | None = None) -> Array:
        """Return values near x at which the loops are closed, as nearly as it could be found.

        Parameters
        ----------
        free
            Which values may change, shape (n,).
        limits
            Between which they stay.
        """
        x = x.copy()

        def at(y: Array) -> Array:
            return _put(x, free, y)

        @lru_cache(maxsize=1)  # of a point residuals are asked for first, derivatives then
        def rows(y: bytes) -> tuple[Array, Array]:
            return self.rows(at(np.frombuffer(y)))

        bounds = (-np.inf, np.inf)
        if limits is not None:
            x = np.where(free, np.clip(x, *limits), x)
            bounds = (limits[0][free], limits[1][free])
        if free.any() and self.rows(x)[0].size:
            done = least_squares(  # type: ignore[operator]
                lambda y: rows(y.tobytes())[0], x[free], lambda y: rows(y.tobytes())[1][:, free],
                bounds, xtol=1e-10, ftol=1e-15, gtol=1e-15, max_nfev=self._steps(),
            )  # fmt: skip
            x = at(done.x)
            for _ in range(3):  # Newton's method leaves rounding errors alone
                row, slope = self.rows(x)
                step = np.linalg.lstsq(slope[:, free], row, rcond=1e-9)[0]
                if np.abs(step).max() < 1e-2:
                    x = _put(x, free, x[free] - step)
        return x

    def _steps(self) -> int:
        """Return how many steps may be made, of two evaluations each."""
        return max(1, min(STEPS, self.left // 2))

    def missed(self, x: Array) -> float:
        """Return the largest residual."""
        return float(np.abs(self.rows(x)[0]).max(initial=0.0))

    def independent(self, x: Array, names: Sequence[str]) -> list[str]:
        """Return those joints that move independently of the ones before, loops closed."""
        slope = self.rows(x)[1]
        _, sizes, right = np.linalg.svd(slope)
        rank = int(np.count_nonzero(sizes > INDEPENDENT * max(sizes.max(initial=0.0), 1.0)))
        motions = right[rank:].T
        basis, found = np.zeros((0, motions.shape[1])), []
        for name in names:
            rest = motions[self.places[name]]
            rest = rest - rest @ basis.T @ basis
            if np.linalg.norm(rest) > INDEPENDENT:
                basis = np.vstack([basis, rest / np.linalg.norm(rest)])
                found.append(name)
        return found


def start_of(tree: Tree, x: Array, *, is_given: bool) -> tuple[Array, list[str]]:
    """Return values at which the loops are closed, near x, and the joints outside their limits.

    Of several assemblies one within the limits is taken, where no pose was given; without one the
    first that was found.
    """
    limits, every = tree.limits(), np.ones(tree.size, dtype=bool)
    rng = np.random.default_rng(1)
    best = None
    for number in range(STARTS):
        begin = x + 0.05 * number * rng.standard_normal(tree.size)
        for bounds in (None,) if is_given else (None, limits):
            if tree.left <= 0:
                break
            found = tree.closed(begin, every, bounds)
            if tree.missed(found) > CLOSED:
                continue
            outside = _outside(tree, found, limits)
            if is_given or not outside:
                return found, outside
            best = best or (found, outside)
    return best or (tree.closed(x, every), [])


def led(tree: Tree, x: Array, wanted: Mapping[str, float]) -> tuple[Array, float]:
    """Follow the motors from x to the values that are wanted; how far it went, 1 at the end.

    A step is halved where the loops do not close, or a joint turns too far.
    """
    free, goal = np.ones(tree.size, dtype=bool), x.copy()
    for name, value in wanted.items():
        free[tree.places[name]] = False
        goal[tree.places[name]] = value
    first, done, step = x, 0.0, 1.0
    while done < 1 and step > LEAST_STEP and tree.left > 0:
        part = min(1.0, done + step)
        found = tree.closed(np.where(free, x, first + part * (goal - first)), free)
        if tree.missed(found) < CLOSED and np.abs(found - x).max() < NEAR:
            x, done, step = found, part, 2 * step
        else:
            step /= 2
    return x, done


def _put(x: Array, free: Array, y: Array) -> Array:
    made = x.copy()
    made[free] = y
    return made


def _outside(tree: Tree, x: Array, limits: tuple[Array, Array]) -> list[str]:
    low, high = limits
    names = tree.names()
    return [names[k] for k in np.flatnonzero((x < low - 1e-9) | (x > high + 1e-9))]


def _inverse(frame: Array) -> Array:
    turn = frame[:3, :3].T
    return placement(-turn @ frame[:3, 3], turn)


def _spin_of(rotation: Array) -> Array:
    """Return J (3, 3): the angular velocity, before the turn, is J times the vector's rate."""
    angle = float(np.linalg.norm(rotation))
    v = skew(rotation)
    if angle < 1e-4:
        return np.asarray(np.eye(3) + v / 2 + v @ v / 6)
    a, b = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + a * v + b * v @ v)


def _moved(joint: Joint, here: Array, values: Array, turns: Array, slides: Array) -> Array:
    """Return a joint's frame after its motion; write the twists of its values."""
    turn, r = here[:3, :3], here[:3, 3]
    if joint.kind == "spherical":
        turns[:] = (turn @ _spin_of(values)).T
        moved = placement(r, turn @ turned(values))
    elif joint.kind == "prismatic":
        slides[0] = turn @ joint.axes[0]
        return placement(r + values[0] * slides[0], turn)
    else:
        for k, (axis, value) in enumerate(zip(joint.axes, values, strict=True)):
            turns[k] = turn @ axis
            turn = turn @ turned(value * axis)
        moved = placement(r, turn)
    slides[:] = np.cross(r, turns)
    return moved


Side = tuple["Array", "Array", "Array"]
"""A frame of a loop, its angular velocity by each value (n, 3), and that of its origin (n, 3)."""


def _closure_rows(closure: Closure, a: Side, b: Side) -> Iterator[tuple[Array, Array]]:
    """Yield residuals (k,) and their derivatives (n, k)."""
    (frame_a, spin_a, rate_a), (frame_b, spin_b, rate_b) = a, b
    d, d_rate = frame_b[:3, 3] - frame_a[:3, 3], rate_b - rate_a
    u, v = frame_a[:3, :3] @ closure.axes[0], frame_b[:3, :3] @ closure.axes[1]
    u_rate, v_rate = np.cross(spin_a, u), np.cross(spin_b, v)
    if closure.kind == "prismatic":
        along = u_rate @ d + d_rate @ u
        yield d - u * (u @ d), d_rate - u_rate * (u @ d) - np.outer(along, u)
    else:
        yield d, d_rate
    if closure.kind == "revolute":  # 1 - u.v: opposite axes are no root
        yield np.cross(u, v), np.cross(u_rate, v) + np.cross(u, v_rate)
        yield np.array([1 - u @ v]), -(u_rate @ v + v_rate @ u)[:, None]
    elif closure.kind == "universal":
        yield np.array([u @ v]), (u_rate @ v + v_rate @ u)[:, None]
    elif closure.kind in ("fixed", "prismatic"):
        turn = frame_b[:3, :3] @ frame_a[:3, :3].T
        rotation = Rotation.from_matrix(turn).as_rotvec()
        yield rotation, (spin_b - spin_a @ turn.T) @ np.linalg.inv(_spin_of(rotation)).T
