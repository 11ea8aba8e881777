"""Which side of a box a point faces: it touches that side while it is above it, and does not pass to the far side."""

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX
from softseam_services.tools.kernels import box_gap, rotate_back

from .lanes import batch_kernel, lane_kernel
from .pairs import BEFORE, EIGHT, FACED, FORCE


@njit(cache=True, error_model="numpy", forceinline=True)
def faces(kind, shape):
    """Whether points face a side of the tool: a box with sharp edges, as nodes and embedded surfaces feel it."""
    return kind == BOX and shape[3] == 0.0


@lane_kernel
def faced_gap(row, lane, a, b, c, x, y, z):
    """Gap and normal, in the frame of a box of half edges a, b, c, of a point there: to the side that it faced when the
    substep began, where it is above that, else to the box."""
    sx, sy, sz = row[lane + EIGHT * FACED], row[lane + EIGHT * (FACED + 1)], row[lane + EIGHT * (FACED + 2)]
    gap, nx, ny, nz = box_gap(a, b, c, 0.0, x, y, z)
    above = (sx != 0.0 or abs(x) <= a) and (sy != 0.0 or abs(y) <= b) and (sz != 0.0 or abs(z) <= c)
    faces = above and (sx != 0.0 or sy != 0.0 or sz != 0.0)
    gap = sx * x + sy * y + sz * z - (abs(sx) * a + abs(sy) * b + abs(sz) * c) if faces else gap
    return gap, sx if faces else nx, sy if faces else ny, sz if faces else nz


@lane_kernel
def face_side(row, lane, a, b, c, x, y, z, fx, fy, fz):
    """FACED of one point at x, y, z with the force f, both in the frame of a box of half edges a, b, c.

    A point inside is pushed by the side where its force is largest beside its way out there: that of friction alone may
    be larger than what presses, where it is lent or its coefficient is above 1, but the way along a side is long. A
    point that yields may come out behind: there its force points back through the box.
    """
    u, v, w = abs(x) - a, abs(y) - b, abs(z) - c
    beyond = (1.0 if u > 0.0 else 0.0) + (1.0 if v > 0.0 else 0.0) + (1.0 if w > 0.0 else 0.0)
    outwards = (fx * x if u > 0.0 else 0.0) + (fy * y if v > 0.0 else 0.0) + (fz * z if w > 0.0 else 0.0)
    back = beyond == 1.0 and outwards < 0.0
    pushed = fx * fx + fy * fy + fz * fz > 0.0 and (beyond == 0.0 or back)
    u = abs(fx) / (a - (x if fx > 0.0 else -x)) if pushed else u
    v = abs(fy) / (b - (y if fy > 0.0 else -y)) if pushed else v
    w = abs(fz) / (c - (z if fz > 0.0 else -z)) if pushed else w
    x, y, z = fx if pushed else x, fy if pushed else y, fz if pushed else z
    one = 1.0 if beyond <= 1.0 else 0.0
    first = u >= v and u >= w
    second = not first and v >= w
    third = not first and not second
    row[lane + EIGHT * FACED] = (one if x > 0.0 else -one) if first else 0.0
    row[lane + EIGHT * (FACED + 1)] = (one if y > 0.0 else -one) if second else 0.0
    row[lane + EIGHT * (FACED + 2)] = (one if z > 0.0 else -one) if third else 0.0


@batch_kernel
def face_sides(row, a, b, c, place, turn):
    """FACED of eight points: the side of a box that a point outside is beyond, none past an edge; of one inside the
    side that pushes it, by its FORCE, or else the nearest. Tools are where they begin the substep."""
    px, py, pz = place
    for lane in range(EIGHT):
        x, y, z = row[lane + EIGHT * BEFORE], row[lane + EIGHT * (BEFORE + 1)], row[lane + EIGHT * (BEFORE + 2)]
        x, y, z = rotate_back(turn, x - px, y - py, z - pz)
        fx, fy, fz = row[lane + EIGHT * FORCE], row[lane + EIGHT * (FORCE + 1)], row[lane + EIGHT * (FORCE + 2)]
        fx, fy, fz = rotate_back(turn, fx, fy, fz)
        face_side(row, lane, a, b, c, x, y, z, fx, fy, fz)
