"""How firmly a tool presses a patch of a block's surface: by how round it is, and how much of the patch a face covers.

A patch yields in place of the waves that a cell's few freedoms lack. These grow with a tool's curvature: between places
h apart, the spacing of nodes, what is R wide on either side of its middle sags by h^2/(8 R). So of a patch A that is
inside a tool by d the force is
  F = r/2 (d - s + sqrt((d - s)^2 + 4 q s d)),   r = DENSE E A/h,   q = LIGHT/DENSE,                               (1)
  s = SAG h^2/(R (1 + (R/(WIDE h))^4))
that is LIGHT E A d/h at first and r (d - (1 - q) s) deeper, or d = F/r + (1 - q) s F/(F + q r s); s = 0 under what is
flat. With DENSE alone, what is round is felt up to a third too firmly where few patches touch.

Which part of a patch a flat face covers is known by signed distance alone. A place is covered where there is tool above
it. Of a window about the patch, twice as long and wide, four places are looked at, halfway from the middle to its
corners. Raised along the outward normal N of the surface by the patch's width b, so that a face that covers them is b
below, each sees by the distance phi and the normal m there how near a wall of the tool is beside it. With the patch's
edges u, v
  c = mean min(1, max(0, 1/2 - phi/e)),   e = |m . u| + |m . v|                                                  (2)
is covered: exactly where a wall is along the edges, and all of it under what is round unless that is steeper than 60
degrees there. Where a wall is nearest to the patch, N is what it has along that wall: the surface beside a tool rises.
A traction on a part of a face of a cell lets the body yield locally by what the cell's functions cannot show.
So the patch is as firm as its own 1/r = h/(DENSE E A) and h (1/c - 1)/(EDGE E A) in a row,
  1/r_c = (1/r) (1 + (DENSE/EDGE) (1/c - 1))                                                                     (3)
It is pressed by the plane of the face: that which the tool has at z, the patch's middle moved to b/2 within the wall,
where the face is the nearest surface; where all is covered, that at the middle. Where the tool bends there it is round,
its pressure fades, and it is met at the patch's middle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, CAPSULE, PLANE, SPHERE
from softseam_services.shapes.distance import tool_gap
from softseam_services.shapes.turns import rotate, rotate_back

DENSE = 60.0
"""contact penalty of a patch, E A/h with h the spacing of nodes; see the decision notes"""
LIGHT = 2.5
"""the same of a patch that hardly touches what is round"""
SAG, WIDE = 0.08, 6.0
"""of eq. (1)"""
EDGE = 2.0
"""the same of what yields about a traction on a part of a face"""
FLAT = -3
"""in place of a side of a box: the tool presses by the plane of a face that covers the patch in part"""
_FACING = 0.5
"""cosine of an angle between normals: what faces the surface, and what is behind a tool"""
_STRAIGHT = 0.99
"""cosine of the angle by which a face turns at most in half a patch's width beside its edge"""
_FLAT = 0.998
"""and away from edges: what turns more is round"""
_NO_FORCE = 1e-300
"""times a compliance [m]"""
_ROUNDOFF = 1e-9
"""of a covered share"""


@njit(cache=True, error_model="numpy")
def has_flats(kind):
    """Whether a tool that presses between nodes may have flat faces with edges; spheres and capsules have none."""
    return kind != PLANE and kind != BOX and kind != SPHERE and kind != CAPSULE


@njit(cache=True, error_model="numpy")
def plane_gap(plane, position, orientation, point):
    """Gap to a plane of a tool, normal and distance in its frame (4,), and its outward normal: gap, nx, ny, nz."""
    nx, ny, nz = rotate(orientation, plane[0], plane[1], plane[2])
    away = nx * (point[0] - position[0]) + ny * (point[1] - position[1]) + nz * (point[2] - position[2])
    return away - plane[3], nx, ny, nz


def sag_by(half_width: Any, h: Any) -> Any:
    """s of eq. (1) [m], of tools of half width R [m] where nodes are h apart [m]."""
    wide = half_width / (WIDE * h)
    return SAG * h * h / (half_width * (1.0 + wide**4))


sag_under = njit(cache=True, error_model="numpy")(sag_by)


@njit(cache=True, error_model="numpy")
def press(inside, sag):
    """Eq. (1): F/r [m] and its slope [1], of a patch that is inside a tool by d [m] where s > 0 [m]."""
    ahead = inside - sag
    root = np.sqrt(max(0.0, ahead * ahead + 4.0 * LIGHT / DENSE * sag * inside))
    return 0.5 * (ahead + root), 0.5 + 0.5 * (ahead + 2.0 * LIGHT / DENSE * sag) / root


@njit(cache=True, error_model="numpy", forceinline=True)
def patch_yields(give, lag, force):
    """Eq. (1): d/F of a patch with this force [m/N]; give: 1/r, lag: (1 - q) s [m]."""
    return give + give * lag / (force * give + LIGHT / (DENSE - LIGHT) * lag + _NO_FORCE)


@njit(cache=True, error_model="numpy")
def _is_flat(kind, shape, position, orientation, x, u, v):
    """Whether a tool's surface keeps its normal in the patch of middle x (3,) and edges u, v (3,)."""
    _, mx, my, mz = tool_gap(kind, shape, position, orientation, x)
    for quarter in range(4):
        s, t = (0.5 if quarter % 2 else -0.5), (0.5 if quarter >= 2 else -0.5)
        at = (x[0] + s * u[0] + t * v[0], x[1] + s * u[1] + t * v[1], x[2] + s * u[2] + t * v[2])
        _, ax, ay, az = tool_gap(kind, shape, position, orientation, at)
        if mx * ax + my * ay + mz * az < _FLAT:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _set_plane(plane, position, orientation, at, gap, mx, my, mz):
    """plane (4,) <- that of the tool's surface which is `gap` from a place, where its normal is m."""
    plane[0], plane[1], plane[2] = rotate_back(orientation, mx, my, mz)
    plane[3] = mx * (at[0] - position[0]) + my * (at[1] - position[1]) + mz * (at[2] - position[2]) - gap


@njit(cache=True, error_model="numpy")
def cover_patch(kind, shape, position, orientation, x, u, v, outward, plane):
    """r_c/r of a patch that a flat face covers, eq. (3), and plane (4,) <- of that face, normal and distance in the
    tool's frame.

    0 where the tool is to be met by its gap at the middle, and there plane stays: where nothing is covered, or the tool
    is round, or too thin to be looked at from within.

    x (3,) middle, u, v (3,) edges of the patch [m]; outward: 1 where u x v points out of the body, -1 where inwards
    """
    n0, n1, n2 = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    area = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    square = u[0] ** 2 + u[1] ** 2 + u[2] ** 2 + v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    gap, mx, my, mz = tool_gap(kind, shape, position, orientation, x)
    if area == 0.0 or gap * gap > 4.0 * square:
        return 0.0
    n0, n1, n2, b = outward * n0 / area, outward * n1 / area, outward * n2 / area, np.sqrt(area)
    along = mx * n0 + my * n1 + mz * n2
    if along > -_FACING:
        n0, n1, n2 = n0 - along * mx, n1 - along * my, n2 - along * mz
        size = np.sqrt(max(n0 * n0 + n1 * n1 + n2 * n2, _ROUNDOFF))
        n0, n1, n2 = n0 / size, n1 / size, n2 / size
    rise = b
    if gap > 0.0:
        rise += max(0.0, -gap * (mx * n0 + my * n1 + mz * n2))
    share = 0.0
    for quarter in range(4):
        s, t = (0.5 if quarter % 2 else -0.5), (0.5 if quarter >= 2 else -0.5)
        at = (
            x[0] + s * u[0] + t * v[0] + rise * n0,
            x[1] + s * u[1] + t * v[1] + rise * n1,
            x[2] + s * u[2] + t * v[2] + rise * n2,
        )
        away, mx, my, mz = tool_gap(kind, shape, position, orientation, at)
        if away > 0.0 and mx * n0 + my * n1 + mz * n2 > _FACING:
            return 0.0
        extent = abs(mx * u[0] + my * u[1] + mz * u[2]) + abs(mx * v[0] + my * v[1] + mz * v[2])
        part = 0.5 - away / extent if extent > 0.0 else (1.0 if away < 0.0 else 0.0)
        share += 0.25 * min(1.0, max(0.0, part))
    if share < _ROUNDOFF:
        return 0.0
    if share > 1.0 - _ROUNDOFF:
        if not _is_flat(kind, shape, position, orientation, x, u, v):
            return 0.0
        gap, mx, my, mz = tool_gap(kind, shape, position, orientation, x)
        _set_plane(plane, position, orientation, x, gap, mx, my, mz)
        return 1.0
    at = (x[0] + rise * n0, x[1] + rise * n1, x[2] + rise * n2)
    away, mx, my, mz = tool_gap(kind, shape, position, orientation, at)
    inwards = max(0.0, away + 0.5 * b)
    z = (x[0] - inwards * mx, x[1] - inwards * my, x[2] - inwards * mz)
    farther = (z[0] - 0.5 * b * mx, z[1] - 0.5 * b * my, z[2] - 0.5 * b * mz)
    gap, mx, my, mz = tool_gap(kind, shape, position, orientation, z)
    _, fx, fy, fz = tool_gap(kind, shape, position, orientation, farther)
    if mx * n0 + my * n1 + mz * n2 > -_FACING or mx * fx + my * fy + mz * fz < _STRAIGHT:
        return 0.0
    _set_plane(plane, position, orientation, z, gap, mx, my, mz)
    return 1.0 / (1.0 + DENSE / EDGE * (1.0 / share - 1.0))
