"""Meshes that a scene places -> one file, with a part for each name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.formats.mesh_file import Cells, MeshFile, polygon_file

MOST_PLACED = 10_000
"""meshes that a scene may place: a file of a few lines can place one mesh a billion times"""


@dataclass(frozen=True)
class Placed:
    """Polygons of a mesh where a node of a scene has them."""

    name: str
    points: Floats
    """in the mesh's own frame (n, 3)"""
    corners: Cells
    """(k,)"""
    sizes: Cells
    """how many of the corners each polygon has (m,)"""
    to_scene: Floats
    """from the mesh's frame to the scene's, acting on columns (4, 4)"""


def placed_file(meshes: Sequence[Placed], unit: float, up: str) -> MeshFile:
    """All meshes in the scene's frame, whose unit [m] and upward axis the file states.

    Where a frame is mirrored, polygons are turned round, so that they face as before. Raises ValueError where a corner
    is no point, a polygon has others than there are, or a unit no length.
    """
    if not 0.0 < unit < np.inf:
        raise ValueError(f"its unit is {unit:g} m")
    names = tuple(dict.fromkeys(mesh.name for mesh in meshes)) or ("",)
    nothing = np.zeros(0, dtype=np.int64)
    points, corners, sizes, part = [np.zeros((0, 3))], [nothing], [nothing], [nothing]
    for mesh in meshes:
        if mesh.sizes.sum() != len(mesh.corners) or (mesh.sizes < 0).any():
            raise ValueError(f"{mesh.name!r} has {len(mesh.corners):,} corners in place of {mesh.sizes.sum():,}")
        if len(mesh.corners) and not 0 <= mesh.corners.min() <= mesh.corners.max() < len(mesh.points):
            raise ValueError(f"{mesh.name!r} has a corner {mesh.corners.max()}, or one below 0, of {len(mesh.points)}")
        mirrored = np.linalg.det(mesh.to_scene[:3, :3]) < 0.0
        corners.append((mesh.corners[::-1] if mirrored else mesh.corners) + sum(map(len, points)))
        sizes.append(mesh.sizes[::-1] if mirrored else mesh.sizes)
        part.append(np.full(len(mesh.sizes), names.index(mesh.name)))
        points.append(mesh.points @ mesh.to_scene[:3, :3].T + mesh.to_scene[:3, 3])
    flat, counts, whose = (np.concatenate(each) for each in (corners, sizes, part))
    return replace(polygon_file(np.concatenate(points), flat, counts, whose, names), unit=unit, up=up)
