"""Integrators by their names in the scene file: the coefficients of the stepper that each is run by.

A row makes a `Scheme` of a `Setting`. The steppers are kernels (`scheme`); one from outside gives coefficients to one
of them: a member of Newmark's family, HHT's or generalised-alpha's is `of_family` of its coefficients.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softseam_protocol.scene.models import FemSpec
from softseam_protocol.table import Table
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.work import Work

from . import bdf2, generalised_alpha, midpoint
from .scheme import BDF2, GENERALISED_ALPHA, IMPLICIT_EULER, MIDPOINT, STATIC, STEPPERS, SYMPLECTIC_EULER, Scheme
from .symplectic_euler import SAFETY, highest_frequency


class Setting(NamedTuple):
    """What an integrator's coefficients may depend on."""

    model: FemModel
    parameters: FemParameters
    work: Work
    radius: float | None
    """share of the fastest oscillations that the scene wants kept each step [1]"""
    touched: bool
    """there are tools"""

    @property
    def retardation_time(self) -> float:
        """Of the material [s]."""
        return self.parameters.retardation_time

    @property
    def drag(self) -> float:
        """Of the body [1/s]."""
        return self.parameters.drag

    def kept(self, free: float, touched: float) -> float:
        """The scene's radius, or the one for a free body and the one for a touched body: where tools touch,
        oscillations of the held points must die out within a few steps; elsewhere they should live."""
        return (touched if self.touched else free) if self.radius is None else self.radius


def of_family(share: float, am: float, beta: float, gamma: float) -> Scheme:
    """The member of `generalised_alpha`'s family with these coefficients; share = 1 - af [1]."""
    return Scheme(GENERALISED_ALPHA, np.array([share, am, beta, gamma]), generalised_alpha.N_HISTORY)


def _implicit_euler(setting: Setting) -> Scheme:
    return Scheme(IMPLICIT_EULER, np.ones(1), 0, setting.retardation_time, setting.drag)


def _midpoint(setting: Setting) -> Scheme:
    theta = midpoint.theta(setting.kept(free=1.0, touched=0.5))
    return Scheme(MIDPOINT, np.array([theta]), 0, setting.retardation_time, setting.drag)


def _bdf2(setting: Setting) -> Scheme:
    return Scheme(BDF2, np.ones(1), bdf2.N_HISTORY)


def _newmark(setting: Setting) -> Scheme:
    return of_family(*generalised_alpha.trapezoidal())


def _generalised_alpha(setting: Setting) -> Scheme:
    return of_family(*generalised_alpha.parameters(setting.kept(free=0.8, touched=0.0)))


def _symplectic_euler(setting: Setting) -> Scheme:
    longest = longest_substep(setting.model, setting.parameters, setting.work)
    return Scheme(SYMPLECTIC_EULER, np.array([1.0, longest]), 0)


def _static(setting: Setting) -> Scheme:
    return Scheme(STATIC, np.ones(1), 0, setting.retardation_time)


INTEGRATORS: Table[Callable[[Setting], Scheme]] = Table(
    "integrators' coefficients",
    {
        "implicit_euler": _implicit_euler,
        "midpoint": _midpoint,
        "bdf2": _bdf2,
        "newmark": _newmark,
        "generalised_alpha": _generalised_alpha,
        "symplectic_euler": _symplectic_euler,
        "static": _static,
    },
)


def build_scheme(spec: FemSpec, model: FemModel, parameters: FemParameters, work: Work, touched: bool) -> Scheme:
    """The kernels' view of a scene's integrator; touched: there are tools.

    Raises ValueError where a row names no stepper.
    """
    scheme = INTEGRATORS[spec.integrator](Setting(model, parameters, work, spec.radius, touched))
    if scheme.kind not in STEPPERS:
        raise ValueError(f"{spec.integrator} is stepped by number {scheme.kind}, and integrators.scheme has no such")
    return scheme


def longest_substep(model: FemModel, parameters: FemParameters, work: Work) -> float:
    """Of symplectic Euler: SAFETY 2/w [s]."""
    frequency: float = highest_frequency(model, parameters, work)
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
