"""A unit for co-simulation, FMI 3.0: an archive of emitted C, with the functions of FMI round it.

The code of the mechanism is the C target's as it is. `templates/fmi/unit.c.jinja` has the functions
of the standard; `motion.c.jinja` and `transmission.c.jinja` call the march and the transmission.
"""

from __future__ import annotations

import hashlib
import io
import math
import platform
import zipfile
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile import criteria
from kincompile.emitters.lines import indented, quoted, wrapped
from kincompile.emitters.target import Emitted
from kincompile.errors import InputError, StructuralError
from kincompile.ir.elimination import sizes_of
from kincompile.model.dimensions import base_unit
from kincompile.model.points import PlacedPoint
from kincompile.names import listed, rate_unit
from kincompile.report.templates import fill
from kincompile.writing import require_writable, write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.transmission import TransmissionCode
    from kincompile.model.bodies import Coordinate
    from kincompile.model.points import OutputColumn
    from kincompile.model.system import ConstraintSystem

    Build = Callable[[Mapping[str, str]], bytes | None]

ENDING, SOURCES = ".fmu", "sources/"
OLDEST = (1980, 1, 1, 0, 0, 0)
"""Date of the files in an archive: the same model gives the same bytes."""

MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
LIBRARIES = {"darwin": ".dylib", "windows": ".dll"}
"""What FMI calls processors, and how systems end the names of libraries, where others do not."""

RATES = ("{}", "der({})", "der({},2)")
SHOWN = {rate_unit("rad", order): rate_unit("deg", order) for order in range(3)}
"""Units in which tools may show numbers of others."""

PARAMETER, INPUT, OUTPUT = "parameter", "input", "output"


@dataclass(frozen=True, slots=True, repr=False)
class Unit(Emitted):
    """The files of a unit for co-simulation, and what makes a library of its sources.

    Attributes
    ----------
    build
        Returns the library of sources, text by name; None where there is no compiler.
    """

    build: Build = field(kw_only=True)

    def headline(self) -> str:
        """Return the name of the archive, and what is in it."""
        return f"{self.main}: {listed(self.files)}, and a library of the sources"

    @property
    def main(self) -> str:
        """Name of the archive."""
        return f"{self.name}{ENDING}"

    @property
    def companions(self) -> tuple[str, ...]:
        """Names of the files beside the archive: none."""
        return ()

    def write(self, folder: str | Path, main: str | None = None) -> tuple[Path, ...]:
        """Write the archive, with a library of the sources for this machine, and return its path.

        Parameters
        ----------
        folder
            Where to write: a file, ``"x.fmu"``, or a folder.
        main
            Name of the archive in the folder.

        Raises
        ------
        InputError
            If it cannot be written.
        UnsupportedError
            If the C compiler fails. Where there is none, a warning says that the archive has its
            sources alone.
        """
        place = Path(folder)
        if main is None and place.suffix == ENDING and not place.is_dir():
            place, main = place.parent, place.name
        path = place / (main or self.main)
        if place.exists():
            require_writable(path)
        library = self.build(
            {x.removeprefix(SOURCES): self.files[x] for x in self.files if x.endswith((".c", ".h"))}
        )
        files: dict[str, str | bytes] = dict(self.files)
        if library is not None:
            system, machine = platform.system().lower(), platform.machine().lower()
            folder_of_library = f"binaries/{MACHINES.get(machine, machine)}-{system}"
            files[f"{folder_of_library}/{self.name}{LIBRARIES.get(system, '.so')}"] = library
        # Where the folder cannot be made, writing says why.
        with suppress(OSError):
            place.mkdir(parents=True, exist_ok=True)
        return (write_atomically(path, _archive(files)),)


def _archive(files: Mapping[str, str | bytes]) -> bytes:
    """Return files by name as the bytes of an archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, OLDEST), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


@dataclass(frozen=True, slots=True)
class _Variable:
    """A variable: `reference` is its number, `derivative` that of the one whose rate it is."""

    name: str
    reference: int
    causality: str
    unit: str
    start: float | None = None
    derivative: int | None = None

    @property
    def variability(self) -> str:
        """Whether it may change in a simulation."""
        return "fixed" if self.causality == PARAMETER else "continuous"


def motion_unit(
    emitted: Emitted, code: InlineProgram, system: ConstraintSystem, build: Build
) -> Unit:
    """Return the unit of a motion: parameters, coordinates and outputs with their rates.

    Raises
    ------
    StructuralError
        If the equations cannot determine the coordinates.
    """
    program, names = code.program, _titles(system)
    if emitted.unsolvable:
        raise StructuralError(f"a unit of FMI has a motion: {emitted.unsolvable}")
    given = _numbered(PARAMETER, 1, ((x.name, x.unit, x.default) for x in program.parameters))
    n, first = len(program.coordinates), 1 + len(given)
    second = code.entries("outputs_ddot") if program.observers else []
    unknown = {x.row for x in second if _is_unknown(code, x.node)}
    found = [
        *_with_rates(program.coordinates, names, first),
        *_with_rates(program.outputs, names, first + 3 * n, unknown),
    ]
    data = {
        "n": n,
        "n_y": len(program.outputs),
        "size": repr(sizes_of(code).length),
        "tolerance": repr(criteria.TOLERANCE),
        "iterations": criteria.MAX_ITERATIONS,
        "halvings": criteria.ROOT_STEPS,
    }
    about = f"The motion of the mechanism {program.name}"
    outputs = 3 * (n + len(program.outputs))
    experiment = {"end": program.end, "step": program.end / max(program.points - 1, 1)}
    return _unit(emitted, build, about, [*given, *found], outputs, data, experiment)


def transmission_unit(
    emitted: Emitted, of: TransmissionCode, system: ConstraintSystem, build: Build
) -> Unit:
    """Return the unit of a transmission: parameters, inputs and outputs.

    Raises
    ------
    InputError
        If an output is a velocity, which has no value.
    """
    program, names = of.code.program, _titles(system)
    rows = {x.row: x.node for x in of.code.entries("outputs")}
    places = [x for x, (vector, _) in enumerate(of.places) if vector == "x"]
    twists = [
        x for x, row in zip(of.outputs, places, strict=True) if _is_unknown(of.code, rows[row])
    ]
    if twists:
        raise InputError(
            f"a unit of {program.name} has no value of {listed(twists)}: a function of positions "
            "gives velocities a Jacobian alone. Leave it out of the outputs."
        )
    defaults = {x.name: x.default for x in program.parameters}
    given = _numbered(PARAMETER, 1, ((x.name, x.unit, x.default) for x in of.parameters))
    inputs = zip(of.titles, of.inputs, strict=True)
    own = ((names.get(x, x), of.units[x], defaults[name]) for x, name in inputs)
    given += _numbered(INPUT, 1 + len(given), own)
    outputs = ((names.get(x, x), of.units[x], None) for x in of.outputs)
    given += _numbered(OUTPUT, 1 + len(given), outputs)
    about = f"The mechanism {program.name} as a function of its inputs"
    data = {
        "near": repr(criteria.SMALL_ERROR),
        "smallest": repr(criteria.SMALLEST_PART),
    }
    return _unit(emitted, build, about, given, len(of.outputs), data, {"end": 0.0, "step": 0.0})


def _titles(system: ConstraintSystem) -> dict[str, str]:
    """Return what a unit calls columns: ``crank.phi`` the coordinate ``phi_crank`` of a body."""
    found = {}
    for body, columns in zip(system.bodies, system.body_columns, strict=True):
        for name in (system.coordinates[k].name for k in columns):
            found[name] = f"{body.name}.{name.removesuffix(f'_{body.name}')}"
    for point in system.observers:
        for row in point.rows if isinstance(point, PlacedPoint) else ():
            found[row.name] = f"{point.name}.{row.name.removesuffix(f'_{point.name}')}"
    return found


def _is_unknown(code: InlineProgram, node: int) -> bool:
    return bool(code.nodes[node][0] == "nan")


def _numbered(
    causality: str, first: int, given: Iterable[tuple[str, str, float | None]]
) -> list[_Variable]:
    """Return variables of names, units and defaults, in order."""
    return [
        _Variable(name, k, causality, unit, None if causality == OUTPUT else float(start or 0.0))
        for k, (name, unit, start) in enumerate(given, first)
    ]


def _with_rates(
    columns: Sequence[Coordinate | OutputColumn],
    names: Mapping[str, str],
    first: int,
    unknown: Collection[int] = (),
) -> Iterator[_Variable]:
    """Yield columns, their rates and second rates, but for those second ones that are unknown."""
    for order, form in enumerate(RATES):
        for k, item in enumerate(columns):
            if order < 2 or k not in unknown:
                place = first + order * len(columns) + k
                of = place - len(columns) if order else None
                title, unit = names.get(item.name, item.name), rate_unit(item.unit, order)
                yield _Variable(form.format(title), place, OUTPUT, unit, derivative=of)


def _unit(
    emitted: Emitted,
    build: Build,
    about: str,
    variables: Sequence[_Variable],
    outputs: int,
    own: Mapping[str, object],
    experiment: Mapping[str, float],
) -> Unit:
    """Return the unit of emitted C code, which has a number of outputs, not all of them variables.

    `own` is data of the template that calls the code: of a transmission where there are inputs.
    """
    counts = Counter(x.name for x in variables)
    if twice := [name for name, count in counts.items() if count > 1]:
        raise InputError(
            f"in a unit of {emitted.name} two variables would be called {listed(twice)}: "
            "parameters, inputs and outputs need names of their own. Leave one out, or rename it."
        )
    main = next(iter(emitted.files))
    identifier, inputs = main.removesuffix(".c"), sum(x.causality == INPUT for x in variables)
    given = [x for x in variables if x.causality != OUTPUT]
    text = repr((*emitted.files.items(), *variables))
    shared = {"about": about, "token": hashlib.sha256(text.encode()).hexdigest()[:32]}
    names = {"name": emitted.name, "NAME": emitted.name.upper()}
    core = fill(f"fmi/{'transmission' if inputs else 'motion'}.c.jinja", {**names, **own})
    units = dict.fromkeys(["s", *(x.unit for x in variables if x.unit)])
    files = {
        "modelDescription.xml": fill(
            "fmi/modelDescription.xml.jinja",
            {
                **shared,
                **experiment,
                "name": emitted.name,
                "identifier": identifier,
                "has_derivatives": inputs > 0,
                "units": [_definition(unit) for unit in units],
                "degrees": repr(180 / math.pi),
                "variables": variables,
            },
        ),
        f"{SOURCES}buildDescription.xml": fill(
            "fmi/buildDescription.xml.jinja", {"identifier": identifier, "main": main}
        ),
        f"{SOURCES}{identifier}_fmi.c": fill(
            "fmi/unit.c.jinja",
            {
                **shared,
                **names,
                "identifier": identifier,
                "parameters": len(given) - inputs,
                "inputs": inputs,
                "outputs": outputs,
                "names": indented(quoted(x.name for x in given)),
                "defaults": indented(wrapped([repr(x.start) for x in given])),
                "core": core,
                "others": fill("fmi/others.c.jinja", {"name": emitted.name, "inputs": inputs}),
            },
        ),
        **{f"{SOURCES}{name}": text for name, text in emitted.files.items()},
    }
    return Unit(identifier, files, build=build)


def _definition(unit: str) -> dict[str, Any]:
    """Return a unit as powers of those of the SI, as far as they are known."""
    known = base_unit(unit)
    factor, powers = known or (1.0, {})
    base = [f'{name}="{power}"' for name, power in powers.items() if power]
    base += [f'factor="{factor!r}"'] if factor != 1 else []
    return {"name": unit, "base": base, "shown": SHOWN.get(unit)}
