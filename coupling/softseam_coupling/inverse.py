"""The inverse of a symmetric positive definite matrix, or word that it is too close to singular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

Floats = NDArray[np.float64]

__all__ = ["invert_definite"]


def invert_definite(matrix: Floats, least_rcond: float) -> Floats | None:
    """Symmetric inverse (n, n) by Cholesky; None where the matrix is not definite, or LAPACK's estimate of its
    reciprocal condition (in the 1-norm) is not above least_rcond. About twenty times as quick as eigenvectors."""
    norm = float(np.abs(matrix).sum(axis=0).max())
    # the lower triangle of a C-ordered matrix is the upper one of its transpose, which LAPACK takes without a copy
    factor, info = lapack.dpotrf(matrix.T, lower=0, clean=1)
    if info != 0:
        return None
    rcond, _ = lapack.dpocon(factor, norm, uplo="U")
    if not rcond > least_rcond:
        return None
    upper, _ = lapack.dpotri(factor, lower=0)
    inverse = upper + upper.T
    inverse.reshape(-1, order="A")[:: len(matrix) + 1] *= 0.5
    return np.ascontiguousarray(inverse)
