"""Backward differences of second order, for steps of any length: dissipates the fast oscillations, keeps the slow ones.

With w = dt/dt_past and g = (1 + w)/(1 + 2 w), and x_past, v_past one step before x0, v0:
x1 = X + g dt v1,  M (v1 - V) = g dt F(x1),  X = ((1 + w)^2 x0 - w^2 x_past)/(1 + 2 w), V likewise              (1)
M (x1 - x_hat)/(g dt)^2 = F(x1),  x_hat = X + g dt V,  v1 = (x1 - X)/(g dt)                                    (2)
(Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, III.5: stable for w below 1 + sqrt 2.)
Equal steps give g = 2/3. History: x_past, v_past. One step makes an error of
C(w) dt^3 times the third derivative,  C(w) = (1 + w)^2/(6 w (1 + 2 w))                                        (3)
"""

from softseam_services.jit import njit

N_HISTORY = 2


def _error(w: float) -> float:
    """C of eq. (3)."""
    return (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w))


def halves_share(dt: float, past: float) -> float:
    """Error of two steps of dt/2 over their difference from one of dt [1].

    past: length of the step before, 0 where there is none and a step of midpoint, of which C is 1/12, comes first
    """
    whole = 8.0 * (_error(dt / past) if past > 0.0 else 1.0 / 12.0)
    halves = (_error(0.5 * dt / past) if past > 0.0 else 1.0 / 12.0) + _error(1.0)
    return halves / (whole - halves)


@njit(cache=True, error_model="numpy")
def _weights(dt, past):
    """g, and the weights of the state at the start and of the one before it, eq. (1)."""
    w = dt / past
    below = 1.0 / (1.0 + 2.0 * w)
    return (1.0 + w) * below, (1.0 + w) * (1.0 + w) * below, w * w * below


def kept_on(dt: float, past: float) -> float:
    """Share of the last step's change that V of eq. (1) goes on by [1]."""
    w = dt / past
    return w * w / (1.0 + 2.0 * w)


@njit(cache=True, error_model="numpy")
def begin(dt, past, x0, v0, history, x_hat):
    """Fill x_hat (n, 3) [m] of eq. (2); history (2, n, 3); returns the share of M in the balance [1/s^2]."""
    g, a, b = _weights(dt, past)
    for node in range(len(x0)):
        for i in range(3):
            X = a * x0[node, i] - b * history[0, node, i]
            V = a * v0[node, i] - b * history[1, node, i]
            x_hat[node, i] = X + g * dt * V
    return 1.0 / (g * g * dt * dt)


@njit(cache=True, error_model="numpy")
def finish(dt, past, x0, v0, history, x, v):
    """v (n, 3) [m/s] <- eq. (2)."""
    g, a, b = _weights(dt, past)
    for node in range(len(x0)):
        for i in range(3):
            v[node, i] = (x[node, i] - (a * x0[node, i] - b * history[0, node, i])) / (g * dt)


@njit(cache=True, error_model="numpy")
def remember(x0, v0, history):
    """history (2, n, 3) <- x0, v0."""
    for node in range(len(x0)):
        for i in range(3):
            history[0, node, i], history[1, node, i] = x0[node, i], v0[node, i]
