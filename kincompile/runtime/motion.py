"""A motion while it is being found: what the paths through a time grid fill in."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.criteria import TOO_NEAR
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.status import Status
from kincompile.runtime.verdict import unassembled

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.singular.events import Event

    Vector: TypeAlias = NDArray[np.float64]
    Progress: TypeAlias = Callable[[int, int], object]


@dataclass(slots=True, eq=False)
class Motion:
    """The arrays of a solution while they are being filled, N points and n coordinates.

    Attributes
    ----------
    q, q_dot, q_ddot : ndarray, shape (N, n)
        The motion; NaN where nothing was found.
    status, residual, iterations : ndarray, shape (N,)
        What became of each point.
    statistics : dict
        How many points were found in which way.
    events, passed : list of Event
        What happened on the way, and those of it that the motion went through.
    near : list of int
        Points so near to a singular configuration that their rates are uncertain.
    note : str
        A remark for the message of the solution.
    is_folded : bool
        Whether the guess shows no branch: a determinant is zero there.
    """

    q: Vector
    q_dot: Vector
    q_ddot: Vector
    status: NDArray[np.int64]
    residual: Vector
    iterations: NDArray[np.int64]
    statistics: dict[str, int]
    events: list[Event] = field(default_factory=list)
    passed: list[Event] = field(default_factory=list)
    near: list[int] = field(default_factory=list)
    note: str = ""
    is_folded: bool = False

    @classmethod
    def over(cls, inputs: Inputs) -> Motion:
        """Make the arrays for a time grid, with nothing reached."""
        points = inputs.t.size
        if code_of(inputs.module).stages:
            q, q_dot, q_ddot = np.full((3, points, inputs.guess.size), np.nan)
        else:  # each coordinate contiguous in memory, as the code of a grid wants it
            q, q_dot, q_ddot = np.full((3, inputs.guess.size, points), np.nan).transpose(0, 2, 1)
        return cls(
            q,
            q_dot,
            q_ddot,
            np.full(points, int(Status.NOT_REACHED)),
            np.full(points, np.nan),
            np.zeros(points, dtype=np.int64),
            {"coarse": 0, "marched": 0},
        )

    def forget(self, index: int) -> None:
        """Clear the results of a grid after the last point reached."""
        for values in (self.q, self.q_dot, self.q_ddot, self.residual):
            values[index:] = np.nan
        self.iterations[index:] = 0

    def put(self, index: int, outcome: Outcome) -> None:
        """Write down what became of a point."""
        self.status[index] = outcome.status
        self.iterations[index] = outcome.iterations
        self.q[index] = self.q_dot[index] = self.q_ddot[index] = np.nan
        self.residual[index] = np.nan
        if outcome.position is not None:
            self.q[index] = outcome.position.q
            self.residual[index] = np.max(np.abs(outcome.position.Phi))
        elif (point := unassembled(outcome)) is not None:
            self.residual[index] = np.max(np.abs(point.Phi))
        if outcome.status is Status.CONVERGED and outcome.state is not None:
            self.q_dot[index] = outcome.state.q_dot
            self.q_ddot[index] = outcome.state.q_ddot
            if outcome.state.sensitivity > TOO_NEAR:
                self.near.append(index)
