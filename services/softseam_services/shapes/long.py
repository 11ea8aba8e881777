"""What capsules and cylinders have alike."""

import numpy as np

from softseam_services.body.body import Floats

_AROUND = 16


def around(radius: float, half: float, end: float) -> Floats:
    """Rings around the side, from -half to half along z, the two ends, and the middle (n, 3) [m]."""
    turn = 2.0 * np.pi / _AROUND * np.arange(_AROUND)
    ring = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    levels = [ring + z * up for z in half * np.linspace(-1.0, 1.0, 5)]
    return np.concatenate([*levels, end * up[None], -end * up[None], 0.0 * up[None]])


def ends(radius: float, half: float) -> Floats:
    """Balls about both ends of the axis (2, 4) [m]."""
    return np.array([[0.0, 0.0, -half, radius], [0.0, 0.0, half, radius]])
