"""What a step of a cut is expected to cost, so that a body is not split where one model is enough.

A model of the participants' work in microseconds of one core; only ratios are used. What a part costs an exchange, in a
grip, where most of a run's time goes, and while no tool is near, its solver's row says (`solvers.SOLVERS`); a call of
any costs CALL besides.

The choice must be the same on every machine and in every replay: so nothing is timed while a simulation runs, and the
constants were measured once (docs/decisions/06).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body
from softseam_services.orchestrator.parts import Parts
from softseam_services.solver_row import StepWork
from softseam_services.solvers import SOLVERS

CALL = 60.0
"""a call of a participant [us]"""
EXCHANGES = 2.0
"""solves of both parts in a step of a cut; fitted to the headline scenes"""


def step_cost(
    body: Body, parts: Parts, models: ModelsSpec, dt: float, touched: bool, coarse: NDArray[np.bool_]
) -> float:
    """Cost of one step of length dt [s] cut like this [us]; touched: there are tools; coarse (C,): cells that PBD takes
    as one block."""
    cost = 0.0
    for name, model in parts.models.items():
        cells = parts.cells[name]
        n_coarse = int(np.count_nonzero(coarse[cells]))
        work = StepWork(body, models, dt, touched, len(cells), n_coarse, parts.n_nodes[name], 3 * len(parts.seam))
        cost += CALL
        cost += SOLVERS[model].cost_of_cells(work)
        cost += SOLVERS[model].cost_of_equations(work)
    return cost * (EXCHANGES if len(parts.models) > 1 else 1.0)


def one_is_enough(body: Body, models: ModelsSpec, dt: float, touched: bool) -> float:
    """What the default model of near cells alone costs of that of far ones alone while no tool is near, where the first
    alone is never dearer than any cut that tools may ask for; inf where it may be [1].

    See `step_cost`. Of what a cut costs, all but the cells' own share is more than nothing, and that share is linear in
    the number of near cells: so no cut costs less than one with but one of them, or all but one, and no seam.
    """
    near, far, n_cells = SOLVERS[NEAR_DEFAULT], SOLVERS[FAR_DEFAULT], body.n_cells
    one, whole = (StepWork(body, models, dt, touched, n, n_nodes=body.n_nodes) for n in (1, n_cells))
    of_near, of_far = near.cost_of_cells(one), far.cost_of_cells(one)
    alone = CALL + near.cost_of_cells(whole) + near.cost_of_equations(whole)
    if alone > EXCHANGES * (2.0 * CALL + min(of_near + (n_cells - 1) * of_far, (n_cells - 1) * of_near + of_far)):
        return math.inf
    round_one = not body.boxes or bool((body.fill < 1.0).any())  # cells of another shape may be of a round body
    resting = alone if round_one else CALL + near.cost_at_rest(whole)
    return resting / (CALL + far.cost_at_rest(whole))
