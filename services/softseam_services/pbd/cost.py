"""What PBD's steps are expected to cost, in microseconds of one core.

Eight blocks a cell, or one of coarse ones, in each sweep of each substep; as many while no tool is near as in a grip.
The constants were measured once (docs/decisions/06).
"""

import math

import numpy as np

from softseam_protocol.scene.models import PbdSpec
from softseam_services.body.body import Body
from softseam_services.pbd.stability import EXPLICIT, STABLE, TOUCHED, TWO_SWEEPS, shorter_by
from softseam_services.solver_row import StepWork

BLOCK = 0.1
"""a block of PBD, sweep and substep [us]"""
DAMPING = 1.2
"""what damping in proportion to stiffness costs a substep, in sweeps [1]"""
SWING, PARTLY, EVEN = 1.87, 1.15, 0.77
"""omega_max of blocks with edges l is SWING c_p |1/l|, and PARTLY times that where the body fills cells in part, EVEN
times where each cell is one block: its nodes have even masses [1]"""


def of_cells(work: StepWork) -> float:
    """What its cells cost, in a grip and at rest [us]."""
    body, spec, n_cells, n_coarse = work.body, work.models.pbd, work.n_cells, work.n_coarse
    count = substeps(body, spec, work.dt, work.touched, n_coarse == n_cells)
    return (8 * n_cells - 7 * n_coarse) * _block(body, spec) * count


def _block(body: Body, spec: PbdSpec) -> float:
    """Cost of a block in one substep [us]."""
    damped = body.material.retardation_time or spec.damping.stiffness
    return BLOCK * (spec.sweeps + (DAMPING if damped > 0.0 else 0.0))


def substeps(body: Body, spec: PbdSpec, dt: float, touched: bool, whole: bool = False) -> int:
    """Substeps that PBD takes, as the scene has them or expected by PBD's own rule, omega_max h <= its limit.

    omega_max takes the blocks of a region; here it is estimated from their size, so that the number is the same for
    every cut. On the scenes that come along it is the same as PBD's or next to it. whole: each cell is one block
    """
    if spec.substeps != "auto":
        return spec.substeps
    if spec.method == "leapfrog":
        limit = EXPLICIT
    else:
        table = TOUCHED if touched else STABLE
        limit = min(float(np.interp(material.elastic.poisson, *table)) for material in body.materials)
        limit *= TWO_SWEEPS if spec.sweeps > 1 else 1.0
    frequency = SWING * body.wave_speed * float(np.linalg.norm(2.0 / body.edges))
    if whole:
        frequency *= 0.5 * EVEN
    if (body.fill < 1.0).any():
        frequency *= PARTLY
    rate, damped = frequency / limit, body.material.retardation_time or spec.damping.stiffness
    return max(1, math.ceil(dt * rate * shorter_by(rate, damped)))
