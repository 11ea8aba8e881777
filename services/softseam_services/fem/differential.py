"""What a number owes to a state and to the inputs of steps, or how a change of these moves it."""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import record

from .model import FemModel


@record
class Differential(NamedTuple):
    """Of n nodes, p surface points, t tools. Backward, derivatives of a number by each entry; forward, their change."""

    x: Floats
    """positions (n, 3)"""
    v: Floats
    """velocities (n, 3)"""
    force: Floats
    """contact forces, which the next step begins with (p, t, 3)"""
    anchor: Floats
    """and anchors (p, t, 3)"""
    tool_force: Floats
    """forces of the body on tools in the step (t, 3)"""
    tool_start: Floats
    """places of tools when the step begins (t, 3)"""
    tool_end: Floats
    """and when it ends (t, 3)"""
    friction: Floats
    """coefficients of tools (t,)"""
    young: Floats
    """logarithm of Young's modulus (1,)"""
    w: Floats
    """solution of the last step's equation, a guess for the next (3 n_free,)"""


def no_differential(model: FemModel, n_tools: int) -> Differential:
    """Zeros."""
    n, p, free = len(model.order), len(model.point_face), int(np.count_nonzero(model.order >= 0))
    return Differential(
        x=np.zeros((n, 3)),
        v=np.zeros((n, 3)),
        force=np.zeros((p, n_tools, 3)),
        anchor=np.zeros((p, n_tools, 3)),
        tool_force=np.zeros((n_tools, 3)),
        tool_start=np.zeros((n_tools, 3)),
        tool_end=np.zeros((n_tools, 3)),
        friction=np.zeros(n_tools),
        young=np.zeros(1),
        w=np.zeros(3 * free),
    )
