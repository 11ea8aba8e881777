"""Statics: each step ends in equilibrium with the tools where they then are, and with all of the weight.

0 = f_ext - f(x1) + f_contact(x1),  v1 = 0                                                                     (1)
The weight comes with the first step; where that cannot be solved at once it is raised in 2, 4 ... 32 parts, like the
tools' way, and the share of it that a state carries is part of the state. Nothing but clamped nodes holds a body before
it touches something, so a scene without any is refused.
"""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def begin(x0, x_hat):
    """x_hat <- x0; the share of M in the balance is 0."""
    for node in range(len(x0)):
        for i in range(3):
            x_hat[node, i] = x0[node, i]
    return 0.0


@njit(cache=True, error_model="numpy")
def finish(v):
    """v <- 0."""
    v[:] = 0.0


def raised(carried: float, parts_left: int) -> float:
    """Share of the load at the end of the next of `parts_left` equal parts, when `carried` of it is borne."""
    return carried + (1.0 - carried) / parts_left
