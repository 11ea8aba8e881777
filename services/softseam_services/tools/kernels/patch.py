"""How firmly a tool presses a patch of a block's surface, by how round the tool is.

A patch yields in place of the waves that a cell's few freedoms lack. These grow with a tool's curvature: between places
h apart, the spacing of nodes, what is R wide on either side of its middle sags by h^2/(8 R). So of a patch A that is
inside a tool by d the force is
  F = r/2 (d - s + sqrt((d - s)^2 + 4 q s d)),   r = DENSE E A/h,   q = LIGHT/DENSE,                               (1)
  s = SAG h^2/(R (1 + (R/(WIDE h))^4))
that is LIGHT E A d/h at first and r (d - (1 - q) s) deeper, or d = F/r + (1 - q) s F/(F + q r s); s = 0 under what is
flat. With DENSE alone, what is round is felt up to a third too firmly where few patches touch.

On an embedded surface r is that of body/contact_points.py, and s goes by how round the surface is (body/bulges.py).

Under a tool with edges a patch x(s, t) = x + s u + t v, s and t from -1/2 to 1/2, is looked at in n x n places, each of
which is inside by its own d and pushed along its own normal n, with its share of r. All of that acts at one place:
  F = mean F(d_q) n_q,   dF/dx along F's direction m:  mean F'(d_q) (n_q . m)^2,
  (s, t) = mean (s_q, t_q) F(d_q) n_q . m / |F|                                                                  (2)
and what resists a turn of the patch is the spread of the places about the mean of theirs, all weighted by F':
  (s', t') = mean (s_q, t_q),   c_ss, c_st, c_tt = mean of (s_q - s')^2, (s_q - s') (t_q - t'), (t_q - t')^2     (3)
So a patch is let go by and by as an edge passes, and turns as it is pressed in part. All of it is the slope of an
energy of places: what a tool puts in it gets back. Where a tool lies flat on all of a patch, its corners count.
"""

from typing import Any

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from softseam_services.shapes.distance import turned_gap
from softseam_services.shapes.turns import rotate, rotate_back

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


@njit(cache=True, error_model="numpy")
def press_energy(inside, sag):
    """What eq. (1) stores over r [m^2], the integral of F/r, of a patch that is inside a tool by d [m]; s >= 0 [m]."""
    if inside <= 0.0:
        return 0.0
    if sag == 0.0:
        return 0.5 * inside * inside
    before = (1.0 - 2.0 * LIGHT / DENSE) * sag
    square, ahead = sag * sag - before * before, inside - before
    root = np.sqrt(ahead * ahead + square)
    curved = ahead * root + before * sag + square * np.log((ahead + root) / (sag - before))
    return 0.25 * (inside * (inside - 2.0 * sag) + curved)


@njit(cache=True, error_model="numpy", forceinline=True)
def _on_one_face(shape, x, y, z, u, v):
    """Which face of a box with half edges and their radius (4,) all of a patch is nearest to, u and v of which are its
    edges in the frame of the box: 0, 1 or 2 for the axis of that face; -1: none, or an edge."""
    ex, ey, ez = 0.5 * (abs(u[0]) + abs(v[0])), 0.5 * (abs(u[1]) + abs(v[1])), 0.5 * (abs(u[2]) + abs(v[2]))
    ox, oy, oz = abs(x) - shape[0], abs(y) - shape[1], abs(z) - shape[2]
    inner = -shape[3]
    if oy + ey <= inner and oz + ez <= inner and max(oy + ey, oz + ez) <= ox - ex and ex < abs(x):
        return 0
    if ox + ex <= inner and oz + ez <= inner and max(ox + ex, oz + ez) <= oy - ey and ey < abs(y):
        return 1
    if ox + ex <= inner and oy + ey <= inner and max(ox + ex, oy + ey) <= oz - ez and ez < abs(z):
        return 2
    return -1


@njit(cache=True, error_model="numpy")
def patch_press(kind, shape, position, orientation, point, u, v, sag, places):
    """Eq. (2) over r of the patch of middle (3,) and edges u, v (3,): F [m], its slope [1] and its direction; of tools
    that have edges.

    F is minus the least gap, or less, where the tool does not reach it; then the direction is that of the middle. Then
    come s and t of eq. (2), from -1/2 to 1/2, and the five of eq. (3).
    """
    x, y, z = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    gap, nx, ny, nz = turned_gap(kind, shape, x, y, z)
    size = 0.5 * (np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) + np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
    reach = size * steepness(kind)
    if gap > reach:
        nx, ny, nz = rotate(orientation, nx, ny, nz)
        return reach - gap, 1.0, nx, ny, nz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    u, v = rotate_back(orientation, u[0], u[1], u[2]), rotate_back(orientation, v[0], v[1], v[2])
    by_u, by_v = nx * u[0] + ny * u[1] + nz * u[2], nx * v[0] + ny * v[1] + nz * v[2]
    about = 0.5 * (abs(by_u) + abs(by_v))
    flat = kind == BOX and sag == 0.0 and _on_one_face(shape, x, y, z, u, v) >= 0
    if not flat and kind != BOX and abs(gap) > about and (gap > 0.0 or sag == 0.0):
        flat = True
        for corner in range(4):
            s, t = (corner // 2) - 0.5, (corner % 2) - 0.5
            _, mx, my, mz = turned_gap(
                kind, shape, x + s * u[0] + t * v[0], y + s * u[1] + t * v[1], z + s * u[2] + t * v[2]
            )
            flat = flat and mx * nx + my * ny + mz * nz > 1.0 - _ALIKE
    if flat:
        nx, ny, nz = rotate(orientation, nx, ny, nz)
        if gap > about:
            return about - gap, 1.0, nx, ny, nz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if gap < -about:
            square = (1.0 - 1.0 / places**2) / 12.0
            s, t = square / gap * by_u, square / gap * by_v
            return -gap, 1.0, nx, ny, nz, s, t, 0.0, 0.0, square, 0.0, square
    least, middle = np.inf, (nx, ny, nz)
    slopes = ks = kt = kss = kst = ktt = 0.0
    ux = uy = uz = vx = vy = vz = 0.0
    fx = fy = fz = xx = xy = xz = yy = yz = zz = 0.0
    if flat:
        f_all, f_s, f_t = 0.0, 0.0, 0.0
        for i in range(places):
            s = (2 * i + 1.0 - places) / (2.0 * places)
            for j in range(places):
                t = (2 * j + 1.0 - places) / (2.0 * places)
                f = -(gap + s * by_u + t * by_v)
                least = min(least, -f)
                if f > 0.0:
                    f_all, f_s, f_t, slopes, ks, kt = f_all + f, f_s + s * f, f_t + t * f, slopes + 1.0, ks + s, kt + t
                    kss, kst, ktt = kss + s * s, kst + s * t, ktt + t * t
        if f_all == 0.0:
            return -max(least, 0.0), 1.0, nx, ny, nz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        ks, kt = ks / slopes, kt / slopes
        kss, kst, ktt = kss / slopes - ks * ks, kst / slopes - ks * kt, ktt / slopes - kt * kt
        force, slope = f_all / places**2, slopes / places**2
        return force, slope, nx, ny, nz, f_s / f_all, f_t / f_all, ks, kt, kss, kst, ktt
    for i in range(places):
        s = (2 * i + 1.0 - places) / (2.0 * places)
        for j in range(places):
            t = (2 * j + 1.0 - places) / (2.0 * places)
            gap, nx, ny, nz = turned_gap(
                kind, shape, x + s * u[0] + t * v[0], y + s * u[1] + t * v[1], z + s * u[2] + t * v[2]
            )
            least = min(least, gap)
            if gap < 0.0:
                f, k = -gap, 1.0
                if sag > 0.0:
                    f, k = press(f, sag)
                fx, fy, fz = fx + f * nx, fy + f * ny, fz + f * nz
                ux, uy, uz = ux + s * f * nx, uy + s * f * ny, uz + s * f * nz
                vx, vy, vz = vx + t * f * nx, vy + t * f * ny, vz + t * f * nz
                xx, xy, xz = xx + k * nx * nx, xy + k * nx * ny, xz + k * nx * nz
                yy, yz, zz = yy + k * ny * ny, yz + k * ny * nz, zz + k * nz * nz
                slopes, ks, kt = slopes + k, ks + k * s, kt + k * t
                kss, kst, ktt = kss + k * s * s, kst + k * s * t, ktt + k * t * t
    size = np.sqrt(fx * fx + fy * fy + fz * fz)
    if size == 0.0:
        nx, ny, nz = rotate(orientation, middle[0], middle[1], middle[2])
        return -max(least, 0.0), 1.0, nx, ny, nz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    nx, ny, nz = fx / size, fy / size, fz / size
    k = nx * (xx * nx + 2.0 * (xy * ny + xz * nz)) + ny * (yy * ny + 2.0 * yz * nz) + zz * nz * nz
    a, b = (ux * nx + uy * ny + uz * nz) / size, (vx * nx + vy * ny + vz * nz) / size
    ks, kt = ks / slopes, kt / slopes
    kss, kst, ktt = kss / slopes - ks * ks, kst / slopes - ks * kt, ktt / slopes - kt * kt
    nx, ny, nz = rotate(orientation, nx, ny, nz)
    return size / places**2, k / places**2, nx, ny, nz, a, b, ks, kt, kss, kst, ktt


@njit(cache=True, error_model="numpy")
def patch_energy(kind, shape, position, orientation, point, u, v, sag, places):
    """The energy of which eq. (2) is the slope, over r [m^2]: the mean of `press_energy` of the places of a patch; as
    of `patch_press`."""
    x, y, z = rotate_back(orientation, point[0] - position[0], point[1] - position[1], point[2] - position[2])
    gap, nx, ny, nz = turned_gap(kind, shape, x, y, z)
    size = 0.5 * (np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) + np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
    if gap > size * steepness(kind):
        return 0.0
    u, v = rotate_back(orientation, u[0], u[1], u[2]), rotate_back(orientation, v[0], v[1], v[2])
    if kind == BOX and sag == 0.0 and _on_one_face(shape, x, y, z, u, v) >= 0:
        by_u, by_v = nx * u[0] + ny * u[1] + nz * u[2], nx * v[0] + ny * v[1] + nz * v[2]
        if gap < -0.5 * (abs(by_u) + abs(by_v)):
            return 0.5 * (gap * gap + (1.0 - 1.0 / places**2) / 12.0 * (by_u * by_u + by_v * by_v))
    energy = 0.0
    for i in range(places):
        s = (2 * i + 1.0 - places) / (2.0 * places)
        for j in range(places):
            t = (2 * j + 1.0 - places) / (2.0 * places)
            gap, _, _, _ = turned_gap(
                kind, shape, x + s * u[0] + t * v[0], y + s * u[1] + t * v[1], z + s * u[2] + t * v[2]
            )
            energy += press_energy(-gap, sag)
    return energy / places**2


@njit(cache=True, error_model="numpy", forceinline=True)
def patch_yields(give, lag, ease, force):
    """Eq. (1): d/F of a patch with this force [m/N]; give: 1/r, lag: (1 - q) s [m], ease: q/(1 - q)."""
    return give + give * lag / (force * give + ease * lag + _NO_FORCE)
