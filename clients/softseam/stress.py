"""Invariants of Cauchy stress, ordered xx yy zz yz xz xy."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def von_mises(cauchy: Floats) -> Floats:
    """Von Mises stress sqrt(3/2 s:s), s = deviator of the stress (..., 6) ordered xx yy zz yz xz xy [Pa]."""
    xx, yy, zz, yz, xz, xy = np.moveaxis(cauchy, -1, 0)
    normal = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
    return np.asarray(np.sqrt(normal + 3.0 * (yz**2 + xz**2 + xy**2)))


def principal_stress(cauchy: Floats) -> Floats:
    """Eigenvalues, ascending, of stresses (..., 6) ordered xx yy zz yz xz xy: (..., 3) [Pa]."""
    full = cauchy[..., [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(*cauchy.shape[:-1], 3, 3)
    return np.asarray(np.linalg.eigvalsh(full), dtype=np.float64)
