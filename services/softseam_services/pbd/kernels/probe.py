"""Response of a region to small forces on its seam, column by column, by the same sweeps as the step's."""

import numpy as np

from softseam_services.jit import njit

from .contact import begin_pairs, let_slide
from .damping import damping_share, note_shapes
from .hold import find_held_blocks
from .lanes import copy_rows
from .pairs import find_pairs, place_points
from .relax import relax
from .substep import finish, predict
from .sweep import exact_stress
from .tool_motion import tool_motions


@njit(cache=True, error_model="numpy")
def begin_probes(model, parameters, start, inputs, scratch, hh, ws):
    """Stress of the shapes in start.x into start.stress, contacts there, and tools that stand still.

    What friction holds at its bound slides: under a probe that pulls it back it would stick, but a step's forces push
    it on, and it goes much farther than a response says in which it sticks.
    """
    contacts, xw = scratch.contacts, scratch.xw
    copy_rows(xw, start.x)
    exact_stress(ws, xw, model.blocks, parameters.volume, start.stress, parameters.constants, parameters.law)
    place_points(model, parameters, xw, contacts.point_x)
    copy_rows(scratch.softness, parameters.softness)
    contacts.ahead[:] = 0.0
    find_pairs(model, parameters, start, inputs, contacts, 0.0, hh)
    contacts.clear[:] = -np.inf
    find_held_blocks(model, parameters, contacts)
    for now in range(2):
        copy_rows(contacts.position[now], inputs.position)
        copy_rows(contacts.orientation[now], inputs.orientation)
    tool_motions(inputs.position, inputs.orientation, inputs.position, inputs.orientation, contacts.motion)
    let_slide(model, parameters, contacts, xw)


@njit(cache=True, error_model="numpy", nogil=True)
def probe_seam(model, parameters, start, state, inputs, scratch, probing, dt, n_substeps, n_sweeps, ramp, probe, ws):
    """compliance[:, c] = (seam x after a step under `probe` [N] in component c - the same without it)/probe.

    c from probing.columns[0] to before probing.columns[1]; no column depends on another.

    start, state  where the probes start, of which x and force say where that is, and where they are
    ramp          of the seam's velocities, under a probe that grows from nothing with the substeps [m/(N s)]

    ways[c] likewise, of x and v of every node, and last of what lies beyond: the mean of the nodes `edge` (e,) by
    `share_of_edge` (e,). compliance (3s, 3s) [m/N] and ways (3s, 2, n + 1, 3) [m/N, m/s/N] of `probing` are
    overwritten in these columns, ways unless it is empty.
    """
    contacts, xw, push, seam = scratch.contacts, scratch.xw, scratch.push, model.seam
    nodes, volume, constants, law = model.blocks, parameters.volume, parameters.constants, parameters.law
    x, v, a, stress, compliance, ways = state.x, state.v, state.a, state.stress, probing.compliance, probing.ways
    edge, share_of_edge = probing.edge, probing.share_of_edge
    n = len(x)
    h = dt / n_substeps
    keep = np.exp(-parameters.mass_rate * h)
    damped = damping_share(parameters.stiffness_time, parameters.lag, h, n_sweeps)
    begin_probes(model, parameters, start, inputs, scratch, h * h, ws)
    pairs_start = contacts.pairs.copy()
    push[:] = 0.0
    rest = np.zeros((2, n, 3))
    first, last = probing.columns
    for place in range(first - 1, last):
        column = place if place >= first else -1
        copy_rows(x, start.x)
        copy_rows(xw, start.x)
        v[:] = 0.0
        a[:] = 0.0
        copy_rows(stress, start.stress)
        copy_rows(contacts.pairs, pairs_start)
        for substep in range(n_substeps):
            if column >= 0:
                share = (substep + 1) / n_substeps if ramp else 1.0
                push[seam[column // 3], column % 3] = share * probe * xw[seam[column // 3], 3]
            begin_pairs(model, parameters, contacts, xw, a, h)
            if damped > 0.0:
                note_shapes(ws, xw, nodes, volume, constants, law, scratch.asked, scratch.frame, 0, len(nodes))
            predict(xw, scratch.x_star, x, v, a, push, keep, h, 0, n)
            relax(model, parameters, stress, scratch, 0, n_sweeps, h, probing.parts, 0, probing.team, 0, 0, ws)
            finish(xw, scratch.x_star, x, v, a, h, 0, n)
        if column < 0:
            copy_rows(rest[0], x)
            copy_rows(rest[1], v)
            continue
        push[seam[column // 3], column % 3] = 0.0
        for row in range(3 * len(seam)):
            i, c = seam[row // 3], row % 3
            end = v[i, c] if ramp else x[i, c]
            compliance[row, column] = (end - rest[1 if ramp else 0, i, c]) / probe
        if len(ways) > 0:
            for which in range(2):
                at = x if which == 0 else v
                way = ways[column, which]
                for i in range(n):
                    for c in range(3):
                        way[i, c] = (at[i, c] - rest[which, i, c]) / probe
                for c in range(3):
                    way[n, c] = 0.0
                    for e in range(len(edge)):
                        way[n, c] += share_of_edge[e] * way[edge[e], c]
