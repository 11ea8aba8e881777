"""The neo-Hookean pair of a tetrahedron (Macklin and Mueller 2021, "A constraint-based formulation of stable
neo-Hookean materials"): C_D = sqrt(F:F) and C_H = det F - gamma, one after the other.

Their energies with alpha_D = 1/(mu V) and alpha_H = 1/(lambda' V) add up to V (mu/2 F:F + lambda'/2 (J - gamma)^2),
which for gamma = 1 + mu/lambda' is at rest where F = 1 and meets Hooke's law there for lambda' = lambda + mu.
Gradients by x_k, k = 1..3: P d_k with P = F/C_D and P = cof F, d_k the rows of D_m^-1; that of x_0 is minus their sum.
"""

from __future__ import annotations

import numpy as np

from softseam_services.compiled_once import njit
from softseam_services.pbd.kernels.lanes import batch_kernel, lane_kernel, move_four

from .corners import CORNER as NODE
from .corners import gather_corner, scatter_corner
from .tetrahedron import deformation

WIDTH = 8
SHAPE, SOFT, GAMMA, LAMBDA = 4 * NODE, 4 * NODE + 72, 4 * NODE + 88, 4 * NODE + 96
PULL = 4 * NODE + 112
N_WORK = PULL + 12 * WIDTH
TINY = 1e-100
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
            d0, d1, d2 = ws[SHAPE + lane], ws[SHAPE + 8 + lane], ws[SHAPE + 16 + lane]
            d3, d4, d5 = ws[SHAPE + 24 + lane], ws[SHAPE + 32 + lane], ws[SHAPE + 40 + lane]
            d6, d7, d8 = ws[SHAPE + 48 + lane], ws[SHAPE + 56 + lane], ws[SHAPE + 64 + lane]
            w0, w1 = ws[24 + lane], ws[NODE + 24 + lane]
            w2, w3 = ws[2 * NODE + 24 + lane], ws[3 * NODE + 24 + lane]
            x0, y0, z0 = ws[lane], ws[8 + lane], ws[16 + lane]
            x1, y1, z1 = ws[NODE + lane] - x0, ws[NODE + 8 + lane] - y0, ws[NODE + 16 + lane] - z0
            x2, y2, z2 = ws[2 * NODE + lane] - x0, ws[2 * NODE + 8 + lane] - y0, ws[2 * NODE + 16 + lane] - z0
            x3, y3, z3 = ws[3 * NODE + lane] - x0, ws[3 * NODE + 8 + lane] - y0, ws[3 * NODE + 16 + lane] - z0
            a, b, c = x1 * d0 + x2 * d3 + x3 * d6, x1 * d1 + x2 * d4 + x3 * d7, x1 * d2 + x2 * d5 + x3 * d8
            d, e, f = y1 * d0 + y2 * d3 + y3 * d6, y1 * d1 + y2 * d4 + y3 * d7, y1 * d2 + y2 * d5 + y3 * d8
            g, h, k = z1 * d0 + z2 * d3 + z3 * d6, z1 * d1 + z2 * d4 + z3 * d7, z1 * d2 + z2 * d5 + z3 * d8
            value = np.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + k * k + TINY)
            # C_D: gradients times its value, F d_k
            x1, y1, z1 = a * d0 + b * d1 + c * d2, d * d0 + e * d1 + f * d2, g * d0 + h * d1 + k * d2
            x2, y2, z2 = a * d3 + b * d4 + c * d5, d * d3 + e * d4 + f * d5, g * d3 + h * d4 + k * d5
            x3, y3, z3 = a * d6 + b * d7 + c * d8, d * d6 + e * d7 + f * d8, g * d6 + h * d7 + k * d8
            x0, y0, z0 = x1 + x2 + x3, y1 + y2 + y3, z1 + z2 + z3
            weight = w0 * (x0 * x0 + y0 * y0 + z0 * z0) + w1 * (x1 * x1 + y1 * y1 + z1 * z1)
            weight += w2 * (x2 * x2 + y2 * y2 + z2 * z2) + w3 * (x3 * x3 + y3 * y3 + z3 * z3)
            per = 1.0 / value
            alpha, before = ws[SOFT + lane], ws[LAMBDA + lane]
            change = -(value + alpha * before) / (weight * per * per + alpha + TINY)  # eq. (1)
            ws[LAMBDA + lane] = before + change
            step = change * per
            s0, s1, s2, s3 = -step * w0, step * w1, step * w2, step * w3
            x0, y0, z0, x1, y1, z1 = s0 * x0, s0 * y0, s0 * z0, s1 * x1, s1 * y1, s1 * z1
            x2, y2, z2, x3, y3, z3 = s2 * x2, s2 * y2, s2 * z2, s3 * x3, s3 * y3, s3 * z3
            ws[lane] += x0
            ws[8 + lane] += y0
            ws[16 + lane] += z0
            ws[NODE + lane] += x1
            ws[NODE + 8 + lane] += y1
            ws[NODE + 16 + lane] += z1
            ws[2 * NODE + lane] += x2
            ws[2 * NODE + 8 + lane] += y2
            ws[2 * NODE + 16 + lane] += z2
            ws[3 * NODE + lane] += x3
            ws[3 * NODE + 8 + lane] += y3
            ws[3 * NODE + 16 + lane] += z3
            x1, y1, z1, x2, y2, z2 = x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0
            x3, y3, z3 = x3 - x0, y3 - y0, z3 - z0
            a, b, c = a + x1 * d0 + x2 * d3 + x3 * d6, b + x1 * d1 + x2 * d4 + x3 * d7, c + x1 * d2 + x2 * d5 + x3 * d8
            d, e, f = d + y1 * d0 + y2 * d3 + y3 * d6, e + y1 * d1 + y2 * d4 + y3 * d7, f + y1 * d2 + y2 * d5 + y3 * d8
            g, h, k = g + z1 * d0 + z2 * d3 + z3 * d6, h + z1 * d1 + z2 * d4 + z3 * d7, k + z1 * d2 + z2 * d5 + z3 * d8
            # C_H: cof F d_k
            ca, cb, cc = e * k - f * h, f * g - d * k, d * h - e * g
            cd, ce, cf = c * h - b * k, a * k - c * g, b * g - a * h
            cg, ch, ci = b * f - c * e, c * d - a * f, a * e - b * d
            value = a * ca + b * cb + c * cc - ws[GAMMA + lane]
            x1, y1, z1 = ca * d0 + cb * d1 + cc * d2, cd * d0 + ce * d1 + cf * d2, cg * d0 + ch * d1 + ci * d2
            x2, y2, z2 = ca * d3 + cb * d4 + cc * d5, cd * d3 + ce * d4 + cf * d5, cg * d3 + ch * d4 + ci * d5
            x3, y3, z3 = ca * d6 + cb * d7 + cc * d8, cd * d6 + ce * d7 + cf * d8, cg * d6 + ch * d7 + ci * d8
            x0, y0, z0 = x1 + x2 + x3, y1 + y2 + y3, z1 + z2 + z3
            weight = w0 * (x0 * x0 + y0 * y0 + z0 * z0) + w1 * (x1 * x1 + y1 * y1 + z1 * z1)
            weight += w2 * (x2 * x2 + y2 * y2 + z2 * z2) + w3 * (x3 * x3 + y3 * y3 + z3 * z3)
            alpha, before = ws[SOFT + 8 + lane], ws[LAMBDA + 8 + lane]
            change = -(value + alpha * before) / (weight + alpha + TINY)  # eq. (1)
            ws[LAMBDA + 8 + lane] = before + change
            s0, s1, s2, s3 = -change * w0, change * w1, change * w2, change * w3
            ws[lane] += s0 * x0
            ws[8 + lane] += s0 * y0
            ws[16 + lane] += s0 * z0
            ws[NODE + lane] += s1 * x1
            ws[NODE + 8 + lane] += s1 * y1
            ws[NODE + 16 + lane] += s1 * z1
            ws[2 * NODE + lane] += s2 * x2
            ws[2 * NODE + 8 + lane] += s2 * y2
            ws[2 * NODE + 16 + lane] += s2 * z2
            ws[3 * NODE + lane] += s3 * x3
            ws[3 * NODE + 8 + lane] += s3 * y3
            ws[3 * NODE + 16 + lane] += s3 * z3
        for four in range(0, WIDTH, 4):
            for i in range(4):
                scatter_corner(ws, xw, nodes, batch, i, four)
            for each in range(2):
                move_four(lam, WIDTH * (2 * batch + each) + four, ws, LAMBDA + 8 * each + four)


@njit(cache=True, error_model="numpy")
def prepare_pairs(compliance, h, soft):
    """alpha/h^2 (b, 2, 8) from compliances alpha [1/J]; soft in place."""
    for batch in range(len(compliance)):
        for each in range(2):
            for lane in range(WIDTH):
                soft[batch, each, lane] = compliance[batch, each, lane] / (h * h)


@batch_kernel
def pull_pairs(ws, xw, nodes, inverse, soft, gamma, lam, pull):
    """lambda = -share C/alpha~ of every tetrahedron into lam (b, 2, 8), and what it pulls with, eq. (2), onto pull.

    pull (n + 8, 4) [kg m]; the fourth column is not used; the rest as of `project_pairs`, and not changed
    """
    for batch in range(len(nodes)):
        _bring(ws, xw, nodes, inverse, soft, gamma, batch)
        for lane in range(WIDTH):
            d0, d1, d2 = ws[SHAPE + lane], ws[SHAPE + 8 + lane], ws[SHAPE + 16 + lane]
            d3, d4, d5 = ws[SHAPE + 24 + lane], ws[SHAPE + 32 + lane], ws[SHAPE + 40 + lane]
            d6, d7, d8 = ws[SHAPE + 48 + lane], ws[SHAPE + 56 + lane], ws[SHAPE + 64 + lane]
            w0, w1 = ws[24 + lane], ws[NODE + 24 + lane]
            w2, w3 = ws[2 * NODE + 24 + lane], ws[3 * NODE + 24 + lane]
            x0, y0, z0 = ws[lane], ws[8 + lane], ws[16 + lane]
            x1, y1, z1 = ws[NODE + lane] - x0, ws[NODE + 8 + lane] - y0, ws[NODE + 16 + lane] - z0
            x2, y2, z2 = ws[2 * NODE + lane] - x0, ws[2 * NODE + 8 + lane] - y0, ws[2 * NODE + 16 + lane] - z0
            x3, y3, z3 = ws[3 * NODE + lane] - x0, ws[3 * NODE + 8 + lane] - y0, ws[3 * NODE + 16 + lane] - z0
            a, b, c = x1 * d0 + x2 * d3 + x3 * d6, x1 * d1 + x2 * d4 + x3 * d7, x1 * d2 + x2 * d5 + x3 * d8
            d, e, f = y1 * d0 + y2 * d3 + y3 * d6, y1 * d1 + y2 * d4 + y3 * d7, y1 * d2 + y2 * d5 + y3 * d8
            g, h, k = z1 * d0 + z2 * d3 + z3 * d6, z1 * d1 + z2 * d4 + z3 * d7, z1 * d2 + z2 * d5 + z3 * d8
            value = np.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + k * k)
            ca, cb, cc = e * k - f * h, f * g - d * k, d * h - e * g
            cd, ce, cf = c * h - b * k, a * k - c * g, b * g - a * h
            cg, ch, ci = b * f - c * e, c * d - a * f, a * e - b * d
            off = a * ca + b * cb + c * cc - ws[GAMMA + lane]
            x1, y1, z1 = ca * d0 + cb * d1 + cc * d2, cd * d0 + ce * d1 + cf * d2, cg * d0 + ch * d1 + ci * d2
            x2, y2, z2 = ca * d3 + cb * d4 + cc * d5, cd * d3 + ce * d4 + cf * d5, cg * d3 + ch * d4 + ci * d5
            x3, y3, z3 = ca * d6 + cb * d7 + cc * d8, cd * d6 + ce * d7 + cf * d8, cg * d6 + ch * d7 + ci * d8
            x0, y0, z0 = x1 + x2 + x3, y1 + y2 + y3, z1 + z2 + z3
            weight = w0 * (x0 * x0 + y0 * y0 + z0 * z0) + w1 * (x1 * x1 + y1 * y1 + z1 * z1)
            weight += w2 * (x2 * x2 + y2 * y2 + z2 * z2) + w3 * (x3 * x3 + y3 * y3 + z3 * z3)
            at_once = AT_ONCE * ws[SOFT + 8 + lane] / (weight + TINY)
            share = at_once if at_once < 1.0 else 1.0
            m, n = -share / (ws[SOFT + lane] + TINY), -share * off / (ws[SOFT + 8 + lane] + TINY)
            ws[LAMBDA + lane], ws[LAMBDA + 8 + lane] = m * value, n
            # P D_m^-T, P = -(m F + n cof F)
            a, b, c, d, e, f = (
                m * a + n * ca,
                m * b + n * cb,
                m * c + n * cc,
                m * d + n * cd,
                m * e + n * ce,
                m * f + n * cf,
            )
            g, h, k = m * g + n * cg, m * h + n * ch, m * k + n * ci
            x1, y1, z1 = a * d0 + b * d1 + c * d2, d * d0 + e * d1 + f * d2, g * d0 + h * d1 + k * d2
            x2, y2, z2 = a * d3 + b * d4 + c * d5, d * d3 + e * d4 + f * d5, g * d3 + h * d4 + k * d5
            x3, y3, z3 = a * d6 + b * d7 + c * d8, d * d6 + e * d7 + f * d8, g * d6 + h * d7 + k * d8
            ws[PULL + lane], ws[PULL + 8 + lane], ws[PULL + 16 + lane] = -x1 - x2 - x3, -y1 - y2 - y3, -z1 - z2 - z3
            ws[PULL + 24 + lane], ws[PULL + 32 + lane], ws[PULL + 40 + lane] = x1, y1, z1
            ws[PULL + 48 + lane], ws[PULL + 56 + lane], ws[PULL + 64 + lane] = x2, y2, z2
            ws[PULL + 72 + lane], ws[PULL + 80 + lane], ws[PULL + 88 + lane] = x3, y3, z3
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
    """How well pairs are met: result (5,) in place, as of `distance.measure_distances`: a violation is |C + alpha~
    lambda|, without unit as it is, the largest strain that of any component of Green's, and the energy that of the
    law, zero at rest, V (mu/2 (F:F - 3) - mu (J - 1) + lambda'/2 (J - 1)^2). strain (n,) [1] is raised."""
    energy, worst, total, most, count = 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            f = deformation(xw, i, j, k, m, inverse, batch, lane)
            xx = f[0] * f[0] + f[3] * f[3] + f[6] * f[6]
            yy = f[1] * f[1] + f[4] * f[4] + f[7] * f[7]
            zz = f[2] * f[2] + f[5] * f[5] + f[8] * f[8]
            xy = f[0] * f[1] + f[3] * f[4] + f[6] * f[7]
            xz = f[0] * f[2] + f[3] * f[5] + f[6] * f[8]
            yz = f[1] * f[2] + f[4] * f[5] + f[7] * f[8]
            J = f[0] * (f[4] * f[8] - f[5] * f[7]) + f[1] * (f[5] * f[6] - f[3] * f[8])
            J += f[2] * (f[3] * f[7] - f[4] * f[6])
            stiff, bulk = 1.0 / compliance[batch, 0, lane], 1.0 / compliance[batch, 1, lane]
            gamma = 1.0 + stiff / bulk
            energy += 0.5 * stiff * (xx + yy + zz - 3.0) + 0.5 * bulk * (J - 1.0) ** 2 - stiff * (J - 1.0)
            if xw[i, 3] + xw[j, 3] + xw[k, 3] + xw[m, 3] > 0.0:
                off = abs(np.sqrt(xx + yy + zz) + soft[batch, 0, lane] * lam[batch, 0, lane])
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
    result[0], result[1], result[2], result[3], result[4] = energy, worst, total, most, count
