"""Depth and labels of a picture: one ray a pixel, cast onto triangles by Embree; needs no display."""

from collections.abc import Sequence

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from softseam.view.raster import Camera

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def directions(camera: Camera, height: int, width: int) -> NDArray[np.float32]:
    """Through the middles of pixels, rows from above, in the camera's frame: right, up, forward = 1 (h w, 3)."""
    half = np.tan(np.radians(0.5 * camera.fov))
    down, across = np.mgrid[:height, :width]
    rays = np.ones((height, width, 3), np.float32)
    rays[..., 0] = half * (2.0 * across + 1.0 - width) / height
    rays[..., 1] = half * (height - 1.0 - 2.0 * down) / height
    return rays.reshape(-1, 3)


def cast(
    camera: Camera, height: int, width: int, meshes: Sequence[tuple[Floats, Ints]]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Depth along the camera's axis [m], inf where there is nothing, and the number of the mesh there, -1 for none.

    meshes  places of corners (n, 3) [m], and triangles (T, 3), seen from either side; returns arrays (height, width)

    In single precision, from the eye on: depths are right to some 1e-6 of the largest triangle that is seen.
    """
    scene, axes = EmbreeScene(robust=True), camera.axes()
    drawn = [number for number, (_, triangles) in enumerate(meshes) if len(triangles)]
    for number in drawn:
        places, triangles = meshes[number]
        seen = ((places - camera.eye) @ axes.T).astype(np.float32)
        TriangleMesh(scene, seen, triangles.astype(np.int32))
    rays = directions(camera, height, width)
    found = scene.run(np.zeros_like(rays), rays, output=True)
    hit = found["geomID"] >= 0
    depth = np.where(hit, found["tfar"], np.float32(np.inf)).reshape(height, width)
    which = np.array([*drawn, -1])[np.where(hit, found["geomID"], -1)].reshape(height, width)
    return depth, which
