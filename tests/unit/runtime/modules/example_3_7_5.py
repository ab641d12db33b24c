"""Example 3.7.5 (case R4) by hand, as an emitted module: a slider-crank with rod length l."""

import math

import numpy as np

NAME = "example_3_7_5"
FORMAT = 1
FINGERPRINT = "375"
N_COORDINATES = 3
N_EQUATIONS = 3
COORDINATES = ("x2", "phi1", "phi2")
EQUATIONS = ("loop.x", "loop.y", "motor")
PARAMETERS = ("l",)
UNITS = {"x2": "m", "phi1": "rad", "phi2": "rad", "l": "m"}
DEFAULTS = np.array([1.5])
GUESS = np.array([2.0, 0.0, 1.5])
PATTERN = np.array([[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 1]])


class InputError(ValueError):
    pass


def Phi(q, t, p=DEFAULTS):
    x2, phi1, phi2 = q
    (rod,) = p
    return np.array(
        [
            -x2 + math.cos(phi1) + rod * math.sin(phi2),
            math.sin(phi1) - rod * math.cos(phi2),
            phi1 - math.pi * t / 12,
        ]
    )


def Phi_q(q, t, p=DEFAULTS):
    _, phi1, phi2 = q
    (rod,) = p
    return np.array(
        [
            [-1.0, -math.sin(phi1), rod * math.cos(phi2)],
            [0.0, math.cos(phi1), rod * math.sin(phi2)],
            [0.0, 1.0, 0.0],
        ]
    )


def nu(q, t, p=DEFAULTS):
    return np.array([0.0, 0.0, math.pi / 12])


def gamma(q, q_dot, t, p=DEFAULTS):
    _, phi1, phi2 = q
    _, phi1_dot, phi2_dot = q_dot
    (rod,) = p
    return np.array(
        [
            phi1_dot**2 * math.cos(phi1) + rod * phi2_dot**2 * math.sin(phi2),
            phi1_dot**2 * math.sin(phi1) - rod * phi2_dot**2 * math.cos(phi2),
            0.0,
        ]
    )


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
