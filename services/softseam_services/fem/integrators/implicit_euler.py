"""Implicit Euler: x1 = x0 + dt v1, M (v1 - v0)/dt = F(x1). First order, dissipates, meets every seam and contact.

M (x1 - x_hat)/dt^2 = F(x1),  x_hat = x0 + dt v0,  v1 = (x1 - x0)/dt                                           (1)
A drag -a M v1 (Rayleigh's C = a M) leaves that form, with s = 1 + a dt:
s M (x1 - x_hat)/dt^2 = F(x1),  x_hat = x0 + dt v0/s                                                           (2)
"""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def begin(dt, drag, x0, v0, x_hat):
    """Fill x_hat (n, 3) [m] of eq. (2), drag = a [1/s]; returns the share of M in the balance [1/s^2]."""
    slowed = 1.0 + drag * dt
    for node in range(len(x0)):
        for i in range(3):
            x_hat[node, i] = x0[node, i] + dt * v0[node, i] / slowed
    return slowed / (dt * dt)


@njit(cache=True, error_model="numpy")
def finish(dt, x0, x, v):
    """v (n, 3) [m/s] <- eq. (1)."""
    for node in range(len(x0)):
        for i in range(3):
            v[node, i] = (x[node, i] - x0[node, i]) / dt
