"""The command line: `kincompile COMMAND MODEL`; each command is a file of this folder.

stdout is data, stderr messages. Exit codes: 0 done; 2 wrong usage or model, or a file that cannot
be read or written; 3 the motion did not converge; 130 interrupted; 1 is kept for an entry that is
different: in `compare`, and in `inspect --verify`.
No traceback reaches a user, unless the environment variable KINCOMPILE_TRACEBACK asks for one.

A command is loaded when it is called, and loads what it uses: `--help` does not wait for SymPy.
"""

from __future__ import annotations

import os
import signal
import traceback
import warnings
from importlib import import_module
from typing import Any, NoReturn

import click

import kincompile as kc
from kincompile.cli.shared import INTERRUPTED, USAGE_OR_MODEL, on_screen, shown_angles
from kincompile.errors import InternalError, KincompileError
from kincompile.names import escaped_lines

COMMANDS = (
    "assemblies", "compare", "compile", "convert", "derive", "draw", "editor", "equilibrium",
    "exercise", "fit", "inspect", "mark", "run", "schema", "simulate", "sweep", "tolerance",
    "transmission", "view",
)  # fmt: skip
"""The commands: each is the `command` of the file of its name."""

TRACEBACK = "KINCOMPILE_TRACEBACK"
"""The environment variable that shows where an error comes from."""


class _Shell(click.Group):
    """A group of commands that turns every exception into a message and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, whose file is loaded now."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"{__name__}.{cmd_name}").command
        return command

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
            where = f"{error.filename}: {error.strerror}" if error.filename else error
            _end(f"Error: {where}; check the path", USAGE_OR_MODEL)
        except Exception as error:
            bug = InternalError(f"{type(error).__name__}: {error}.")
            _end(f"Error: {bug} {TRACEBACK}=1 shows where it happened.", USAGE_OR_MODEL)


def _end(message: str, code: int) -> NoReturn:
    """Write a message to stderr, after the traceback if one is wanted, and end."""
    if os.environ.get(TRACEBACK, "0") not in ("", "0"):
        traceback.print_exc()
    click.echo(escaped_lines(message), err=True)
    raise click.exceptions.Exit(code)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Write a warning to stderr as a message, without the line of code that gave it."""
    context, said = click.get_current_context(silent=True), f"Warning: {message}"
    if context and context.params.get("angle_unit", "rad") != "rad":
        said = shown_angles(said, context.params["angle_unit"])
    click.echo(on_screen(escaped_lines(said)), err=True)


@click.group(
    cls=_Shell,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog=f"Set {TRACEBACK}=1 to see where an error comes from.",
)
@click.version_option(kc.__version__, message="%(prog)s %(version)s")
def cli() -> None:
    """Compile mechanisms, in the plane and in space, to numerical code, and run it.

    MODEL is a data file (.toml, .json, a robot as .urdf or MJCF, or .adm of simEngine2D), or a
    Python file with one Mechanism or ConstraintSystem at module level; of several, the one called
    mechanism, system or m. A data file never runs code. A Python file is run: use only what you
    trust.
    """


def main() -> None:
    """Run the command line as a process."""
    if hasattr(signal, "SIGPIPE"):
        # A reader that has seen enough (`| head`) ends this process as it ends any other filter.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    cli(prog_name="kincompile")
