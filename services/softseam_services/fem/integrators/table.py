"""Integrators by their names in the scene file."""

from __future__ import annotations

import numpy as np

from softseam_protocol.scene_models import FemSpec
from softseam_services.fem.integrators import bdf2, generalised_alpha, midpoint, newmark
from softseam_services.fem.integrators.scheme import (
    BDF2,
    GENERALISED_ALPHA,
    IMPLICIT_EULER,
    MIDPOINT,
    STATIC,
    SYMPLECTIC_EULER,
    Scheme,
)
from softseam_services.fem.integrators.symplectic_euler import SAFETY, highest_frequency
from softseam_services.fem.model import FemModel
from softseam_services.fem.work import Work

# Where tools touch, oscillations of the held points must die out within a few steps; elsewhere they should live.
_RADIUS = {"midpoint": (1.0, 0.5), "generalised_alpha": (0.8, 0.0)}


def build_scheme(spec: FemSpec, model: FemModel, work: Work, touched: bool, retardation_time: float = 0.0) -> Scheme:
    """The kernels' view of a scene's integrator; touched: there are tools; retardation_time of the material [s]."""
    name = spec.integrator
    if name == "symplectic_euler":
        return Scheme(SYMPLECTIC_EULER, np.array([1.0, longest_substep(model, work)]), 0)
    if name == "bdf2":
        return Scheme(BDF2, np.ones(1), bdf2.N_HISTORY)
    if name == "newmark":
        return Scheme(GENERALISED_ALPHA, newmark.parameters(), generalised_alpha.N_HISTORY)
    if name in ("implicit_euler", "static"):
        return Scheme(STATIC if name == "static" else IMPLICIT_EULER, np.ones(1), 0, retardation_time)
    radius = _RADIUS[name][touched] if spec.radius is None else spec.radius
    if name == "midpoint":
        return Scheme(MIDPOINT, np.array([midpoint.theta(radius)]), 0, retardation_time)
    return Scheme(GENERALISED_ALPHA, generalised_alpha.parameters(radius), generalised_alpha.N_HISTORY)


def longest_substep(model: FemModel, work: Work) -> float:
    """Of symplectic Euler: SAFETY 2/w [s]."""
    frequency: float = highest_frequency(model, work)
    return SAFETY * 2.0 / frequency


def order(scheme: Scheme) -> int:
    """Of convergence: the error of one step grows with its length to the power order + 1."""
    return 1 if scheme.kind == IMPLICIT_EULER or (scheme.kind == MIDPOINT and scheme.parameters[0] > 0.5) else 2


def halves_share(scheme: Scheme, dt: float, past: float) -> float:
    """Error of two steps of dt/2 over their difference from one of dt, after a step of length `past` [1]."""
    if scheme.kind == BDF2:
        return bdf2.halves_share(dt, past)
    return float(1.0 / (2 ** order(scheme) - 1))


def _starts(scheme: Scheme, past: float) -> bool:
    """Whether the step is the first of an integrator that needs a history: one of midpoint."""
    return scheme.n_history > 0 and past == 0.0


def forces_at(scheme: Scheme, past: float) -> float:
    """Fraction of the step at which forces act, after a step of length `past` [1]."""
    return 0.5 if _starts(scheme, past) else float(scheme.parameters[0])


def works_at(scheme: Scheme, past: float) -> float:
    """Fraction of the step at which a force that is linear in time, times the way, is its work [1].

    Where it acts, of implicit Euler and midpoint; the mean, to second order, of those that end in balance: Newmark's
    energy changes by exactly that.
    """
    return 0.5 if scheme.n_history > 0 else forces_at(scheme, past)


def velocity_gain(scheme: Scheme, dt: float, past: float) -> float:
    """d(velocity)/d(position) at the end of a step [1/s], see `finish` of the integrator."""
    if scheme.kind == MIDPOINT or _starts(scheme, past):
        return 1.0 / (forces_at(scheme, past) * dt)
    if scheme.kind == BDF2:
        return (past + 2.0 * dt) / ((past + dt) * dt)  # 1/(g dt)
    if scheme.kind == GENERALISED_ALPHA:
        return float(scheme.parameters[3] / (scheme.parameters[2] * dt))
    return 1.0 / dt
