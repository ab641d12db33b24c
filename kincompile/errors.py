"""Every exception and warning that kincompile raises on purpose.

A message says what is wrong, where (names, not indices), what was given and expected, and what to
do. Problems that can be found together are collected and raised once: the classes that collect
accept one message or a sequence of them.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from kincompile.names import escaped_lines

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class KincompileError(Exception):
    """Base class of every error that kincompile raises on purpose."""


class _CollectedError(KincompileError):
    """An error that lists all the problems found in one go.

    Parameters
    ----------
    problems : str or iterable of str
        One message, or all the problems in the order in which they are to be read.

    Attributes
    ----------
    problems : tuple of str
        The messages, one per problem.
    """

    def __init__(self, problems: str | Iterable[str]) -> None:
        given = (problems,) if isinstance(problems, str) else problems
        # A message quotes what its reader may not have written: keys, names, paths.
        self.problems = tuple(map(escaped_lines, given))
        if not self.problems:
            raise InternalError(f"{type(self).__name__} was raised without a problem.")
        super().__init__(self.problems)

    def __str__(self) -> str:
        """Return the message, or a count and one line per problem when there are several."""
        if len(self.problems) == 1:
            return self.problems[0]
        lines = "\n".join(f"  - {problem}" for problem in self.problems)
        return f"{len(self.problems)} problems:\n{lines}"


class ModelError(_CollectedError, ValueError):
    """The mechanism, as written, is unusable."""


class StructuralError(_CollectedError, ValueError):
    """The equations cannot determine the unknowns: too few, too many, or dependent."""


class UnsupportedError(KincompileError, NotImplementedError):
    """A target cannot print this expression or this kind of constraint."""


@contextmanager
def package_of_extra(package: str, extra: str) -> Iterator[None]:
    """Import, inside the `with` statement, a package that is installed by an extra only.

    Raises
    ------
    UnsupportedError
        If the package is not installed; the message names the extra.
    """
    try:
        yield
    except ImportError:
        raise UnsupportedError(
            f"{package} is not installed; {install_command(extra)} brings it"
        ) from None


def install_command(extra: str) -> str:
    """Return the command that installs an extra, which leaves a checkout editable."""
    from pathlib import Path  # takes time to load, and nothing but a missing package needs it

    if (Path(__file__).parents[1] / "pyproject.toml").is_file():
        return f"pip install -e '.[{extra}]' in the checkout"
    return f"pip install 'kincompile[{extra}]'"


@contextmanager
def memory_for(what: str, remedy: str) -> Iterator[None]:
    """Say what takes too much memory, inside the `with` statement, and what to do.

    Raises
    ------
    InputError
        If there is not as much memory as is asked for.
    """
    try:
        yield
    except MemoryError:
        raise InputError(f"{what}, more than this machine has memory: {remedy}.") from None


class TemplateError(KincompileError):
    """A template and the data for it do not fit together."""


class ContractError(_CollectedError, ValueError):
    """A loaded module is not what an emitted module must be."""


class InputError(_CollectedError, ValueError):
    """A value given to a function has the wrong name, shape, type or is not finite."""


class SolveError(KincompileError, ArithmeticError):
    """The motion could not be solved at every point.

    Parameters
    ----------
    message : str
        The time, the status and the remedy, as in ``Solution.message``.
    solution : kincompile.runtime.results.solution.Solution
        What was solved before the failure, with a status per point. Typed `Any` because this file
        lies on the lowest floor and knows no other module.

    Attributes
    ----------
    solution : kincompile.runtime.results.solution.Solution
        The partial solution.
    """

    def __init__(self, message: str, solution: Any) -> None:
        super().__init__(message, solution)
        self.solution = solution

    def __str__(self) -> str:
        """Return the message alone; the partial solution is in `solution`."""
        return str(self.args[0])


class SweepError(KincompileError, RuntimeError):
    """A sweep was stopped by its executor: a worker died, or could not do its work.

    Parameters
    ----------
    message : str
        What the executor says, what is kept, and what to do.
    sweep : kincompile.sweeps.result.Sweep
        What was solved before.

    Attributes
    ----------
    sweep : kincompile.sweeps.result.Sweep
        What was solved before; the status of the rest is -1.
    """

    def __init__(self, message: str, sweep: Any) -> None:
        super().__init__(escaped_lines(message), sweep)
        self.sweep = sweep

    def __str__(self) -> str:
        """Return the message alone; what was solved is in `sweep`."""
        return str(self.args[0])


class InternalError(KincompileError):
    """A bug of kincompile, not of the caller.

    Parameters
    ----------
    message : str
        The contradiction.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)

    def __str__(self) -> str:
        """Return the message, with the remark that the fault is not the caller's."""
        return f"{self.args[0]} This is a bug in kincompile: please report it with the model."


class KincompileWarning(UserWarning):
    """Base class of every warning that kincompile gives."""


class SingularConfigurationWarning(KincompileWarning):
    """A motion that converged has points very near to a configuration where Phi_q is singular."""


class AssemblyWarning(KincompileWarning):
    """A mechanism can be assembled in several ways, and no guess chooses one."""


class BranchSwitchWarning(KincompileWarning):
    """The solution may have changed from one assembly branch to another."""


class DamagedStoreWarning(KincompileWarning):
    """Files of a sweep's folder are damaged or missing, and are written again."""


class CornerWarning(KincompileWarning):
    """A driver has a corner at a time that was solved: there is no acceleration."""


class RedundantConstraintWarning(KincompileWarning):
    """A constraint repeats what the others already demand."""
