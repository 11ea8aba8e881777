"""The constraint solve of one substep: contacts, then sweeps each followed by contacts."""

from __future__ import annotations

from numba import njit

from .contact import project_contacts
from .sweep import sweep


@njit(cache=True, error_model="numpy")
def relax(
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
    pair_start,
    pair_rows,
    pairs,
    n_sweeps,
    kappa,
    h,
):
    """Move xw from the prediction to the end of the substep; arguments as in `sweep` and `project_contacts`.

    Contacts come first, because the carried contact force throws a point that has just stopped off its tool, and the
    blocks would answer to that; and they come last, so that no point ends inside a tool.
    """
    for round_ in range(n_sweeps + 1):
        if round_ > 0:
            sweep(ws, xw, nodes, volume, softness, stress, constants, law, kappa, h)
        project_contacts(
            xw,
            indptr,
            node,
            weight,
            kind,
            shape,
            friction,
            position,
            orientation,
            motion,
            h * h,
            pair_start,
            pair_rows,
            pairs,
        )
