"""Stress in one number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def von_mises(cauchy: Floats) -> Floats:
    """von Mises stress sqrt(3/2 s:s) of Cauchy stresses xx yy zz yz xz xy (..., 6) [Pa]."""
    xx, yy, zz, yz, xz, xy = (cauchy[..., i] for i in range(6))
    return np.asarray(
        np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * (yz * yz + xz * xz + xy * xy))
    )
