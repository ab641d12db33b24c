"""The command line: `kincompile compile | run | inspect | derive | view | compare MODEL`.

stdout is data, stderr messages. Exit codes: 0 done; 2 wrong usage or model, or a file that cannot
be read or written; 3 the motion did not converge; 130 interrupted; 1 is kept for an entry that is
different: in `compare`, and in `inspect --verify`.
No traceback reaches a user, unless the environment variable KINCOMPILE_TRACEBACK asks for one.

SymPy is loaded by the names of `kc` that need it, so that `--help` does not wait for it.
"""

from __future__ import annotations

import json
import math
import operator
import os
import signal
import sys
import time
import traceback
import warnings
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
import numpy as np

import kincompile as kc
from kincompile.errors import InputError, InternalError, KincompileError
from kincompile.names import listed
from kincompile.runtime.results.summary import summary
from kincompile.runtime.results.write import require_known_suffix
from kincompile.targets.registry import TARGETS
from kincompile.writing import require_writable, write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.targets.target import Emitted

DIFFERENT, USAGE_OR_MODEL, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes."""

DERIVATIONS = (".html", ".tex", ".md", ".ipynb")
"""Endings of the files that `derive` writes."""

TRACEBACK = "KINCOMPILE_TRACEBACK"
"""The environment variable that shows where an error comes from."""

ENDINGS = {ending: name for name, item in TARGETS.items() for ending in item.endings}
"""The target whose files have an ending."""

PATIENCE = 0.5
"""Seconds after which a progress bar appears."""


class _Shell(click.Group):
    """A group of commands that turns every exception into a message and an exit code."""

    def invoke(self, context: click.Context) -> Any:
        """Run a command."""
        try:
            with warnings.catch_warnings():
                warnings.showwarning = _show_warning
                return super().invoke(context)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            _end("Interrupted.", INTERRUPTED)
        except MemoryError:
            _end("Error: there is not enough memory; ask for fewer points", USAGE_OR_MODEL)
        except KincompileError as error:
            _end(f"Error: {error}", USAGE_OR_MODEL)
        except OSError as error:
            _end(f"Error: the system says: {error}; check the paths", USAGE_OR_MODEL)
        except Exception as error:
            bug = InternalError(f"{type(error).__name__}: {error}.")
            _end(f"Error: {bug} {TRACEBACK}=1 shows where it happened.", USAGE_OR_MODEL)


def _end(message: str, code: int) -> NoReturn:
    """Write a message to stderr, after the traceback if one is wanted, and end."""
    if os.environ.get(TRACEBACK, "0") not in ("", "0"):
        traceback.print_exc()
    click.echo(message, err=True)
    raise click.exceptions.Exit(code)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Write a warning to stderr as a message, without the line of code that gave it."""
    click.echo(f"Warning: {message}", err=True)


@click.group(
    cls=_Shell,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog=f"Set {TRACEBACK}=1 to see where an error comes from.",
)
@click.version_option(kc.__version__, message="%(prog)s %(version)s")
def cli() -> None:
    """Compile planar mechanisms to numerical code, and run it.

    MODEL is a data file (.toml, .json, or .adm of simEngine2D), or a Python file with one Mechanism
    or ConstraintSystem at module level; of several, the one called mechanism, system or m. A data
    file never runs code. A Python file is run: use only what you trust.
    """


@cli.command("compile")
@click.argument("model")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    help="File to write, or a folder, or - for stdout.",
)
@click.option(
    "--target",
    default="numpy",
    metavar="NAME",
    help=f"What to emit: {listed(TARGETS)}.",
)
def compile_command(model: str, output: str, target: str) -> None:
    """Write Phi, Phi_q, nu and gamma of MODEL as a module.

    The module imports NumPy and nothing else: it runs where kincompile is not installed. Where a
    target has several files, the others are written beside the one named.
    """
    emitted = kc.emit(_read(model), target)
    if output == "-":
        _print("\n".join(emitted.files.values()))
        return
    folder, main = _destination(output, emitted, target)
    for path in (folder / name for name in (main, *emitted.companions)):
        if path.parent.exists():
            _require_output(path, model, "the model itself")
    for path in emitted.write(folder, main):
        click.echo(f"Wrote {path}", err=True)


def _require_output(path: str | Path, read: str, what: str) -> None:
    """Refuse an output that cannot be written, or that is a file which is read."""
    require_writable(path)
    if Path(path).exists() and Path(read).exists() and Path(path).samefile(read):
        raise InputError(f"{path} is {what}; give another name to write to")


def _destination(output: str, emitted: Emitted, target: str) -> tuple[Path, str]:
    """Return the folder to write to, and the name there of the main file."""
    path = Path(output)
    usual = next(iter(emitted.files))
    if path.is_dir() or (emitted.companions and not path.suffix):
        return path, usual
    other = ENDINGS.get(path.suffix, target)
    if other != target:
        raise InputError(
            f"{path} is the name of a file for {other}, and the target is {target}; "
            f"give --target {other}, or end the name as {usual}"
        )
    if path.name in emitted.companions:
        raise InputError(f"{path} is the name of another file that is written; end it as {usual}")
    require_writable(path)
    return path.parent, path.name


def _motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a motion: its times, and the values of parameters."""
    options = (
        click.option("--end", type=float, help="Last time.  [default: the model's own]"),
        click.option(
            "--points",
            type=click.IntRange(min=1),
            help="Number of equally spaced times from 0 to the end.  [default: the model's own]",
        ),
        click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="NAME=VALUE",
            help="Value of a parameter; may be given several times.",
        ),
        click.option(
            "--through",
            type=click.Choice(["smooth"]),
            help="Go on past a bifurcation, along the smooth branch.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@cli.command()
@click.argument("model")
@_motion_options
@click.option("--analysis", metavar="FILE", help="Take end and points from an .acf file.")
@click.option("-o", "--output", metavar="FILE", help="Write the motion: .csv, .npz or .json.")
@click.pass_context
def run(
    context: click.Context,
    model: str,
    end: float | None,
    points: int | None,
    assignments: tuple[str, ...],
    through: str | None,
    analysis: str | None,
    output: str | None,
) -> None:
    """Solve the motion of MODEL over time and summarise it.

    Position, velocity and acceleration are solved at equally spaced times, from 0 to the end. The
    summary goes to stdout, or to stderr where a file is written. Where the motion does not
    converge, what was found is written nevertheless, and the exit code is 3.
    """
    if output is not None:
        require_known_suffix(output)
        _require_output(output, model, "the model itself")
    values = _values(assignments)
    mechanism = _read(model)
    if analysis is not None:
        settings = kc.read_analysis(analysis)
        end = settings.end if end is None else end
        points = settings.points if points is None else points
    times = _times(mechanism, end, points)
    module = kc.compile(mechanism)
    with progress_bar() as progress:
        solution = kc.solve(module, times, values, through=through, progress=progress)
    if output is None:
        _print(summary(solution) + "\n")
    else:
        kc.write(solution, output)
        click.echo(f"{summary(solution)}\nWrote {output}", err=True)
    if not solution.success:
        click.echo(f"Error: {solution.message}", err=True)
        context.exit(NOT_CONVERGED)


@cli.command()
def schema() -> None:
    """Show the JSON Schema of a model in TOML or JSON, for editors that check while one writes."""
    _print(json.dumps(kc.model_schema(), indent=2) + "\n")


@cli.command()
@click.argument("model")
@click.option("--verify", is_flag=True, help="Check Phi_q, nu and gamma against Phi alone.")
@click.pass_context
def inspect(context: click.Context, model: str, verify: bool) -> None:
    """Show what MODEL is made of, and whether it can be compiled.

    Bodies, parameters, constraints, rows and columns of Phi_q, mobility, rank, the order of
    solution and the pattern of Phi_q; and what to do about missing drivers, about redundant and
    conflicting equations, and where it cannot be assembled. Rows and columns count from 0. With
    --verify, Phi_q, nu and gamma of the emitted module are compared with complex steps of its Phi
    and the second derivative of Phi along a line, at seeded states; the exit code is 1 where one
    differs.
    """
    read = _read(model)
    _print(f"{kc.inspect(read)}\n")
    if verify:
        found = kc.verify(read)
        _print(f"\n{found}\n")
        if not found.passed:
            context.exit(DIFFERENT)


@cli.command()
@click.argument("model")
@click.argument("hand")
@click.option("--constraint", metavar="NAME", help="Check this constraint alone.")
@click.option("--reveal", is_flag=True, help="Show the right formulas.")
@click.option("-o", "--output", metavar="FILE", help="Write the report: .html, .json or .txt.")
@click.option("--gradescope", metavar="FILE", help="Write a results.json for Gradescope.")
@click.pass_context
def compare(
    context: click.Context,
    model: str,
    hand: str,
    constraint: str | None,
    reveal: bool,
    output: str | None,
    gradescope: str | None,
) -> None:
    """Compare the formulas in HAND with those derived from MODEL.

    HAND is a TOML or JSON file, or lines such as "Phi_q = [[1, 0, cos(phi)], ...]", with any of
    Phi, Phi_q, nu and gamma. Its formulas are parsed, never run. The exit code is 0 where all
    entries are equal, up to a convention that is named or on the constraint manifold; 1 where one
    is different.
    """
    writers = {".html": "to_html", ".json": "to_json", ".txt": "to_text"}
    if output is not None and Path(output).suffix not in writers:
        raise InputError(f"{output}: a report is written as .html, .json or .txt")
    for path in filter(None, (output, gradescope)):
        _require_output(path, model, "the model itself")
        _require_output(path, hand, "the file to compare")
    report = kc.compare_file(_read(model), hand, constraint=constraint)
    if output is not None:
        write_atomically(output, getattr(report, writers[Path(output).suffix])(reveal))
    if gradescope is not None:
        write_atomically(gradescope, report.to_gradescope(reveal))
    if output is None and sys.stdout.isatty():
        _print_coloured(report.to_rich(reveal))
    elif output is None:
        _print(report.to_text(reveal))
    else:
        click.echo(f"{report.summary}\nWrote {output}", err=True)
    if not report.equal:
        context.exit(DIFFERENT)


@cli.command()
@click.argument("model")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    help="File to write: .html, .tex, .md or .ipynb.",
)
@click.option("--time", "at", type=float, default=0.0, metavar="T", help="Time of the numbers.")
@click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME=VALUE",
    help="Value of a parameter, coordinate or rate; may be given several times.",
)
def derive(model: str, output: str, at: float, assignments: tuple[str, ...]) -> None:
    """Show how Phi_q, nu and gamma of MODEL follow from Phi, step by step.

    A page for each constraint in nine steps (in vectors, in sines and cosines, in numbers) and for
    the assembled system. The numbers are taken where the mechanism is assembled at the time, or at
    the coordinates that are set.
    """
    if Path(output).suffix not in DERIVATIONS:
        raise InputError(f"{output}: a derivation is written as {', '.join(DERIVATIONS)}")
    require_writable(output)
    state = {"t": at, **_values(assignments)}
    kc.derivation(_read(model), state).write(output)
    click.echo(f"Wrote {output}", err=True)


@cli.command()
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    help="Page to write, .html; a folder gets a page of each model, and index.html.",
)
@_motion_options
@click.pass_context
def view(
    context: click.Context,
    models: tuple[str, ...],
    output: str,
    end: float | None,
    points: int | None,
    assignments: tuple[str, ...],
    through: str | None,
) -> None:
    """Write a page that shows MODEL in motion, with plots and numbers.

    The page is one file that needs no network: open it in a browser. Of several models, each gets
    a page in a folder, whose index.html links them. Where the motion does not converge, the page
    shows what was found, or the start guess, and the exit code is 3.
    """
    is_page = Path(output).suffix in (".html", ".htm")
    if is_page:
        require_writable(output)
    if is_page and len(models) > 1:
        raise InputError(f"{output}: {len(models)} pages do not go into one file; name a folder")
    read = [_read(model) for model in models]
    options: dict[str, Any] = {"p": _values(assignments), "through": through}
    pages = [kc.page(model, t=_times(model, end, points), **options) for model in read]
    written = [pages[0].write(output)] if is_page else kc.gallery(pages).write(output)
    for path in written:
        click.echo(f"Wrote {path}", err=True)
    failed = [item for item in pages if not item.success]
    for item in failed:
        click.echo(f"Error: {item.message}", err=True)
    if failed:
        context.exit(NOT_CONVERGED)


def _print_coloured(table: Any) -> None:
    """Print a table to the terminal."""
    from rich.console import Console

    Console().print(table)


def _read(model: str) -> Mechanism | ConstraintSystem:
    """Read a model; what its file prints is a message, not data."""
    with redirect_stdout(sys.stderr):
        read: Mechanism | ConstraintSystem = kc.read_model(model)
    return read


def _values(assignments: tuple[str, ...]) -> dict[str, float]:
    """Return the parameters that are set; the last one counts where one is set twice."""
    values, problems = {}, []
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        try:
            values[name.strip()] = float(text)
        except ValueError:
            problems.append(f"--set {assignment}: give NAME=VALUE with a number, such as a=0.25")
    if problems:
        raise InputError(problems)
    return values


def _times(
    model: Mechanism | ConstraintSystem, end: float | None, points: int | None
) -> NDArray[np.float64]:
    """Return the time grid: the options before the model's own."""
    try:
        last = float(model.end if end is None else end)
        count = operator.index(model.points if points is None else points)
    except (TypeError, ValueError):
        last, count = math.nan, 0
    if not math.isfinite(last) or count < 1:
        given = f"end = {model.end!r}, points = {model.points!r}" if end is None else f"--end {end}"
        raise InputError(f"{given}: give a finite time, and at least one point")
    if count == 1 and end:
        raise InputError("one point is the time 0 alone: give --points 2 or more to reach the end")
    return np.linspace(0.0, last, count)


def _print(text: str) -> None:
    """Write data to stdout, or say why that is impossible."""
    try:
        click.echo(text, nl=False)
    except OSError as error:
        raise InputError(f"cannot write to stdout: {error.strerror}") from error


@contextmanager
def progress_bar() -> Iterator[Callable[[int, int], None] | None]:
    """Give a progress bar on stderr for work that takes long, and nothing where nobody looks."""
    if not sys.stderr.isatty():
        yield None
        return
    bar = _Bar()
    try:
        yield bar
    finally:
        bar.close()


class _Bar:
    """A progress bar that appears when work has lasted longer than `PATIENCE`, and then goes."""

    def __init__(self) -> None:
        self._appears = time.monotonic() + PATIENCE
        self._shown: Any = None

    def __call__(self, done: int, total: int) -> None:
        """Show how many points are done."""
        if self._shown is None:
            if time.monotonic() < self._appears:
                return
            self._shown = _shown_bar(total)
        self._shown.update(self._shown.task_ids[0], completed=done)

    def close(self) -> None:
        """Take the bar away."""
        if self._shown is not None:
            self._shown.stop()


def _shown_bar(total: int) -> Any:
    """Show a bar; rich is loaded here, because few runs last long enough to need it."""
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    bar.add_task("solving", total=total)
    bar.start()
    return bar


def main() -> None:
    """Run the command line as a process."""
    if hasattr(signal, "SIGPIPE"):
        # A reader that has seen enough (`| head`) ends this process as it ends any other filter.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    cli(prog_name="kincompile")
