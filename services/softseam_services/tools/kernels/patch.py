"""How firmly a tool presses a patch of a block's surface, by how round the tool is.

A patch yields in place of the waves that a cell's few freedoms lack. These grow with a tool's curvature: between places
h apart, the spacing of nodes, what is R wide on either side of its middle sags by h^2/(8 R). So of a patch A that is
inside a tool by d the force is
  F = r/2 (d - s + sqrt((d - s)^2 + 4 q s d)),   r = DENSE E A/h,   q = LIGHT/DENSE,                               (1)
  s = SAG h^2/(R (1 + (R/(WIDE h))^4))
that is LIGHT E A d/h at first and r (d - (1 - q) s) deeper, or d = F/r + (1 - q) s F/(F + q r s); s = 0 under what is
flat. With DENSE alone, what is round is felt up to a third too firmly where few patches touch.

Under a tool with edges a patch x(s, t) = x + s u + t v, s and t from -1/2 to 1/2, is looked at in n x n places, each of
which is inside by its own d and pushed along its own normal n, with its share of r. All of that acts at one place:
  F = mean F(d_q) n_q,   dF/dx along F's direction m:  mean F'(d_q) (n_q . m)^2,
  (s, t) = mean (s_q, t_q) F(d_q) n_q . m / |F|                                                                  (2)
So a patch is let go by and by as an edge passes, and turns as it is pressed in part. All of it is the slope of an
energy of places: what a tool puts in it gets back. Where a tool lies flat on all of a patch, its corners tell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from softseam_services.shapes.distance import tool_gap
from softseam_services.shapes.turns import rotate

DENSE = 60.0
"""contact penalty of a patch, E A/h with h the spacing of nodes; see the decision notes"""
LIGHT = 2.5
"""the same of a patch that hardly touches what is round"""
SAG, WIDE = 0.08, 6.0
"""of eq. (1)"""
EXACT, STEEP = 1.001, 2.0
"""how much a gap changes at most as a point or a tool goes one length: as much, but for rounding; and that to a mesh,
which is a polynomial's, or to a shape that is added"""
_ALIKE = 1e-12
"""of the cosine of normals that are one"""
_NO_FORCE = 1e-300
"""times a compliance [m]"""


@njit(cache=True, error_model="numpy")
def steepness(kind):
    """EXACT or STEEP."""
    exact = kind == PLANE or kind == BOX or kind == SPHERE or kind == CAPSULE or kind == CYLINDER
    return EXACT if exact else STEEP


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
def bent(kind, orientation, nx, ny, nz):
    """Part of s of eq. (1) that counts where a tool has this normal [1]: none at the flat ends of a cylinder."""
    if kind != CYLINDER:
        return 1.0
    ax, ay, az = rotate(orientation, 0.0, 0.0, 1.0)
    along = ax * nx + ay * ny + az * nz
    return 1.0 - along * along


@njit(cache=True, error_model="numpy")
def patch_press(kind, shape, position, orientation, point, u, v, sag, places):
    """Eq. (2) over r of the patch of middle (3,) and edges u, v (3,): F [m], its slope [1] and its direction.

    F is minus the least gap, or less, where the tool does not reach it; then the direction is that of the middle. Last
    come the means of s and t over the patch, from -1/2 to 1/2, by what presses there along that direction.
    """
    gap, nx, ny, nz = tool_gap(kind, shape, position, orientation, point)
    reach = 0.5 * (np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) + np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
    reach *= steepness(kind)
    if gap > reach:
        return reach - gap, 1.0, nx, ny, nz, 0.0, 0.0
    by_u, by_v = nx * u[0] + ny * u[1] + nz * u[2], nx * v[0] + ny * v[1] + nz * v[2]
    about = 0.5 * (abs(by_u) + abs(by_v))
    if abs(gap) > about and (gap > 0.0 or sag == 0.0):
        flat = True
        for corner in range(4):
            s, t = (corner // 2) - 0.5, (corner % 2) - 0.5
            at = (
                point[0] + s * u[0] + t * v[0],
                point[1] + s * u[1] + t * v[1],
                point[2] + s * u[2] + t * v[2],
            )
            _, mx, my, mz = tool_gap(kind, shape, position, orientation, at)
            flat = flat and mx * nx + my * ny + mz * nz > 1.0 - _ALIKE
        if flat and gap > 0.0:
            return about - gap, 1.0, nx, ny, nz, 0.0, 0.0
        if flat:
            share = (1.0 - 1.0 / places**2) / 12.0 / gap
            return -gap, 1.0, nx, ny, nz, share * by_u, share * by_v
    least = np.inf
    ux = uy = uz = vx = vy = vz = 0.0
    fx = fy = fz = xx = xy = xz = yy = yz = zz = 0.0
    for i in range(places):
        s = (2 * i + 1.0 - places) / (2.0 * places)
        for j in range(places):
            t = (2 * j + 1.0 - places) / (2.0 * places)
            at = (
                point[0] + s * u[0] + t * v[0],
                point[1] + s * u[1] + t * v[1],
                point[2] + s * u[2] + t * v[2],
            )
            gap, nx, ny, nz = tool_gap(kind, shape, position, orientation, at)
            least = min(least, gap)
            if gap < 0.0:
                f, k = -gap, 1.0
                here = sag * bent(kind, orientation, nx, ny, nz)
                if here > 0.0:
                    f, k = press(f, here)
                fx, fy, fz = fx + f * nx, fy + f * ny, fz + f * nz
                ux, uy, uz = ux + s * f * nx, uy + s * f * ny, uz + s * f * nz
                vx, vy, vz = vx + t * f * nx, vy + t * f * ny, vz + t * f * nz
                xx, xy, xz = xx + k * nx * nx, xy + k * nx * ny, xz + k * nx * nz
                yy, yz, zz = yy + k * ny * ny, yz + k * ny * nz, zz + k * nz * nz
    size = np.sqrt(fx * fx + fy * fy + fz * fz)
    if size == 0.0:
        _, nx, ny, nz = tool_gap(kind, shape, position, orientation, point)
        return -max(least, 0.0), 1.0, nx, ny, nz, 0.0, 0.0
    nx, ny, nz = fx / size, fy / size, fz / size
    k = nx * (xx * nx + 2.0 * (xy * ny + xz * nz)) + ny * (yy * ny + 2.0 * yz * nz) + zz * nz * nz
    a, b = (ux * nx + uy * ny + uz * nz) / size, (vx * nx + vy * ny + vz * nz) / size
    return size / places**2, k / places**2, nx, ny, nz, a, b


@njit(cache=True, error_model="numpy", forceinline=True)
def patch_yields(give, lag, force):
    """Eq. (1): d/F of a patch with this force [m/N]; give: 1/r, lag: (1 - q) s [m]."""
    return give + give * lag / (force * give + LIGHT / (DENSE - LIGHT) * lag + _NO_FORCE)
