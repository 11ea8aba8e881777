"""A box, by its half edges and the radius of its edges, which are sharp as a scene has them."""

import numpy as np

from softseam_protocol.scene.parts import BoxPart
from softseam_protocol.scene.tools import BoxTool
from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX
from softseam_services.shapes.geometry import Geometry, Sameness
from softseam_services.shapes.shape import Files, Shape
from softseam_services.shapes.turns import quaternion_turning


@njit(cache=True, error_model="numpy", forceinline=True)
def box_gap(a, b, c, radius, x, y, z):
    """A box with half edges a, b, c, whose edges and corners have this radius [m]."""
    ox, oy, oz = abs(x) - (a - radius), abs(y) - (b - radius), abs(z) - (c - radius)
    sx = 1.0 if x >= 0.0 else -1.0
    sy = 1.0 if y >= 0.0 else -1.0
    sz = 1.0 if z >= 0.0 else -1.0
    mx, my, mz = max(ox, 0.0), max(oy, 0.0), max(oz, 0.0)
    # Choices without branches, so that loops over points can use vector instructions.
    square = mx * mx + my * my + mz * mz
    outside = square > 0.0
    distance = np.sqrt(square if outside else 1.0)
    on_x = 1.0 if (ox >= oy) & (ox >= oz) else 0.0
    on_y = (1.0 - on_x) if oy >= oz else 0.0
    gap = (distance if outside else max(ox, max(oy, oz))) - radius
    nx, ny, nz = (mx, my, mz) if outside else (on_x, on_y, 1.0 - on_x - on_y)
    return gap, sx * nx / distance, sy * ny / distance, sz * nz / distance


def geometry(spec: BoxTool | BoxPart, files: Files) -> Geometry:
    """Numbers are half edges and the edges' radius (4,) [m]. Its core is looked at face by face, see `tools.travel`."""
    half = 0.5 * np.array(spec.size)
    steps = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)
    return Geometry(
        numbers=np.append(half, 0.0),
        outline=steps * half,
        reach=float(np.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)),
        orientation=quaternion_turning(np.array(spec.rotation)),
        extent=lambda direction: float(np.abs(direction) @ half),
        sameness=Sameness((1.0, 2.0, 3.0)),
        rounded=lambda radius: np.append(half, radius),
        wall=float(2.0 / np.sum(1.0 / half)),
        bends=0.0,
    )


SHAPE = Shape(geometry, inline=BOX)
