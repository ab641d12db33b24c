"""The compiler, stage by stage.

mechanism -> system()        ConstraintSystem  names and attributes checked, all problems at once
system    -> lower           Program           kernels x instances; each type derived once
program   -> inline          InlineProgram     written out in one graph, where equal values meet
system    -> held_system      ConstraintSystem  an equation for each freedom that nothing sees
pattern   -> counting_problem  str              why no position can be solved for; else ""
pattern   -> redundant_equations               of more equations than coordinates those that repeat
program   -> emit_program    Emitted           the files of a target
emitted   -> from_source     module            loaded, its contract checked
module    -> make_native     module            its functions replaced by compiled C, for target="c"

Stages that not every model needs are imported where they begin: the grouped form, redundancy, the
runtime, its compiled functions, the report. A process that emits a four-bar loads none of them.
"""

from __future__ import annotations

import gc
import logging
import warnings
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile import further
from kincompile.emitters.emission import emit_program
from kincompile.emitters.registry import PACKAGES, TARGETS
from kincompile.emitters.target import Start
from kincompile.errors import (
    InputError,
    KincompileError,
    RedundantConstraintWarning,
    UnsupportedError,
)
from kincompile.ir.inline import InlineProgram, inline
from kincompile.ir.lower import lower
from kincompile.model.mechanism import Mechanism, system_of
from kincompile.model.system import remember_model
from kincompile.names import listed
from kincompile.quantities import turning
from kincompile.structure.counting import counting_problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import ModuleType

    import numpy as np
    from numpy.typing import NDArray

    from kincompile.emitters.target import Emitted
    from kincompile.ir.grouping import GroupedProgram
    from kincompile.ir.program import Program
    from kincompile.ir.transmission import TransmissionCode
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.report import Inspection

LOG = logging.getLogger(__name__)


def emit(
    model: Mechanism | ConstraintSystem,
    target: str = "numpy",
    form: str | None = None,
    *,
    sensitivities: Sequence[str] = (),
    dynamics: bool = False,
    transmission: tuple[Sequence[str], Sequence[str]] | None = None,
    real: str = "float64",
    points: str = "many",
) -> Emitted:
    """Compile a mechanism to source files.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.
    target
        Language of the files: ``"numpy"``, ``"c"``, ``"octave"``, which is MATLAB too,
        ``"javascript"`` or ``"rust"``; or ``"fmi"``, a unit for co-simulation, FMI 3.0: its
        ``.write("x.fmu")`` writes the archive, with the C files and a library of them.
    form : {"inline", "grouped"}, optional
        ``"inline"`` writes every constraint out, with names and comments; ``"grouped"`` writes one
        function per type of constraint, for mechanisms of any size. Without a choice the size
        decides.
    sensitivities
        Names of parameters: the files are then those of the mechanism together with the derivatives
        by them, coordinates and outputs of their own, ``phi_rod_by_a``, whose rates are the
        derivatives of the rates.
    dynamics
        Whether the files have the right side of the equations of motion too, for any integrator:
        ``accelerations(q, q_dot, t, p)`` and ``multipliers``, of a mechanism whose bodies have
        masses, with as many degrees of freedom as it likes.
    transmission
        Names of inputs, drivers or coordinates, and of outputs, coordinates, outputs or points: the
        file is then the mechanism as a function from the one to the other, and nothing else.
        ``<name>_transmission(state, u)`` gives x, its Jacobian J by u and a status; it goes on from
        the last position, which the caller keeps.
    real : {"float64", "float32"}
        The type of numbers; ``"float32"`` is for one point at a time.
    points : {"many", "one"}
        ``"one"``, of the target ``"c"``, is for a controller: ``<name>_step(state, t)`` goes on
        from the last position, which the caller keeps, to a time. It uses no heap, and little
        memory and stack; ``.needs`` says how much.

    Returns
    -------
    Emitted
        The files; ``.source`` is the text of the main one, ``.write(folder)`` writes them. A NumPy
        module ends with ``march(q, t, p)``, which follows a motion without kincompile, unless it is
        in grouped form. Where the equations cannot determine the coordinates, there is no march,
        and ``.unsolvable`` says why.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If it has no parameter of a name, or with `dynamics` no masses; with `transmission`, if it
        has no input or output of a name, or the inputs do not determine the outputs. For one point
        at a time, if no position was found at t = 0, or float32 does not reach 1e-5 of it.
    StructuralError
        With `dynamics`, if a body has no mass, or constraints contradict each other.
    UnsupportedError
        If there is no such target, or it cannot print the mechanism: only ``"numpy"`` has the
        grouped form, and that has neither sensitivities nor equations of motion; only ``"c"`` has
        one point at a time.
    """
    _check_target(target, form)
    _check_numbers(target, real, points, dynamics=dynamics)
    system = system_of(model)
    language = PACKAGES[target].language if target in PACKAGES else target
    if transmission is not None:
        if form == "grouped" or sensitivities or dynamics:
            raise UnsupportedError(
                "a transmission is a file of its own, written out, without sensitivities and "
                "equations of motion; leave out what is asked for beside it"
            )
        start = Start(real) if points == "one" else None
        emitted, found = transmission_files(system, language, *transmission, start=start)
        return emitted if language == target else _unit(emitted, found, system)
    with _without_collector():
        system = further.held_system(system)
        if form == "grouped" and (sensitivities or dynamics):
            what = "sensitivities" if sensitivities else "equations of motion"
            raise UnsupportedError(f"the grouped form has no {what}; use form='inline'")
        if _is_grouped(system, form) and not TARGETS[language].has_grouped_form:
            raise UnsupportedError(
                f"the target {target!r} has no grouped form; use target='numpy', or form='inline'"
            )
        code = _lowered(system, form)
        if sensitivities:
            code = further.sensitive(code.program, sensitivities)
        if dynamics:
            code = further.moving(code, system)
        start = _start_of(system, code.program, real) if points == "one" else None
        emitted = emit_program(language, code, start)
        if language != target:
            return _unit(emitted, code, system)
        if target != "numpy" or not isinstance(code, InlineProgram):
            return emitted
        from kincompile.emitters.numpy.march import with_march

        return with_march(emitted, code.program)


def _unit(
    emitted: Emitted,
    code: InlineProgram | GroupedProgram | TransmissionCode,
    system: ConstraintSystem,
) -> Emitted:
    """Return the unit of FMI with emitted C code: of a transmission, or of a motion."""
    from kincompile.emitters.fmi import motion_unit, transmission_unit
    from kincompile.ir.transmission import TransmissionCode
    from kincompile.runtime.native.library import shared_library

    if isinstance(code, TransmissionCode):
        return transmission_unit(emitted, code, system, shared_library)
    assert isinstance(code, InlineProgram)
    if code.program.motion:
        raise UnsupportedError(
            "a unit of FMI follows a motion that drivers prescribe, without equations of motion; "
            "leave out what is asked for beside it"
        )
    unit = motion_unit(emitted, code, system, shared_library)
    if _assembled(system) is None:
        raise InputError(
            f"no position of {system.name} was found at t = 0, where a unit of FMI begins: change "
            "lengths, or what the drivers demand there, or give a better guess."
        )
    return unit


def transmission_files(
    system: ConstraintSystem,
    target: str,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    is_drawn: bool = False,
    start: Start | None = None,
) -> tuple[Emitted, TransmissionCode]:
    """Return the files of a mechanism as a function of its inputs, and the code in them.

    Its outputs are followed by all coordinates where it is to be drawn. A start says which numbers
    it has for one point at a time.
    """
    from kincompile.emitters.transmission_emission import emit_transmission, require_transmission
    from kincompile.ir.transmission import transmission_code
    from kincompile.transmissions.legs import lengths_of, without_legs
    from kincompile.transmissions.loop import loop_of

    require_transmission(target)
    loop = loop_of(system, inputs, outputs)
    names = dict(zip(loop.parameters, loop.inputs, strict=True))
    q = _assembled(loop.system)
    if q is None:
        raise InputError(
            f"no position of {system.name} was found where a transmission begins, at the values "
            "that its drivers have at t = 0: give a better guess."
        )
    wanted = [*loop.outputs, *(x.name for x in loop.system.coordinates if is_drawn)]
    smaller, q = without_legs(loop.system, names, wanted, q)
    code = _lowered(smaller, "inline")
    assert isinstance(code, InlineProgram)
    further.require_small(code.program, "transmissions", "take")
    lengths = lengths_of(smaller, set(names))
    found = transmission_code(code, names, wanted, q.tolist(), lengths)
    defaults = {x.name: float(x.default or 0.0) for x in code.program.parameters}
    first = [q[k] for k in found.free], [defaults[name] for name in names]
    if start is not None and start.real == "float32":
        names_of = [code.program.coordinates[k].name for k in found.free]
        further.require_float32(
            dict(zip(names_of, first[0], strict=True)), found.angular, found.size
        )
    return emit_transmission(target, found, *first, start), found


@contextmanager
def _without_collector() -> Iterator[None]:
    """Pause Python's collector of cycles.

    The many small values of a mechanism all stay, and the collector would walk over them again and
    again: 90,000 coordinates take 1.16 times as long with it. Up to 900 there is no difference.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _check_target(target: str, form: str | None) -> None:
    if target not in (known := [*TARGETS, *PACKAGES]):
        raise UnsupportedError(f"there is no target {target!r}; targets are: {listed(known)}")
    if form not in (None, "inline", "grouped"):
        raise InputError(f"there is no form {form!r}; forms are: inline, grouped")


def _check_numbers(target: str, real: str, points: str, *, dynamics: bool) -> None:
    """Refuse numbers and points that a target does not have."""
    if real not in ("float64", "float32"):
        raise InputError(f"there are no numbers {real!r}; real is float64 or float32")
    if points not in ("many", "one"):
        raise InputError(f"points are many or one, not {points!r}")
    if points == "many" and real == "float32":
        raise UnsupportedError(
            "float32 is for one point at a time, as on a controller: give points='one' too"
        )
    if points == "many":
        return
    if target not in TARGETS or not TARGETS[target].has_one:
        known = [name for name, item in TARGETS.items() if item.has_one]
        raise UnsupportedError(
            f"the target {target!r} has no code for one point at a time; targets that do: "
            f"{listed(known)}"
        )
    if dynamics:
        raise UnsupportedError(
            "code for one point at a time follows the drivers, and has no equations of motion; "
            "leave out dynamics, or points='one'"
        )


def _start_of(system: ConstraintSystem, program: Program, real: str) -> Start:
    """Return where code for one point at a time begins: an assembled position, and the size."""
    if program.unsolvable:
        raise UnsupportedError(f"there is no motion to follow: {program.unsolvable}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        module = compile(system)
    found = further.start_of(module)
    if found is None:
        raise InputError(
            f"no position of {system.name} was found at t = 0, where code for one point at a time "
            "begins: give a better guess."
        )
    q, size, sensitivity = found
    if real == "float32":
        named = dict(zip(program.names_of("coordinates"), q, strict=True))
        angular = turning(
            [x.unit for x in program.coordinates], [x.columns for x in program.bodies]
        )
        further.require_float32(named, angular, size, sensitivity)
    return Start(real, tuple(q), size)


def _is_grouped(system: ConstraintSystem, form: str | None) -> bool:
    return form == "grouped" or (form is None and len(system.coordinates) > further.LARGEST_INLINE)


def _lowered(system: ConstraintSystem, form: str | None) -> InlineProgram | GroupedProgram:
    """Return the program of a system in the form that is to be printed.

    Where its equations cannot determine the coordinates, it knows why.
    """
    is_grouped = _is_grouped(system, form)
    program = lower(system, share_equations=is_grouped)
    code = _grouped(program) if is_grouped else inline(program)
    n = len(system.coordinates)
    if len(system.equations) <= n or n > further.LARGEST_REDUNDANT:
        problem = counting_problem(system, code.pattern())
        return replace(code, program=replace(code.program, unsolvable=problem))
    return _with_redundancy(system, code)


def _grouped(program: Program) -> GroupedProgram:
    """Return the grouped form of a program."""
    from kincompile.ir.grouping import group

    return group(program)


def _with_redundancy(
    system: ConstraintSystem, code: InlineProgram | GroupedProgram
) -> InlineProgram | GroupedProgram:
    """Return a program that knows which of its equations repeat others, and warn of them."""
    from kincompile.ir.redundancy import redundant_equations

    left_out, warning, problem = redundant_equations(system, code.program, code.pattern())
    if problem:
        return replace(code, program=replace(code.program, unsolvable=problem))
    warnings.warn(warning, RedundantConstraintWarning, stacklevel=4)
    return replace(code, program=replace(code.program, redundant=left_out))


def compile(  # noqa: A001 - the public name kc.compile
    model: Mechanism | ConstraintSystem, target: str = "numpy", form: str | None = None
) -> ModuleType:
    """Compile a mechanism and load the result.

    Parameters
    ----------
    model
        A mechanism or a system of free equations.
    target
        ``"numpy"``, or ``"c"``: the same module, but its functions are compiled by the machine's
        own C compiler, which takes a second or two the first time; after that they come from the
        user's cache. A large mechanism, in grouped form, stays NumPy's.
    form : {"inline", "grouped"}, optional
        As for `emit`.

    Returns
    -------
    module
        The emitted module, with Phi, Phi_q, nu, gamma and their fused forms, but without the march
        at the end of a file: `solve` has its own. Where the equations cannot determine the
        coordinates, ``UNSOLVABLE`` says why, and so does `solve`.

    Raises
    ------
    ModelError
        As `emit` does.
    UnsupportedError
        If there is no such target, it cannot print the mechanism, or there is no C compiler.
    """
    with _without_collector():
        system = further.held_system(system_of(model))
        target = _loadable(target, system, form)
        code = _lowered(system, form)
        compiled = further.loaded(code, target)
    compiled.makers.update(further.makers_of(compiled, system, code, target))
    return remember_model(compiled.module, system)


def _loadable(target: str, system: ConstraintSystem, form: str | None) -> str:
    """Return the target whose module is loaded: of a large mechanism NumPy's, not C's."""
    loadable = [name for name, item in TARGETS.items() if item.is_loadable]
    if target not in loadable:
        raise UnsupportedError(
            f"only modules of the targets {listed(loadable)} can be loaded, not {target!r}; "
            f"kc.emit(model, {target!r}).write(folder) gives the files"
        )
    _check_target(target, form)
    if target == "c" and _is_grouped(system, form):
        LOG.info("%s is in grouped form, which C does not have: it stays NumPy's", system.name)
        return "numpy"
    return target


def forces_program(system: ConstraintSystem) -> Program | None:
    """Return the program whose outputs are the forces of a mechanism along a motion, or None.

    None where its equations do not determine the motion, or redundant ones forbid a planned solve.
    """
    from kincompile.ir.forces import observing_forces

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        code = _lowered(further.held_system(system), "inline")
    return observing_forces(code) if isinstance(code, InlineProgram) else None


def inspect(model: Mechanism | ConstraintSystem) -> Inspection:
    """Count what a mechanism is made of, also where its motion cannot be solved yet.

    Parameters
    ----------
    model
        A mechanism or a system of free equations, with too few or too many equations perhaps.

    Returns
    -------
    Inspection
        Bodies, constraints, rows and columns, mobility, rank, redundant and conflicting equations,
        what may still move, blocks in the order of solution; `.to_text()` gives tables of them.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    """
    from kincompile.ir.redundancy import missing_drivers, rank_report
    from kincompile.structure.report import inspect_system

    system = further.held_system(system_of(model))
    program = lower(system)
    ranks = rank_report(system, program)
    if not ranks.assembled:
        guess = _assembled(model)
        ranks = ranks if guess is None else rank_report(system, program, guess)
    missing = missing_drivers(system, ranks)
    return inspect_system(system, _grouped(program).pattern(), ranks, missing)


def _assembled(model: Mechanism | ConstraintSystem) -> NDArray[np.float64] | None:
    """Return the position at the start that the runtime finds, with its restarts, or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        try:
            module = compile(model)
        except KincompileError:
            return None
    return further.position_of(module)
