r"""Masses, forces and the equations of motion of a module, by oracles that need no derivation.

M is symmetric and no movement has a negative energy; M and Q are the model's where that is known;
the Jacobians of Q are complex steps of Q, or differences; and accelerations and multipliers are put
back into :math:`M \ddot q + \Phi_q^T \lambda = Q` and :math:`\Phi_q \ddot q = \gamma`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import COMPLEX_STEP
from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.quantities import TOGETHER, states_of
from kincompile.verification.oracles import DIFFERENCE, slope

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.engine.code import Compiled
    from kincompile.verification.samples import Samples

    Array = NDArray[Any]
    Found = tuple[str, str, str, str, float, float]

EXACT, ROUGH = 1e-8, 1e-5
"""Allowed errors, relative to the terms; the second one of differences."""

OF_LARGEST = 1e-7
"""Part of the largest number, in scales, that counts for all: rounding errors go from large numbers
to small ones."""

REGULAR = 1e-3
"""Singular value of Phi_q, relative to its largest, from which accelerations can be put back."""

MATRICES = "M", "Q_q", "Q_q_dot"


def errors_of_motion(samples: Samples, model: ConstraintSystem | None) -> Iterator[Found]:
    """Yield quantity, row, coordinate, oracle, error and limit of all that loads bring along."""
    with np.errstate(all="ignore"):
        yield from _errors_of_loads(samples, model)
        if "accelerations" in samples.code.functions:
            yield from _errors_of_accelerations(samples)


def _errors_of_loads(samples: Samples, model: ConstraintSystem | None) -> Iterator[Found]:
    """Yield the errors of M, Q and the Jacobians of Q."""
    code, scale = samples.code, samples.reference
    names, both = code.coordinates, np.multiply.outer(scale, scale)
    M, Q = (_forms(samples, name) for name in ("M", "Q"))
    transposed, least = M[0].swapaxes(1, 2), np.linalg.eigvalsh(M[0] * both)[:, :1]
    largest = np.abs(M[0] * both).max(axis=(1, 2))[:, np.newaxis]
    energy = np.broadcast_to(np.maximum(-least, 0) / np.where(largest > 0, largest, 1), Q[0].shape)
    yield from _rows("M", names, "its own transpose", _errors(M, transposed, both), EXACT)
    yield from _rows("M", names, "energy of movements", energy[..., np.newaxis], EXACT)
    if model is not None:
        states = [np.array(x) for x in zip(*samples.each(), strict=True)]
        of_model = interpreter(lower(model), ("M", "Q"))(*states[:3], states[3].T)
        yield from _rows("M", names, "the model", _errors(M, of_model[0], both), EXACT)
        yield from _rows("Q", names, "the model", _errors(Q, of_model[1], scale), EXACT)
    else:  # functions of states and of batches are written out apart
        yield from _rows("M", names, "its other forms", _errors(M, M[0], both), EXACT)
        yield from _rows("Q", names, "its other forms", _errors(Q, Q[0], scale), EXACT)
    for k, name in enumerate(("Q_q", "Q_q_dot")):
        found = _forms(samples, name)
        exact, rough = (
            _errors(found, slopes, both)
            for slopes in (_complex_slopes(samples, k), _differences(samples, k))
        )
        believed = (exact.max(axis=(0, 2)) <= EXACT)[:, np.newaxis]
        exact, rough = np.where(believed, exact, 0.0), np.where(believed, 0.0, rough)
        yield from _rows(name, names, "complex step", exact, EXACT)
        yield from _rows(name, names, "differences", rough, ROUGH)


def _errors_of_accelerations(samples: Samples) -> Iterator[Found]:
    """Yield by how much accelerations and multipliers miss their equations."""
    code, scale = samples.code, samples.reference
    parts: list[list[Array]] = [[] for _ in range(4)]
    for q, q_dot, t, p in samples.each():
        given = code.M(q, t, p), code.Phi_q(q, t, p), code.Q(q, q_dot, t, p)
        for part, value in zip(parts, (*given, code.gamma(q, q_dot, t, p)), strict=True):
            part.append(np.asarray(value))
    M, Phi_q, Q, gamma = map(np.array, parts)
    regular = np.array([_is_regular(J * scale) for J in Phi_q], dtype=bool)
    accelerations, multipliers = (
        [form[regular] for form in _forms(samples, name)]
        for name in ("accelerations", "multipliers")
    )
    M, Phi_q, Q, gamma = (x[regular] for x in (M, Phi_q, Q, gamma))
    # A multiplier that is zero everywhere is that of an equation that repeats others.
    kept = np.any([x != 0 for x in multipliers], axis=(0, 1))
    balance, rows = [], []
    for a, force in zip(accelerations, multipliers, strict=True):
        terms = np.einsum("sij,sj->sij", M, a), np.einsum("sji,sj->sij", Phi_q, force)
        balance.append(_missing(np.concatenate((*terms, -Q[..., np.newaxis]), axis=2), scale))
        moved = np.einsum("sij,sj->sij", Phi_q, a)
        missing = _missing(np.concatenate((moved, -gamma[..., np.newaxis]), axis=2), 1.0)
        rows.append(np.where(kept, missing, 0.0))
    oracle = "put back"
    for name, names, found in (
        ("accelerations", code.coordinates, balance), ("multipliers", code.equations, rows),
    ):  # fmt: skip
        yield from _rows(name, names, oracle, np.max(found, axis=0)[..., np.newaxis], EXACT)


def _forms(samples: Samples, name: str) -> list[Array]:
    """Return a quantity as each function of the module gives it, (S, rows) or (S, n, n)."""
    code, given = samples.code, states_of((name,))
    moving = ("q", "q_dot")[: len(given)]
    states = [(*state[: len(moving)], *state[2:]) for state in samples.each()]
    batch = (*(getattr(samples, x) for x in moving), samples.t, samples.p)

    def of_single(function: str, place: int | None = None) -> list[Array]:
        call = code.functions[function]
        both = [call(*state) for state in states], call(*batch)
        if place is None:
            return [np.array(both[0]), np.asarray(both[1])]
        return [np.array([value[place] for value in both[0]]), np.asarray(both[1][place])]

    found = of_single(name)
    if name in MATRICES:
        found += [_dense(code, name, entries) for entries in of_single(f"{name}_nonzeros")]
    elif name in TOGETHER["forward_dynamics"]:
        found += of_single("forward_dynamics", TOGETHER["forward_dynamics"].index(name))
    return found


def _dense(code: Compiled, name: str, entries: Array) -> Array:
    """Return matrices (S, n, n) of their entries."""
    n, pattern = len(code.coordinates), code.patterns[name]
    matrix = np.zeros((len(entries), n, n))
    matrix[:, pattern[:, 0], pattern[:, 1]] = entries
    return matrix


def _complex_slopes(samples: Samples, order: int) -> Array:
    """Return the derivatives of Q by coordinates or rates, (S, n, n); NaN where it has none."""
    one, found = np.eye(samples.reference.size) * 1j * COMPLEX_STEP, []
    for q, q_dot, t, p in samples.each():
        try:
            rows = [
                samples.code.Q(q + h * (order == 0), q_dot + h * (order == 1), t, p) for h in one
            ]
            found.append(np.imag(rows).T / COMPLEX_STEP)
        except (ArithmeticError, TypeError, ValueError):
            found.append(np.full(one.shape, np.nan))
    return np.array(found)


def _differences(samples: Samples, order: int) -> Array:
    """Return the same by differences."""
    code, scale, columns = samples.code, samples.reference, []
    for step, size in zip(np.eye(scale.size) * scale, scale, strict=True):

        def aside(h: float, step: Array = step) -> Array:
            moved = [h * step * (k == order) for k in range(2)]
            states = samples.q + moved[0], samples.q_dot + moved[1]
            return np.asarray(code.Q(*states, samples.t, samples.p))

        columns.append(slope(aside, DIFFERENCE) / size)
    return np.stack(columns, axis=-1)


def _errors(forms: list[Array], given: Array, scale: Array) -> Array:
    """Return the largest error of the forms, relative to each number, (S, rows, columns)."""
    size = np.abs(given * scale)
    flat = size.reshape(len(size), -1).max(axis=1).reshape(-1, *[1] * (size.ndim - 1))
    size = size + OF_LARGEST * flat
    size = np.where(size > 0, size, 1.0)
    errors = np.max(
        [np.nan_to_num(np.abs((x - given) * scale) / size, nan=np.inf) for x in forms], axis=0
    )
    return np.asarray(errors if errors.ndim > 2 else errors[..., np.newaxis])


def _missing(terms: Array, scale: Array | float) -> Array:
    """Return what the sum of the terms of each row is, (S, rows), relative to these."""
    size = np.abs(terms).sum(axis=2) * scale
    size = size + OF_LARGEST * size.max(axis=1, keepdims=True, initial=0.0)
    missing = np.abs(terms.sum(axis=2) * scale) / np.where(size > 0, size, 1.0)
    return np.asarray(np.nan_to_num(missing, nan=np.inf))


def _is_regular(Phi_q: Array) -> bool:
    sizes = np.linalg.svd(Phi_q, compute_uv=False)
    rank = sizes > 1e-12 * sizes[:1]
    return bool((sizes[rank] > REGULAR * sizes[0]).all()) if sizes.size else True


def _rows(
    quantity: str, names: tuple[str, ...], oracle: str, errors: Array, limit: float
) -> Iterator[Found]:
    """Yield the worst error of each row, of errors (S, rows, columns)."""
    if not len(errors):
        return
    worst = errors.max(axis=0)
    for row, name in enumerate(names):
        column = int(np.argmax(worst[row]))
        by = names[column] if worst.shape[1] > 1 else ""
        yield quantity, name, by, oracle, float(worst[row, column]), limit
