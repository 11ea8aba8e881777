"""The constraint solve of one substep: contacts, then sweeps each followed by contacts."""

import numpy as np

from softseam_services.jit import njit

from .contact import project_contacts
from .damping import LEAST_KAPPA, begin_damping, damping_share, end_damping
from .hold import soften_held_blocks
from .monitor import batch_residuals, residual
from .sweep import sweep
from .thread_team import done, first_range, next_range, wait_for

LEAST = 4
"""batches that a thread takes at least"""


@njit(cache=True, error_model="numpy")
def sweep_together(model, parameters, stress, scratch, kappa, h, parts, worker, team, before, stretch, ws):
    """Project every block once; the batches parts[p] .. parts[p + 1] - 1 are one stretch, with no node in common.

    before (items) and stretch count up to this sweep; returns both after it.
    """
    nodes, volume, constants, law = model.blocks, parameters.volume, parameters.constants, parameters.law
    for part in range(len(parts) - 1):
        begin, n = parts[part], parts[part + 1] - parts[part]
        first, end = first_range(team, before, stretch, n, worker, LEAST)
        while first < end:
            sweep(
                *(ws, scratch.xw, nodes, volume, scratch.softness, stress, constants, law),
                *(kappa, h, begin + first, begin + end),
            )
            first, end = next_range(team, stretch, worker, end - first, LEAST)
        before, stretch = before + n, stretch + 1
    return before, stretch


@njit(cache=True, error_model="numpy")
def begin_together(model, parameters, stress, scratch, share, h, parts, worker, team, before, stretch, ws):
    """`begin_damping` of all blocks, by the `damping_share` of a substep of h [s]. Returns before and stretch then."""
    for part in range(len(parts) - 1):
        begin, n = parts[part], parts[part + 1] - parts[part]
        first, end = first_range(team, before, stretch, n, worker, LEAST)
        while first < end:
            begin_damping(
                *(ws, scratch.xw, model.blocks, parameters.constants, parameters.law, share, h * h),
                *(scratch.asked, scratch.frame, stress),
                *(begin + first, begin + end),
            )
            first, end = next_range(team, stretch, worker, end - first, LEAST)
        before, stretch = before + n, stretch + 1
    return before, stretch


@njit(cache=True, error_model="numpy")
def end_together(model, stress, scratch, share, worker, team, before, stretch):
    """`end_damping` of all blocks. Returns before and stretch as they are then."""
    n = len(model.blocks)
    first, end = first_range(team, before, stretch, n, worker, LEAST)
    while first < end:
        end_damping(share, scratch.asked, stress, first, end)
        first, end = next_range(team, stretch, worker, end - first, LEAST)
    return before + n, stretch + 1


@njit(cache=True, error_model="numpy")
def sweep_round(model, parameters, stress, scratch, round_, share, h, parts, worker, team, before, stretch, ws):
    """What comes before the contacts of a round: a sweep, after the first round, where damping begins. Returns before
    and stretch as they are then."""
    if round_ > 0:
        kappa = max(parameters.kappa, LEAST_KAPPA) if share > 0.0 else parameters.kappa
        blocks_h = h * np.sqrt(1.0 + share)
        return sweep_together(
            model, parameters, stress, scratch, kappa, blocks_h, parts, worker, team, before, stretch, ws
        )
    if share > 0.0:
        return begin_together(model, parameters, stress, scratch, share, h, parts, worker, team, before, stretch, ws)
    return before, stretch


@njit(cache=True, error_model="numpy")
def relax(model, parameters, stress, scratch, substep, n_sweeps, h, parts, worker, team, before, stretch, ws):
    """Move scratch.xw from the prediction to the end of the substep, and stress (b, N_STRESS) with it.

    Contacts come first, because the carried contact force throws a point that has just stopped off its tool, and the
    blocks would answer to that; and they come last, so that no point ends inside a tool. Sweeps end when n_sweeps
    are done, or where the residual is below the tolerance. The softness of blocks that tools hold is updated in place,
    see `hold`. Returns before and stretch as they are then.
    """
    contacts = scratch.contacts
    share = damping_share(parameters.stiffness_time, parameters.lag, h, n_sweeps)
    for round_ in range(n_sweeps + 1):
        before, stretch = sweep_round(
            model, parameters, stress, scratch, round_, share, h, parts, worker, team, before, stretch, ws
        )
        if worker == 0:
            wait_for(team, before)
            project_contacts(model, parameters, contacts, scratch.xw, h * h, len(model.seam) > 0)
            if round_ < n_sweeps:
                soften_held_blocks(model, parameters, contacts, scratch.softness)
            done(team, worker, 1)
        before += 1
        if parameters.tolerance > 0.0 and 0 < round_:
            before, stretch = look_at_residual(
                model, parameters, stress, scratch, substep, round_, worker, team, before, stretch, ws
            )
            if scratch.used[substep] == round_:
                break
    if share > 0.0:
        before, stretch = end_together(model, stress, scratch, share, worker, team, before, stretch)
    return before, stretch


@njit(cache=True, error_model="numpy")
def look_at_residual(model, parameters, stress, scratch, substep, sweeps, worker, team, before, stretch, ws):
    """Note in scratch.used where the blocks' stress is close enough to what their shapes ask for after so many sweeps.

    A thread that comes late finds what was noted for its substep, and stops after the same sweep. Returns before and
    stretch as they are then.
    """
    nodes, volume, constants, law = model.blocks, parameters.volume, parameters.constants, parameters.law
    first, end = first_range(team, before, stretch, len(nodes), worker, LEAST)
    while first < end:
        batch_residuals(
            *(ws, scratch.xw, nodes, volume, stress, constants, law, first, end, scratch.figures),
        )
        first, end = next_range(team, stretch, worker, end - first, LEAST)
    before, stretch = before + len(nodes), stretch + 1
    wait_for(team, before)
    if worker == 0:
        if residual(scratch.figures)[0] <= parameters.tolerance:
            scratch.used[substep] = sweeps
        done(team, worker, 1)
    before += 1
    wait_for(team, before)
    return before, stretch
