"""Distance of two particles: C = |x_a - x_b| - d, gradients n and -n with n the direction from b to a.

As a spring of stiffness k the compliance is alpha = 1/k [m/N].
"""

import numpy as np

from softseam_services.pbd.kernels.lanes import batch_kernel, move_four

from .corners import gather_corner, scatter_corner

WIDTH = 8
TINY = 1e-100
(AX, AY, AZ, AW, BX, BY, BZ, BW, REST, INVERSE, SOFT, LAMBDA) = range(0, 96, 8)
N_WORK = 96


@batch_kernel
def prepare_distances(xw, nodes, compliance, h, stiffness, inverse, soft):
    """alpha~ and the inverse of the denominator of eq. (1) of every constraint, into inverse and soft (b, 8) in place.

    compliance (b, 8) alpha [m/N]. stiffness > 0 makes it classic: no compliance, that share of every violation.
    """
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            alpha = compliance[batch, lane] / (h * h)
            share = 1.0
            if stiffness > 0.0:
                alpha, share = 0.0, stiffness
            weight = xw[nodes[batch, 0, lane], 3] + xw[nodes[batch, 1, lane], 3]
            inverse[batch, lane] = share / (weight + alpha) if weight > 0.0 else 0.0
            soft[batch, lane] = alpha


@batch_kernel
def project_distances(ws, xw, nodes, rest, inverse, soft, lam):
    """Project every distance constraint once, batch after batch.

    ws                (N_WORK,)     workspace
    xw                (n + 8, 4)    particles, positions updated in place
    nodes             (b, 2, 8)     particle ids
    rest              (b, 8)        d [m]
    inverse, soft     (b, 8)        see `prepare_distances` [kg], [1/kg]
    lam               (b, 8)        multipliers [kg m], updated in place
    """
    for batch in range(len(nodes)):
        for four in range(0, WIDTH, 4):
            gather_corner(ws, xw, nodes, batch, 0, four)
            gather_corner(ws, xw, nodes, batch, 1, four)
            at = WIDTH * batch + four
            move_four(ws, REST + four, rest, at)
            move_four(ws, INVERSE + four, inverse, at)
            move_four(ws, SOFT + four, soft, at)
            move_four(ws, LAMBDA + four, lam, at)
        for lane in range(WIDTH):
            dx = ws[AX + lane] - ws[BX + lane]
            dy = ws[AY + lane] - ws[BY + lane]
            dz = ws[AZ + lane] - ws[BZ + lane]
            length = np.sqrt(dx * dx + dy * dy + dz * dz + TINY)
            before = ws[LAMBDA + lane]
            change = -(length - ws[REST + lane] + ws[SOFT + lane] * before) * ws[INVERSE + lane]  # eq. (1)
            ws[LAMBDA + lane] = before + change
            step = change / length
            wa, wb = step * ws[AW + lane], step * ws[BW + lane]
            ws[AX + lane] += wa * dx
            ws[AY + lane] += wa * dy
            ws[AZ + lane] += wa * dz
            ws[BX + lane] -= wb * dx
            ws[BY + lane] -= wb * dy
            ws[BZ + lane] -= wb * dz
        for four in range(0, WIDTH, 4):
            scatter_corner(ws, xw, nodes, batch, 0, four)
            scatter_corner(ws, xw, nodes, batch, 1, four)
            move_four(lam, WIDTH * batch + four, ws, LAMBDA + four)


@batch_kernel
def measure_distances(xw, nodes, row, rest, soft, lam, h, strain, result):
    """How well distances are met: result (5,) in place: energy [J], worst and sum of violations [1], worst strain,
    count.

    A violation is |C + alpha~ lambda| relative to d: how far a constraint is from its own law. The energy is the work
    of what was applied, -1/2 C lambda/h^2: 1/2 C^2/alpha where a constraint is met. strain (n,) [1]: raised to the
    largest |C|/d at each particle, in place.
    """
    energy, worst, total, most, count = 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            a, b = nodes[batch, 0, lane], nodes[batch, 1, lane]
            dx, dy, dz = xw[a, 0] - xw[b, 0], xw[a, 1] - xw[b, 1], xw[a, 2] - xw[b, 2]
            d = rest[batch, lane]
            value = np.sqrt(dx * dx + dy * dy + dz * dz) - d
            energy -= 0.5 * value * lam[batch, lane] / (h * h)
            violation = abs(value + soft[batch, lane] * lam[batch, lane]) / d
            if xw[a, 3] + xw[b, 3] == 0.0:
                violation = 0.0
            worst = max(worst, violation)
            total += violation
            stretch = abs(value) / d
            most = max(most, stretch)
            strain[a] = max(strain[a], stretch)
            strain[b] = max(strain[b], stretch)
            count += 1.0
    result[0], result[1], result[2], result[3], result[4] = energy, worst, total, most, count


@batch_kernel
def add_distance_forces(xw, nodes, row, lam, h, force):
    """Add lambda grad C / h^2, the forces of the springs [N], to force (n, 3) in place."""
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            a, b = nodes[batch, 0, lane], nodes[batch, 1, lane]
            dx, dy, dz = xw[a, 0] - xw[b, 0], xw[a, 1] - xw[b, 1], xw[a, 2] - xw[b, 2]
            size = lam[batch, lane] / (h * h) / np.sqrt(dx * dx + dy * dy + dz * dz + TINY)
            force[a, 0] += size * dx
            force[a, 1] += size * dy
            force[a, 2] += size * dz
            force[b, 0] -= size * dx
            force[b, 1] -= size * dy
            force[b, 2] -= size * dz
