"""What a number owes to a state and to inputs of steps, or how a change of these moves it; and slopes of contacts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.jit import record

from .model import FemModel
from .work import Work


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


MOST_ITERATIONS = 40
"""of GMRES"""


@record
class ContactSlopes(NamedTuple):
    """Of q candidates: see kernels/contact_derivative.py. Rows are force (3) and anchor (3)."""

    place: Floats
    """by the point's place at the end of the step (q, 6, 3)"""
    edges: Floats
    """force by the two edges of the point's patch, where that is looked at in parts (q, 2, 3, 3)"""
    lean: Floats
    """where on its patch the force acts, work.lean, by the point's place and the patch's edges (q, 2, 3, 3) [1/m]"""
    multiplier: Floats
    """by the force of the step before (q, 6, 3)"""
    since: Floats
    """by s (q, 6, 3)"""
    numbers: Floats
    """by penalty and friction (q, 6, 2)"""
    penalty: Floats
    """by the logarithm of Young's modulus (q,) [N/m]"""
    met: Floats
    """force by the places that a point comes from and flies to (2), where it meets a plane between them (q, 2, 3, 3)"""
    anchored: NDArray[np.bool_]
    """whether s goes by the anchor, or by the point's place at the start (q,)"""
    margin: Floats
    """how near the candidate is to opening, closing, sticking or slipping (q,) [1]"""
    seed: Floats
    """of force and anchor, on the way back or along (q, 6)"""
    x: Floats
    """scratch: places (n, 3) [m]"""
    inner: Floats
    """forces of the cells, by which Young's modulus counts (3 n_free,) [N]"""
    right: Floats
    """right side of an equation (3 n_free,)"""
    d: Floats
    basis: Floats
    """of GMRES (MOST_ITERATIONS + 1, 3 n_free)"""
    hessenberg: Floats


def build_slopes(work: Work) -> ContactSlopes:
    """Scratch for the derivatives of steps that `work` is large enough for."""
    q, (n, _), free = len(work.pair), work.x_hat.shape, len(work.r)
    return ContactSlopes(
        place=np.zeros((q, 6, 3)),
        edges=np.zeros((q, 2, 3, 3)),
        lean=np.zeros((q, 2, 3, 3)),
        multiplier=np.zeros((q, 6, 3)),
        since=np.zeros((q, 6, 3)),
        numbers=np.zeros((q, 6, 2)),
        penalty=np.zeros(q),
        met=np.zeros((q, 2, 3, 3)),
        anchored=np.zeros(q, dtype=np.bool_),
        margin=np.zeros(q),
        seed=np.zeros((q, 6)),
        x=np.zeros((n, 3)),
        inner=np.zeros(free),
        right=np.zeros(free),
        d=np.zeros(free),
        basis=np.zeros((MOST_ITERATIONS + 1, free)),
        hessenberg=np.zeros((MOST_ITERATIONS + 1, MOST_ITERATIONS + 3)),
    )
