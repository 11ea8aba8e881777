"""The matrix of contact: eq. (2) of kernels/contact.py of each touching point, W^T D W in the nodes that it follows,
and eq. (4) there on a patch under edges.

Points of an embedded surface come cell by cell, and many of them share one: with W (q, 27) the weights of up to BATCH
of them, the entries (k, l) of the blocks of all pairs of nodes are W^T diag(D_kl) W, six products of matrices, or one
where every D is r I, added to the panels once.
"""

import numpy as np

from softseam_services.jit import njit

from .contact import coefficient
from .contact_columns import EDGED, GAP, NORMAL, OPEN, PRESSURE, RELAXED, SLIP, SLOPE, SPREAD, STICK, TRACTION, TRIAL
from .fronts import LANES, add_block, add_block_row
from .lapack import product

BATCH = 64
"""points of a cell that are multiplied at once"""
N = 27
# columns of work.factored_patch
LEANS, SPREADS = 3, 5
_FIRST, _SECOND = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
"""k and l of the six products"""


@njit(cache=True, error_model="numpy")
def add_contact_tangents(model, parameters, tree, count, ahead, work):
    """Add what every touching candidate resists with to work.values, updated in place; returns for how many.

    ahead [m]: open candidates closer than that are taken to stick, so that the factor is still good when they touch;
    and so are those that touch by work.factored_state, the last factor's: they may open and close by turns. Patches
    under edges are not, for these touch by and by.
    """
    work.factored[:] = 0.0
    added = gathered = 0
    cell_of = -1
    for c in range(count):
        point, tool = work.pair[c, 0], work.pair[c, 1]
        kept = work.factored_state[point, tool] != OPEN
        work.factored_state[point, tool] = work.state[c]
        if work.state[c] == OPEN:
            if not kept and (work.side[c] == EDGED or work.contact[c, GAP] > ahead):
                continue
            work.factored_state[point, tool] = STICK
        added += 1
        block = work.factored[point, tool]
        work.factored_patch[point, tool] = 0.0
        _resist(c, coefficient(parameters, point, tool), work, block)
        cell = model.point_cell[point]
        if work.side[c] == EDGED:
            _keep_patch(c, work, work.factored_patch[point, tool])
        if model.point_face[point] != SPREAD:
            _add_point(model, parameters, tree, point, block, work.factored_patch[point, tool], work)
            continue
        if gathered == BATCH or (gathered > 0 and cell != cell_of):
            _add_points(tree, cell_of, gathered, work)
            gathered = 0
        cell_of = cell
        _gather(model, parameters, tree, point, block, gathered, work)
        gathered += 1
    if gathered > 0:
        _add_points(tree, cell_of, gathered, work)
    return added


@njit(cache=True, error_model="numpy")
def _resist(c, friction, work, block):
    """block (3, 3) <- eq. (2) of a candidate."""
    row = work.contact[c]
    tangential = work.hold[c, 0]
    relaxed = 0.0
    if work.state[c] == SLIP:
        traction = friction * row[PRESSURE]
        tangential *= traction / row[TRIAL]
        relaxed = tangential * row[RELAXED] / (traction * traction) if traction > 0.0 else 0.0
    for i in range(3):
        for j in range(3):
            block[i, j] = (row[SLOPE] - tangential) * row[NORMAL + i] * row[NORMAL + j]
            block[i, j] -= relaxed * row[TRACTION + i] * row[TRACTION + j]
        block[i, i] += tangential


@njit(cache=True, error_model="numpy")
def _keep_patch(c, work, kept):
    """kept <- how a candidate's patch resists: a row of work.factored_patch."""
    row = work.contact[c]
    root = np.sqrt(row[SLOPE])
    for i in range(3):
        kept[i] = root * row[NORMAL + i]
    kept[LEANS], kept[LEANS + 1] = work.lean[c, 0], work.lean[c, 1]
    for i in range(5):
        kept[SPREADS + i] = work.spread[c, i]


@njit(cache=True, error_model="numpy")
def _add_point(model, parameters, tree, point, block, patch, work):
    """Add the block of one point, pair by pair of its nodes; patch: its row of work.factored_patch, 0 where it has
    none."""
    cell, pair = model.point_cell[point], np.empty((3, 3))
    for a in range(model.point_ptr[point], model.point_ptr[point + 1]):
        rank_a = tree.cell_rank[cell, model.point_local[a]]
        if rank_a >= tree.cell_free[cell]:
            continue
        for b in range(model.point_ptr[point], model.point_ptr[point + 1]):
            rank_b = tree.cell_rank[cell, model.point_local[b]]
            if rank_a <= rank_b < tree.cell_free[cell]:
                across = patch_weight(a, parameters, patch) * patch_weight(b, parameters, patch)
                along = _spread_weight(a, b, parameters, patch) - across
                for i in range(3):
                    for j in range(3):
                        pair[i, j] = across * block[i, j] + along * patch[i] * patch[j]
                add_block(tree, work.values, cell, rank_a, rank_b, 1.0, pair)


@njit(cache=True, error_model="numpy", forceinline=True)
def patch_weight(entry, parameters, patch):
    """Weight of a node where the force acted, by a row of work.factored_patch."""
    tilt = parameters.point_tilt
    return parameters.point_weight[entry] + patch[LEANS] * tilt[entry, 0] + patch[LEANS + 1] * tilt[entry, 1]


@njit(cache=True, error_model="numpy", forceinline=True)
def _spread_weight(a, b, parameters, patch):
    """Of two nodes: eq. (4) of kernels/contact.py, by a row of work.factored_patch."""
    tilt = parameters.point_tilt
    s, t = patch[SPREADS], patch[SPREADS + 1]
    of_a = parameters.point_weight[a] + s * tilt[a, 0] + t * tilt[a, 1]
    of_b = parameters.point_weight[b] + s * tilt[b, 0] + t * tilt[b, 1]
    of_turns = patch[SPREADS + 2] * tilt[a, 0] * tilt[b, 0] + patch[SPREADS + 4] * tilt[a, 1] * tilt[b, 1]
    return of_a * of_b + of_turns + patch[SPREADS + 3] * (tilt[a, 0] * tilt[b, 1] + tilt[a, 1] * tilt[b, 0])


@njit(cache=True, error_model="numpy")
def _gather(model, parameters, tree, point, block, place, work):
    """Weights of a point in its cell's order of elimination, and its block, to this place of the batch."""
    cell, weights, blocks = model.point_cell[point], work.gathered, work.gathered_block
    for a in range(N):
        weights[N * place + a] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        weights[N * place + tree.cell_rank[cell, model.point_local[entry]]] = parameters.point_weight[entry]
    for each in range(6):
        blocks[place, each] = block[_FIRST[each], _SECOND[each]]


@njit(cache=True, error_model="numpy")
def _add_points(tree, cell, count, work):
    """Add the batch to the panels of its cell."""
    weights, blocks, scaled, products, row = (
        work.gathered, work.gathered_block, work.gathered_scaled, work.gathered_product, work.row,
    )  # fmt: skip
    alike = True
    for place in range(count):
        b = blocks[place]
        alike = alike and b[0] == b[1] == b[2] and b[3] == 0.0 and b[4] == 0.0 and b[5] == 0.0
    for each in range(1 if alike else 6):
        for place in range(count):
            factor = blocks[place, each]
            for a in range(N):
                scaled[N * place + a] = factor * weights[N * place + a]
        product(N, N, count, 1, weights, 0, N, scaled, 0, N, True, False, products, N * N * each, N, work.ints)
    for a in range(tree.cell_free[cell]):
        for entry in range(9 * LANES):
            row[entry] = 0.0
        for each in range(1 if alike else 6):
            k, l = _FIRST[each], _SECOND[each]  # noqa: E741 as in the equation
            at = N * N * each + N * a
            for b in range(a, N):
                value = products[at + b]
                row[(3 * k + l) * LANES + b] = value
                row[(3 * l + k) * LANES + b] = value
                if alike:
                    row[4 * LANES + b] = row[8 * LANES + b] = value
        add_block_row(tree, work.values, cell, a, row, LANES)
