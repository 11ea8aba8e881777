"""The integrators as one pair of kernels: what a step begins from, and what follows from its end.

Every one but symplectic Euler, which marches on its own, solves for the end x of a step from x0
  share_M M (x - x_hat) = f_ext - f(x0 + share (x - x0)) + f_contact(x) + f_seam(x)                            (1)
with M's share [1/s^2] and x_hat from `begin`; share = parameters[0] is where in the step internal forces are taken.
past is the length of the step that made the history [s], 0 where there is none; of statics, the share of the load.
"""

from typing import NamedTuple

from softseam_services.body.body import Floats
from softseam_services.jit import njit, record

from . import bdf2, generalised_alpha, implicit_euler, midpoint, static

IMPLICIT_EULER, MIDPOINT, BDF2, GENERALISED_ALPHA, SYMPLECTIC_EULER, STATIC = 0, 1, 2, 3, 4, 5
STEPPERS = frozenset({IMPLICIT_EULER, MIDPOINT, BDF2, GENERALISED_ALPHA, SYMPLECTIC_EULER, STATIC})
"""kinds that have a branch here, or in kernels/step.py"""


@record
class Scheme(NamedTuple):
    """An integrator for the kernels."""

    kind: int
    parameters: Floats
    """share [1] first, then the integrator's own"""
    n_history: int
    """arrays (n, 3) of a state beside x and v"""
    retardation_time: float = 0.0
    """of the material [s], see kernels/viscosity.py"""
    drag: float = 0.0
    """force over mass and velocity [1/s]; of implicit Euler and midpoint"""


@njit(cache=True, error_model="numpy")
def _starts(scheme, past):
    """Whether this step is the first of an integrator that needs a history: one of midpoint, which loses nothing."""
    return scheme.n_history > 0 and past == 0.0


@njit(cache=True, error_model="numpy")
def viscous_share(scheme, dt, share):
    """c of kernels/viscosity.py, eq. (1) [1]: what the material damps beyond the integrator; 0 where that is more."""
    if scheme.retardation_time == 0.0 or scheme.kind == STATIC:
        return 0.0
    return max(0.0, scheme.retardation_time - (2.0 * share - 1.0) * dt) / (share * dt)


@njit(cache=True, error_model="numpy")
def begin(scheme, dt, past, x0, v0, history, x_hat):
    """Fill x_hat (n, 3) [m]; returns share_M [1/s^2] and share [1] of eq. (1)."""
    kind, parameters = scheme.kind, scheme.parameters
    if _starts(scheme, past):
        return midpoint.begin(dt, 0.5, scheme.drag, x0, v0, x_hat), 0.5
    if kind == MIDPOINT:
        return midpoint.begin(dt, parameters[0], scheme.drag, x0, v0, x_hat), parameters[0]
    if kind == BDF2:
        return bdf2.begin(dt, past, x0, v0, history, x_hat), 1.0
    if kind == GENERALISED_ALPHA:
        return generalised_alpha.begin(dt, parameters, x0, v0, history, x_hat), parameters[0]
    if kind == STATIC:
        return static.begin(x0, x_hat), 1.0
    return implicit_euler.begin(dt, scheme.drag, x0, v0, x_hat), 1.0


@njit(cache=True, error_model="numpy")
def finish(scheme, dt, past, x0, v0, history, x, v, history_next):
    """v (n, 3) [m/s] at the end x of the step, and the history that the next one needs; both updated in place."""
    kind, parameters = scheme.kind, scheme.parameters
    starts = _starts(scheme, past)
    if kind == MIDPOINT or starts:
        midpoint.finish(dt, 0.5 if starts else parameters[0], x0, v0, x, v)
    elif kind == BDF2:
        bdf2.finish(dt, past, x0, v0, history, x, v)
    elif kind == GENERALISED_ALPHA:
        generalised_alpha.finish(dt, parameters, x0, v0, history, x, v)
    elif kind == STATIC:
        static.finish(v)
    else:
        implicit_euler.finish(dt, x0, x, v)
    if kind == BDF2:
        bdf2.remember(x0, v0, history_next)
    elif kind == GENERALISED_ALPHA:
        generalised_alpha.remember(dt, parameters, x0, v0, history, x, v, starts, history_next)
