"""The constraint solve of one substep: contacts, then sweeps each followed by contacts."""

from __future__ import annotations

from numba import njit

from .contact import project_contacts
from .pairs import anchor_pairs
from .sweep import sweep


@njit(cache=True, error_model="numpy")
def relax(
    ws,
    xw,
    x_prev,
    nodes,
    volume,
    softness,
    stress,
    constants,
    linear,
    node,
    weight,
    kind,
    shape,
    friction,
    position,
    orientation,
    position_prev,
    orientation_prev,
    pair_start,
    pair_rows,
    pairs,
    n_sweeps,
    kappa,
    h,
):
    """Move xw from the prediction to the end of the substep; arguments as in `sweep` and `project_contacts`.

    x_prev (n, 3) and the poses _prev are those at its start. Contacts come first, because the carried contact force
    throws a point that has just stopped off its tool, and the blocks would answer to that; and they come last, so that
    no point ends inside a tool.
    """
    anchor_pairs(
        x_prev,
        node,
        weight,
        kind,
        shape,
        position,
        orientation,
        position_prev,
        orientation_prev,
        h,
        pair_start,
        pair_rows,
        pairs,
    )
    for round_ in range(n_sweeps + 1):
        if round_ > 0:
            sweep(ws, xw, nodes, volume, softness, stress, constants, linear, kappa, h)
        project_contacts(
            xw,
            node,
            weight,
            kind,
            shape,
            friction,
            position,
            orientation,
            h * h,
            pair_start,
            pair_rows,
            pairs,
        )
