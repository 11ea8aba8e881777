"""Which regions are given back what steps lose of a rotation."""

import numpy as np

from softseam_services.body.turning import Turning

from .integrators.bdf2 import kept_on
from .integrators.scheme import BDF2, STATIC, SYMPLECTIC_EULER, Scheme
from .kernels.contact_columns import FORCE
from .model import FemModel
from .parameters import FemParameters
from .state import FemState


def free_to_turn(kind: int, model: FemModel, parameters: FemParameters) -> Turning | None:
    """What gives a rotation back; None of a region that is held, whose law knows no turns, or whose integrator, of this
    kind, loses nothing."""
    planes = np.unique(model.rollers[:, 1])
    held = len(planes) > 1 or bool((model.order < 0).any())
    if held or model.linear or kind in (STATIC, SYMPLECTIC_EULER):
        return None
    return Turning(parameters.mass, int(planes[0]) if len(planes) else -1)


def begins(turning: Turning, scheme: Scheme, now: FemState, dt: float) -> bool:
    """Whether a step of dt [s] of a whole region is given its rotation back.

    Integrators with a history weigh the torques of several steps. So with them only a body that flies is: BDF2's spin
    goes on as its momentum does, by eq. (1) of integrators/bdf2.py without forces, that of generalised-alpha stays.
    """
    slowed = 1.0 + scheme.parameters[0] * scheme.drag * dt
    if not turning.begins(now.x, now.v, dt, slowed):
        return False
    if not scheme.n_history:
        return True
    if now.contact[:, :, FORCE : FORCE + 3].any():
        return False
    if scheme.kind == BDF2 and now.past:
        turning.carry_on(now.history[0], now.history[1], kept_on(dt, now.past))
    return True
