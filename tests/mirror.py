"""A second implementation of whole mechanisms, with 100 digits: rows, masses, loads, motion.

It reads the mechanism as it was written and the formulas of docs/joints.md, docs/space.md and
docs/forces.md (`by_hand`), and shares no code with the compiler. Every derivative is a difference.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import sympy
from sympy.printing.pycode import MpmathPrinter

import kincompile as kc
from kincompile import spatial
from kincompile.model.arguments import Kind
from kincompile.model.constraint import Constraint
from tests.by_hand import BY_HAND, IN_SPACE, cross, mp, product, rotated, triad, vector

STEP = mp.mpf(10) ** -16
VECTORS = (Kind.POINT, Kind.AXIS)
FUNCTIONS = {name: getattr(mp, name) for name in ("sin", "cos", "exp", "sqrt", "mpf", "pi")}

Array = Any
"""An array of numbers with 100 digits: three differences of one another lose 48 of them."""


def exact(numbers: Any) -> Array:
    """Return doubles with all their digits, as an array of objects."""
    return np.vectorize(mp.mpf, otypes=[object])(np.asarray(numbers, dtype=float))


def slope(function: Callable[[Any], Array]) -> Array:
    """Return the derivative of a function of one number at 0."""
    return (function(STEP) - function(-STEP)) / (2 * STEP)


def along(function: Callable[[Any], Array], direction: Array, s: Any) -> Array:
    """Return the derivative of something by the coordinates, along a direction."""
    return slope(lambda h: function(moved(s, q=direction * h)))


class Mirror:
    """A mechanism, by hand: each quantity at one q, q_dot, t and p."""

    def __init__(self, mechanism: Any, module: Any) -> None:
        self.m, self.in_space = mechanism, isinstance(mechanism, spatial.Mechanism)
        self.coordinates, self.parameters = module.COORDINATES, module.PARAMETERS
        self.first = {name: first for name, first, _ in module.BODIES}
        self.defaults = exact(module.DEFAULTS)
        rates = [f"{name}_dot" for name in self.coordinates]
        self._symbols = sympy.symbols(["alpha", "t", *self.parameters, *self.coordinates, *rates])
        self._functions: dict[Any, Any] = {}

    # ---- values, bodies and what the formulas read ----------------------------------------------

    def value(self, given: Any, s: Any, alpha: Any = 0) -> Any:
        """Return a number, or an expression at a state, and at an angle of a profile."""
        if not isinstance(given, sympy.Basic):
            return mp.mpf(given)
        if given not in self._functions:
            printer = MpmathPrinter({"fully_qualified_modules": False})
            self._functions[given] = sympy.lambdify(
                self._symbols, given, modules=[FUNCTIONS], printer=printer
            )
        return mp.mpf(self._functions[given](alpha, s.t, *s.p, *s.q, *s.q_dot))

    def values(self, given: Sequence[Any], s: Any) -> Any:
        """Return the components of a point or a direction: a number of the complex plane."""
        numbers = [self.value(item, s) for item in given]
        return vector(numbers) if self.in_space else mp.mpc(*numbers)

    def place(self, body: Any) -> Any:
        """Return the first column of a body, None of the ground."""
        return self.first.get(getattr(body, "name", body))

    def put(self, w: Any, index: str, body: Any, s: Any) -> None:
        """Give a world the place and the rotation of a body."""
        k = self.place(body)
        if self.in_space:
            r, p = (vector([0] * 3), vector([1, 0, 0, 0])) if k is None else np.split(
                s.q[k : k + 7], [3]
            )  # fmt: skip
            found = {"r": r, "p": p, "A": lambda v: rotated(p, v)}
        else:
            x, y, phi = exact([0] * 3) if k is None else s.q[k : k + 3]
            found = {"r": mp.mpc(x, y), "phi": phi, "A": mp.expj(phi)}
        vars(w).update({f"{name}_{index}": item for name, item in found.items()})

    def world(self, item: Any, s: Any) -> SimpleNamespace:
        """Return what the formula of a constraint or a load reads, by the joint's symbols."""
        w, given = SimpleNamespace(), type(item).arguments()
        for name, argument in given.items():
            written = getattr(item, name)
            if argument.kind is Kind.BODY:
                self.put(w, argument.symbol, written, s)
            elif argument.kind in (*VECTORS, Kind.LOADS):
                setattr(w, argument.symbol, self.values(written, s))
            elif argument.kind is not Kind.PROFILE:
                setattr(w, argument.symbol, self.value(written, s))
        if self.in_space:
            put_triads(w)
        contacts = type(item).contacts_of(item.name) if isinstance(item, Constraint) else ()
        profiles = [(x.symbol[-1], name) for name, x in given.items() if x.kind is Kind.PROFILE]
        for k, name in enumerate(contacts):
            alpha = s.q[self.coordinates.index(name)]
            w.alpha_i = alpha
            if profiles:
                self.put_profile(w, profiles[k][0], getattr(item, profiles[k][1]), alpha, s)
        return w

    def put_profile(self, w: Any, index: str, rho: Any, alpha: Any, s: Any) -> None:
        """Give a world the point of a profile, and its tangent: rho u and (rho u)'."""
        rho = sympy.sympify(rho)
        radius, rise = (self.value(item, s, alpha) for item in (rho, rho.diff(kc.alpha)))
        setattr(w, f"a_{index}", radius * mp.expj(alpha))
        setattr(w, f"g_{index}", (rise + 1j * radius) * mp.expj(alpha))

    # ---- constraints ----------------------------------------------------------------------------

    def Phi(self, s: Any) -> Array:
        """Return all rows, in the order in which the mechanism has them."""
        table, found = IN_SPACE if self.in_space else BY_HAND, []
        for item in self.m.constraints:
            if isinstance(item, kc.Equation):
                found += [self.value(row, s) for row in item.expressions]
            else:
                found += table[type(item).__name__](self.world(item, s))
        if self.in_space:
            found += [product(*[s.q[k + 3 : k + 7]] * 2) - 1 for k in self.first.values()]
        return np.array(found, dtype=object)

    def kinematics(self, s: Any, Phi: Any = None) -> tuple[Array, Array, Array, Array]:
        """Return Phi, Phi_q, nu and gamma, by differences of Phi, or of what is given for it."""
        rows = self.Phi if Phi is None else Phi
        n = len(s.q)

        def along(dq: Any, dt: int) -> Callable[[Any], Array]:
            return lambda h: rows(moved(s, q=dq * h, t=h * dt))

        columns = [slope(along(direction, 0)) for direction in np.eye(n, dtype=int)]
        way, here = along(s.q_dot, 1), rows(s)
        bend = (way(STEP) - here * 2 + way(-STEP)) / STEP**2
        return here, np.array(columns).T, -slope(along(0 * s.q, 1)), -bend

    def by_parameter(self, s: Any, which: int) -> Array:
        """Return Phi and its total derivative by a parameter; s.q has q and then q_p."""
        n = len(self.coordinates)
        q, q_p = s.q[:n], s.q[n:]
        step = np.array([int(k == which) for k in range(len(s.p))])
        base = SimpleNamespace(q=q, q_dot=s.q_dot[:n], t=s.t, p=s.p)
        change = slope(lambda h: self.Phi(moved(base, q=q_p * h, p=step * h)))
        return np.concatenate([self.Phi(base), change])

    # ---- masses and loads -----------------------------------------------------------------------

    def point(self, body: Any, local: Any, s: Any) -> Array:
        """Return a point of a body as an array of its components."""
        w = SimpleNamespace()
        self.put(w, "i", body, s)
        if self.in_space:
            return w.r_i + w.A_i(local)
        place = w.r_i + w.A_i * local
        return np.array([place.real, place.imag], dtype=object)

    def rate(self, function: Callable[[Any], Array], s: Any) -> Array:
        """Return the rate of something that depends on the coordinates alone."""
        return along(function, s.q_dot, s)

    def kinetic_energy(self, body: Any, s: Any) -> Any:
        """Return m v^T v/2 + omega'^T J omega'/2 with the velocity of the centre of mass."""
        centre = self.values(body.centre or (0,) * (3 if self.in_space else 2), s)
        v = self.rate(lambda at: self.point(body, centre, at), s)
        mass, k = self.value(body.mass, s), self.place(body)
        if not self.in_space:
            return (mass * product(v, v) + self.value(body.inertia, s) * s.q_dot[k + 2] ** 2) / 2
        p, p_dot = s.q[k + 3 : k + 7], s.q_dot[k + 3 : k + 7]
        e, e_dot = p[1:], p_dot[1:]
        omega = (e_dot * p[0] - e * p_dot[0] - cross(e, e_dot)) * 2  # 2 G p_dot
        inertia = vector([self.value(item, s) for item in body.inertia])
        return (mass * product(v, v) + product(omega, omega * inertia)) / 2

    @cached_property
    def heavy(self) -> list[Any]:
        """The bodies that have a mass."""
        return [body for body in self.m.bodies if body.mass]

    def columns(self, body: Any) -> range:
        """Return the columns of a body."""
        first = self.place(body)
        return range(0) if first is None else range(first, first + (7 if self.in_space else 3))

    def M(self, s: Any) -> Array:
        """Return the mass matrix: T is quadratic in the rates."""
        n = len(s.q)
        found, unit = exact(np.zeros((n, n))), np.eye(n, dtype=int)
        for body in self.heavy:

            def energy(rates: Any, body: Any = body) -> Any:
                return self.kinetic_energy(body, SimpleNamespace(**{**vars(s), "q_dot": rates}))

            alone = {k: energy(exact(unit[k])) for k in self.columns(body)}
            for k in alone:
                for c in alone:
                    both = energy(exact(unit[k] + unit[c]))
                    found[k, c] += both - alone[k] - alone[c]
        return found

    def Q(self, s: Any) -> Array:
        """Return the generalised forces, with those of inertia that are quadratic in the rates."""
        found = exact(np.zeros(len(s.q)))
        for body in self.heavy:
            columns = self.columns(body)

            def energy(at: Any, body: Any = body) -> Any:
                return self.kinetic_energy(body, at)

            def momentum(at: Any, columns: Any = columns, energy: Any = energy) -> Array:
                unit = np.eye(len(at.q), dtype=int)
                return np.array(  # T is quadratic in the rates: the step may be one
                    [(energy(moved(at, q_dot=unit[k])) - energy(moved(at, q_dot=-unit[k]))) / 2
                     for k in columns], dtype=object,
                )  # fmt: skip

            turn = self.rate(momentum, s)
            for k, row in zip(columns, turn, strict=True):
                unit = np.array([int(c == k) for c in range(len(s.q))])
                found[k] += along(energy, unit, s) - row
        for force, place, bodies in self.works(s):
            for k in (k for body in bodies for k in self.columns(body)):
                unit = np.array([int(c == k) for c in range(len(s.q))])
                found[k] += product(force, along(place, unit, s))
        return found

    def works(self, s: Any) -> Iterator[tuple[Array, Callable[[Any], Array], Sequence[Any]]]:
        """Yield forces, each with what it does work on as a function of the state."""
        for body in self.heavy:
            centre = self.values(body.centre or (0,) * (3 if self.in_space else 2), s)
            gravity = np.array([self.value(item, s) for item in self.m.gravity], dtype=object)
            weight = gravity * self.value(body.mass, s)
            yield weight, partial(self.point, body, centre), (body,)
        for load in self.m.loads:
            w, kind = self.world(load, s), type(load).__name__
            bodies = [getattr(load, name) for name, x in type(load).arguments().items()
                      if x.kind is Kind.BODY]  # fmt: skip
            if kind in ("Force", "FollowerForce"):
                force = w.f
                if kind == "FollowerForce":
                    force = w.A_i(force) if self.in_space else w.A_i * force
                if not self.in_space:
                    force = np.array([force.real, force.imag], dtype=object)
                yield force, partial(self.point, bodies[0], w.s_i), bodies
            elif kind == "Spring":
                length = self.length(load)
                pull = w.k * (length(s)[0] - w.l_0) + w.c * self.rate(length, s)[0] + w.F
                yield np.array([-pull]), length, bodies
            elif kind == "SliderFriction":
                along = self.sliding(load)
                yield self.friction(w, self.rate(along, s)[0]), along, bodies
            else:
                yield from self.couples(load, kind, w, bodies, s)

    def friction(self, w: Any, v: Any) -> Array:
        """Return -F v/sqrt(v^2 + v_0^2)."""
        return np.array([-w.F * v / mp.sqrt(v**2 + w.v_0**2)])

    def length(self, load: Any) -> Callable[[Any], Array]:
        """Return the distance of two points as a function of the state."""

        def length(at: Any) -> Array:
            w = self.world(load, at)
            way = self.point(load.j, w.s_j, at) - self.point(load.i, w.s_i, at)
            return np.array([mp.sqrt(product(way, way))])

        return length

    def sliding(self, load: Any) -> Callable[[Any], Array]:
        """Return the way of a point along an axis as a function of the state."""

        def way(at: Any) -> Array:
            w = self.world(load, at)
            d = self.point(load.j, w.s_j, at) - self.point(load.i, w.s_i, at)
            if self.in_space:
                axis, size = w.A_i(w.v_i), mp.sqrt(product(w.v_i, w.v_i))
            else:
                turned, size = w.A_i * w.v_i, abs(w.v_i)
                axis = np.array([turned.real, turned.imag], dtype=object)
            return np.array([product(axis, d) / size])

        return way

    def couples(
        self, load: Any, kind: str, w: Any, bodies: Any, s: Any
    ) -> Iterator[tuple[Array, Callable[[Any], Array], Sequence[Any]]]:
        """Yield what torques, torsion springs and friction of hinges do."""
        if not self.in_space:

            def turned(at: Any) -> Array:
                angles = [0 if self.place(b) is None else at.q[self.place(b) + 2] for b in bodies]
                return np.array([angles[-1] - (angles[0] if len(angles) == 2 else 0)])

            if kind == "Torque":
                yield np.array([w.F]), turned, bodies
                return
            speed, angle = self.rate(turned, s)[0], turned(s)[0]
            if kind == "HingeFriction":
                yield self.friction(w, speed), turned, bodies
            else:
                torque = w.k * (angle - w.phi_0) + w.c * speed + w.F
                yield np.array([-torque]), turned, bodies
            return
        eye = np.eye(3, dtype=int).tolist()
        if kind in ("Torque", "FollowerTorque"):
            # About each axis a force at the tip of the second axis along the third one.
            axes = [w.A_i(vector(axis)) for axis in eye]
            own = w.f if kind == "FollowerTorque" else [product(w.f, axis) for axis in axes]
            for k, part in enumerate(own):
                arm = partial(self.arrow, bodies[0], vector(eye[k - 2]))
                yield axes[k - 1] * part, arm, bodies
            return
        ends = [(bodies[1], w.f_j, w.A_j(w.g_j), 1), (bodies[0], w.f_i, w.A_i(w.g_i), -1)]
        arrows = [partial(self.arrow, body, f) for body, f, _, _ in ends]
        speed = sum(
            sign * product(g, self.rate(arrow, s))
            for (_, _, g, sign), arrow in zip(ends, arrows, strict=True)
        )
        if kind == "HingeFriction":
            torque = self.friction(w, speed)[0]
        else:
            torque = -(w.k * (w.theta - w.phi_0) + w.c * speed + w.F)
        for (body, _, g, sign), arrow in zip(ends, arrows, strict=True):
            yield g * (sign * torque), arrow, (body,)

    def arrow(self, body: Any, local: Any, s: Any) -> Array:
        """Return a direction of a body in space."""
        w = SimpleNamespace()
        self.put(w, "i", body, s)
        return w.A_i(local)

    # ---- the motion -----------------------------------------------------------------------------

    def dynamics(self, s: Any) -> tuple[Array, Array]:
        """Return q_ddot and lambda of M q_ddot + Phi_q^T lambda = Q and Phi_q q_ddot = gamma."""
        _, Phi_q, _, gamma = self.kinematics(s)
        m, n = Phi_q.shape
        left = exact(np.zeros((n + m, n + m)))
        left[:n, :n], left[:n, n:], left[n:, :n] = self.M(s), Phi_q.T, Phi_q
        right = np.concatenate([self.Q(s), gamma])
        found = mp.lu_solve(mp.matrix(left.tolist()), mp.matrix(right.tolist()))
        numbers = np.array([found[k] for k in range(n + m)], dtype=object)
        return numbers[:n], numbers[n:]


def put_triads(w: Any) -> None:
    """Give a world the unit triads about its axes; without a cross f is farthest from h."""
    for index in "ij":
        h, f = getattr(w, f"h_{index}", None), getattr(w, f"f_{index}", None)
        if h is not None:
            farthest = min(range(3), key=lambda k: abs(h[k]))
            beside = vector([k == farthest for k in range(3)]) if f is None else f
            found = dict(zip("fgh", triad(h, beside), strict=True))
            vars(w).update({f"{name}_{index}": item for name, item in found.items()})


def moved(s: Any, **changes: Any) -> SimpleNamespace:
    """Return a state of which some parts are changed by so much."""
    return SimpleNamespace(
        **{**vars(s), **{key: getattr(s, key) + x for key, x in changes.items()}}
    )
