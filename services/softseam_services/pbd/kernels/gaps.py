"""Gaps and normals of a group's eight points to a tool, where they are not found as their pairs are solved.

They are kept as GAP of `pairs`: the signed distance [m] and the normal out of the tool [1]. A point that comes fast is
followed on its way (`swept_gap`), so that it does not pass to the far side of a thin tool.
"""

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, PLANE
from softseam_services.tools.kernels import box_gap, patch_press, rotate, rotate_back, swept_gap

from .faced import faced_gap, faces
from .lanes import batch_kernel
from .pairs import BEFORE, CHANGE, EIGHT, GAP, GRADE, LEAN, NEXT, PATCH, POINT, SAG, SLIPPED

JUST = 1e-12
"""gap of a patch that no tool reaches, though its middle is inside one [m]"""
BY_EDGES, SUMS = SLIPPED, CHANGE
"""what is here of use for patches alone, until the pair is solved: by how much the gap grows along their edges (2,)
[m], and sums over places of F, s F and t F of `patch_press` (3,) [m]"""


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


@batch_kernel
def _face_patches(row, a, b, c, radius, place, turn, motion, square_slow):
    """GAP of the middles of a group's patches under a box of half edges a, b, c with edges of this radius, and by how
    much it grows along their edges, where one face of the box is nearest to all of a patch, or none reaches it, and its
    point came by no more than the root of square_slow [m^2]. Returns the others, a bit each, and whether some are
    inside in part.
    """
    px, py, pz = place
    xx, xy, xz, yx, yy, yz, zx, zy, zz, bx, by, bz = motion
    others, parted = 0, 0
    for lane in range(EIGHT):
        x, y, z = row[lane], row[lane + EIGHT], row[lane + 2 * EIGHT]
        ux, uy = row[lane + EIGHT * BEFORE], row[lane + EIGHT * (BEFORE + 1)]
        uz = row[lane + EIGHT * (BEFORE + 2)]
        mx, my = x - (xx * ux + xy * uy + xz * uz + bx), y - (yx * ux + yy * uy + yz * uz + by)
        mz = z - (zx * ux + zy * uy + zz * uz + bz)
        slow = mx * mx + my * my + mz * mz <= square_slow
        s, t = row[lane + EIGHT * LEAN], row[lane + EIGHT * (LEAN + 1)]
        x, y, z = rotate_back(turn, x - px, y - py, z - pz)
        ux, uy = row[lane + EIGHT * PATCH], row[lane + EIGHT * (PATCH + 1)]
        vx, vy = row[lane + EIGHT * (PATCH + 3)], row[lane + EIGHT * (PATCH + 4)]
        ux, uy, uz = rotate_back(turn, ux, uy, row[lane + EIGHT * (PATCH + 2)])
        vx, vy, vz = rotate_back(turn, vx, vy, row[lane + EIGHT * (PATCH + 5)])
        off, ax, ay, az = box_gap(a, b, c, radius, x, y, z)
        x, y, z = x - s * ux - t * vx, y - s * uy - t * vy, z - s * uz - t * vz
        ex, ey, ez = 0.5 * (abs(ux) + abs(vx)), 0.5 * (abs(uy) + abs(vy)), 0.5 * (abs(uz) + abs(vz))
        ox, oy, oz = abs(x) - a, abs(y) - b, abs(z) - c
        on_x = (max(oy + ey, oz + ez) <= min(-radius, ox - ex)) & (ex < abs(x))
        on_y = (max(ox + ex, oz + ez) <= min(-radius, oy - ey)) & (ey < abs(y))
        on_z = (max(ox + ex, oy + ey) <= min(-radius, oz - ez)) & (ez < abs(z))
        gap, about = ox if on_x else oy if on_y else oz, ex if on_x else ey if on_y else ez
        away = max(ox, oy, oz) >= ex + ey + ez
        found = (on_x | on_y | on_z | away) & slow & (ex + ey + ez > 0.0)
        nx = (1.0 if x >= 0.0 else -1.0) if on_x else 0.0
        ny = (1.0 if y >= 0.0 else -1.0) if on_y else 0.0
        nz = (1.0 if z >= 0.0 else -1.0) if on_z else 0.0
        row[lane + EIGHT * BY_EDGES] = 0.0 if away else nx * ux + ny * uy + nz * uz
        row[lane + EIGHT * (BY_EDGES + 1)] = 0.0 if away else nx * vx + ny * vy + nz * vz
        gap, nx, ny, nz = off if away else gap, ax if away else nx, ay if away else ny, az if away else nz
        nx, ny, nz = rotate(turn, nx, ny, nz)
        row[lane + EIGHT * GAP] = gap
        row[lane + EIGHT * (GAP + 1)] = nx
        row[lane + EIGHT * (GAP + 2)] = ny
        row[lane + EIGHT * (GAP + 3)] = nz
        others += 0 if found else 1 << lane
        parted += 1 if found & (not away) & (abs(gap) < about) else 0
    return others, parted > 0


@batch_kernel
def _press_faces(row, lanes, places, parted):
    """GAP, GRADE and NEXT of eight patches as of `patch_press`, of what `_face_patches` found of them."""
    spread = (1.0 - 1.0 / places**2) / 12.0
    for lane in range(lanes):
        row[lane + EIGHT * SUMS] = row[lane + EIGHT * (SUMS + 1)] = row[lane + EIGHT * (SUMS + 2)] = 0.0
        row[lane + EIGHT * GRADE] = 0.0
    for place in range(places * places if parted else 0):
        s = (2 * (place // places) + 1.0 - places) / (2.0 * places)
        t = (2 * (place % places) + 1.0 - places) / (2.0 * places)
        for lane in range(lanes):
            inside = -row[lane + EIGHT * GAP]
            inside -= s * row[lane + EIGHT * BY_EDGES] + t * row[lane + EIGHT * (BY_EDGES + 1)]
            row[lane + EIGHT * GRADE] += 1.0 if inside > 0.0 else 0.0
            inside = max(inside, 0.0)
            row[lane + EIGHT * SUMS] += inside
            row[lane + EIGHT * (SUMS + 1)] += s * inside
            row[lane + EIGHT * (SUMS + 2)] += t * inside
    for lane in range(lanes):
        gap, by_u = row[lane + EIGHT * GAP], row[lane + EIGHT * BY_EDGES]
        by_v = row[lane + EIGHT * (BY_EDGES + 1)]
        s, t = row[lane + EIGHT * LEAN], row[lane + EIGHT * (LEAN + 1)]
        # what no part of the patch touches is as far away as the place where the force would act
        away = max(gap + s * by_u + t * by_v, JUST)
        whole, outside = 2.0 * gap < -(abs(by_u) + abs(by_v)), 2.0 * gap >= abs(by_u) + abs(by_v)
        force, touched = row[lane + EIGHT * SUMS], row[lane + EIGHT * GRADE]
        part = (not whole) & (not outside) & (force > 0.0)
        s = spread * by_u / gap if whole else row[lane + EIGHT * (SUMS + 1)] / force if part else s
        t = spread * by_v / gap if whole else row[lane + EIGHT * (SUMS + 2)] / force if part else t
        row[lane + EIGHT * GAP] = gap if whole else -force / touched if part else away
        row[lane + EIGHT * GRADE] = touched / places**2 if part else 1.0
        row[lane + EIGHT * NEXT] = s if whole | part else row[lane + EIGHT * NEXT]
        row[lane + EIGHT * (NEXT + 1)] = t if whole | part else row[lane + EIGHT * (NEXT + 1)]


@njit(cache=True, error_model="numpy")
def find_gaps(row, lanes, rows, group, kind, shape, places, place, turn, motion, slow):
    """GAP of a group's points to a tool of any kind, `slow` [m] being how far one goes that is not followed on its way.

    For a patch under a tool with edges it is that of the tangent of what presses its places, minus F over its slope: so
    its force is one that grows in proportion, and goes by where the patch is now."""
    others = -1
    if kind == BOX and places > 0:
        others, parted = _face_patches(row, shape[0], shape[1], shape[2], shape[3], place, turn, motion, slow * slow)
        _press_faces(row, lanes, places, parted)
    for lane in range(EIGHT):
        if rows[group, POINT + lane] < 0 or others >> lane & 1 == 0:
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
            depth, grade, mx, my, mz, s, t = patch_press(
                kind, shape, place, turn, middle, u, v, row[lane + EIGHT * SAG], places
            )[:7]
            gap = max(gap, JUST)
            if depth > 0.0:
                row[lane + EIGHT * GRADE] = grade
                row[lane + EIGHT * NEXT], row[lane + EIGHT * (NEXT + 1)] = s, t
                gap, nx, ny, nz = -depth / grade, mx, my, mz
        row[lane + EIGHT * GAP] = gap
        row[lane + EIGHT * (GAP + 1)] = nx
        row[lane + EIGHT * (GAP + 2)] = ny
        row[lane + EIGHT * (GAP + 3)] = nz


@batch_kernel
def find_plane_gaps(row, lanes, normal, place):
    """GAP of a group's points to a plane through this place; lanes is EIGHT, see `records.Contacts`."""
    nx, ny, nz = normal
    px, py, pz = place
    for lane in range(lanes):
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
def find_all_gaps(row, lanes, rows, group, kind, shape, places, place, turn, motion, slow):
    """GAP of a group's points to a tool: to a box with sharp edges as of `faced_gap`."""
    if kind == PLANE:
        find_plane_gaps(row, lanes, rotate(turn, shape[0], shape[1], shape[2]), place)
    elif faces(kind, shape):
        find_box_gaps(row, shape[0], shape[1], shape[2], place, turn)
    else:
        find_gaps(row, lanes, rows, group, kind, shape, places, place, turn, motion, slow)
