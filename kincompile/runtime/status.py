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
        "No position was found that continues the motion, though no lock-up ends it: the mechanism "
        "would have to jump (make the drivers continuous), the guess is too far away (give one "
        "nearer to the assembled mechanism), or the times are too far apart (ask for more). At the "
        "first time of one of several parameter sets: no position was found on the branch of the "
        "first set (solve that set alone, with a guess of its own).",
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
    NOT_ASSEMBLED = (
        6,
        "At the first time no position was found: the mechanism cannot be assembled there (change "
        "lengths, or what the drivers demand), or the guess is too far away (give one nearer to "
        "the assembled mechanism).",
    )
    LOCK_UP = (
        7,
        "The motion ends before this time, at a lock-up: the drivers demand what the joints cannot "
        "give. Shorten the range of the drivers, or change lengths.",
    )
