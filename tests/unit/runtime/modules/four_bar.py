"""Four-bar (case R11) by hand, as an emitted module: full coordinates, lengths as parameters."""

import math

import numpy as np

NAME = "four_bar"
FORMAT = 1
FINGERPRINT = "411"
N_COORDINATES = 9
N_EQUATIONS = 9
COORDINATES = tuple(
    f"{axis}_{body}" for body in ("crank", "coupler", "rocker") for axis in ("x", "y", "phi")
)
EQUATIONS = (*(f"{joint}.{axis}" for joint in "ABCD" for axis in "xy"), "motor")
PARAMETERS = ("a", "b", "c", "d", "omega")
UNITS = {name: "rad" if name.startswith("phi") else "m" for name in COORDINATES}
UNITS |= {"a": "m", "b": "m", "c": "m", "d": "m", "omega": "rad/s"}
DEFAULTS = np.array([10.0, 26.0, 18.0, 20.0, 1.5])
GUESS = np.array([5, 0, 0, 20, 10, math.pi / 4, 20, 9, 1.5 * math.pi])
PATTERN = np.array(
    [
        *((0, 0), (0, 2), (1, 1), (1, 2)),
        *((2, 0), (2, 2), (2, 3), (2, 5), (3, 1), (3, 2), (3, 4), (3, 5)),
        *((4, 3), (4, 5), (4, 6), (4, 8), (5, 4), (5, 5), (5, 7), (5, 8)),
        *((6, 6), (6, 8), (7, 7), (7, 8), (8, 2)),
    ]
)


class InputError(ValueError):
    pass


def joints(p):
    """Body, signed distance of the pin from its centre, twice per joint; and the ground's point."""
    a, b, c, d, _ = p
    return (
        (((0, -a / 2),), (0.0, 0.0)),
        (((0, a / 2), (1, -b / 2)), (0.0, 0.0)),
        (((1, b / 2), (2, -c / 2)), (0.0, 0.0)),
        (((2, c / 2),), (d, 0.0)),
    )


def Phi(q, t, p=DEFAULTS):
    values = np.zeros(9)
    for joint, (pins, (ground_x, ground_y)) in enumerate(joints(p)):
        for sign, (body, arm) in zip((1, -1), pins, strict=False):
            x, y, phi = q[3 * body : 3 * body + 3]
            values[2 * joint] += sign * (x + arm * math.cos(phi))
            values[2 * joint + 1] += sign * (y + arm * math.sin(phi))
        values[2 * joint : 2 * joint + 2] -= (ground_x, ground_y)
    values[8] = q[2] - p[4] * t
    return values


def Phi_q(q, t, p=DEFAULTS):
    matrix = np.zeros((9, 9))
    for joint, (pins, _) in enumerate(joints(p)):
        row = 2 * joint
        for sign, (body, arm) in zip((1, -1), pins, strict=False):
            phi, column = q[3 * body + 2], 3 * body
            matrix[row, column] = matrix[row + 1, column + 1] = sign
            matrix[row, column + 2] = -sign * arm * math.sin(phi)
            matrix[row + 1, column + 2] = sign * arm * math.cos(phi)
    matrix[8, 2] = 1
    return matrix


def nu(q, t, p=DEFAULTS):
    return np.array([0.0] * 8 + [p[4]])


def gamma(q, q_dot, t, p=DEFAULTS):
    values = np.zeros(9)
    for joint, (pins, _) in enumerate(joints(p)):
        for sign, (body, arm) in zip((1, -1), pins, strict=False):
            phi, phi_dot = q[3 * body + 2], q_dot[3 * body + 2]
            values[2 * joint] += sign * arm * phi_dot**2 * math.cos(phi)
            values[2 * joint + 1] += sign * arm * phi_dot**2 * math.sin(phi)
    return values


def Phi_q_nonzeros(q, t, p=DEFAULTS):
    return Phi_q(q, t, p)[PATTERN[:, 0], PATTERN[:, 1]]


def position(q, t, p=DEFAULTS):
    return Phi(q, t, p), Phi_q(q, t, p)


def velocity(q, t, p=DEFAULTS):
    return Phi_q(q, t, p), nu(q, t, p)


def acceleration(q, q_dot, t, p=DEFAULTS):
    return Phi_q(q, t, p), gamma(q, q_dot, t, p)


def kinematics(q, q_dot, t, p=DEFAULTS):
    return Phi(q, t, p), Phi_q(q, t, p), nu(q, t, p), gamma(q, q_dot, t, p)
