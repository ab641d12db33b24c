"""What can happen to a point in time, as sentences with the remedy."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome at one point in time; an integer, so that arrays of it are plain integers.

    Attributes
    ----------
    sentence : str
        What the status means and what to do about it.
    """

    sentence: str

    def __new__(cls, value: int, sentence: str) -> Status:
        """Make a member that is the integer `value` and carries its sentence."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.sentence = sentence
        return member

    CONVERGED = 0, "Position, velocity and acceleration were found, and the equations hold."
    NOT_CONVERGED = (
        1,
        "No position was found, or none that continues the motion: the mechanism cannot be "
        "assembled there (lock-up: shorten the range of the drivers or change lengths), or it "
        "would have to jump (make the drivers continuous), or the guess is too far away (give one "
        "nearer to the assembled mechanism).",
    )
    SINGULAR = (
        2,
        "Phi_q is singular here, so that velocity and acceleration are not determined: a lock-up, "
        "a bifurcation, or dependent constraints. Drive another coordinate near this time, change "
        "the lengths, or remove the constraint that repeats another.",
    )
    NOT_FINITE = (
        3,
        "An equation or a derivative is not a finite number here. Look for a division by zero, a "
        "square root or logarithm of a negative number, or a driver that is not defined at this "
        "time.",
    )
    CORNER = (
        5,
        "A driver has a corner here: position and velocity were found, the velocity after the "
        "corner; there is no acceleration. Take a smooth motion law, or round the corner off, "
        "where one is needed.",
    )
    NOT_REACHED = 4, "Not tried, because an earlier point failed. Remove the cause of that failure."
