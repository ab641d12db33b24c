r"""What tolerances of dimensions and clearances of joints do to a motion.

model      -> variation      clearances become parameters, zero at first      variation
           -> Solution       the nominal motion                               kc.solve
           -> gradients      exact, of the columns by those parameters        kc.sensitivities
           -> effects        worst case, root sum of squares                  deviation
           -> Drawn          the motion of samples, by chance                 draw

To first order :math:`\Delta y = \sum_k y_{p_k} \Delta p_k`: the worst case is the sum of the
largest terms, the variance that of their variances. Second derivatives, exact too, shift the mean
by :math:`\tfrac12 \sum_{kl} y_{p_k p_l} E[\Delta p_k \Delta p_l]`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import qmc

from kincompile.compiler import compile as compile_model
from kincompile.design.columns import columns_of
from kincompile.design.deviation import read_clearance, read_deviation
from kincompile.design.tolerance_analysis import Drawn, ToleranceAnalysis
from kincompile.design.variation import clearance_names, require_mechanism, with_clearances
from kincompile.errors import InputError
from kincompile.model.declared import require
from kincompile.model.tasks import Tolerance
from kincompile.names import listed, suggestion
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.results.sensitivities import sensitivities
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from kincompile.design.columns import Column
    from kincompile.design.deviation import Clearance, Deviation
    from kincompile.model.mechanism import Mechanism
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]
    Bands = tuple[Array, Array, Array, Array, Array, Array]
    Sources = dict[str, tuple[tuple[str, ...], Deviation | Clearance]]

MOST_NUMBERS = 20_000_000
"""Numbers of the motions that are sampled at a time, so that they fit into memory."""

STILL = 1e-13
"""Effect, relative to the largest value of its column, that is a rounding error."""


def tolerance(
    model: Mechanism,
    tolerances: Mapping[str, float | tuple[float, float] | Deviation],
    of: str | Sequence[str] | None = None,
    *,
    clearances: Mapping[str, float] | None = None,
    t: ArrayLike | None = None,
    p: Mapping[str, float] | None = None,
    guess: Mapping[str, float] | None = None,
    assembly: int | None = None,
    samples: int = Tolerance.samples,
    seed: int = Tolerance.seed,
) -> ToleranceAnalysis:
    r"""Say how far a motion deviates for given tolerances: worst case, RSS and Monte Carlo.

    Parameters
    ----------
    model
        A mechanism. Dimensions that have a tolerance are parameters of it.
    tolerances
        By the name of a parameter a number for plus and minus, in its unit, or two limit
        deviations, or a `Deviation`, which says how it is distributed. A number is the limits of
        a normal distribution at three standard deviations.
    of
        The columns that are looked at, ``["foot.x", "rod.phi_dot"]``: coordinates, outputs, and
        their rates. Without them the outputs, or where there are none the coordinates.
    clearances
        By the name of a joint its radial clearance [length]: the pin lies at the edge of its hole,
        in any direction alike, which adds a small vector to the joint's point on body i.
    t : array_like, shape (N,), optional
        Times; those of the model without.
    p, guess : mapping, optional
        Nominal values of parameters, and where Newton starts, as `kc.solve` takes them.
    assembly : int, optional
        The way to assemble the mechanism, instead of a guess.
    samples
        Number of samples of Monte Carlo, by Sobol's sequence; a power of two spreads them best.
        Each is solved exactly. Without them worst case and RSS alone.
    seed
        Of the sequence.

    Returns
    -------
    ToleranceAnalysis
        Bands over time, contributions in per cent, tables and plots.

    Raises
    ------
    InputError
        If a name is that of no parameter, joint or column, a tolerance is malformed or moves
        nothing. One message has all problems.
    SolveError
        If the nominal mechanism does not move through all times.
    """
    model = require_mechanism(model, "kc.tolerance")
    loose = mapping_of(clearances, "clearances")
    require(Tolerance, samples=samples, seed=seed)
    sources = _sources(model, tolerances, loose)
    module = compile_model(with_clearances(model, loose))
    columns = columns_of(code_of(module), of)
    times = np.linspace(0.0, model.end, model.points) if t is None else t
    nominal = solve(module, times, dict(p or {}), guess, assembly=assembly, throw=True)
    names = [name for group, _ in sources.values() for name in group]
    gradients, curvatures = _derivatives(nominal, names, columns)
    bands = _effects(gradients, curvatures, sources)
    values = np.stack([nominal[column.name] for column in columns], axis=-1)
    _require_effect(model.name, sources, columns, bands, values)
    drawn = _drawn(nominal, sources, columns, int(samples), seed) if samples else None
    return ToleranceAnalysis(
        model.name,
        nominal.t,
        tuple(column.name for column in columns),
        {column.name: column.unit for column in columns},
        tuple(sources),
        values,
        *bands,
        drawn,
        nominal,
    )


def _sources(
    model: Mechanism, tolerances: Mapping[str, Any], clearances: Mapping[str, Any]
) -> Sources:
    """Return what deviates by its title: its parameters, and how."""
    known = [item.name for item in model.parameters]
    found: Sources = {}
    problems = []
    for name, given in mapping_of(tolerances, "tolerances").items():
        if name not in known:
            near = suggestion(str(name), known) or "."
            problems.append(
                f"{model.name} has no parameter {name!r}{near} The parameters are {listed(known)}; "
                "a dimension that has a tolerance is declared with m.parameter."
            )
            continue
        try:
            found[name] = (name,), read_deviation(given, f"the tolerance of {name!r}")
        except InputError as error:
            problems += error.problems
    for joint, given in clearances.items():
        try:
            radius = read_clearance(given, f"the clearance of {joint!r}")
            found[f"clearance of {joint}"] = clearance_names(joint), radius
        except InputError as error:
            problems += error.problems
    if not (found or problems):
        problems.append("there are no tolerances: give some, such as {'a': 1e-4}.")
    if problems:
        raise InputError(problems)
    return found


def _derivatives(
    nominal: Solution, names: Sequence[str], columns: Sequence[Column]
) -> tuple[Array, Array]:
    """Return the derivatives of columns by parameters (N, columns, k), and by pairs of them."""
    of = list(dict.fromkeys(column.of for column in columns))
    found = sensitivities(nominal, names, of, second=True)
    first = [[found[x.name, name] for name in names] for x in columns]
    second = [[[found[x.name, name, by] for by in names] for name in names] for x in columns]
    return np.moveaxis(np.array(first), -1, 0), np.moveaxis(np.array(second), -1, 0)


def _effects(gradients: Array, curvatures: Array, sources: Sources) -> Bands:
    """Return what each source does, (N, columns, k) each.

    That is slope, least and greatest effect, mean, sigma, and shift of the mean.
    """
    moments = [deviation.moments() for _, deviation in sources.values()]
    means = np.concatenate([mean for mean, _ in moments])
    products = np.outer(means, means) + block_diag(*(own for _, own in moments))
    shifts = (curvatures * products).sum(axis=-1) / 2
    found, first = [], 0
    for (names, deviation), (mean, covariance) in zip(sources.values(), moments, strict=True):
        place = np.s_[..., first : first + len(names)]
        own = gradients[place]
        first += len(names)
        slope = own[..., 0] if len(names) == 1 else np.linalg.norm(own, axis=-1)
        sigma = np.sqrt(((own @ covariance) * own).sum(axis=-1))
        shift = shifts[place].sum(axis=-1)
        found.append((slope, *deviation.effects(own), own @ mean, sigma, shift))
    slope, low, high, mean, sigma, shift = (np.stack(x, axis=-1) for x in zip(*found, strict=True))
    return slope, low, high, mean, sigma, shift


def _require_effect(
    name: str, sources: Sources, columns: Sequence[Column], bands: Sequence[Array], values: Array
) -> None:
    """Check that every tolerance moves one of the columns."""
    size = np.maximum(np.nanmax(np.abs(values), axis=0), np.finfo(float).tiny)
    moved = np.nanmax(bands[2] - bands[1], axis=0) / size[:, np.newaxis]
    still = [title for k, title in enumerate(sources) if not (moved[:, k] > STILL).any()]
    if still:
        raise InputError(
            [
                f"the tolerance of {title!r} moves none of "
                f"{listed(column.name for column in columns)} of {name} at these times: leave it "
                "out, or ask for a column that depends on it."
                for title in still
            ]
        )


def _drawn(
    nominal: Solution, sources: Sources, columns: Sequence[Column], count: int, seed: int
) -> Drawn:
    """Solve the motion of samples that are spread evenly over the tolerances."""
    sets = _sets(nominal, sources, count, seed)
    start = dict(zip(nominal.coordinates, nominal.q[0].tolist(), strict=True))
    block = max(1, MOST_NUMBERS // (6 * nominal.q.size))
    found = []
    for first in range(0, count, block):
        own = {name: values[first : first + block] for name, values in sets.items()}
        motion = solve(nominal.require_module("samples"), nominal.t, own, start)
        found.append(np.stack([motion[column.name] for column in columns], axis=-1))
    values = np.concatenate(found)
    is_whole = np.isfinite(values).all(axis=(1, 2))
    kept = {name: item[is_whole] for name, item in sets.items()}
    return Drawn(values[is_whole], kept, int(np.count_nonzero(~is_whole)))


def _sets(nominal: Solution, sources: Sources, count: int, seed: int) -> dict[str, Array]:
    """Return values of all parameters for each of `count` samples."""
    size = max(1, (count - 1).bit_length())
    parts = qmc.Sobol(len(sources), seed=seed).random_base2(size)[:count]
    inside = np.clip(parts, np.finfo(float).eps, 1 - np.finfo(float).eps)
    sets = {name: np.full(count, float(value)) for name, value in nominal.parameters.items()}
    for (names, deviation), column in zip(sources.values(), inside.T, strict=True):
        for name, moved in zip(names, deviation.deviations(column), strict=True):
            sets[name] = sets[name] + moved
    return sets
