"""Response of a region to small forces on its seam, column by column, by the same sweeps as the step's."""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit

from .block import N_STRESS
from .contact import begin_pairs
from .copy_rows import copy_rows
from .damping import damping_share, note_shapes
from .hold import find_held_blocks
from .pairs import find_pairs, place_points
from .relax import relax
from .substep import finish, predict
from .sweep import exact_stress
from .tool_motion import tool_motions


@njit(cache=True, error_model="numpy", nogil=True)
def probe_seam(
    x_start,
    force_start,
    blocks,
    points,
    tools,
    contacts,
    solve,
    xw,
    position,
    orientation,
    seam,
    probe,
    dt,
    n_substeps,
    n_sweeps,
    kappa,
    ramp,
    parts,
    crew,
    ws,
    edge,
    share_of_edge,
    compliance,
    ways,
):
    """compliance[:, c] = (seam x after a step under `probe` [N] in component c - the same without it)/probe.

    ramp: of the seam's velocities, under a probe that grows from nothing with the substeps [m/(N s)].
    ways[c] likewise, of x and v of every node, and last of what lies beyond: the mean of the nodes `edge` (e,) by
    `share_of_edge` (e,). compliance (3s, 3s) [m/N] and ways (3s, 2, n + 1, 3) [m/N, m/s/N] are updated in place, ways
    unless it is empty; `crew` says alone; the other shapes are those of `advance_step`.
    """
    nodes, volume, constants, law = blocks.nodes, blocks.volume, blocks.constants, blocks.law
    indptr, node, weight = points.indptr, points.node, points.weight
    kind, shape, motion = tools.kind, tools.shape, contacts.motion
    n = len(x_start)
    h = dt / n_substeps
    keep, damped = np.exp(-solve.mass_rate * h), damping_share(solve.stiffness_time, solve.lag, h, n_sweeps)
    stress_start = np.zeros((len(nodes), N_STRESS))
    for i in range(n):
        for c in range(3):
            xw[i, c] = x_start[i, c]
    exact_stress(ws, xw, nodes, volume, stress_start, constants, law)
    point_x = np.zeros((len(force_start), 3))
    place_points(xw, indptr, node, weight, point_x)
    copy_rows(blocks.softness, blocks.softness_free)
    newest = np.empty(n, dtype=np.int32)
    find_pairs(
        *(
            kind,
            shape,
            tools.reach,
            position,
            orientation,
            point_x,
            points.active,
            indptr,
            node,
            weight,
            points.softness,
        ),
        *(force_start, np.zeros_like(force_start), points.side, points.soft, 0.0, h * h, n, newest),
        *(contacts.start, contacts.rows, contacts.pairs),
    )
    find_held_blocks(
        nodes, volume, indptr, node, weight, contacts.start, contacts.rows, contacts.held, contacts.held_blocks
    )
    pairs_start = contacts.pairs.copy()
    for now in range(2):
        copy_rows(contacts.position[now], position)
        copy_rows(contacts.orientation[now], orientation)
    tool_motions(position, orientation, position, orientation, motion)
    x = np.empty((n, 3))
    v = np.empty((n, 3))
    a = np.empty((n, 3))
    x_star = np.empty((n, 3))
    push = np.zeros((n, 3))
    stress = np.empty_like(stress_start)
    rest = np.zeros((2, n, 3))
    for column in range(-1, 3 * len(seam)):
        copy_rows(x, x_start)
        copy_rows(xw, x_start)
        v[:] = 0.0
        a[:] = 0.0
        copy_rows(stress, stress_start)
        copy_rows(contacts.pairs, pairs_start)
        for substep in range(n_substeps):
            if column >= 0:
                share = (substep + 1) / n_substeps if ramp else 1.0
                push[seam[column // 3], column % 3] = share * probe * xw[seam[column // 3], 3]
            begin_pairs(
                *(xw, indptr, node, weight, kind, shape, position, orientation, h),
                *(contacts.start, contacts.rows, contacts.pairs),
            )
            if damped > 0.0:
                note_shapes(ws, xw, nodes, volume, constants, law, solve.asked, solve.frame, 0, len(nodes))
            predict(xw, x_star, x, v, a, push, keep, h, 0, n)
            relax(
                *(ws, xw, blocks, points, tools, contacts, stress, solve, 0, n_sweeps, kappa, h),
                *(parts, 0, crew, 0, 0),
            )
            finish(xw, x_star, x, v, a, h, 0, n)
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
                state = x if which == 0 else v
                way = ways[column, which]
                for i in range(n):
                    for c in range(3):
                        way[i, c] = (state[i, c] - rest[which, i, c]) / probe
                for c in range(3):
                    way[n, c] = 0.0
                    for place in range(len(edge)):
                        way[n, c] += share_of_edge[place] * way[edge[place], c]
