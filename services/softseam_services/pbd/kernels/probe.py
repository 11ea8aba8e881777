"""Response of the seam to small forces on it, column by column, by the same sweeps as the step's."""

from __future__ import annotations

import numpy as np
from numba import njit

from .block import N_STRESS
from .contact import begin_pairs
from .damping import damping_share, note_shapes
from .hold import find_held_blocks
from .pairs import N_ROWS, WIDTH, find_pairs, place_points
from .relax import relax
from .substep import finish, predict
from .sweep import exact_stress
from .tool_motion import tool_motions


@njit(cache=True, error_model="numpy", nogil=True)
def probe_seam(
    x_start,
    ws,
    xw,
    nodes,
    volume,
    inverse_mass,
    softness,
    constants,
    law,
    indptr,
    node,
    weight,
    point_softness,
    force_start,
    kind,
    shape,
    friction,
    position,
    orientation,
    seam,
    probe,
    solve,
    dt,
    n_substeps,
    n_sweeps,
    kappa,
    parts,
    crew,
    compliance,
):
    """compliance[:, c] = (seam x after a step under `probe` [N] in component c - the same without it)/probe.

    compliance (3s, 3s) [m/N] is updated in place; `crew` says alone; the other shapes are those of `advance_step`.
    """
    n = len(x_start)
    n_points = len(force_start)
    h = dt / n_substeps
    keep, share = np.exp(-solve.mass_rate * h), damping_share(solve.stiffness_time, h)
    stress_start = np.zeros((len(nodes), N_STRESS))
    for i in range(n):
        for c in range(3):
            xw[i, c] = x_start[i, c]
    exact_stress(ws, xw, nodes, volume, stress_start, constants, law)
    point_x = np.zeros((n_points, 3))
    place_points(xw, indptr, node, weight, point_x)
    active = np.ones(n_points, dtype=np.bool_)
    start = np.zeros(len(kind) + 1, dtype=np.int32)
    rows = np.zeros((n_points * len(kind), N_ROWS), dtype=np.int32)
    pairs_start = np.zeros((n_points * len(kind), WIDTH))
    find_pairs(
        kind,
        shape,
        position,
        orientation,
        point_x,
        active,
        indptr,
        node,
        weight,
        point_softness,
        force_start,
        np.zeros_like(force_start),
        0.0,
        h * h,
        n,
        np.empty(n, dtype=np.int32),
        start,
        rows,
        pairs_start,
    )
    held = np.zeros(n + 8, dtype=np.int32)
    held_blocks = np.zeros(volume.size + 1, dtype=np.int32)
    find_held_blocks(nodes, volume, indptr, node, weight, start, rows, held, held_blocks)
    pairs = np.empty_like(pairs_start)
    motion = np.zeros((2, len(kind), 12))
    tool_motions(position, orientation, position, orientation, motion)
    x = np.empty((n, 3))
    v = np.empty((n, 3))
    a = np.empty((n, 3))
    x_star = np.empty((n, 3))
    push = np.zeros((n, 3))
    stress = np.empty_like(stress_start)
    base = np.zeros(3 * len(seam))
    for column in range(-1, 3 * len(seam)):
        x[:] = x_start
        xw[:n, :3] = x_start
        v[:] = 0.0
        a[:] = 0.0
        stress[:] = stress_start
        pairs[:] = pairs_start
        if column >= 0:
            push[seam[column // 3], column % 3] = probe * xw[seam[column // 3], 3]
        for _ in range(n_substeps):
            begin_pairs(xw, indptr, node, weight, kind, shape, position, orientation, h, start, rows, pairs)
            if share > 0.0:
                note_shapes(ws, xw, nodes, volume, constants, law, solve.asked, solve.frame, 0, len(nodes))
            predict(xw, x_star, x, v, a, push, keep, h, 0, n)
            relax(
                ws,
                xw,
                nodes,
                volume,
                softness,
                stress,
                constants,
                law,
                indptr,
                node,
                weight,
                kind,
                shape,
                friction,
                position,
                orientation,
                motion,
                start,
                rows,
                pairs,
                inverse_mass,
                held,
                held_blocks,
                solve,
                0,
                n_sweeps,
                kappa,
                h,
                parts,
                0,
                crew,
                0,
                0,
            )
            finish(xw, x_star, x, v, a, h, 0, n)
        for row in range(3 * len(seam)):
            moved = x[seam[row // 3], row % 3]
            if column < 0:
                base[row] = moved
            else:
                compliance[row, column] = (moved - base[row]) / probe
        if column >= 0:
            push[seam[column // 3], column % 3] = 0.0
