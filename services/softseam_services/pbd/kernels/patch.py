"""Edges of the patches inside faces of blocks that tools with edges press, by which these are felt in part."""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def find_patches(model, parameters, x, patch):
    """patch (p, 2, 3) [m] <- edges of the patch of each point inside a face, where nodes are at x (n, 3); in place."""
    if not parameters.places.any():
        return
    indptr, node, tilt = model.indptr, model.node, parameters.tilt
    for point in range(model.n_surface, len(patch)):
        patch[point] = 0.0
        for entry in range(indptr[point], indptr[point + 1]):
            i = node[entry]
            for c in range(3):
                patch[point, 0, c] += tilt[entry, 0] * x[i, c]
                patch[point, 1, c] += tilt[entry, 1] * x[i, c]
