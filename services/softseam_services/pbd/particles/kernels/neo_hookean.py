"""The neo-Hookean pair of a tetrahedron (Macklin and Mueller 2021, "A constraint-based formulation of stable
neo-Hookean materials"): C_D = sqrt(F:F) and C_H = det F - gamma, one after the other.

Their energies with alpha_D = 1/(mu V) and alpha_H = 1/(lambda' V) add up to V (mu/2 F:F + lambda'/2 (J - gamma)^2),
which for gamma = 1 + mu/lambda' is at rest where F = 1 and meets Hooke's law there for lambda' = lambda + mu.
Gradients by x_k, k = 1..3: P d_k with P = F/C_D and P = cof F, d_k the rows of D_m^-1; that of x_0 is minus their sum.
By these energies a point, F = 0, would be at rest, too: the push of C_H is quadratic there, the pull of C_D linear. So
the stiffness mu is multiplied with min(1, F:F), which makes mu/4 (1 + (F:F)^2) of mu/2 F:F where F:F < 1, that is in
tetrahedra crushed from all sides; and what is a point is pushed as if it were SEED of its size.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import batch_kernel, lane_kernel, move_four
from softseam_services.pbd.kernels.neo_hookean import cofactors

from .corners import CORNER as NODE
from .corners import gather_corner, scatter_corner
from .distance import TINY
from .tetrahedron import deformation, is_crushed, metric, stretched

WIDTH = 8
SHAPE, SOFT, GAMMA, LAMBDA = 4 * NODE, 4 * NODE + 72, 4 * NODE + 88, 4 * NODE + 96
PULL = 4 * NODE + 112
N_WORK = PULL + 12 * WIDTH
SEED = 0.01
AT_ONCE = 0.4
"""h^2 times the square of a tetrahedron's own frequency of volume up to which its stress acts at once, eq. (2)"""


@lane_kernel
def _bring(ws, xw, nodes, inverse, soft, gamma, batch):
    """Corners, shapes, compliances and gamma of a batch into the workspace."""
    for four in range(0, WIDTH, 4):
        for i in range(4):
            gather_corner(ws, xw, nodes, batch, i, four)
        for entry in range(9):
            move_four(ws, SHAPE + 8 * entry + four, inverse, WIDTH * (9 * batch + entry) + four)
        for each in range(2):
            move_four(ws, SOFT + 8 * each + four, soft, WIDTH * (2 * batch + each) + four)
        move_four(ws, GAMMA + four, gamma, WIDTH * batch + four)


@lane_kernel
def _shape(ws, lane):
    """D_m^-1 (9 values) and F = D_s D_m^-1 (9 values), row by row."""
    d = (
        *(ws[SHAPE + lane], ws[SHAPE + 8 + lane], ws[SHAPE + 16 + lane]),
        *(ws[SHAPE + 24 + lane], ws[SHAPE + 32 + lane], ws[SHAPE + 40 + lane]),
        *(ws[SHAPE + 48 + lane], ws[SHAPE + 56 + lane], ws[SHAPE + 64 + lane]),
    )
    x, y, z = ws[lane], ws[8 + lane], ws[16 + lane]
    edges = (
        *(ws[NODE + lane] - x, ws[NODE + 8 + lane] - y, ws[NODE + 16 + lane] - z),
        *(ws[2 * NODE + lane] - x, ws[2 * NODE + 8 + lane] - y, ws[2 * NODE + 16 + lane] - z),
        *(ws[3 * NODE + lane] - x, ws[3 * NODE + 8 + lane] - y, ws[3 * NODE + 16 + lane] - z),
    )
    return d, stretched(edges, d)


@lane_kernel
def _square(f):
    """F:F."""
    square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] + f[3] * f[3] + f[4] * f[4]
    return square + f[5] * f[5] + f[6] * f[6] + f[7] * f[7] + f[8] * f[8]


@lane_kernel
def _along(p, d):
    """P d_k of the corners 1, 2, 3 (9 values); that of corner 0 is minus their sum."""
    return (
        *(p[0] * d[0] + p[1] * d[1] + p[2] * d[2], p[3] * d[0] + p[4] * d[1] + p[5] * d[2]),
        *(p[6] * d[0] + p[7] * d[1] + p[8] * d[2], p[0] * d[3] + p[1] * d[4] + p[2] * d[5]),
        *(p[3] * d[3] + p[4] * d[4] + p[5] * d[5], p[6] * d[3] + p[7] * d[4] + p[8] * d[5]),
        *(p[0] * d[6] + p[1] * d[7] + p[2] * d[8], p[3] * d[6] + p[4] * d[7] + p[5] * d[8]),
        p[6] * d[6] + p[7] * d[7] + p[8] * d[8],
    )


@lane_kernel
def _weighted(ws, lane, g):
    """sum w |g|^2 of the corners, with g of `_along`."""
    x, y, z = g[0] + g[3] + g[6], g[1] + g[4] + g[7], g[2] + g[5] + g[8]
    weight = ws[24 + lane] * (x * x + y * y + z * z)
    weight += ws[NODE + 24 + lane] * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    weight += ws[2 * NODE + 24 + lane] * (g[3] * g[3] + g[4] * g[4] + g[5] * g[5])
    return weight + ws[3 * NODE + 24 + lane] * (g[6] * g[6] + g[7] * g[7] + g[8] * g[8])


@lane_kernel
def _move(ws, lane, step, g):
    """x += step w g of the corners, with g of `_along`."""
    s = -step * ws[24 + lane]
    ws[lane] += s * (g[0] + g[3] + g[6])
    ws[8 + lane] += s * (g[1] + g[4] + g[7])
    ws[16 + lane] += s * (g[2] + g[5] + g[8])
    s = step * ws[NODE + 24 + lane]
    ws[NODE + lane] += s * g[0]
    ws[NODE + 8 + lane] += s * g[1]
    ws[NODE + 16 + lane] += s * g[2]
    s = step * ws[2 * NODE + 24 + lane]
    ws[2 * NODE + lane] += s * g[3]
    ws[2 * NODE + 8 + lane] += s * g[4]
    ws[2 * NODE + 16 + lane] += s * g[5]
    s = step * ws[3 * NODE + 24 + lane]
    ws[3 * NODE + lane] += s * g[6]
    ws[3 * NODE + 8 + lane] += s * g[7]
    ws[3 * NODE + 16 + lane] += s * g[8]


@batch_kernel
def project_pairs(ws, xw, nodes, inverse, soft, gamma, lam):
    """Project both constraints of every tetrahedron once, batch after batch.

    ws (N_WORK,) workspace; xw (n + 8, 4) updated in place; nodes (b, 4, 8); inverse (b, 9, 8) D_m^-1; soft (b, 2, 8)
    alpha/h^2 of C_D and C_H; gamma (b, 8); lam (b, 2, 8) in place
    """
    for batch in range(len(nodes)):
        _bring(ws, xw, nodes, inverse, soft, gamma, batch)
        for four in range(0, WIDTH, 4):
            for each in range(2):
                move_four(ws, LAMBDA + 8 * each + four, lam, WIDTH * (2 * batch + each) + four)
        for lane in range(WIDTH):
            d, f = _shape(ws, lane)
            square, g = _square(f), _along(f, d)  # g: gradients times the value
            hold, value = min(1.0, square), np.sqrt(square + TINY)
            per = 1.0 / value
            alpha, before = ws[SOFT + lane], ws[LAMBDA + lane]
            weight = hold * _weighted(ws, lane, g) * per * per
            change = -(hold * value + alpha * before) / (weight + alpha + TINY)  # eq. (1), both sides times hold
            ws[LAMBDA + lane] = before + change
            _move(ws, lane, change * per, g)
            _, f = _shape(ws, lane)
            p, J = cofactors(f)
            g = _along(p, d)
            alpha, before = ws[SOFT + 8 + lane], ws[LAMBDA + 8 + lane]
            change = -(J - ws[GAMMA + lane] + alpha * before) / (_weighted(ws, lane, g) + alpha + TINY)  # eq. (1)
            ws[LAMBDA + 8 + lane] = before + change
            _move(ws, lane, change, g)
        for four in range(0, WIDTH, 4):
            for i in range(4):
                scatter_corner(ws, xw, nodes, batch, i, four)
            for each in range(2):
                move_four(lam, WIDTH * (2 * batch + each) + four, ws, LAMBDA + 8 * each + four)


@batch_kernel
def pull_pairs(ws, xw, nodes, inverse, soft, gamma, lam, pull):
    """lambda = -share C/alpha~ of every tetrahedron into lam (b, 2, 8), and what it pulls with, eq. (2), onto pull.

    pull (n + 8, 4) [kg m]; the fourth column is not used; the rest as of `project_pairs`, and not changed
    """
    for batch in range(len(nodes)):
        _bring(ws, xw, nodes, inverse, soft, gamma, batch)
        for lane in range(WIDTH):
            d, f = _shape(ws, lane)
            square = _square(f)
            seed = SEED if square < SEED * SEED else 0.0
            f = (f[0] + seed, f[1], f[2], f[3], f[4] + seed, f[5], f[6], f[7], f[8] + seed)
            c, J = cofactors(f)
            at_once = AT_ONCE * ws[SOFT + 8 + lane] / (_weighted(ws, lane, _along(c, d)) + TINY)
            share = at_once if at_once < 1.0 else 1.0
            m = -share * min(1.0, square) / (ws[SOFT + lane] + TINY)
            n = -share * (J - ws[GAMMA + lane]) / (ws[SOFT + 8 + lane] + TINY)
            ws[LAMBDA + lane], ws[LAMBDA + 8 + lane] = m * np.sqrt(square), n
            p = (  # -P = m F + n cof F
                *(m * f[0] + n * c[0], m * f[1] + n * c[1], m * f[2] + n * c[2]),
                *(m * f[3] + n * c[3], m * f[4] + n * c[4], m * f[5] + n * c[5]),
                *(m * f[6] + n * c[6], m * f[7] + n * c[7], m * f[8] + n * c[8]),
            )
            g = _along(p, d)
            ws[PULL + lane], ws[PULL + 8 + lane] = -(g[0] + g[3] + g[6]), -(g[1] + g[4] + g[7])
            ws[PULL + 16 + lane] = -(g[2] + g[5] + g[8])
            ws[PULL + 24 + lane], ws[PULL + 32 + lane], ws[PULL + 40 + lane] = g[0], g[1], g[2]
            ws[PULL + 48 + lane], ws[PULL + 56 + lane], ws[PULL + 64 + lane] = g[3], g[4], g[5]
            ws[PULL + 72 + lane], ws[PULL + 80 + lane], ws[PULL + 88 + lane] = g[6], g[7], g[8]
        for four in range(0, WIDTH, 4):
            for i in range(4):
                gather_corner(ws, pull, nodes, batch, i, four)
        for i in range(4):
            for lane in range(3 * WIDTH):
                ws[NODE * i + lane] += ws[PULL + 3 * WIDTH * i + lane]
        for four in range(0, WIDTH, 4):
            for i in range(4):
                scatter_corner(ws, pull, nodes, batch, i, four)
            for each in range(2):
                move_four(lam, WIDTH * (2 * batch + each) + four, ws, LAMBDA + 8 * each + four)


@njit(cache=True, error_model="numpy")
def begin_pairs(ws, xw, nodes, inverse, soft, gamma, lam, pull):
    """Multipliers at once those of the positions, and the way that their forces make in a substep: so the sweeps are
    left what has changed since.

    lambda = -C/alpha~,  x_k += w_k sum lambda grad_k C = -w_k h^2 V P D_m^-T e_k                                (2)

    Both multipliers are large at rest and opposite. From zero, each projection would find the gradients that the one
    before has turned, and their fixed point is not the energy's. A tetrahedron so stiff or so stretched that its own
    stress would throw it about takes a share of both. xw (n + 8, 4) and lam in place; pull (n + 8, 4) is scratch, zero
    before and after.
    """
    if len(nodes) == 0:
        return
    pull_pairs(ws, xw, nodes, inverse, soft, gamma, lam, pull)
    for i in range(len(pull)):
        for axis in range(3):
            xw[i, axis] += xw[i, 3] * pull[i, axis]
            pull[i, axis] = 0.0


@njit(cache=True, error_model="numpy")
def measure_pairs(xw, nodes, row, inverse, compliance, soft, lam, strain, result):
    """How well pairs are met: result (6,) in place, as of `distance.measure_distances`: a violation is |C + alpha~
    lambda|, without unit as it is, the largest strain that of any component of Green's, and the energy that of the
    law, zero at rest, V (mu/2 (F:F - 3) - mu (J - 1) + lambda'/2 (J - 1)^2) but for what is crushed from all sides.
    strain (n,) [1] is raised."""
    energy, worst, total, most, count, crushed = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            f = deformation(xw, i, j, k, m, inverse, batch, lane)
            crushed += 1.0 if is_crushed(f) else 0.0
            xx, yy, zz, xy, xz, yz = metric(f)
            J = cofactors(f)[1]
            stiff, bulk = 1.0 / compliance[batch, 0, lane], 1.0 / compliance[batch, 1, lane]
            gamma = 1.0 + stiff / bulk
            square = xx + yy + zz
            held = square if square > 1.0 else 0.5 * (1.0 + square * square)
            energy += 0.5 * stiff * (held - 3.0) + 0.5 * bulk * (J - 1.0) ** 2 - stiff * (J - 1.0)
            if xw[i, 3] + xw[j, 3] + xw[k, 3] + xw[m, 3] > 0.0:
                off = abs(min(1.0, square) * np.sqrt(square) + soft[batch, 0, lane] * lam[batch, 0, lane])
                volume_off = abs(J - gamma + soft[batch, 1, lane] * lam[batch, 1, lane])
                worst = max(worst, off, volume_off)
                total += off + volume_off
            largest = max(0.5 * abs(xx - 1.0), 0.5 * abs(yy - 1.0), 0.5 * abs(zz - 1.0))
            largest = max(largest, 0.5 * abs(xy), 0.5 * abs(xz), 0.5 * abs(yz))
            most = max(most, largest)
            for corner in range(4):
                node = nodes[batch, corner, lane]
                strain[node] = max(strain[node], largest)
            count += 2.0
    result[0], result[1], result[2], result[3], result[4], result[5] = energy, worst, total, most, count, crushed
