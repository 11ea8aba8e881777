"""What a step of a cut is expected to cost, so that a body is not split where one model is enough.

A model of the two participants' work in microseconds of one core; only ratios are used. Per exchange, in a grip, where
most of a run's time goes:

  FEM   ITERATIONS of forces and a solve, and FACTORS factorisations: the cells' matrices, nested dissection of the
        region (times of the order of its unknowns to the power 1.95, fitted from 216 to 3993 unknowns) and the dense
        front of the seam's unknowns
  PBD   eight blocks a cell, or one of coarse ones, in each sweep of each substep

and CALL for a call of either. While no tool is near, FEM takes RESTING iterations with the factor that it has, unless
the body is round; PBD takes what it always does.

The choice must be the same on every machine and in every replay: so nothing is timed while a simulation runs, and the
constants were measured once (docs/decisions/06).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.models import ModelsSpec, PbdSpec
from softseam_services.body.body import Body
from softseam_services.orchestrator.sides import Sides
from softseam_services.pbd.stability import EXPLICIT, STABLE, TOUCHED, TWO_SWEEPS, shorter_by

CALL = 60.0
"""a call of a participant [us]"""
EXCHANGES = 2.0
"""solves of both sides in a step of a cut; fitted to the headline scenes"""
ITERATIONS, ITERATION = 5.0, 4.4
"""Newton iterations an exchange; one costs so much a cell [us]"""
RESTING = 2.0
"""Newton iterations of a step while no tool is near: 1.5 of boxes of 8 to 125 cells that settle on the ground, 1.9 in
their first 60 steps, 2.3 of one that is dropped on it. A round body comes to lie on other points: 4.8, as in a grip"""
FACTORS, ASSEMBLY = 0.45, 9.4
"""factorisations an exchange; the matrix costs so much a cell [us]"""
DEARER: dict[ElementKind, tuple[float, float]] = {
    "hex27": (0.0, 0.0),
    "hex27_full": (5.0, 102.0),
    "hex27_reduced": (0.0, 0.0),
    "hex8": (2.5, 2.0),
    "hex8_bbar": (11.3, 80.0),
    "hex8_full": (7.5, 43.0),
    "hex8_reduced": (2.6, 1.0),
    "tet4": (10.3, 29.0),
    "tet4_fbar": (9.0, 58.0),
    "tet10": (3.2, 22.0),
}
"""what an iteration and a matrix of other elements cost more than hex27's (docs/reference/elements.md), a cell [us]"""
UNMEASURED = 10.3, 102.0
"""the dearest of these, for elements from outside"""
FACTOR = 100.0 / 375.0**1.95
"""factor of n unknowns: FACTOR n^1.95 [us]"""
DENSE = 1.0 / 3.0 / 15e3
"""dense factor of n unknowns: DENSE n^3 [us], at 15 GFLOP/s"""
BLOCK = 0.1
"""a block of PBD, sweep and substep [us]"""
DAMPING = 1.2
"""what damping in proportion to stiffness costs a substep, in sweeps [1]"""
SWING, PARTLY, EVEN = 1.87, 1.15, 0.77
"""omega_max of blocks with edges l is SWING c_p |1/l|, and PARTLY times that where the body fills cells in part, EVEN
times where each cell is one block: its nodes have even masses [1]"""


def step_cost(
    body: Body, sides: Sides, models: ModelsSpec, dt: float, touched: bool, coarse: NDArray[np.bool_]
) -> float:
    """Cost of one step of length dt [s] cut like this [us]; touched: there are tools; coarse (C,): cells that PBD takes
    as one block."""
    force, matrix = DEARER.get(models.fem.element, UNMEASURED)
    seam = 3 * len(sides.seam)
    cost = 0.0
    for name, model in sides.models.items():
        n_cells = len(sides.cells[name])
        cost += CALL
        if model == "fem":
            cost += n_cells * (ITERATIONS * (ITERATION + force) + FACTORS * (ASSEMBLY + matrix))
            cost += FACTORS * (FACTOR * (3 * sides.n_nodes[name]) ** 1.95 + DENSE * seam**3)
        else:
            n_coarse = int(np.count_nonzero(coarse[sides.cells[name]]))
            count = substeps(body, models.pbd, dt, touched, n_coarse == n_cells)
            cost += (8 * n_cells - 7 * n_coarse) * _block(body, models.pbd) * count
    return cost * (EXCHANGES if len(sides.models) > 1 else 1.0)


def one_is_enough(body: Body, models: ModelsSpec, dt: float, touched: bool) -> float:
    """What FEM alone costs of XPBD alone while no tool is near, where FEM alone is never dearer than any cut that tools
    may ask for; inf where it may be [1].

    See `step_cost`. Of what a cut costs, all but the cells' own share is more than nothing, and that share is linear in
    the number of FEM's cells: so no cut costs less than one with but one of them, or all but one, and no seam.
    """
    n_cells, spec = body.n_cells, models.pbd
    force, matrix = DEARER.get(models.fem.element, UNMEASURED)
    fem = ITERATIONS * (ITERATION + force) + FACTORS * (ASSEMBLY + matrix)
    pbd = 8 * _block(body, spec) * substeps(body, spec, dt, touched)
    alone = CALL + n_cells * fem + FACTORS * FACTOR * (3 * body.n_nodes) ** 1.95
    if alone > EXCHANGES * (2.0 * CALL + min(fem + (n_cells - 1) * pbd, (n_cells - 1) * fem + pbd)):
        return math.inf
    round_one = not body.boxes or bool((body.fill < 1.0).any())  # cells of another shape may be of a round body
    resting = alone if round_one else CALL + n_cells * RESTING * (ITERATION + force)
    return resting / (CALL + n_cells * pbd)


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
