"""What a pair of motion and resistance teaches a stiffness."""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit
from softseam_coupling.kernels.quasi_newton import multiply

CURVATURE = 1e-3
"""least stiffness that a pair may teach, relative to the model's [1]"""


@njit(cache=True, error_model="numpy")
def learn_stiffness(stiffness, moved, resisted):
    """BFGS: make stiffness (n, n), updated in place, map `moved` (n,) [m] to `resisted` (n,) [N]; it stays positive.

    S <- S - S s s^T S / (s^T S s) + y y^T / (y^T s), left alone where the pair says nothing (Nocedal & Wright,
    Numerical Optimization, 2006, eq. 6.19).
    """
    n = moved.shape[0]
    expected = np.empty(n)
    multiply(stiffness, moved, expected)
    energy = 0.0
    seen = 0.0
    for i in range(n):
        energy += moved[i] * expected[i]
        seen += moved[i] * resisted[i]
    if not (seen > CURVATURE * energy and energy > 0.0):
        return
    for i in range(n):
        forgotten = expected[i] / energy
        learned = resisted[i] / seen
        for j in range(n):
            stiffness[i, j] += learned * resisted[j] - forgotten * expected[j]
