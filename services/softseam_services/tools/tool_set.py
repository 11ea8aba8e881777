"""Rigid tools as flat arrays: what both models touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PLANE, BOX, SPHERE = 0, 1, 2


@dataclass(frozen=True)
class ToolSet:
    """t tools in the scene's order. Poses change every step and travel in `ToolMotion`; this does not."""

    names: tuple[str, ...]
    kind: NDArray[np.int32]
    """PLANE, BOX or SPHERE (t,)"""
    shape: NDArray[np.float64]
    """unit normal of a plane, half edges of a box, (radius, 0, 0) of a sphere, in the tool's own frame (t, 3)"""
    friction: NDArray[np.float64]
    """Coulomb coefficients (t,)"""
    near: NDArray[np.bool_]
    """tools whose distance makes cells near (t,)"""
    position: NDArray[np.float64]
    """positions at time 0: centre, or a point of the plane (t, 3) [m]"""
    orientation: NDArray[np.float64]
    """unit quaternions w, x, y, z at time 0 (t, 4)"""
