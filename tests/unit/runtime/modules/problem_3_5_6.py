"""Problem 3.5.6 (case R3) by hand, as an emitted module: reduced coordinates, no parameters."""

import math

import numpy as np

NAME = "problem_3_5_6"
FORMAT = 1
FINGERPRINT = "356"
N_COORDINATES = 3
N_EQUATIONS = 3
COORDINATES = ("x2", "y2", "phi3")
EQUATIONS = ("pin.x", "pin.y", "length")
PARAMETERS = ()
UNITS = {"x2": "m", "y2": "m", "phi3": "rad"}
DEFAULTS = np.array([])
GUESS = np.array([0.2, 0.2, math.pi / 4])
PATTERN = np.array([[0, 0], [0, 2], [1, 1], [1, 2], [2, 0], [2, 1]])


class InputError(ValueError):
    pass


def Phi(q, t, p=DEFAULTS):
    x2, y2, phi3 = np.moveaxis(np.asarray(q), -1, 0)
    if not np.isfinite(q).all():
        raise InputError("q is not finite")
    rows = (
        x2 + 0.25 * np.sin(phi3) - 0.6,
        y2 - 0.25 * np.cos(phi3),
        x2**2 + y2**2 - (t / 10 + 0.4) ** 2,
    )
    return np.stack(np.broadcast_arrays(*rows), axis=-1)


def Phi_q(q, t, p=DEFAULTS):
    x2, y2, phi3 = np.moveaxis(np.asarray(q), -1, 0)
    matrix = np.zeros((*np.broadcast_shapes(x2.shape, np.shape(t)), 3, 3))
    matrix[..., 0, 0] = 1
    matrix[..., 0, 2] = 0.25 * np.cos(phi3)
    matrix[..., 1, 1] = 1
    matrix[..., 1, 2] = 0.25 * np.sin(phi3)
    matrix[..., 2, 0] = 2 * x2
    matrix[..., 2, 1] = 2 * y2
    return matrix


def nu(q, t, p=DEFAULTS):
    return np.stack(np.broadcast_arrays(0.0, 0.0, (t + 4) / 50), axis=-1)


def gamma(q, q_dot, t, p=DEFAULTS):
    x2_dot, y2_dot, phi3_dot = np.moveaxis(np.asarray(q_dot), -1, 0)
    phi3 = np.asarray(q)[..., 2]
    rows = (
        phi3_dot**2 * np.sin(phi3) / 4,
        -(phi3_dot**2) * np.cos(phi3) / 4,
        -2 * x2_dot**2 - 2 * y2_dot**2 + 1 / 50,
    )
    return np.stack(np.broadcast_arrays(*rows), axis=-1)


def Phi_q_nonzeros(q, t, p=DEFAULTS):
    return Phi_q(q, t, p)[..., PATTERN[:, 0], PATTERN[:, 1]]


def position(q, t, p=DEFAULTS):
    return Phi(q, t, p), Phi_q(q, t, p)


def velocity(q, t, p=DEFAULTS):
    return Phi_q(q, t, p), nu(q, t, p)


def acceleration(q, q_dot, t, p=DEFAULTS):
    return Phi_q(q, t, p), gamma(q, q_dot, t, p)


def kinematics(q, q_dot, t, p=DEFAULTS):
    return Phi(q, t, p), Phi_q(q, t, p), nu(q, t, p), gamma(q, q_dot, t, p)
