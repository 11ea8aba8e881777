"""Copying without numba's checks of shapes, whose messages compile for seconds."""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def copy_rows(to, source):
    """to[i, j] <- source[i, j] for all rows and columns of source (n, m); `to` may have more."""
    for i in range(len(source)):
        for j in range(source.shape[1]):
            to[i, j] = source[i, j]
