"""Isometric bending: the vector C = sum_i c_i x_i of four particles, zero where they are flat; gradients c_i times one.

With energy 1/2 k |C|^2 the compliance is alpha = 1/k [m/N]. The three components share one denominator, so they are
solved at once. Quadratic in x: nothing is divided by a length or an angle, so a flat hinge, an empty one and a folded
one are alike (Bergou et al. 2006).
"""

import numpy as np

from softseam_services.pbd.kernels.lanes import batch_kernel, move_four

from .corners import CORNER as NODE
from .corners import gather_corner, scatter_corner

WIDTH = 8
COEFFICIENT, INVERSE, SOFT, LAMBDA = 4 * NODE, 4 * NODE + 32, 4 * NODE + 40, 4 * NODE + 48
N_WORK = 4 * NODE + 72


@batch_kernel
def prepare_bends(xw, nodes, coefficient, compliance, h, stiffness, inverse, soft):
    """alpha~ and the inverse of the denominator of eq. (1), into inverse and soft (b, 8) in place; as for distances."""
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            alpha = compliance[batch, lane] / (h * h)
            share = 1.0
            if stiffness > 0.0:
                alpha, share = 0.0, stiffness
            weight = 0.0
            for i in range(4):
                weight += xw[nodes[batch, i, lane], 3] * coefficient[batch, i, lane] ** 2
            inverse[batch, lane] = share / (weight + alpha) if weight > 0.0 else 0.0
            soft[batch, lane] = alpha


@batch_kernel
def project_bends(ws, xw, nodes, coefficient, inverse, soft, lam):
    """Project every bend once, batch after batch.

    nodes             (b, 4, 8)   particle ids; a bend of three names one twice, with the second coefficient 0
    coefficient       (b, 4, 8)   c
    inverse, soft     (b, 8)      [kg], [1/kg]
    lam               (b, 3, 8)   multipliers [kg m], updated in place
    """
    for batch in range(len(nodes)):
        for four in range(0, WIDTH, 4):
            for i in range(4):
                gather_corner(ws, xw, nodes, batch, i, four)
                move_four(ws, COEFFICIENT + 8 * i + four, coefficient, WIDTH * (4 * batch + i) + four)
            move_four(ws, INVERSE + four, inverse, WIDTH * batch + four)
            move_four(ws, SOFT + four, soft, WIDTH * batch + four)
            for axis in range(3):
                move_four(ws, LAMBDA + 8 * axis + four, lam, WIDTH * (3 * batch + axis) + four)
        for lane in range(WIDTH):
            c0, c1 = ws[COEFFICIENT + lane], ws[COEFFICIENT + 8 + lane]
            c2, c3 = ws[COEFFICIENT + 16 + lane], ws[COEFFICIENT + 24 + lane]
            w0, w1 = c0 * ws[24 + lane], c1 * ws[NODE + 24 + lane]
            w2, w3 = c2 * ws[2 * NODE + 24 + lane], c3 * ws[3 * NODE + 24 + lane]
            inv, alpha = ws[INVERSE + lane], ws[SOFT + lane]
            for axis in range(3):
                at = 8 * axis + lane
                value = c0 * ws[at] + c1 * ws[NODE + at] + c2 * ws[2 * NODE + at] + c3 * ws[3 * NODE + at]
                change = -(value + alpha * ws[LAMBDA + at]) * inv  # eq. (1)
                ws[LAMBDA + at] += change
                ws[at] += w0 * change
                ws[NODE + at] += w1 * change
                ws[2 * NODE + at] += w2 * change
                ws[3 * NODE + at] += w3 * change
        for four in range(0, WIDTH, 4):
            for k in range(4):
                i = 3 - k  # a particle that is named twice keeps what its first name says
                scatter_corner(ws, xw, nodes, batch, i, four)
            for axis in range(3):
                move_four(lam, WIDTH * (3 * batch + axis) + four, ws, LAMBDA + 8 * axis + four)


@batch_kernel
def measure_bends(xw, nodes, row, coefficient, soft, lam, h, spacing, result):
    """As `measure_distances`, a violation relative to the particles' spacing [m]: result (5,) in place."""
    energy, worst, total, most, count = 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            square, off, free = 0.0, 0.0, 0.0
            for axis in range(3):
                value = 0.0
                for i in range(4):
                    value += coefficient[batch, i, lane] * xw[nodes[batch, i, lane], axis]
                square += value * value
                energy -= 0.5 * value * lam[batch, axis, lane] / (h * h)
                off += (value + soft[batch, lane] * lam[batch, axis, lane]) ** 2
            for i in range(4):
                free += abs(coefficient[batch, i, lane]) * xw[nodes[batch, i, lane], 3]
            violation = np.sqrt(off) / spacing if free > 0.0 else 0.0
            worst = max(worst, violation)
            total += violation
            most = max(most, np.sqrt(square) / spacing)
            count += 1.0
    result[0], result[1], result[2], result[3], result[4] = energy, worst, total, most, count


@batch_kernel
def add_bend_forces(nodes, row, coefficient, lam, h, force):
    """Add lambda grad C / h^2 of the bends [N] to force (n, 3) in place."""
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            for i in range(4):
                size = coefficient[batch, i, lane] / (h * h)
                for axis in range(3):
                    force[nodes[batch, i, lane], axis] += size * lam[batch, axis, lane]
