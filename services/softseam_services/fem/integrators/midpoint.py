"""Theta-midpoint: internal forces at x_t = x0 + theta (x1 - x0). Second order for theta = 1/2, where it conserves.

x1 = x0 + dt ((1 - theta) v0 + theta v1),  M (v1 - v0)/dt = F(x_t)                                             (1)
M (x1 - x_hat)/(theta dt^2) = F(x_t),  x_hat = x0 + dt v0,  v1 = v0 + ((x1 - x0)/dt - v0)/theta                (2)

Each step turns the fastest oscillations round and keeps rho = (1 - theta)/theta of them, so theta = 1/(1 + rho).
Contact and the seam are closed at x1, with a force that is constant over the step; then a node held by them keeps
-rho of its velocity.

A drag -a M v_t, v_t = (x1 - x0)/dt, leaves that form, with s = 1 + a theta dt:
s M (x1 - x_hat)/(theta dt^2) = F(x_t),  x_hat = x0 + dt v0/s                                                  (3)
"""

from softseam_services.jit import njit


def theta(radius: float) -> float:
    """theta of the spectral radius rho in [0, 1] at infinite frequency."""
    return 1.0 / (1.0 + radius)


@njit(cache=True, error_model="numpy")
def begin(dt, share, drag, x0, v0, x_hat):
    """Fill x_hat (n, 3) [m] of eq. (3), share = theta, drag = a [1/s]; returns M's share in the balance [1/s^2]."""
    slowed = 1.0 + drag * share * dt
    for node in range(len(x0)):
        for i in range(3):
            x_hat[node, i] = x0[node, i] + dt * v0[node, i] / slowed
    return slowed / (share * dt * dt)


@njit(cache=True, error_model="numpy")
def finish(dt, share, x0, v0, x, v):
    """v (n, 3) [m/s] <- eq. (2)."""
    for node in range(len(x0)):
        for i in range(3):
            v[node, i] = v0[node, i] + ((x[node, i] - x0[node, i]) / dt - v0[node, i]) / share
