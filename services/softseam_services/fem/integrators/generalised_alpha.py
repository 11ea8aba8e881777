"""Generalised-alpha (Chung & Hulbert, J. Appl. Mech. 60, 1993, doi 10.1115/1.2900803), and Newmark's family in it.

x1 = x0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1),  v1 = v0 + dt ((1 - gamma) a0 + gamma a1)                  (1)
M ((1 - am) a1 + am a0) = F(x_t),  x_t = (1 - af) x1 + af x0                                                   (2)
(1 - am)/(beta dt^2) M (x1 - x_hat) = F(x_t),
x_hat = x0 + dt v0 + beta dt^2 ((1/(2 beta) - 1) - am/(1 - am)) a0                                             (3)
Of the spectral radius rho at infinite frequency: am = (2 rho - 1)/(rho + 1), af = rho/(rho + 1),
gamma = 1/2 - am + af, beta = (1 - am + af)^2/4. Second order for every rho; rho = 1 dissipates nothing.
Newmark's average acceleration, the trapezoidal rule: am = af = 0, beta = 1/4, gamma = 1/2.

Contact is closed at x1 (not at x_t), with a force that is constant over the step.
History: a0; after a first step without one, its mean acceleration (v1 - v0)/dt.
"""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import njit

N_HISTORY = 1


def parameters(radius: float) -> Floats:
    """share = 1 - af, am, beta, gamma [1] of the spectral radius in [0, 1]."""
    am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    return np.array([1.0 - af, am, 0.25 * (1.0 - am + af) ** 2, 0.5 - am + af])


def trapezoidal() -> Floats:
    """The same of Newmark's average acceleration, the trapezoidal rule: second order, dissipates nothing."""
    return np.array([1.0, 0.0, 0.25, 0.5])


@njit(cache=True, error_model="numpy")
def begin(dt, parameters, x0, v0, history, x_hat):
    """Fill x_hat (n, 3) [m] of eq. (3); history (1, n, 3); returns the share of M in the balance [1/s^2]."""
    am, beta = parameters[1], parameters[2]
    square = dt * dt * (0.5 - beta - beta * am / (1.0 - am))
    for node in range(len(x0)):
        for i in range(3):
            x_hat[node, i] = x0[node, i] + dt * v0[node, i] + square * history[0, node, i]
    return (1.0 - am) / (beta * dt * dt)


@njit(cache=True, error_model="numpy")
def _acceleration(dt, beta, x0, v0, a0, x):
    """a1 of one coordinate, eq. (1)."""
    return (x - x0 - dt * v0) / (beta * dt * dt) - (0.5 / beta - 1.0) * a0


@njit(cache=True, error_model="numpy")
def finish(dt, parameters, x0, v0, history, x, v):
    """v (n, 3) [m/s] <- eq. (1)."""
    beta, gamma = parameters[2], parameters[3]
    for node in range(len(x0)):
        for i in range(3):
            a0 = history[0, node, i]
            a1 = _acceleration(dt, beta, x0[node, i], v0[node, i], a0, x[node, i])
            v[node, i] = v0[node, i] + dt * ((1.0 - gamma) * a0 + gamma * a1)


@njit(cache=True, error_model="numpy")
def remember(dt, parameters, x0, v0, history, x, v, starts, history_next):
    """history_next (1, n, 3) <- a1; starts: of a step that had no history."""
    beta = parameters[2]
    for node in range(len(x0)):
        for i in range(3):
            if starts:
                history_next[0, node, i] = (v[node, i] - v0[node, i]) / dt
            else:
                a0 = history[0, node, i]
                history_next[0, node, i] = _acceleration(dt, beta, x0[node, i], v0[node, i], a0, x[node, i])
