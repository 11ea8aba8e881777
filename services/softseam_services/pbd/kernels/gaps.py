"""Gaps and normals of a group's eight points to a tool, where they are not found as their pairs are solved.

They are kept as GAP of `pairs`: the signed distance [m] and the normal out of the tool [1]. A point that comes fast is
followed on its way (`swept_gap`), so that it does not pass to the far side of a thin tool.
"""

from __future__ import annotations

from softseam_services.jit import njit
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.kernels import patch_press, rotate, rotate_back, swept_gap

from .faced import faced_gap, faces
from .lanes import batch_kernel
from .pairs import BEFORE, EIGHT, GAP, GRADE, LEAN, NEXT, PATCH, POINT

_JUST = 1e-12
"""gap of a patch that no tool reaches, though its middle is inside one [m]"""


@njit(cache=True, error_model="numpy")
def _swept(row, lane, kind, shape, place, turn, motion, slow):
    """`swept_gap` of a point to a tool, which it does not pass in this substep."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz, bx, by, bz = motion
    ux, uy = row[lane + EIGHT * BEFORE], row[lane + EIGHT * (BEFORE + 1)]
    uz = row[lane + EIGHT * (BEFORE + 2)]
    start = (
        xx * ux + xy * uy + xz * uz + bx,
        yx * ux + yy * uy + yz * uz + by,
        zx * ux + zy * uy + zz * uz + bz,
    )
    point = row[lane], row[lane + EIGHT], row[lane + 2 * EIGHT]
    return swept_gap(kind, shape, place, turn, start, point, slow)


@njit(cache=True, error_model="numpy")
def find_gaps(row, rows, group, kind, shape, places, place, turn, motion, slow):
    """GAP of a group's points to a tool of any kind."""
    for lane in range(EIGHT):
        if rows[group, POINT + lane] < 0:
            continue
        met, gap, nx, ny, nz = _swept(row, lane, kind, shape, place, turn, motion, slow)
        u = row[lane + EIGHT * PATCH], row[lane + EIGHT * (PATCH + 1)], row[lane + EIGHT * (PATCH + 2)]
        v = row[lane + EIGHT * (PATCH + 3)], row[lane + EIGHT * (PATCH + 4)], row[lane + EIGHT * (PATCH + 5)]
        row[lane + EIGHT * GRADE] = 1.0
        if not met and u[0] * u[0] + u[1] * u[1] + u[2] * u[2] > 0.0:
            s, t = row[lane + EIGHT * LEAN], row[lane + EIGHT * (LEAN + 1)]
            middle = (
                row[lane] - s * u[0] - t * v[0],
                row[lane + EIGHT] - s * u[1] - t * v[1],
                row[lane + 2 * EIGHT] - s * u[2] - t * v[2],
            )
            depth, grade, mx, my, mz, s, t = patch_press(kind, shape, place, turn, middle, u, v, 0.0, places)[:7]
            gap = max(gap, _JUST)
            if depth > 0.0:
                row[lane + EIGHT * GRADE] = grade
                row[lane + EIGHT * NEXT], row[lane + EIGHT * (NEXT + 1)] = s, t
                gap, nx, ny, nz = -depth / grade, mx, my, mz
        row[lane + EIGHT * GAP] = gap
        row[lane + EIGHT * (GAP + 1)] = nx
        row[lane + EIGHT * (GAP + 2)] = ny
        row[lane + EIGHT * (GAP + 3)] = nz


@batch_kernel
def find_plane_gaps(row, normal, place):
    """GAP of a group's points to a plane through this place."""
    nx, ny, nz = normal
    px, py, pz = place
    for lane in range(EIGHT):
        gap = (row[lane] - px) * nx + (row[lane + EIGHT] - py) * ny + (row[lane + 2 * EIGHT] - pz) * nz
        row[lane + EIGHT * GAP] = gap
        row[lane + EIGHT * (GAP + 1)] = nx
        row[lane + EIGHT * (GAP + 2)] = ny
        row[lane + EIGHT * (GAP + 3)] = nz


@batch_kernel
def find_box_gaps(row, a, b, c, place, turn):
    """GAP of a group's points to a box of half edges a, b, c, as of `faced_gap`."""
    px, py, pz = place
    for lane in range(EIGHT):
        x, y, z = rotate_back(turn, row[lane] - px, row[lane + EIGHT] - py, row[lane + 2 * EIGHT] - pz)
        gap, nx, ny, nz = faced_gap(row, lane, a, b, c, x, y, z)
        nx, ny, nz = rotate(turn, nx, ny, nz)
        row[lane + EIGHT * GAP] = gap
        row[lane + EIGHT * (GAP + 1)] = nx
        row[lane + EIGHT * (GAP + 2)] = ny
        row[lane + EIGHT * (GAP + 3)] = nz


@njit(cache=True, error_model="numpy")
def find_all_gaps(row, rows, group, kind, shape, places, place, turn, motion, slow):
    """GAP of a group's points to a tool: to a box with sharp edges as of `faced_gap`."""
    if kind == PLANE:
        find_plane_gaps(row, rotate(turn, shape[0], shape[1], shape[2]), place)
    elif faces(kind, shape):
        find_box_gaps(row, shape[0], shape[1], shape[2], place, turn)
    else:
        find_gaps(row, rows, group, kind, shape, places, place, turn, motion, slow)
