"""Which regions are given back what steps lose of a rotation."""

from __future__ import annotations

import numpy as np

from softseam_services.body.turning import Turning
from softseam_services.fem.integrators.scheme import IMPLICIT_EULER, MIDPOINT
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters


def free_to_turn(kind: int, model: FemModel, parameters: FemParameters) -> Turning | None:
    """What gives a rotation back; None of a region that is held, whose law knows no turns, or whose integrator, of this
    kind, loses nothing."""
    planes = np.unique(model.rollers[:, 1])
    held = len(planes) > 1 or bool((model.order < 0).any())
    if held or model.linear or kind not in (IMPLICIT_EULER, MIDPOINT):
        return None
    return Turning(parameters.mass, int(planes[0]) if len(planes) else -1)
