"""Edges of the patches inside faces of blocks that tools with edges press, by which these are felt in part."""

from __future__ import annotations

from softseam_services.jit import njit
from softseam_services.tools.edged import PATCHES

from .pairs import follow


@njit(cache=True, error_model="numpy")
def find_patches(model, parameters, x, patch):
    """patch (p, 2, 3) [m] <- edges of the patch of each point inside a face, where nodes are at x (n, 3); in place.

    Points inside faces come face by face, and their neighbours are a patch's edge away.
    """
    if not parameters.places.any():
        return
    indptr, node, weight, first = model.indptr, model.node, parameters.weight, model.n_surface
    for point in range(first, len(patch)):
        number = (point - first) % PATCHES**2
        up, on = 1 - 2 * (number // PATCHES % 2), 1 - 2 * (number % 2)
        there, beside = point + PATCHES * up, point + on
        px, py, pz = follow(indptr[point], indptr[point + 1], node, weight, x)
        ux, uy, uz = follow(indptr[there], indptr[there + 1], node, weight, x)
        vx, vy, vz = follow(indptr[beside], indptr[beside + 1], node, weight, x)
        patch[point, 0, 0], patch[point, 0, 1], patch[point, 0, 2] = up * (ux - px), up * (uy - py), up * (uz - pz)
        patch[point, 1, 0], patch[point, 1, 1], patch[point, 1, 2] = on * (vx - px), on * (vy - py), on * (vz - pz)
