"""Blocks whose nodes tools hold: less of their inverse mass counts in the blocks' local solve.

A block's local solve counts with the compliance of its own nodes (`block.node_softness`). Nodes that a tool holds do
not give way: where they count in full the solve takes too little of what is missing, D = 1/(1 + c k) of it, and stress
lags behind shape. A force k x that lags so gives a slow motion the energy that it should take: its damping is
(2 - 1/D) omega^2 h/2,                                                                                         (1)
which is implicit Euler's at D = 1 and negative below D = 1/2. So a node counts with `SHARE` of its inverse mass:
what sticks is held in all directions; what slides is held in one of three by each tool.
"""

import numpy as np

from softseam_services.jit import njit

from .lanes import LANES
from .pairs import EIGHT, HOLD, POINT

SHARE = (1.0, 0.874, 0.693, 0.3)
"""of its inverse mass that a node counts with which is held in d = 0 .. 3 directions: (1 - d/3)^(1/3), by the spectral
radius of a substep. With more of it substeps give energy, with 1 - d/3 and less they overshoot along the tool. What
sticks keeps some, for it may break loose"""
OWN = 0.5
"""share of a surface point's place from which on it holds a node"""


@njit(cache=True, error_model="numpy")
def find_held_blocks(model, parameters, contacts):
    """The blocks with a node that may be held by a pair of this step, once a step.

    Updates contacts.held_blocks (4 b + 1,): their count, then batch * 4 + lane of each; `held` (n + 8,) is scratch,
    zero before and after.
    """
    nodes, held, blocks = model.blocks, contacts.held, contacts.held_blocks
    blocks[0] = 0
    if contacts.start[len(contacts.start) - 1] == 0:
        return
    _mark(model, parameters, contacts, np.inf, 1)
    n_blocks = 0
    for batch in range(len(nodes)):
        for lane in range(LANES):
            most = 0
            for i in range(8):
                most = max(most, held[nodes[batch, i, lane]])
            if most > 0 and parameters.volume[batch, lane] > 0.0:
                n_blocks += 1
                blocks[n_blocks] = LANES * batch + lane
    blocks[0] = n_blocks
    _mark(model, parameters, contacts, np.inf, 0)


@njit(cache=True, error_model="numpy")
def _mark(model, parameters, contacts, clear, value):
    """contacts.held <- value for the nodes that the points of the groups stand for that are as `clear` at most [m]."""
    indptr, node, weight, rows, held = model.indptr, model.node, parameters.weight, contacts.rows, contacts.held
    for group in range(contacts.start[len(contacts.start) - 1]):
        if contacts.clear[group] > clear:
            continue
        for lane in range(EIGHT):
            point = rows[group, POINT + lane]
            if point >= 0:
                for entry in range(indptr[point], indptr[point + 1]):
                    if weight[entry] > OWN:
                        held[node[entry]] = value


@njit(cache=True, error_model="numpy")
def soften_held_blocks(model, parameters, contacts, softness):
    """softness (b, 4) of the held blocks by the contacts as they are now: 8 max w_i `SHARE`, updated in place."""
    nodes, indptr, node, weight = model.blocks, model.indptr, model.node, parameters.weight
    start, rows, pairs, clear = contacts.start, contacts.rows, contacts.pairs, contacts.clear
    held, blocks, inverse_mass = contacts.held, contacts.held_blocks, parameters.inverse_mass
    if blocks[0] == 0:
        return
    n_groups = start[len(start) - 1]
    for group in range(n_groups):
        if clear[group] > -np.inf:
            continue
        for lane in range(EIGHT):
            hold, point = int(pairs[group, EIGHT * HOLD + lane]), rows[group, POINT + lane]
            if point >= 0 and hold > 0:
                for entry in range(indptr[point], indptr[point + 1]):
                    if weight[entry] > OWN:
                        held[node[entry]] = min(3, held[node[entry]] + hold)
    for at in range(1, blocks[0] + 1):
        batch, lane = blocks[at] // LANES, blocks[at] % LANES
        most = 0.0
        for i in range(8):
            one = nodes[batch, i, lane]
            most = max(most, inverse_mass[one] * SHARE[held[one]])
        softness[batch, lane] = 8.0 * most
    _mark(model, parameters, contacts, -np.inf, 0)
