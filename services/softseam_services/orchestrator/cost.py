"""What a step of a cut is expected to cost, so that a body is not split where one model is enough.

A model of the two participants' work in microseconds of one core; only ratios are used. Per exchange, in a grip, where
most of a run's time goes:

  FEM   ITERATIONS of forces and a solve, and FACTORS factorisations: the cells' matrices, nested dissection of the
        region (times of the order of its unknowns to the power 1.95, fitted from 216 to 3993 unknowns) and the dense
        front of the seam's unknowns
  PBD   eight blocks a cell in each substep of the wave-speed rule

and CALL for a call of either. The choice must be the same on every machine and in every replay: so nothing is timed
while a simulation runs, and the constants were measured once (docs/decisions/0029).
"""

from __future__ import annotations

import math

from softseam_services.body.body import Body
from softseam_services.orchestrator.sides import Sides

CALL = 60.0
"""a call of a participant [us]"""
EXCHANGES = 2.0
"""solves of both sides in a step of a cut; fitted to the headline scenes"""
ITERATIONS, ITERATION = 5.0, 4.4
"""Newton iterations an exchange; one costs so much a cell [us]"""
FACTORS, ASSEMBLY = 0.45, 9.4
"""factorisations an exchange; the matrix costs so much a cell [us]"""
FACTOR = 100.0 / 375.0**1.95
"""factor of n unknowns: FACTOR n^1.95 [us]"""
DENSE = 1.0 / 3.0 / 15e3
"""dense factor of n unknowns: DENSE n^3 [us], at 15 GFLOP/s"""
BLOCK = 0.1
"""a block of PBD and substep [us]"""
COURANT = 0.9
"""c_p h / dx of the substep rule"""


def step_cost(body: Body, sides: Sides, dt: float) -> float:
    """Cost of one step of length dt [s] cut like this [us]."""
    seam = 3 * len(sides.seam)
    cost = 0.0
    for name, model in sides.models.items():
        n_cells = len(sides.cells[name])
        cost += CALL
        if model == "fem":
            cost += n_cells * (ITERATIONS * ITERATION + FACTORS * ASSEMBLY)
            cost += FACTORS * (FACTOR * (3 * sides.n_nodes[name]) ** 1.95 + DENSE * seam**3)
        else:
            cost += 8 * n_cells * BLOCK * substeps(body, dt)
    return cost * (EXCHANGES if len(sides.models) > 1 else 1.0)


def substeps(body: Body, dt: float) -> int:
    """Substeps of the wave-speed rule, h <= COURANT dx / c_p with dx the least edge of a block."""
    return max(1, math.ceil(dt * body.material.wave_speed / (COURANT * 0.5 * float(body.edges.min()))))
