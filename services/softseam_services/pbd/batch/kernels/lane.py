"""What one lane does in a substep. Equations are those of `kernels.substep`, `kernels.block` and `kernels.contact`.

`ws` is a workspace of LANES lanes, own lane `own`: rows as in `kernels.block`, from FORM on a lane's CONSTANTS; or one
of a pair, as in `kernels.pairs`, from N_COLUMNS on its tool. `s` is a group, its lanes WIDE apart.
"""

import numpy as np

from softseam_services.pbd.batch.layout import OLD, POSITION, SOFTNESS, STAR, TURN, WAY, WEIGHTS, A, V, W, X
from softseam_services.pbd.kernels.block import bending_energy, read_row, shape, spread
from softseam_services.pbd.kernels.block_rows import LAM, MU
from softseam_services.pbd.kernels.block_rows import VOLUME as BLOCK_VOLUME
from softseam_services.pbd.kernels.contact import MEMORY, _solve
from softseam_services.pbd.kernels.faced import face_side, faced_gap
from softseam_services.pbd.kernels.form import FORM
from softseam_services.pbd.kernels.hold import SHARE
from softseam_services.pbd.kernels.lanes import LANES, lane_kernel
from softseam_services.pbd.kernels.neo_hookean import cauchy, cofactors, project_lane, turned_back, volumetric
from softseam_services.pbd.kernels.pairs import BEFORE, EIGHT, N_COLUMNS
from softseam_services.pbd.kernels.pairs import FORCE as ROW_FORCE

WIDE = LANES
TOOL = N_COLUMNS
"""row from which on a pair's tool lies"""
MOST = (1 << 40) - 1


@lane_kernel
def first_of(row):
    """Where a row begins. The mask shows the compiler that it is not negative: else loops would not vectorise."""
    return (WIDE * row) & MOST


@lane_kernel
def constants_of(ws, own):
    """Of a lane's blocks, as `block.hoisted` has them."""
    a = own + LANES * FORM
    return (
        *(ws[a], ws[a + LANES], ws[a + LANES * 2], ws[a + LANES * 3], ws[a + LANES * 4], ws[a + LANES * 5]),
        *(ws[a + LANES * 6], ws[a + LANES * 7], ws[a + LANES * 8], ws[a + LANES * 9], ws[a + LANES * 10]),
        *(ws[a + LANES * 11], ws[a + LANES * 12], ws[a + LANES * 13], ws[a + LANES * 14], ws[a + LANES * 15]),
        *(ws[a + LANES * 16], ws[a + LANES * 17], ws[a + LANES * 18], ws[a + LANES * 19], ws[a + LANES * 20]),
        *(ws[a + LANES * 21], ws[a + LANES * 22], ws[a + LANES * 23], ws[a + LANES * 24], ws[a + LANES * 25]),
        *(ws[a + LANES * 26], ws[a + LANES * 27], ws[a + LANES * 28], ws[a + LANES * 29]),
    )


@lane_kernel
def predict_node(s, i, push, keep, h):
    """x* of a node whose numbers begin at i; push (3 values) [m/s^2]."""
    moves = 1.0 if s[i + WIDE * W] > 0.0 else 0.0
    for c in range(3):
        at = i + WIDE * c
        x = s[at + WIDE * X]
        star = x + moves * h * (keep * s[at + WIDE * V] + h * (push[c] + s[at + WIDE * A]))
        s[at + WIDE * OLD] = x
        s[at + WIDE * STAR] = star
        s[at + WIDE * X] = star


@lane_kernel
def finish_node(s, i, per_h):
    """Acceleration and velocity of a node at the end of a substep."""
    per_hh = per_h * per_h
    for c in range(3):
        at = i + WIDE * c
        now = s[at + WIDE * X]
        s[at + WIDE * A] += (now - s[at + WIDE * STAR]) * per_hh
        s[at + WIDE * V] = (now - s[at + WIDE * OLD]) * per_h


@lane_kernel
def counted(held, w):
    """8 times what counts of an inverse mass in a block's local solve, held in so many directions: `kernels.hold`."""
    share = SHARE[0] if held < 0.5 else SHARE[1] if held < 1.5 else SHARE[2] if held < 2.5 else SHARE[3]
    return 8.0 * w * share


@lane_kernel
def solve_block(ws, own, s, at, kappa, hh):
    """Solve the block whose numbers begin at s[at]."""
    w = at + LANES * WEIGHTS
    move = (
        *(hh * s[w], hh * s[w + LANES], hh * s[w + 2 * LANES], hh * s[w + 3 * LANES]),
        *(hh * s[w + 4 * LANES], hh * s[w + 5 * LANES], hh * s[w + 6 * LANES], hh * s[w + 7 * LANES]),
    )
    g = kappa * hh * s[at + LANES * SOFTNESS]
    project_lane(ws, own, s, at, constants_of(ws, own), ws[own + LANES * BLOCK_VOLUME], g, move)


@lane_kernel
def spread_stress(ws, own, s, at):
    """Add a block's forces to what stands in place of its nodes' positions."""
    one = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    k = constants_of(ws, own)
    spread(ws, own, 0, k, one, read_row(s, at, 0, 0))
    spread(ws, own, 1, k, one, read_row(s, at, 0, 1))
    spread(ws, own, 2, k, one, read_row(s, at, 0, 2))


@lane_kernel
def largest_of_eight(ws, own):
    """Of the first eight rows."""
    a = max(max(ws[own], ws[own + LANES]), max(ws[own + 2 * LANES], ws[own + 3 * LANES]))
    b = max(max(ws[own + 4 * LANES], ws[own + 5 * LANES]), max(ws[own + 6 * LANES], ws[own + 7 * LANES]))
    return max(a, b)


@lane_kernel
def look_at_block(ws, own):
    """Von Mises stress squared at a block's middle [Pa^2], its energy [J], and J."""
    k = constants_of(ws, own)
    f, q = shape(ws, own, k)
    xx, yy, zz, yz, xz, xy = cauchy(f, k[MU], k[LAM])
    square = 0.5 * ((xx - yy) * (xx - yy) + (yy - zz) * (yy - zz) + (zz - xx) * (zz - xx))
    square += 3.0 * (yz * yz + xz * xz + xy * xy)
    _, J = cofactors(f)
    energy, _, _ = volumetric(J, k[MU], k[LAM])
    norm = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] + f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
    norm += f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
    energy += 0.5 * k[MU] * (norm - 3.0) + bending_energy(k, turned_back(f, q))
    return square, ws[own + LANES * BLOCK_VOLUME] * energy, J


@lane_kernel
def to_tool(row, own, x, y, z):
    """A direction in the frame of a pair's tool."""
    a = own + EIGHT * (TOOL + TURN)
    return (
        row[a] * x + row[a + 3 * EIGHT] * y + row[a + 6 * EIGHT] * z,
        row[a + EIGHT] * x + row[a + 4 * EIGHT] * y + row[a + 7 * EIGHT] * z,
        row[a + 2 * EIGHT] * x + row[a + 5 * EIGHT] * y + row[a + 8 * EIGHT] * z,
    )


@lane_kernel
def from_tool(row, own, x, y, z):
    """The way back of `to_tool`."""
    a = own + EIGHT * (TOOL + TURN)
    return (
        row[a] * x + row[a + EIGHT] * y + row[a + 2 * EIGHT] * z,
        row[a + 3 * EIGHT] * x + row[a + 4 * EIGHT] * y + row[a + 5 * EIGHT] * z,
        row[a + 6 * EIGHT] * x + row[a + 7 * EIGHT] * y + row[a + 8 * EIGHT] * z,
    )


@lane_kernel
def from_middle(row, own, start):
    """A point in `start` (3 rows), seen from its tool's middle, in the world's directions."""
    a, b = own + EIGHT * start, own + EIGHT * (TOOL + POSITION)
    return row[a] - row[b], row[a + EIGHT] - row[b + EIGHT], row[a + 2 * EIGHT] - row[b + 2 * EIGHT]


@lane_kernel
def begin_on_box(row, own, a, b, c):
    """The side that a point faces, with the tool where it begins the substep."""
    x, y, z = from_middle(row, own, BEFORE)
    x, y, z = to_tool(row, own, x, y, z)
    at = own + EIGHT * ROW_FORCE
    fx, fy, fz = to_tool(row, own, row[at], row[at + EIGHT], row[at + 2 * EIGHT])
    face_side(row, own, a, b, c, x, y, z, fx, fy, fz)


@lane_kernel
def box_gap_of(row, own, a, b, c):
    """Gap and normal of a point to its tool, a box of half edges a, b, c."""
    x, y, z = from_middle(row, own, 0)
    x, y, z = to_tool(row, own, x, y, z)
    gap, nx, ny, nz = faced_gap(row, own, a, b, c, x, y, z)
    nx, ny, nz = from_tool(row, own, nx, ny, nz)
    return gap, nx, ny, nz


@lane_kernel
def plane_gap_of(row, own, a, b, c):
    """Gap and normal of a point to its tool, a plane whose normal is a, b, c in its own frame."""
    x, y, z = from_middle(row, own, 0)
    nx, ny, nz = from_tool(row, own, a, b, c)
    return x * nx + y * ny + z * nz, nx, ny, nz


@lane_kernel
def solve_pair(row, own, found, hh, newer):
    """Contact at this gap and normal, with a tool that moves without a turn."""
    gap, nx, ny, nz = found
    a = own + EIGHT * (TOOL + WAY)
    motion = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, row[a], row[a + EIGHT], row[a + 2 * EIGHT])
    _solve(row, own, gap, nx, ny, nz, motion, hh, newer)


@lane_kernel
def lends(hh):
    """Share of the pressure in its mean over `MEMORY`."""
    h = np.sqrt(hh)
    return h / (MEMORY + h)
