"""Rigid tools as flat arrays: what both models touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.recording import ToolSurface

PLANE, BOX, SPHERE, CAPSULE, CYLINDER, MESH = 0, 1, 2, 3, 4, 5


@dataclass(frozen=True)
class ToolSet:
    """t tools in the scene's order. Poses change every step and travel in `ToolMotion`; this does not."""

    names: tuple[str, ...]
    kind: NDArray[np.int32]
    """PLANE, BOX, SPHERE, CAPSULE, CYLINDER or MESH (t,)"""
    shape: NDArray[np.float64]
    """unit normal of a plane, half edges of a box, (radius, 0, 0) of a sphere, (radius, half length, 0) of a capsule or
    cylinder along z, in the tool's own frame (t, 3) [m]; with a mesh among them rows are as long as its, `kernels.grid`
    says what it holds, and the others end in zeros"""
    friction: NDArray[np.float64]
    """Coulomb coefficients (t,)"""
    near: NDArray[np.bool_]
    """tools whose distance makes cells near (t,)"""
    position: NDArray[np.float64]
    """positions at time 0: centre, or a point of the plane (t, 3) [m]"""
    orientation: NDArray[np.float64]
    """unit quaternions w, x, y, z at time 0 (t, 4)"""
    outline: tuple[NDArray[np.float64], ...] = ()
    """points (n, 3) of each tool's surface in its own frame, as many as tell where it is; none for a plane [m]"""
    surfaces: Mapping[str, ToolSurface] = field(default_factory=dict)
    """of tools that are meshes, by their names"""
