"""Simple pendulum (case R1) by hand, as an emitted module: full coordinates, two parameters."""

import math

import numpy as np

NAME = "pendulum"
FORMAT = 1
FINGERPRINT = "321"
N_COORDINATES = 3
N_EQUATIONS = 3
COORDINATES = ("x_rod", "y_rod", "phi_rod")
EQUATIONS = ("pin.x", "pin.y", "motor")
PARAMETERS = ("omega", "phi_0")
UNITS = {"x_rod": "m", "y_rod": "m", "phi_rod": "rad", "omega": "rad/s", "phi_0": "rad"}
DEFAULTS = np.array([2 * math.pi, math.pi / 2])
GUESS = np.array([1.0, 0.0, math.pi / 2])
PATTERN = np.array([[0, 0], [0, 2], [1, 1], [1, 2], [2, 2]])


class InputError(ValueError):
    pass


def Phi(q, t, p=DEFAULTS):
    x, y, phi = q
    omega, phi_0 = p
    return np.array([x + math.cos(phi) - 1, y + math.sin(phi) - 1, phi - phi_0 - omega * t])


def Phi_q(q, t, p=DEFAULTS):
    phi = q[2]
    return np.array([[1.0, 0.0, -math.sin(phi)], [0.0, 1.0, math.cos(phi)], [0.0, 0.0, 1.0]])


def nu(q, t, p=DEFAULTS):
    return np.array([0.0, 0.0, p[0]])


def gamma(q, q_dot, t, p=DEFAULTS):
    square = q_dot[2] ** 2
    return np.array([square * math.cos(q[2]), square * math.sin(q[2]), 0.0])


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
