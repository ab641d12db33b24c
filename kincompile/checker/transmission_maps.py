"""What is right for a transmission: dx/du and its other forms, their rates, efforts and outputs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import OF_ROW, ROUNDING, Right, positive

if TYPE_CHECKING:
    from kincompile.checker.states import Array
    from kincompile.checker.transmission_reference import PoseStates, TransmissionReference

DX_DU, DU_DX, TRANSPOSE, BOTH = "dx/du", "du/dx", "transpose", "transpose of du/dx"

SAME_ANGLE = 1e-5
"""Angles that differ by less are one, but for whole turns."""

KINDS = {
    DX_DU: "",
    DU_DX: "this is the inverse of J: du/dx",
    TRANSPOSE: "this is the transpose of J: its rows are inputs, its columns outputs",
    BOTH: "this is the transpose of the inverse of J: the transpose of du/dx",
}
"""The matrices that people call J, each in words."""


@dataclass(frozen=True, eq=False)
class Map:
    """One quantity of a transmission in one form, right at some states.

    Attributes
    ----------
    right
        Its values, (N, rows, columns).
    rows, columns
        Names of inputs and outputs; one column, None, of a vector.
    terms
        Of J_dot the terms of the chain rule, by the rate of each input.
    effort, matrix, tau
        Of effort the name of the efforts that it is of, its matrix (N, rows, k) and theirs (N, k).
    """

    kind: str
    right: Right
    rows: tuple[str, ...]
    columns: tuple[str | None, ...] = (None,)
    terms: tuple[Array, ...] = ()
    effort: str = ""
    matrix: Array = field(default_factory=lambda: np.empty((0, 0, 0)))
    tau: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def is_matrix(self) -> bool:
        """Whether it has named columns."""
        return self.columns != (None,)

    def as_J(self, matrix: Array) -> Array:  # noqa: N802 - its name in the field
        """Return a matrix of this form, (N, rows, columns), as dx/du."""
        if self.kind in (TRANSPOSE, BOTH):
            matrix = np.swapaxes(matrix, 1, 2)
        return np.linalg.pinv(matrix) if self.kind in (DU_DX, BOTH) else matrix


def maps_at(
    reference: TransmissionReference, states: PoseStates, *, with_rates: bool, is_load: bool
) -> dict[str, list[Map]]:
    """Return what each quantity may be, its usual form first.

    With `is_load` efforts are what outputs are loaded with, of the opposite sign.
    """
    f, (s_u, s_x) = reference.f, reference.scales
    jacobian = states.poses.J
    lost = _lost(reference, states)
    rates = None
    if with_rates:
        rates = np.einsum("kija,ka->kaij", states.poses.second, states.u_dot)
    found: dict[str, list[Map]] = {"J": [], "J_dot": [], "effort": [], "x": []}
    forms = [(DX_DU, jacobian, rates, f.outputs, f.inputs, s_x, s_u)]
    if len(f.inputs) == len(f.outputs):
        inverse = np.linalg.inv(jacobian)
        own = None if rates is None else -inverse[:, None] @ rates @ inverse[:, None]
        forms.append((DU_DX, inverse, own, f.inputs, f.outputs, s_u, s_x))
    for kind, matrix, own, rows, columns, s_row, s_column in [*forms]:
        name = TRANSPOSE if kind == DX_DU else BOTH
        turned = None if own is None else np.swapaxes(own, -1, -2)
        forms.append(
            (name, np.swapaxes(matrix, -1, -2), turned, columns, rows, 1 / s_column, 1 / s_row)
        )
    for kind, matrix, own, rows, columns, s_row, s_column in forms:
        scale = np.max(np.abs(matrix) * s_column / s_row[:, None], axis=-1, keepdims=True)
        scale = positive(scale) * s_row[:, None] / s_column
        found["J"].append(Map(kind, Right(matrix, scale, lost * scale), rows, columns))
        if own is not None:
            speed = np.max(np.abs(states.u_dot) / s_u, axis=-1)[:, None, None]
            size = np.max(np.abs(own), axis=1) + speed * scale
            terms = tuple(np.moveaxis(own, 1, 0))
            right = Right(own.sum(axis=1), size, 10 * lost * size)
            found["J_dot"].append(Map(kind, right, rows, columns, terms))
    by = [("tau_x", np.swapaxes(jacobian, 1, 2), states.tau_x, f.inputs)]
    if len(forms) == 4:
        by.append(("tau_u", np.swapaxes(inverse, 1, 2), states.tau_u, f.outputs))
    for name, matrix, tau, rows in by:
        matrix = -matrix if is_load else matrix
        size = np.max(np.abs(matrix) * np.abs(tau)[:, None], axis=-1, keepdims=True)
        right = Right(matrix @ tau[..., None], positive(size), lost * positive(size))
        found["effort"].append(Map(name, right, rows, effort=name, matrix=matrix, tau=tau))
    size = np.maximum(np.abs(states.x), s_x)[..., None]
    found["x"].append(Map("x", Right(states.x[..., None], size, lost * size), f.outputs))
    return found


def turned(given: Array, right: Right, angular: Array) -> Right:
    """Return outputs, (N, n, 1), with the whole turns of angles that are right but for these."""
    with np.errstate(invalid="ignore"):
        values = right.values + 2 * np.pi * np.round((given - right.values) / (2 * np.pi))
        is_angle = angular & np.all(np.abs(values - given) <= SAME_ANGLE, axis=(0, 2))
    return replace(right, values=np.where(is_angle[:, None], values, right.values))


def _lost(reference: TransmissionReference, states: PoseStates) -> Array:
    """Return what rounding of a position may take from J, relative to its scale, (N, 1, 1)."""
    s_u, s_x = reference.scales
    scaled = states.poses.J * s_u / s_x[:, None]
    sizes = reference.f.signature.scales[2]
    fastest = np.max(np.abs(states.poses.q_u * s_u / sizes[:, None]), axis=(-2, -1))
    with np.errstate(all="ignore"):
        condition = np.linalg.cond(scaled)
    worst = 1 + fastest**2 + np.where(np.isfinite(condition), condition, 0.0)
    return np.asarray(OF_ROW + ROUNDING * worst)[:, None, None]
