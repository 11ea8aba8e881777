"""How well each way to predict a step would have done, and the step among the kept ones."""

import numpy as np

from softseam_coupling.kept_kernels import njit


@njit(cache=True, error_model="numpy")
def predict(weights, kept):
    """Sum of the kept vectors (k, m) by weights (k,); those of weight zero are left out (m,)."""
    found = np.zeros(kept.shape[1])
    for step in range(len(weights)):
        weight = weights[step]
        if weight != 0.0:
            for i in range(len(found)):
                found[i] += weight * kept[step, i]
    return found


@njit(cache=True, error_model="numpy")
def score(weights, n_ways, memory, kept, came, errors):
    """Score the first ways on what a step came to (m,), before that becomes the first of the kept vectors (k, m).

    weights  (w, k) [1]
    memory   share of a mean square error that is left a step later [1]
    errors   mean squares (w,), inf of ways that were never scored
    """
    for way in range(n_ways):
        miss = predict(weights[way], kept)
        square = 0.0
        for i in range(len(came)):
            square += (miss[i] - came[i]) ** 2
        errors[way] = memory * errors[way] + (1.0 - memory) * square if np.isfinite(errors[way]) else square
    for step in range(len(kept) - 1, 0, -1):
        kept[step] = kept[step - 1]
    kept[0] = came
