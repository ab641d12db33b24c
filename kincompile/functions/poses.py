"""Poses of a transmission: where it is, how it moves there, and how far it is from singular ones.

At an input singularity (type 1) some direction of the outputs stands still: the smallest singular
value of J is zero. At an output singularity (type 2) Phi_q is singular, and the largest one of the
derivatives of all coordinates is infinite: two assemblies meet. Both are taken in scales, 1 rad and
the size of the mechanism.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.html import Shown
from kincompile.runtime.inputs import names_of
from kincompile.runtime.results.sensitivities import sensitivities
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

SINGULAR = 1e-5
"""Part that the slowest output is of the fastest coordinate, or the input of it, where a pose is
singular; all in scales."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """One pose, from which others may be reached.

    Attributes
    ----------
    u, x : ndarray, shape (m,), (n,)
        Inputs and outputs.
    q, p : ndarray
        All coordinates, and all parameters of the mechanism whose inputs are parameters.
    """

    u: Array
    x: Array
    q: Array
    p: Array


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """Names and scales of a transmission: what its poses need of it."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]  # that the inputs are
    rates: tuple[str, ...]  # that their rates are, where there are twists
    is_twist: NDArray[np.bool_]  # (n,)
    coordinates: tuple[str, ...]
    # Of inputs (m,), outputs (n,) and coordinates: the size of the mechanism for lengths, else 1.
    scales: tuple[Array, Array, Array]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Poses(Shown):
    """Poses at inputs (..., m), one or a batch. All are NaN where `status` is not 0.

    Attributes
    ----------
    u, x : ndarray, shape (..., m), (..., n)
        Inputs and outputs; velocities have no x, so theirs is NaN.
    q : ndarray
        All coordinates.
    status : ndarray of int, shape (...)
        A `Status` each: 0 where the pose was reached, on the branch from which it was sought.
    signature : Signature
        Names and scales of the transmission.
    """

    u: Array
    x: Array
    q: Array
    status: NDArray[np.int64]
    signature: Signature
    _solution: Solution
    _made: dict[bool, tuple[Array, Any]] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether all poses were reached."""
        return bool((self.status == Status.CONVERGED).all())

    @property
    def message(self) -> str:
        """How many were reached, and why the first of the others was not."""
        f, lost = self.signature, np.flatnonzero(self.status.ravel() != Status.CONVERGED)
        if not lost.size:
            return f"{self.signature.name}: all {self.status.size} poses were reached."
        u = self.u.reshape(-1, len(self.signature.inputs))[lost[0]]
        where = ", ".join(f"{a} = {b:.6g}" for a, b in zip(self.signature.inputs, u, strict=True))
        status = next(item for item in Status if item == self.status.ravel()[lost[0]])
        return (
            f"{f.name}: {lost.size} of {self.status.size} poses were not reached, the first at "
            f"{where} ({status.name}): the branch of the first pose ends before it, at an output "
            "singularity (type 2). Stay within it, or start from a pose beyond (near)."
        )

    def to_text(self) -> str:
        """Return the message and the nearest singular poses."""
        near = [
            f"{kind} singularities: {np.nanmin(away):.3g} away at the nearest"
            for kind, away in (("input", self.to_input), ("output", self.to_output))
            if np.isfinite(away).any()
        ]
        return "\n".join([self.message, *near])

    def __repr__(self) -> str:
        """Return the message."""
        return f"<Poses {self.message}>"

    def pose(self, index: Any = ()) -> Pose:
        """Return one of the poses, to start from."""
        flat = np.arange(self.status.size).reshape(self.status.shape)[index]
        k = int(flat)
        p = self._solution.p[k]
        u, x = (
            self.u.reshape(-1, len(self.signature.inputs)),
            self.x.reshape(-1, len(self.signature.outputs)),
        )
        return Pose(u[k], x[k], self._solution.q[k, 0], p)

    def by(self, parameters: str | Sequence[str]) -> Array:
        """Return derivatives of the outputs by k parameters, (..., n, k)."""
        names = names_of(parameters, "parameters")
        found = self._derivatives(names, self.signature.outputs, second=False)[0]
        found[..., self.signature.is_twist, :] = np.nan
        return found

    def _derivatives(
        self, names: Sequence[str], outputs: Sequence[str], *, second: bool
    ) -> tuple[Array, Any]:
        """Return first derivatives (..., n, k), and second ones (..., n, k, k) if wanted."""
        found, shape = (
            sensitivities(self._solution, names, outputs, second=second),
            self.x.shape[:-1],
        )
        columns = (*found.coordinates, *found.outputs)
        order = [columns.index(name) for name in outputs]
        first = np.concatenate((found.q_p, found.y_p), axis=-2)[:, 0, order]
        pairs = found.second[0][:, 0, order] if found.second is not None else None
        return (
            first.reshape(*shape, *first.shape[1:]),
            None if pairs is None else pairs.reshape(*shape, *pairs.shape[1:]),
        )

    def _by_inputs(self, *, second: bool) -> tuple[Array, Any]:
        """Return J, and with it second derivatives if wanted: computed once."""
        if True not in self._made and second not in self._made:
            f = self.signature
            names, k = (*f.rates, *f.parameters), len(f.rates)
            first, pairs = self._derivatives(names, f.outputs, second=second)
            slopes, own = first[..., k:], None if pairs is None else pairs[..., k:, k:]
            if k:  # of velocities at rates v their slopes by v
                slopes[..., f.is_twist, :] = first[..., f.is_twist, :k]
            if k and own is not None:
                own[..., f.is_twist, :, :] = pairs[..., f.is_twist, :k, k:]
            self._made[second] = slopes, own
        return self._made.get(True) or self._made[False]

    @property
    def J(self) -> Array:  # noqa: N802 - its name in the field
        """dx/du, (..., n, m)."""
        return self._by_inputs(second=False)[0]

    @property
    def second(self) -> Array:
        """Derivatives of J by the inputs, (..., n, m, m); symmetric but for velocities."""
        found: Array = self._by_inputs(second=True)[1]
        return found

    @property
    def determinant(self) -> Array:
        """Return det J, (...); NaN where there are not as many outputs as inputs."""
        if len(self.signature.inputs) != len(self.signature.outputs):
            return np.full(self.status.shape, np.nan)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.linalg.det(self.J))

    @property
    def singularity(self) -> NDArray[np.str_]:
        """Of each pose ``""``, ``"input"`` (type 1), ``"output"`` (type 2) or ``"both"``.

        Of one that was not reached it is what ends the way there, an output singularity.
        """
        slowest, _ = self._logarithm(self.J, None, self.signature.scales[1], -1)
        fastest, _ = self._logarithm(*self._of_all(second=False), self.signature.scales[2], 0)
        is_input = slowest - fastest <= math.log(SINGULAR)
        is_output = ~(fastest < -math.log(SINGULAR))
        return np.asarray(np.array(["", "input", "output", "both"])[is_input + 2 * is_output])

    @property
    def to_input(self) -> Array:
        """Estimated distance to an input singularity, (...), inputs in scales.

        To first order, from J and its derivatives; infinite where nothing changes.
        """
        _, slowest = self._logarithm(self.J, self.second, self.signature.scales[1], -1)
        _, fastest = self._logarithm(*self._of_all(second=True), self.signature.scales[2], 0)
        with np.errstate(divide="ignore"):
            return np.asarray(1 / np.linalg.norm(slowest - fastest, axis=-1))

    @property
    def to_output(self) -> Array:
        """Estimated distance to an output singularity, (...), inputs in scales.

        Near one the rates of the mechanism grow like one over the root of the distance.
        """
        _, fastest = self._logarithm(*self._of_all(second=True), self.signature.scales[2], 0)
        with np.errstate(divide="ignore"):
            return np.asarray(1 / (2 * np.linalg.norm(fastest, axis=-1)))

    @property
    def q_u(self) -> Array:
        """Derivatives of all coordinates by the inputs, (..., coordinates, m)."""
        return self._of_all(second=False)[0]

    def _of_all(self, *, second: bool) -> tuple[Array, Any]:
        """Return derivatives of all coordinates by the inputs."""
        names = self.signature.parameters
        return self._derivatives(names, self.signature.coordinates, second=second)

    def _logarithm(self, first: Array, second: Any, sizes: Array, k: int) -> tuple[Array, Array]:
        """Return the logarithm of a singular value, in scales, and its slope (..., m)."""
        given, shape = self.signature.scales[0], self.status.shape
        value, slope = np.full(shape, np.nan), np.full((*shape, given.size), np.nan)
        first = first * given / sizes[:, np.newaxis]
        known = np.isfinite(first).all(axis=(-2, -1))
        left, values, right = np.linalg.svd(first[known], full_matrices=False)
        with np.errstate(divide="ignore", invalid="ignore"):
            value[known] = np.log(values[..., k])
            if second is not None:
                scaled = second[known] * given * given[:, np.newaxis]
                scaled = scaled / sizes[:, np.newaxis, np.newaxis]
                rows = "...i,...ijk,...j->...k", left[..., :, k], scaled, right[..., k, :]
                slope[known] = np.einsum(*rows) / values[..., k, np.newaxis]
        return value, slope
