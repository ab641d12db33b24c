"""The generated side of a comparison with a transmission: J, J_dot, effort and x on its branch.

Formulas by hand use inputs, outputs and all coordinates between them, and hold where the loop is
closed. So states are poses of the transmission: within the limits of its inputs, on its branch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from kincompile.checker.comparison import Difference
from kincompile.checker.reference import MATRICES, Reference, numbered
from kincompile.checker.states import GROUPS, SEED, STATES_PER_GROUP, Array, States, shaped
from kincompile.errors import InputError
from kincompile.model.inputs import input_name
from kincompile.names import listed, rate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from kincompile.model.system import ConstraintSystem

SPREADS = (1.0, 0.3, 0.1, 0.03, 0.01)
"""How far from the first pose states lie, in radians and sizes; as far as can be."""
OF_PARAMETERS = (0.9, 1.1)
FASTEST = 50.0
"""Of coordinates by inputs, in scales: nearer to a singular pose digits are lost."""
OF_INVERSE = {"u": "x", "u_dot": "x_dot", "tau_x": "tau_u"}
"""What the arguments of the inverse's methods are of the transmission."""
STEP = 20
"""Poses from which four of a set of parameters are taken."""


@runtime_checkable
class Transmission(Protocol):
    """What the checker needs of a `kincompile.Transmission`."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    twists: tuple[str, ...]
    units: dict[str, str]
    home: Any

    @property
    def system(self) -> ConstraintSystem:
        """The mechanism, whose last parameters are the inputs."""

    @property
    def signature(self) -> Any:
        """Names and scales."""

    def at(self, u: Any, p: Any = None) -> Any:
        """Return poses."""

    def assemblies(self, u: Any, p: Any = None) -> Any:
        """Return the outputs of all assemblies."""


@dataclass(frozen=True, eq=False)
class PoseStates(States):
    """Poses with rates and efforts: u, u_dot, tau_u (N, m), x, x_dot, tau_x (N, n)."""

    u: Array
    x: Array
    u_dot: Array
    x_dot: Array
    tau_u: Array
    tau_x: Array
    poses: Any

    def take(self, chosen: Array) -> States:
        """Refuse: poses belong together."""
        raise NotImplementedError


class TransmissionReference(Reference):
    """A transmission, ready to be evaluated at poses on its branch.

    Raises
    ------
    InputError
        If it has too few poses on its branch.
    """

    def __init__(self, f: Transmission) -> None:
        super().__init__(f.system)
        self.f = f
        self.name = f.name
        self.own = self.own[: len(self.own) - len(f.inputs) - len(f.signature.rates)]
        self.forces = {f"tau_{name}": f"tau_{name}" for name in (*f.outputs, *f.inputs)}
        for letter, names in (("x", f.outputs), ("u", f.inputs)):
            for k, name in enumerate(names, 1):
                for written in (f"tau_{letter}{k}", f"tau_{letter}_{k}"):
                    self.forces.setdefault(written, f"tau_{name}")
        self.scales: tuple[Array, Array] = f.signature.scales[:2]  # of inputs and outputs

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of values, one of which may be written for another."""
        return tuple(dict.fromkeys((*self.f.inputs, *self.f.outputs, *self.own, *self.coordinates)))

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of angles, one of which may be written for another."""
        given = [name for name in (*self.f.inputs, *self.f.outputs) if self.f.units[name] == "rad"]
        return tuple(dict.fromkeys((*given, *super().angles)))

    def names(self) -> tuple[tuple[str, str], ...]:
        """Return names that formulas use: inputs are numbered u1, u_1, outputs x1, x_1."""
        found = dict.fromkeys((*self.f.inputs, *self.f.outputs, *self.coordinates))
        pairs = [(name, name) for name in found]
        for letter, names in (("u", self.f.inputs), ("x", self.f.outputs), ("q", self.coordinates)):
            for number, name in enumerate(names, 1):
                pairs += numbered(letter, number, name)
        return tuple(pair for pair in pairs if pair[1] not in self.f.twists)

    def names_help(self) -> str:
        """Return in words which names formulas may use."""
        f = self.f
        names = dict.fromkeys((*f.inputs, *f.outputs, *self.own, *self.coordinates))
        return (
            f"the names are: {listed(names, 60)}, rates such as {rate(f.inputs[0])}, and efforts "
            f"such as tau_{f.outputs[0]}; inputs are numbered, u1 is {f.inputs[0]}, and outputs, "
            f"x1 is {f.outputs[0]}"
        )

    def arguments(self, quantity: str, given: Sequence[str] | None) -> list[tuple[str, ...]]:
        """Return what a function is called with: as its arguments are named, or by their number."""
        known = ("u", "x", "u_dot", "x_dot", "tau_x", "tau_u", "q", "q_dot", "p")
        if given and set(given) <= set(known):
            return [tuple(given)]
        more = {"J_dot": ["u_dot", "x_dot"], "effort": ["tau_x", "tau_x"]}.get(quantity)
        count = 1 if more is None else 2
        number = count if given is None else len(given)
        if number not in (count, count + 1):
            names = ("u",) if more is None else ("u", more[0])
            raise InputError(
                f"{quantity}: the function takes {number} arguments; give it {listed(names)}, or "
                f"name its arguments as any of {listed(known)}."
            )
        ends = [(name,) if more is None else (name, more[k]) for k, name in enumerate(("u", "x"))]
        return [(*item, "p") if number > count else item for item in ends]

    def shape_problems(self, name: str, rows: int, columns: int) -> list[str]:
        """Return what is wrong with the shape of a quantity."""
        f = self.f
        m, n = len(f.inputs), len(f.outputs)
        if name in MATRICES:
            if (rows, columns) in ((n, m), (m, n)):
                return []
            return [
                f"{name} is {rows} x {columns}; expected {n} x {m}, a row for each of "
                f"{listed(f.outputs)} and a column for each of {listed(f.inputs)}, or its transpose"
            ]
        if name == "x" and f.twists:
            return [
                f"x of {f.name} has velocities in it, {listed(f.twists)}, and no position gives "
                "them: compare J, or leave them out of the outputs"
            ]
        names = f.outputs if name == "x" else f.inputs
        if (rows, columns) == (len(names), 1):
            return []
        return [
            f"{name} is {rows} x {columns}; it is a vector: expected {len(names)} rows, one for "
            f"each of {listed(names)}"
        ]

    def method(
        self, quantity: str, function: Any, names: Sequence[str] | None
    ) -> tuple[Callable[..., object], tuple[str, ...]] | None:
        """Return a method of a transmission, which takes parameters by name, and its arguments.

        That of the inverse has outputs in the place of inputs.
        """
        f, own = self.f, getattr(function, "__self__", function)
        if not isinstance(own, Transmission) or names is None:
            return None
        if own.inputs != f.inputs and not _are_same(own.inputs, f.outputs):
            raise InputError(
                f"{quantity} is a function of {listed(own.inputs)}; give one of "
                f"{listed(f.inputs)}, or of {listed(f.outputs)}, in this order."
            )
        meant = names if own.inputs == f.inputs else [OF_INVERSE.get(name, name) for name in names]

        def by_name(*arguments: Array) -> object:
            pairs = zip(meant, arguments, strict=True)
            return function(*(
                dict(zip(self.own, values.T, strict=True)) if name == "p" else values
                for name, values in pairs
            ))  # fmt: skip

        (arguments,) = self.arguments(quantity, meant)
        return by_name, arguments

    def argument(self, name: str, states: States) -> Array:
        """Return values that a function is called with; p without the inputs."""
        values = super().argument(name, states)
        return values[:, : len(self.own)] if name == "p" else values

    @cached_property
    def random(self) -> PoseStates:
        """Poses of three sets of parameters, where it has them, else of the default ones."""
        factors = np.random.default_rng(SEED).uniform(*OF_PARAMETERS, (GROUPS, len(self.own)))
        defaults = self.defaults[: len(self.own)]
        found = self._sampled(np.where(defaults == 0, factors, factors * defaults))
        return self.fixed if found is None else found

    @cached_property
    def fixed(self) -> PoseStates:
        """Poses with the default parameters."""
        found = self._sampled(np.tile(self.defaults[: len(self.own)], (1, 1)))
        if found is None:
            raise InputError(
                f"{self.f.name} has too few poses near its first one to compare formulas at: begin "
                "it farther from singular positions, or give states={'u': ...}."
            )
        return found

    def _sampled(self, parameters: Array) -> PoseStates | None:
        """Return four poses of each set of parameters, or twelve of one; None if there are none."""
        sets = len(parameters)
        wanted = GROUPS * STATES_PER_GROUP // sets
        random = np.random.default_rng(SEED)
        group = np.repeat(np.arange(sets), STEP * wanted // STATES_PER_GROUP)
        for spread in SPREADS:
            aside = random.uniform(0.1, 1, (len(group), len(self.f.inputs)))
            aside *= random.choice((-1.0, 1.0), aside.shape)
            u = self.f.home.u + spread * self.scales[0] * aside
            usable = self._is_usable(u, parameters[group])
            chosen = [np.flatnonzero(usable & (group == k))[:wanted] for k in range(sets)]
            if all(len(item) == wanted for item in chosen):
                places = np.concatenate(chosen)
                return self._states(u[places], parameters[group[places]], group[places])
        return None

    def _is_usable(self, u: Array, p: Array) -> Array:
        """Return which poses are there, and not close to a singular one."""
        poses = self._poses(u, p)
        usable = np.asarray(poses.status == 0)
        if not usable.any():
            return usable
        sizes = self.f.signature.scales
        with np.errstate(invalid="ignore"):
            fastest = np.abs(poses.q_u * sizes[0] / sizes[2][:, None]).max(axis=(-2, -1))
            return np.asarray(
                usable & (fastest < FASTEST) & np.isfinite(poses.J).all(axis=(-2, -1))
            )

    def _poses(self, u: Array, p: Array) -> Any:
        return self.f.at(u, p=dict(zip(self.own, p.T, strict=True)))

    def _states(self, u: Array, p: Array, group: Array, **given: Array) -> PoseStates:
        """Return poses with generic rates and efforts, or those that are given."""
        random, count = np.random.default_rng(SEED), len(u)
        m, n = len(self.f.inputs), len(self.f.outputs)
        poses = self._poses(u, p)

        def generic(*shape: int) -> Array:
            return np.asarray(random.uniform(0.4, 1.6, shape) * random.choice((-1.0, 1.0), shape))

        values = {"u_dot": self.scales[0] * generic(count, m), "tau_x": generic(count, n),
                  "tau_u": generic(count, m), **given}  # fmt: skip
        u_dot = values["u_dot"]
        q_dot, x_dot = (np.einsum("kij,kj->ki", item, u_dot) for item in (poses.q_u, poses.J))
        p = np.concatenate([p, np.zeros((count, len(self.f.signature.rates))), u], axis=-1)
        return PoseStates(
            poses.q, q_dot, np.zeros(count), p, group, u=u, x=poses.x, x_dot=x_dot, poses=poses,
            **values,
        )  # fmt: skip

    def given_states(self, given: Mapping[str, ArrayLike]) -> PoseStates:
        """Return the states to which the values of arrays belong.

        Parameters
        ----------
        given
            Arrays ``u`` (N, m), and ``u_dot`` (N, m), ``tau_x`` (N, n), ``tau_u`` (N, m), ``p``
            (N, k). One state may do without its leading axis.

        Raises
        ------
        InputError
            If a key is unknown, u is missing, a shape does not fit, a number is not finite, or the
            branch has no such pose.
        """
        sizes = {name: len(self.f.inputs) for name in ("u", "u_dot", "tau_u")}
        sizes |= {"tau_x": len(self.f.outputs), "p": len(self.own)}
        if "u" not in given or not set(given) <= set(sizes):
            raise InputError(
                f"states has {listed(given)}; give 'u', and where they matter {listed(sizes)}."
            )
        count = len(np.atleast_2d(np.asarray(given["u"], dtype=float)))
        found = {name: shaped(value, name, (count, sizes[name])) for name, value in given.items()}
        u = found.pop("u")
        p = found.pop("p", np.tile(self.defaults[: len(self.own)], (count, 1)))
        if not (poses := self._poses(u, p)).success:
            raise InputError(f"states: {poses.message}")
        _, group = np.unique(p, axis=0, return_inverse=True)
        return self._states(u, p, np.asarray(group).reshape(count), **found)

    def _inputs_at(self, states: States) -> dict[str, Array]:
        """Return values by name: also of inputs and outputs, with rates and efforts."""
        assert isinstance(states, PoseStates)
        f, found = self.f, super()._inputs_at(states)
        x = np.where(f.signature.is_twist, states.x_dot, states.x)  # a velocity is a rate itself
        pairs = ((f.inputs, states.u, states.u_dot), (f.outputs, x, states.x_dot))
        for names, values, rates in pairs:
            for k, name in enumerate(names):
                found.setdefault(name, values[:, k])
                found.setdefault(rate(name), rates[:, k])
        efforts = np.concatenate([states.tau_x, states.tau_u], axis=-1)
        forces = [f"tau_{name}" for name in (*f.outputs, *f.inputs)]
        return found | dict(zip(forces, efforts.T, strict=True))

    def read_as(self, states: PoseStates, values: Mapping[str, Array]) -> PoseStates:
        """Return states at which some names have other values, and all the rest is as it is."""
        changed = {"u": states.u.copy(), "x": states.x.copy()}
        for array, names in ((changed["u"], self.f.inputs), (changed["x"], self.f.outputs)):
            for k, name in enumerate(names):
                array[:, k] = values.get(name, array[:, k])
        read = replace(states, **changed)
        self._inputs[read] = {**self.inputs(states), **values}
        return read

    def difference(self, states: States, written: Array, right: Array) -> Difference:
        """Return the pose at which an entry differs the most, of values of shape (N,)."""
        found = super().difference(states, written, right)
        names = (*self.f.inputs, *self.f.outputs, *self.own)
        return Difference({name: found.state[name] for name in names}, found.generated, found.hand)


def _are_same(one: Sequence[str], other: Sequence[str]) -> bool:
    """Return whether names are the same, of drivers those that an inverse gives them."""
    pairs = list(zip(one, other, strict=False))
    return len(one) == len(other) and all(a == b or b in (input_name(a), a) for a, b in pairs)
