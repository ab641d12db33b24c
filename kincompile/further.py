"""Further code of a mechanism, compiled when the runtime requests it: forces, sensitivities, ...

Stages are imported where they begin, as in `compiler.py`.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.emitters.emission import emit_program
from kincompile.errors import InputError, KincompileError, UnsupportedError
from kincompile.ir.inline import InlineProgram, inline
from kincompile.ir.lower import lower
from kincompile.structure.idle import loose_bodies

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.ir.grouping import GroupedProgram
    from kincompile.ir.program import Program
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.engine.code import Compiled, Dynamics, Kind, Place

LARGEST_INLINE = 300
"""Coordinates up to which every constraint is written out."""

LARGEST_REDUNDANT = 1000
"""Coordinates up to which redundant equations are found, by dense matrices; beyond, there may be no
more equations than coordinates."""


def held_system(system: ConstraintSystem) -> ConstraintSystem:
    """Return a system with an equation more for each freedom that nothing sees."""
    if system.held or len(system.coordinates) > LARGEST_REDUNDANT:
        return system
    loose = loose_bodies(system)
    if not loose:
        return system
    from kincompile.ir.holding import with_held

    return with_held(system, loose)


def makers_of(
    compiled: Compiled,
    system: ConstraintSystem,
    code: InlineProgram | GroupedProgram,
    target: str,
) -> dict[Kind[Any], Callable[..., Any]]:
    """Return the compilers of further code of a mechanism, by kind of request."""
    from kincompile.runtime.engine import code as kinds

    makers: dict[Kind[Any], Callable[..., Any]] = {
        kinds.POINTS: partial(_joint_points, system),
        kinds.DRIVERS: lambda: system.drivers_at,
        kinds.FOUR_BARS: partial(_four_bars, system),
        kinds.JOINTS: partial(_joints, system),
    }
    if system.limits:
        makers[kinds.LIMITS] = partial(_limits, system)
    if len(system.coordinates) <= LARGEST_REDUNDANT:
        makers[kinds.UNDRIVEN] = partial(_undriven, system)
    if not isinstance(code, InlineProgram):  # that of a large mechanism is not worth its memory
        return makers
    if compiled.lanes is not None and compiled.stepper is None:
        makers[kinds.STEPPER] = partial(_stepper, compiled.module, code.program)
    makers[kinds.SENSITIVITIES] = partial(_sensitivities, code, compiled.module, target)
    makers[kinds.SENSITIVE] = partial(_with_sensitivities, code.program)
    if system.loads:
        makers[kinds.FORCES] = partial(_forces, code, target)
        makers[kinds.DYNAMICS] = partial(_dynamics, code, system, target)
        makers[kinds.SLOPES] = partial(_slopes, compiled, code, target)
    return makers


def _stepper(module: ModuleType, program: Program) -> Callable[..., Any]:
    """Return what takes a motion from one time to the next, of the march that ends a file."""
    from kincompile.emitters.numpy.march import march_of
    from kincompile.runtime.load import with_text

    found: Callable[..., Any] = with_text(module, march_of(program), "march")["stepper"]
    return found


def _joints(system: ConstraintSystem) -> dict[str, tuple[str, ...]]:
    """Return the bodies of each constraint, by its name."""
    return {item.name: tuple(body.name for body in item.bodies) for item in system.constraints}


def _limits(system: ConstraintSystem) -> Callable[..., Any]:
    """Return what says which limits of joints are left; made where one is solved first."""
    from kincompile.ir.limits import limits_left

    return limits_left(system)


def _four_bars(system: ConstraintSystem) -> Callable[..., Any]:
    """Return what gives the four-bars with parameters."""
    from kincompile.model.four_bars import four_bar_loops, four_bars_at

    return partial(four_bars_at, system, four_bar_loops(system))


def _joint_points(system: ConstraintSystem) -> Compiled:
    """Return code whose outputs are the points of joints, for who asks for one of them."""
    return _compiled(lower(system.observing(system.joint_points())), "numpy")


def _undriven(system: ConstraintSystem) -> str:
    """Return which drivers are missing where equations depend on others; "" if none are."""
    from kincompile.ir.redundancy import undriven

    return undriven(system, lower(system))


def sensitive(program: Program, names: Sequence[str]) -> InlineProgram:
    """Return the program of a mechanism with its sensitivities, written out."""
    from kincompile.ir.sensitive import with_sensitivities

    require_small(program, "sensitivities", "differentiate")
    return inline(with_sensitivities(program, names))


def require_small(program: Program, what: str, do: str) -> None:
    """Refuse a mechanism that is too large for what is written out whole."""
    if len(program.coordinates) > LARGEST_INLINE:
        raise UnsupportedError(
            f"{program.name!r} has {len(program.coordinates)} coordinates, and {what} are "
            f"compiled for up to {LARGEST_INLINE}: {do} a part of the mechanism."
        )


def moving(code: InlineProgram | GroupedProgram, system: ConstraintSystem) -> InlineProgram:
    """Return the program of a mechanism with its equations of motion, written out."""
    from kincompile.ir.accelerations import with_motion

    require_small(code.program, "equations of motion", "simulate")
    assert isinstance(code, InlineProgram)
    return inline(with_motion(code, _dependent(code, system)[0]))


def _with_sensitivities(program: Program, names: tuple[str, ...]) -> Compiled:
    """Return the code of a mechanism with its sensitivities, for `kc.sensitivities`."""
    return loaded(sensitive(program, names), "numpy")


def _sensitivities(
    code: InlineProgram,
    module: ModuleType,
    target: str,
    names: tuple[str, ...],
    of: tuple[str, ...],
    second: bool,
    is_near: bool,
) -> Compiled | None:
    """Return code whose outputs are derivatives of columns, for `kc.sensitivities`.

    `is_near` where its pivots are to be those of the position at the start: what large mechanisms
    in space need, whose code takes a C compiler minutes.
    """
    from kincompile.ir.implicit import observing_sensitivities

    q = position_of(module) if is_near else None
    if is_near and q is None:
        return None
    near = None if q is None else q.tolist()
    program = observing_sensitivities(code, names, of, second=second, near=near)
    return None if program is None else _compiled(program, "numpy" if is_near else target)


def _forces(code: InlineProgram, target: str, is_planned: bool) -> Compiled | None:
    """Return code whose outputs are forces, for `kc.forces`."""
    from kincompile.ir.forces import observing_forces

    program = observing_forces(code, is_planned=is_planned)
    return None if program is None else _compiled(program, target)


def _dynamics(code: InlineProgram, system: ConstraintSystem, target: str) -> Dynamics:
    """Return the compiled equations of motion, for `kc.simulate`."""
    from kincompile.ir.accelerations import observing_accelerations, observing_corrections
    from kincompile.runtime.engine.code import Dynamics

    left_out, redundant, free = _dependent(code, system)
    accelerations = _compiled(observing_accelerations(code, left_out), target)
    corrections = _compiled(observing_corrections(code, left_out), target)
    return Dynamics(accelerations, corrections, redundant, free)


def _slopes(
    compiled: Compiled, code: InlineProgram, target: str
) -> tuple[Compiled, Sequence[Place], Mapping[Place, float]]:
    """Return the code of the derivatives of accelerations, for implicit integrators."""
    from kincompile.ir.accelerations import observing_slopes
    from kincompile.runtime.engine.code import DYNAMICS

    redundant = compiled.request(DYNAMICS).redundant
    left_out = {compiled.equations.index(name) for name in redundant}
    program, places, numbers = observing_slopes(code, left_out)
    return _compiled(program, target), places, numbers


def _dependent(
    code: InlineProgram, system: ConstraintSystem
) -> tuple[set[int], tuple[str, ...], tuple[str, ...]]:
    """Return rows and names of equations that repeat others, and the coordinates that are free."""
    from kincompile.ir.accelerations import require_masses
    from kincompile.ir.redundancy import independence

    require_masses(code)
    redundant, free = independence(system, code.program)
    return {system.equations.index(name) for name in redundant}, redundant, free


def _compiled(program: Program, target: str) -> Compiled:
    """Return the code of a program, as its module gives it."""
    return loaded(inline(program), target)


def loaded(code: InlineProgram | GroupedProgram, target: str) -> Compiled:
    """Return the code of a module, emitted and loaded."""
    from kincompile.runtime.engine.code import code_of
    from kincompile.runtime.load import from_source

    # The NumPy module has the constants, the checks and the careful march of the compiled one.
    emitted = emit_program("numpy", code)
    module = from_source(emitted.source, code.program.name, emitted.arrays)
    if target == "c":
        from kincompile.runtime.native.module import make_native

        module = make_native(module, emit_program("c", code).files)
    return code_of(module)


def position_of(module: ModuleType) -> NDArray[np.float64] | None:
    """Return the position of a module at the start, or None."""
    from kincompile.runtime.solve import solve

    try:
        position = solve(module, 0.0).q[0]
    except KincompileError:  # no equation has a value there
        return None
    return position if np.isfinite(position).all() else None


def start_of(module: ModuleType) -> tuple[list[float], float, float] | None:
    """Return the position at the start, the size there and the sensitivity, or None."""
    from kincompile.runtime.engine.code import code_of
    from kincompile.runtime.problem import problem

    q = position_of(module)
    if q is None:
        return None
    equations = problem(code_of(module), np.array(module.DEFAULTS), q, 0.0)
    right = equations.magnitude * equations.probe
    moved = np.linalg.lstsq(module.Phi_q(q, 0.0), right, rcond=None)[0] / equations.reference
    return q.tolist(), equations.size, float(np.abs(moved).max())


def require_float32(
    q: Mapping[str, float], angular: Sequence[bool], size: float, sensitivity: float = 1.0
) -> None:
    """Refuse a position that float32 does not know to a part of the scales of its coordinates."""
    eps = float(np.finfo(np.float32).eps)
    for (name, value), is_angle in zip(q.items(), angular, strict=False):
        scale = 1.0 if is_angle else size
        if eps * abs(value) > criteria.IN_FLOAT32 * scale:
            place = "1 rad" if is_angle else f"the size of the mechanism, {size:.3g}"
            raise InputError(
                f"{name} is {value:.6g} at t = 0, which float32 knows to {eps * abs(value):.1g}; "
                f"it must know it to {criteria.IN_FLOAT32:.0e} of {place}. Let coordinates begin "
                "nearer to zero, or choose real='float64'."
            )
    if sensitivity > (most := criteria.for_float32("TOO_NEAR")):
        raise InputError(
            "the mechanism is near a singular position at t = 0: an error of its equations moves "
            f"coordinates {sensitivity:.3g} times as far, in their scales, and float32 bears "
            f"{most:.3g} times. Begin elsewhere, or choose real='float64'."
        )
