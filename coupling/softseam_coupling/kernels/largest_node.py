"""The greatest length of vectors."""

import numpy as np

from softseam_coupling.kept_kernels import njit


@njit(cache=True, error_model="numpy")
def largest_node(vector):
    """Largest Euclidean norm of the triples of a vector (3 s,); NaN if any entry is NaN."""
    largest = 0.0
    for i in range(0, vector.shape[0], 3):
        square = vector[i] * vector[i] + vector[i + 1] * vector[i + 1] + vector[i + 2] * vector[i + 2]
        if not np.isfinite(square):
            return np.nan
        largest = max(largest, square)
    return np.sqrt(largest)
