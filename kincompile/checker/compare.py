"""Comparison of hand-derived formulas with the generated ones.

generated   the formulas the compiler derives, evaluated at random states   reference.py, states.py
written     the formulas of the author: texts, arrays, functions            written.py, hand_file.py
match       rows, columns, signs, scales that conventions leave open        matching.py, layouts.py
agree       entry by entry: equal, undecided, different                     agreement.py, judged.py
            of equations                                                    comparer.py
            of M and Q, which are sums over masses and loads                load_comparer.py
            of the maps of a transmission                                   transmission_*.py
diagnose    the fault of the catalogue that gives the numbers that differ   diagnosis.py, *fault*.py
report      entries with verdicts, for people and for machines              report.py

Equality is decided by numbers at a dozen random states, never by simplification.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.checker.comparer import Comparer
from kincompile.checker.conventions import stated_conventions
from kincompile.checker.given_forms import Forms, Subject
from kincompile.checker.hand_file import HandFile, read_hand_file
from kincompile.checker.judged import retried
from kincompile.checker.load_comparer import LoadComparer
from kincompile.checker.reference import (
    COMPARED,
    OF_LOADS,
    OF_TRANSMISSIONS,
    QUANTITIES,
    Reference,
)
from kincompile.checker.transmission_comparer import TransmissionComparer
from kincompile.checker.transmission_reference import Transmission, TransmissionReference
from kincompile.checker.written import REPORTED, read_written, vocabulary
from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    import os
    from collections.abc import Collection, Mapping

    from numpy.typing import ArrayLike

    from kincompile.checker.report import Report
    from kincompile.checker.states import States
    from kincompile.checker.written import Written
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

Readings = dict[str, list["Written"]]
"""What is by hand, each quantity in the ways in which it may be meant."""


def compare(
    model: Mechanism | ConstraintSystem | Reference | Transmission,
    Phi: object = None,
    Phi_q: object = None,
    nu: object = None,
    gamma: object = None,
    M: object = None,
    Q: object = None,
    *,
    J: object = None,  # noqa: N803 - its name in the field
    J_dot: object = None,  # noqa: N803
    effort: object = None,
    x: object = None,
    constraint: str | None = None,
    aliases: Mapping[str, object] | None = None,
    conventions: Mapping[str, str] | None = None,
    states: Mapping[str, ArrayLike] | None = None,
    strict: bool = False,
) -> Report:
    r"""Compare Phi, Phi_q, nu, gamma, M and Q, or J and efforts, by hand with those derived.

    :math:`\Phi_q \dot q = \nu = -\Phi_t` and :math:`\Phi_q \ddot q = \gamma = -(\Phi_q \dot q)_q
    \dot q - 2 \Phi_{qt} \dot q - \Phi_{tt}` (Haug, section 3.1); :math:`M \ddot q + \Phi_q^T
    \lambda = Q` (section 6.3), where weight and the forces of inertia that are quadratic in the
    rates belong to Q.

    Parameters
    ----------
    model
        The mechanism or system; a `Reference` made of it, where many are compared with one model.
    Phi, Phi_q, nu, gamma, M, Q
        At least one, derived by hand: text such as ``[[1, 0, 0.25*cos(phi3)], ...]``, nested lists
        of numbers, texts and SymPy expressions, a SymPy matrix, an array, or a function ``f(q, t)``
        (of gamma and Q ``f(q, q_dot, t)``), which may take the parameters p as a last argument.
    constraint
        Name of the one constraint that is checked alone. Phi_q then has the columns of the whole
        system, or of the constraint's bodies, i before j; in space seven a body, or six.
    aliases
        Names of the author's own, each with its expression, for instance ``{"w": "phi3_dot"}``.
    conventions
        The author's conventions for nu and gamma: ``{"nu": "Phi_t", "gamma": "left side"}`` have
        the opposite sign, which is a mistake where it is not stated. In space ``form`` says by what
        Phi_q has derivatives, and gamma the second rates: ``"r-p"`` (ME751), ``"r-omega"`` (Haug:
        r and small rotations about the body's axes, without norm rows) or ``"global r-omega"``; the
        shape and the numbers say it where it is not stated.
    states
        States at which the values of arrays belong: ``q`` (N, n), and where they matter ``q_dot``
        (N, n), ``t`` (N,), ``p`` (N, k). Random states where None.
    strict
        Whether an entry must be equal to the generated one to be accepted, without a convention
        and at states off the constraint manifold too.

    Returns
    -------
    Report
        Verdict and diagnosis of every entry, and the conventions in which the two differ.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    InputError
        If a formula cannot be read, holds an unknown name, or has the wrong shape.
    """
    values = (Phi, Phi_q, nu, gamma, M, Q, J, J_dot, effort, x)
    pairs = zip((*COMPARED, *OF_TRANSMISSIONS), values, strict=True)
    given = {name: value for name, value in pairs if value is not None}
    reference, stated = _reference(model), stated_conventions(conventions or {})
    forms = Forms(reference, stated, constraint)
    readings = _read(forms, given, aliases or {}, at_states=states is not None)
    return _compared(forms, readings, states, strict)


def _reference(model: Mechanism | ConstraintSystem | Reference | Transmission) -> Reference:
    if isinstance(model, Reference):
        return model
    return TransmissionReference(model) if isinstance(model, Transmission) else Reference(model)


def _require_own(reference: Reference, given: Collection[str], constraint: str | None) -> None:
    """Refuse what a transmission does not have, or a mechanism."""
    is_function = isinstance(reference, TransmissionReference)
    expected = OF_TRANSMISSIONS if is_function else COMPARED
    if not given:
        raise InputError(f"there is nothing to compare: give at least one of {listed(expected)}.")
    if is_function and constraint is not None:
        raise InputError("a transmission is compared as a whole: leave constraint out.")
    if wrong := [name for name in given if name not in expected]:
        belongs = (
            "those of a mechanism: compare them with the model itself"
            if is_function
            else "those of a transmission: compare them with kc.transmission(model, inputs, "
            "outputs); on the command line, with --transmission INPUTS:OUTPUTS"
        )
        raise InputError(f"{listed(wrong)}: {belongs}.")


def compare_file(
    model: Mechanism | ConstraintSystem | Reference | Transmission,
    path: str | os.PathLike[str] | HandFile,
    *,
    constraint: str | None = None,
    strict: bool = False,
) -> Report:
    """Compare a hand file with the generated formulas.

    Parameters
    ----------
    model
        As for `compare`.
    path
        The hand file: TOML, JSON or lines ``Name = [[...]]``; or what `read_hand_file` made of it.
    constraint
        Name of the one constraint that is checked alone; the file's own where None.
    strict
        As for `compare`.

    Returns
    -------
    Report
        As `compare` gives it.

    Raises
    ------
    ModelError, InputError
        As `compare` does; a message begins with the file and the line.
    """
    file = path if isinstance(path, HandFile) else read_hand_file(Path(path))
    reference = _reference(model)
    constraint = file.constraint if constraint is None else constraint
    try:
        forms = Forms(reference, stated_conventions(file.conventions), constraint)
        readings = _read(forms, file.quantities, file.aliases)
    except InputError as error:
        raise InputError([f"{file.name}, {problem}" for problem in error.problems]) from error
    return _compared(forms, readings, None, strict)


def _compared(
    forms: Forms, readings: Readings, given: Mapping[str, ArrayLike] | None, strict: bool
) -> Report:
    """Compare equations, loads or a transmission."""
    reference, stated = forms.reference, forms.stated
    if isinstance(reference, TransmissionReference):
        return retried(
            lambda states, convention: TransmissionComparer(
                reference, readings, states, stated, strict, convention
            ),
            _states(reference, readings, given),
        ).report()
    of_equations, of_loads = (
        {name: item for name, (item,) in readings.items() if name in names}
        for names in (QUANTITIES, OF_LOADS)
    )
    reports = []
    if of_equations:
        reports.append(_best(forms, of_equations, readings, given, strict).report())
    if of_loads:
        states = _states(reference, readings, given)
        reports.append(
            retried(
                lambda states, convention: LoadComparer(
                    reference, of_loads, states, strict, convention
                ),
                states,
            ).report()
        )
    report, *others = reports
    for added in others:
        conventions = tuple(dict.fromkeys((*report.conventions, *added.conventions)))
        entries = report.entries + added.entries
        report = replace(report, entries=entries, conventions=conventions)
    return report


def _states(
    reference: Reference, readings: Readings, given: Mapping[str, ArrayLike] | None
) -> States:
    """Return where to compare: functions without parameters have the default ones."""
    if given is not None:
        return reference.given_states(given)
    takes_parameters = all(item.takes_parameters for own in readings.values() for item in own)
    return reference.random if takes_parameters else reference.fixed


def _best(
    forms: Forms,
    written: Mapping[str, Written],
    readings: Readings,
    given: Mapping[str, ArrayLike] | None,
    strict: bool,
) -> Comparer:
    """Return the comparison in the form that explains the most, the system's own first."""
    best: Comparer | None = None
    for reference, block in forms.fitting({name: item.shape for name, item in written.items()}):
        subject = Subject(reference, block, _states(reference, readings, given))
        found = _in_one_form(subject, written, forms.stated.signs, strict)
        # Global axes in some constraints alone are a slip, and no way to write.
        is_whole = not found.wrong_count or not reference.is_global
        if best is None or (is_whole and found.wrong_count < best.wrong_count):
            best = found
        if not best.wrong_count:
            break
    assert best is not None, "shapes are checked before"
    return best


def _in_one_form(
    subject: Subject, written: Mapping[str, Written], signs: Mapping[str, float], strict: bool
) -> Comparer:
    return retried(
        lambda states, convention: Comparer(
            replace(subject, states=states), written, signs, strict, convention
        ),
        subject.states,
    )


def _read(
    forms: Forms,
    given: Mapping[str, object],
    aliases: Mapping[str, object],
    *,
    at_states: bool = False,
) -> Readings:
    """Read all quantities, or raise all problems at once."""
    reference = forms.reference
    _require_own(reference, given, forms.constraint)
    if any(name in OF_LOADS for name in given):
        _require_loads(forms)
    if forms.constraint is not None:
        reference.block(forms.constraint)
    own = reference if isinstance(reference, TransmissionReference) else forms
    words = vocabulary(reference, aliases)
    readings: Readings = {}
    problems: list[str] = []
    for name, value in given.items():
        check = partial(own.shape_problems, name)
        try:
            readings[name] = read_written(name, value, words, reference, at_states, check)
            problems += check(*readings[name][0].shape)
        except InputError as error:
            problems += [item for item in error.problems if item != REPORTED]
    if problems:
        raise InputError(problems)
    return readings


def _require_loads(forms: Forms) -> None:
    """Refuse M and Q of a mechanism that has none, and of one constraint."""
    if forms.constraint is not None:
        raise InputError(
            f"M and Q are those of the whole system, not of {forms.constraint!r}: leave "
            "constraint out."
        )
    system = forms.reference.system
    if not system.loads:
        raise InputError(
            f"{system.name} has no masses and no forces, so that M and Q are zero: give "
            "its bodies masses, m.body(..., mass=..., inertia=...), or add loads."
        )
