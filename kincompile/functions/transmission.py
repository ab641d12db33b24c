r"""`kc.transmission`: a mechanism as a function x(u), with its derivatives and torque maps.

The inputs are parameters of the mechanism, so its positions are those of sets of parameters, and
the derivatives in

.. math:: J = \frac{\partial x}{\partial u}, \qquad \dot x = J \dot u, \qquad
          \ddot x = J \ddot u + \dot J \dot u, \qquad \tau_u = J^T \tau_x

are its sensitivities to them. A velocity, such as omega of a body, has no x, but it has a J: its
derivatives by the rates v of inputs u + v t, at t = 0. Nothing here solves, and nothing here
differentiates.
"""

from __future__ import annotations

import math
import warnings
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compiled
from kincompile.errors import (
    AssemblyWarning,
    InputError,
    SingularConfigurationWarning,
    SolveError,
)
from kincompile.functions.poses import Pose, Poses, Signature
from kincompile.html import Shown
from kincompile.names import listed, unknown
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import mapping_of, names_of
from kincompile.runtime.problem import problem
from kincompile.runtime.singular.assemblies import assemblies
from kincompile.runtime.solve import solve, solve_sets
from kincompile.transmissions.inverted import inverted
from kincompile.transmissions.loop import loop_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.transmissions.loop import Loop

    Array = NDArray[np.float64]
    Values = Mapping[str, ArrayLike] | None

SAME = 1e-9
"""Poses whose outputs differ by less, in scales, are one."""


def transmission(
    model: Mechanism | ConstraintSystem,
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    *,
    target: str = "numpy",
) -> Transmission:
    """Make a mechanism a function from inputs to outputs, with exact derivatives.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.
    inputs
        Names of drivers, or of other constraints that have a value, whose value becomes an input,
        and of coordinates, as ``"phi_crank"`` or ``"crank.phi"``. A motion law is not needed.
    outputs
        Names of coordinates, outputs and points, and of velocities: components of the angular
        velocity of a body in space, ``"omega_x_foot"`` in the ground's frame or ``"omega_xi_foot"``
        in its own, or an output that is linear in rates. J maps u_dot to them, and `effort` their
        torques to the inputs; they have no x, so theirs is NaN.
    target
        ``"numpy"``, or ``"c"`` for compiled functions, as for `compile`.

    Returns
    -------
    Transmission
        Its first pose is that at the value of each driver, or at the guess of a coordinate.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If a name is unknown, something depends on time, the inputs are not as many as the degrees
        of freedom, or do not determine an output.
    SolveError
        If it cannot be assembled at the first values of its inputs.
    """
    loop = loop_of(model, names_of(inputs, "inputs"), names_of(outputs, "outputs"), moving=True)
    return Transmission(loop, target=target)


class Transmission(Shown):
    """A mechanism as a function x(u) of m inputs and n outputs, made by `kc.transmission`.

    Inputs are arrays (..., m) and outputs (..., n): one pose, or any batch. `p` gives parameters by
    name, a number or an array (...) each. Poses are those on the branch of the first one, never of
    another: where that branch has none they are NaN, with a `SingularConfigurationWarning`, and
    `at` says more.

    Attributes
    ----------
    name : str
        Of the mechanism.
    inputs, outputs : tuple of str
        Names, in the order of u and x; of points the components.
    held : tuple of str
        Freedoms that no output sees, and that are held.
    twists : tuple of str
        Outputs that are velocities, which have derivatives but no x.
    units : dict
        Unit of each input and output.
    loop : Loop
        The mechanism whose inputs are parameters.
    module : module
        That, compiled.
    home : Pose
        The first pose.
    """

    def __init__(self, loop: Loop, *, target: str = "numpy", guess: Array | None = None) -> None:
        self.loop, self.name, self.held, self.target = loop, loop.system.name, loop.held, target
        self.inputs, self.outputs, self.twists = loop.inputs, loop.outputs, loop.twists
        self.module: ModuleType = compiled(loop.system, target)
        self._code = code_of(self.module)
        units = self._code.units
        self.units = {name: units[name] for name in self.outputs}
        self.units |= {name: units[x] for name, x in zip(self.inputs, loop.parameters, strict=True)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssemblyWarning)  # the first pose is the guess's own
            first = solve(self.module, 0.0, guess=guess)
        if not first.success:
            raise SolveError(
                f"{self.name} cannot be assembled at the first values of its inputs, "
                f"{listed(self.inputs)}: {first.message}",
                first,
            )
        begin = np.asarray(self._code.defaults)
        u = begin[len(begin) - len(self.inputs) :]
        self.home = Pose(u, np.empty(0), first.q[0], begin)
        self.home = self.at(u).pose()

    @property
    def system(self) -> ConstraintSystem:
        """The mechanism whose inputs are parameters."""
        return self.loop.system

    def to_text(self) -> str:
        """Return inputs and outputs with their units, and what is held."""
        given, found = (
            ", ".join(f"{name} [{self.units[name] or 1}]" for name in names)
            for names in (self.inputs, self.outputs)
        )
        held = f"; no output sees, and held is: {listed(self.held)}" if self.held else ""
        twists = f"; velocities, without x: {listed(self.twists)}" if self.twists else ""
        return f"{self.name}: ({given}) -> ({found}){twists}{held}"

    def __repr__(self) -> str:
        """Return inputs and outputs."""
        return f"<Transmission {self.to_text()}>"

    def __call__(self, u: ArrayLike, p: Values = None) -> Array:
        """Return the outputs x (..., n) at inputs u (..., m)."""
        return self._known(u, p).x

    def J(self, u: ArrayLike, p: Values = None) -> Array:  # noqa: N802 - its name in the field
        """Return dx/du, (..., n, m)."""
        return self._known(u, p).J

    def second(self, u: ArrayLike, p: Values = None) -> Array:
        """Return second derivatives of the outputs by the inputs, (..., n, m, m)."""
        return self._known(u, p).second

    def J_dot(self, u: ArrayLike, u_dot: ArrayLike, p: Values = None) -> Array:  # noqa: N802
        """Return the rate of J, (..., n, m), at rates u_dot (..., m)."""
        rates = self._vector(u_dot, "u_dot", self.inputs)
        return np.asarray(np.einsum("...ijk,...k->...ij", self.second(u, p), rates))

    def rates(
        self, u: ArrayLike, u_dot: ArrayLike, u_ddot: ArrayLike | None = None, p: Values = None
    ) -> tuple[Array, Array]:
        """Return velocities and accelerations of the outputs, (..., n) each.

        Without u_ddot (..., m) the inputs have no acceleration.
        """
        first, poses = self._vector(u_dot, "u_dot", self.inputs), self._known(u, p)
        x_ddot = np.einsum("...ijk,...j,...k->...i", poses.second, first, first)
        if u_ddot is not None:
            second = self._vector(u_ddot, "u_ddot", self.inputs)
            x_ddot = x_ddot + np.einsum("...ij,...j->...i", poses.J, second)
        return np.einsum("...ij,...j->...i", poses.J, first), x_ddot

    def effort(self, u: ArrayLike, tau_x: ArrayLike, p: Values = None) -> Array:
        """Return what the inputs supply, J^T tau_x (..., m), where the outputs deliver tau_x.

        A load on an output is -tau_x. With it tau_u^T u_dot = tau_x^T x_dot.
        """
        efforts = self._vector(tau_x, "tau_x", self.outputs)
        return np.asarray(np.einsum("...ij,...i->...j", self.J(u, p), efforts))

    def by(self, u: ArrayLike, parameters: str | Sequence[str], p: Values = None) -> Array:
        """Return derivatives of the outputs by k parameters, (..., n, k), with inputs held."""
        return self._known(u, p).by(parameters)

    @cached_property
    def inverse(self) -> Transmission:
        """The inverse u(x) on the working mode of the first pose, with derivatives of its own.

        It is derived and compiled when it is first asked for. Its parameters have their defaults
        where `p` gives no others. Of a driver it is the parameter, ``u_<name>``, that is found.
        """
        loop = inverted(self.loop, self.home.x.tolist())
        return Transmission(loop, target=self.target, guess=self.home.q)

    def modes(self, x: ArrayLike, p: Values = None) -> Array:
        """Return the inputs of all working modes at outputs x (n,), (k, m).

        These are all ways to assemble the mechanism with the outputs given, the nearest to the
        first pose first; angles are those nearest to it.
        """
        return self.inverse.assemblies(x, p)

    def assemblies(self, u: ArrayLike, p: Values = None) -> Array:
        """Return the outputs of all ways to assemble the mechanism at inputs u (m,), (k, n)."""
        sets, shape = self._sets(u, p)
        if shape:
            raise InputError("assemblies are those of one pose: call it for each of a batch.")
        kept: list[Array] = []
        for q in assemblies(self.module, 0.0, sets[0]):
            x = self._poses(self._solved(sets, q, sets[0]), sets, ()).x
            if all(_apart((x - other) / self.signature.scales[1]) > SAME for other in kept):
                kept.append(x)
        return np.array(kept).reshape(-1, len(self.outputs))

    @cached_property
    def signature(self) -> Signature:
        """Names and scales, as `Poses.signature`."""
        sizes = np.asarray(problem(self._code, self.home.p, self.home.q, 0.0).reference)
        length = float(max(sizes[~self._code.angular], default=1.0))
        unit = self.system.length_unit
        lengths = unit, f"{unit}/s"
        given, found = (
            np.array([length if self.units[name] in lengths else 1.0 for name in names])
            for names in (self.inputs, self.outputs)
        )
        return Signature(
            self.name, self.inputs, self.outputs, self.loop.parameters, self.loop.rates,
            np.array([name in self.twists for name in self.outputs]), self._code.coordinates,
            (given, found, sizes),
        )  # fmt: skip

    def at(self, u: ArrayLike, p: Values = None, near: Pose | None = None) -> Poses:
        """Return poses: status, derivatives, and how far singular ones are.

        Parameters
        ----------
        u : array_like, shape (..., m)
            The inputs.
        p : mapping, optional
            Parameters by name, a number or an array (...) each.
        near : Pose, optional
            The pose to start from in place of `home`, as ``poses.pose(index)`` gives it.

        Raises
        ------
        InputError
            When a value has the wrong name or shape, or is not finite.
        """
        begin = self.home if near is None else near
        given: object = begin
        if not isinstance(given, Pose) or given.p.shape != self.home.p.shape:
            raise InputError(
                f"near is {near!r}: give a pose of {self.name}, as poses.pose(index) does."
            )
        sets, shape = self._sets(u, p)
        return self._poses(self._solved(sets, begin.q, begin.p), sets, shape)

    def _solved(self, sets: Array, q: Array, p: Array) -> Solution:
        """Return positions of sets of parameters (B, k) on the branch of one position."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssemblyWarning)
            return solve_sets(self.module, 0.0, sets, q, p)

    def _poses(self, solution: Solution, sets: Array, shape: tuple[int, ...]) -> Poses:
        """Return the poses of positions."""
        columns = np.concatenate((solution.q[:, 0], solution.observed.y[:, 0]), axis=-1)
        names = (*self._code.coordinates, *self._code.outputs)
        x = columns[:, [names.index(name) for name in self.outputs]]
        x[:, self.signature.is_twist] = np.nan
        u = sets[:, sets.shape[1] - len(self.inputs) :]
        u, x, q = (part.reshape(*shape, part.shape[-1]) for part in (u, x, solution.q[:, 0]))
        return Poses(u, x, q, solution.status.reshape(shape), self.signature, solution)

    def _known(self, u: ArrayLike, p: Values) -> Poses:
        """Return poses, and warn where there are none."""
        poses = self.at(u, p)
        if not poses.success:
            warnings.warn(poses.message, SingularConfigurationWarning, stacklevel=3)
        return poses

    def _sets(self, u: ArrayLike, p: Values) -> tuple[Array, tuple[int, ...]]:
        """Return sets of parameters (B, k), and the shape of the batch."""
        inputs, values = self._vector(u, "u", self.inputs), dict(mapping_of(p, "p"))
        count = len(self._code.parameters) - len(self.inputs) - len(self.loop.rates)
        names = self._code.parameters[:count]
        arrays = {}
        for name, value in values.items():
            if name not in names:
                text = f"{self.name} has no parameter {name!r}"
                raise InputError(unknown(text, str(name), names, "; inputs are given by u"))
            arrays[name] = _numbers(value, f"the parameter {name}")
        try:
            shape = np.broadcast_shapes(inputs.shape[:-1], *(x.shape for x in arrays.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items())
            raise InputError(
                f"u has the batch {inputs.shape[:-1]}, and parameters have {shapes}: give each "
                "parameter one number, or one for each pose."
            ) from None
        if not math.prod(shape):
            raise InputError(f"u has the shape {inputs.shape}: give at least one pose.")
        sets = np.empty((*shape, len(self._code.parameters)))
        sets[...] = self._code.defaults
        sets[..., sets.shape[-1] - len(self.inputs) :] = inputs
        for name, value in arrays.items():
            sets[..., names.index(name)] = value
        return sets.reshape(-1, sets.shape[-1]), shape

    def _vector(self, given: ArrayLike, what: str, names: Sequence[str]) -> Array:
        """Return vectors (..., k), checked."""
        found = _numbers(given, what)
        if not found.ndim or found.shape[-1] != len(names):
            raise InputError(
                f"{what} has the shape {found.shape}: its last axis is {listed(names)} of "
                f"{self.name}, of length {len(names)}."
            )
        return found


def _apart(differences: Array) -> float:
    """Return the largest of those that are numbers."""
    return float(np.max(np.abs(differences), initial=0.0, where=~np.isnan(differences)))


def _numbers(given: Any, what: str) -> Array:
    """Return an array of finite numbers."""
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} is {given!r}: give numbers.") from None
    if not np.isfinite(found).all():
        raise InputError(f"{what} is not finite everywhere: give finite numbers.")
    return found
