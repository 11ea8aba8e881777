"""Rigid tools as flat arrays: what both models touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.recording import ToolSurface
from softseam_services.shapes.branches import BOX
from softseam_services.shapes.geometry import ROUNDEST, Geometry

FEWEST, MOST = 4, 12
"""places in which a patch looks at a tool, along each of its edges"""


@dataclass(frozen=True)
class ToolSet:
    """t tools in the scene's order. Poses change every step and travel in `ToolMotion`; this does not."""

    names: tuple[str, ...]
    kind: NDArray[np.int64]
    """by which kernels know the shapes: one of `shapes.branches`, or the address of a distance from outside (t,)"""
    shape: NDArray[np.float64]
    """numbers of each shape (t, w); rows are as long as the longest, the others end in zeros"""
    reach: NDArray[np.float64]
    """radius of a ball about each tool's position that holds it, infinite for a plane (t,) [m]"""
    friction: NDArray[np.float64]
    """Coulomb coefficients (t,)"""
    followed: NDArray[np.bool_]
    """tools whose distance makes cells near (t,)"""
    position: NDArray[np.float64]
    """positions at time 0: centre, or a point of the plane (t, 3) [m]"""
    orientation: NDArray[np.float64]
    """unit quaternions w, x, y, z at time 0 (t, 4)"""
    geometry: tuple[Geometry, ...]
    """of each tool, in its own frame"""
    patch: float = 0.0
    """longest edge of a patch of the body that feels them, 0 where none has patches [m]"""

    @cached_property
    def sameness(self) -> NDArray[np.float64]:
        """What turns and reflections leave each shape as it is, see `Sameness.row`; NaN where that is not known
        (t, 6)"""
        rows = [np.full(6, np.nan) if each.sameness is None else each.sameness.row for each in self.geometry]
        return np.array(rows).reshape(-1, 6)

    @cached_property
    def thin(self) -> list[float]:
        """Half of each tool's thickness, infinite for planes and meshes (t,) [m]"""
        return [
            float(numbers[:3].min() if kind == BOX else each.core[:, 3].min(initial=np.inf))
            for kind, numbers, each in zip(self.kind, self.shape, self.geometry, strict=True)
        ]

    @cached_property
    def half_width(self) -> NDArray[np.float64]:
        """As of each one's geometry (t,) [m]"""
        return np.array([each.half_width for each in self.geometry])

    @cached_property
    def bends(self) -> NDArray[np.float64]:
        """As of each one's geometry (t,) [1]"""
        return np.array([each.bends for each in self.geometry])

    @cached_property
    def wall(self) -> NDArray[np.float64]:
        """As of each one's geometry (t,) [m]"""
        return np.array([each.wall for each in self.geometry])

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """In how many places along each edge of a patch a tool with edges is looked at, two on the thickness of its
        walls; 0: it has no edges (t,)"""
        edged = np.array([each.rounded is not None and each.bends < 1.0 for each in self.geometry], dtype=np.bool_)
        return np.where(edged, np.clip(np.ceil(2.0 * self.patch / self.wall), FEWEST, MOST), 0).astype(np.int64)

    def half_around(self, orientation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Halves of the edges, along x, y and z, of a box about each tool's position that holds it, where tools are
        turned like this (t, 4); infinite for a plane (t, 3) [m]."""
        w, x, y, z = orientation.T
        turns = np.array(
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ]
        )
        box = self.kind == BOX
        found = np.broadcast_to(self.reach[:, None], (len(box), 3)).copy()
        found[box] = np.einsum("ijt,tj->ti", np.abs(turns[:, :, box]), self.shape[box, :3])
        return found

    def felt(self, patch: float, radius: NDArray[np.float64]) -> ToolSet:
        """The same tools as a body of such patches feels them [m]: with edges of these radii (t,) [m], and less where
        walls are thin; 0 leaves one as it is."""
        shape, radius = self.shape.copy(), np.minimum(radius, ROUNDEST * self.wall)
        for tool in np.flatnonzero(radius):
            make = self.geometry[tool].rounded
            if make is not None:
                numbers = make(float(radius[tool]))
                shape[tool, : len(numbers)] = numbers
        return replace(self, shape=shape, patch=patch)

    @cached_property
    def short(self) -> list[float]:
        """Square of a way that takes no tool's middle to where its face was, a bit less than need be (t,) [m^2]"""
        return [0.9 * thin**2 for thin in self.thin]

    @cached_property
    def round(self) -> list[int]:
        """Tools whose core is balls: spheres, capsules and cylinders."""
        return [tool for tool, each in enumerate(self.geometry) if len(each.core)]

    @property
    def surfaces(self) -> Mapping[str, ToolSurface]:
        """Of tools that viewers do not draw by themselves, by their names."""
        found = ((name, each.surface) for name, each in zip(self.names, self.geometry, strict=True))
        return {name: surface for name, surface in found if surface is not None}
