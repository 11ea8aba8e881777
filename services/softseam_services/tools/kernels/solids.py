"""Signed distances to solids in their own frames: gap and outward unit normal at the nearest point of the surface."""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def box_gap(a, b, c, x, y, z):
    """A box with half edges a, b, c [m]; its edges and corners are sharp."""
    ox, oy, oz = abs(x) - a, abs(y) - b, abs(z) - c
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
    gap = distance if outside else max(ox, max(oy, oz))
    nx, ny, nz = (mx, my, mz) if outside else (on_x, on_y, 1.0 - on_x - on_y)
    return gap, sx * nx / distance, sy * ny / distance, sz * nz / distance


@njit(cache=True, error_model="numpy")
def capsule_gap(radius, half, x, y, z):
    """All points within `radius` of the segment from -half to half along z [m]; on the segment the normal is +x."""
    rise = z - min(max(z, -half), half)
    distance = np.sqrt(x * x + y * y + rise * rise)
    if distance == 0.0:
        return -radius, 1.0, 0.0, 0.0
    return distance - radius, x / distance, y / distance, rise / distance


@njit(cache=True, error_model="numpy")
def cylinder_gap(radius, half, x, y, z):
    """A cylinder from -half to half along z with flat ends and sharp rims [m]; on the axis +x is outward."""
    from_axis = np.sqrt(x * x + y * y)
    ux, uy = (x / from_axis, y / from_axis) if from_axis > 0.0 else (1.0, 0.0)
    side = 1.0 if z >= 0.0 else -1.0
    out, above = from_axis - radius, abs(z) - half
    if out > 0.0 and above > 0.0:
        gap = np.sqrt(out * out + above * above)
        return gap, out / gap * ux, out / gap * uy, above / gap * side
    if out >= above:
        return out, ux, uy, 0.0
    return above, 0.0, 0.0, side
