"""The constraint solve of one substep: contacts, then sweeps each followed by contacts."""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit

from .contact import project_contacts
from .crew import done, first_share, next_share, wait_for
from .damping import LEAST_KAPPA, begin_damping, damping_share, end_damping
from .hold import soften_held_blocks
from .monitor import batch_residuals, residual
from .sweep import sweep

LEAST = 4
"""batches that a thread takes at least"""


@njit(cache=True, error_model="numpy")
def sweep_together(ws, xw, blocks, stress, kappa, h, parts, rank, crew, before, stretch):
    """Project every block once; the batches parts[p] .. parts[p + 1] - 1 are one stretch, with no node in common.

    before (items) and stretch count up to this sweep; returns both after it.
    """
    for part in range(len(parts) - 1):
        begin, n = parts[part], parts[part + 1] - parts[part]
        first, end = first_share(crew, before, stretch, n, rank, LEAST)
        while first < end:
            sweep(
                *(ws, xw, blocks.nodes, blocks.volume, blocks.softness, stress, blocks.constants, blocks.law),
                *(kappa, h, begin + first, begin + end),
            )
            first, end = next_share(crew, stretch, rank, end - first, LEAST)
        before, stretch = before + n, stretch + 1
    return before, stretch


@njit(cache=True, error_model="numpy")
def relax(
    ws,
    xw,
    blocks,
    points,
    tools,
    contacts,
    stress,
    solve,
    substep,
    n_sweeps,
    kappa,
    h,
    parts,
    rank,
    crew,
    before,
    stretch,
):
    """Move xw from the prediction to the end of the substep; the other arguments are records.

    Contacts come first, because the carried contact force throws a point that has just stopped off its tool, and the
    blocks would answer to that; and they come last, so that no point ends inside a tool. Sweeps end when n_sweeps
    are done, or where `solve` says so. The softness of blocks that tools hold is updated in place, see `hold`.
    Returns before and stretch as they are then.
    """
    nodes, constants, law = blocks.nodes, blocks.constants, blocks.law
    share = damping_share(solve.stiffness_time, solve.lag, h, n_sweeps)
    blocks_h = h * np.sqrt(1.0 + share)
    if share > 0.0:
        kappa = max(kappa, LEAST_KAPPA)
    for round_ in range(n_sweeps + 1):
        if round_ > 0:
            before, stretch = sweep_together(
                ws, xw, blocks, stress, kappa, blocks_h, parts, rank, crew, before, stretch
            )
        elif share > 0.0:
            for part in range(len(parts) - 1):
                begin, n = parts[part], parts[part + 1] - parts[part]
                first, end = first_share(crew, before, stretch, n, rank, LEAST)
                while first < end:
                    begin_damping(
                        *(ws, xw, nodes, constants, law, share, h * h, solve.asked, solve.frame, stress),
                        *(begin + first, begin + end),
                    )
                    first, end = next_share(crew, stretch, rank, end - first, LEAST)
                before, stretch = before + n, stretch + 1
        if rank == 0:
            wait_for(crew, before)
            project_contacts(
                *(xw, points.indptr, points.node, points.weight, tools.kind, tools.shape, tools.friction),
                *(contacts.position[1], contacts.orientation[1], contacts.motion, h * h),
                *(contacts.start, contacts.rows, contacts.pairs),
            )
            if round_ < n_sweeps:
                soften_held_blocks(
                    *(nodes, points.inverse_mass, points.indptr, points.node, points.weight, contacts.start),
                    *(contacts.rows, contacts.pairs, contacts.held, contacts.held_blocks, blocks.softness),
                )
            done(crew, rank, 1)
        before += 1
        if solve.tolerance > 0.0 and 0 < round_:
            before, stretch = look_at_residual(
                ws, xw, blocks, stress, solve, substep, round_, rank, crew, before, stretch
            )
            if solve.used[substep] == round_:
                break
    if share > 0.0:
        first, end = first_share(crew, before, stretch, len(nodes), rank, LEAST)
        while first < end:
            end_damping(share, solve.asked, stress, first, end)
            first, end = next_share(crew, stretch, rank, end - first, LEAST)
        before, stretch = before + len(nodes), stretch + 1
    return before, stretch


@njit(cache=True, error_model="numpy")
def look_at_residual(ws, xw, blocks, stress, solve, substep, sweeps, rank, crew, before, stretch):
    """Note in solve.used where the blocks' stress is close enough to what their shapes ask for after so many sweeps.

    A thread that comes late finds what was noted for its substep, and stops after the same sweep. Returns before and
    stretch as they are then.
    """
    nodes = blocks.nodes
    first, end = first_share(crew, before, stretch, len(nodes), rank, LEAST)
    while first < end:
        batch_residuals(
            *(ws, xw, nodes, blocks.volume, stress, blocks.constants, blocks.law, first, end, solve.figures),
        )
        first, end = next_share(crew, stretch, rank, end - first, LEAST)
    before, stretch = before + len(nodes), stretch + 1
    wait_for(crew, before)
    if rank == 0:
        if residual(solve.figures)[0] <= solve.tolerance:
            solve.used[substep] = sweeps
        done(crew, rank, 1)
    before += 1
    wait_for(crew, before)
    return before, stretch
