"""Volume of a tetrahedron in classic PBD: C = V - V_0, of which a projection removes a share k.

With grad_1 = (x_2 - x_0) x (x_3 - x_0)/6 and so on in turn, grad_0 = -(grad_1 + grad_2 + grad_3) and V = (x_1 - x_0) .
grad_1 (Mueller, Heidelberger, Hennix and Ratcliff, "Position based dynamics", 2007, section 3.3, with the volume of one
tetrahedron in place of a balloon's):
    d lambda = -k C/sum w_i |grad_i|^2,  x_i += w_i d lambda grad_i                                                (1)
"""

from softseam_services.pbd.kernels.lanes import batch_kernel, move_four
from softseam_services.pbd.kernels.neo_hookean import cofactors

from .corners import CORNER, gather_corner, scatter_corner, three_edges
from .tetrahedron import CRUSHED

WIDTH = 8
REST, LAMBDA = 4 * CORNER, 4 * CORNER + 8
N_WORK = 4 * CORNER + 16


@batch_kernel
def project_volumes(ws, xw, nodes, rest, share, lam):
    """Project every tetrahedron once, batch after batch.

    ws     (N_WORK,)   workspace
    xw     (n + 8, 4)  particles, positions updated in place
    nodes  (b, 4, 8)   corners
    rest   (b, 8)      V_0 [m^3]
    share              k [1]
    lam    (b, 8)      sums of d lambda [kg/m], updated in place
    """
    for batch in range(len(nodes)):
        for four in range(0, WIDTH, 4):
            for corner in range(4):
                gather_corner(ws, xw, nodes, batch, corner, four)
            move_four(ws, REST + four, rest, WIDTH * batch + four)
            move_four(ws, LAMBDA + four, lam, WIDTH * batch + four)
        for lane in range(WIDTH):
            x, y, z = ws[lane], ws[lane + 8], ws[lane + 16]
            ax, ay, az = ws[lane + CORNER] - x, ws[lane + CORNER + 8] - y, ws[lane + CORNER + 16] - z
            bx, by, bz = ws[lane + 2 * CORNER] - x, ws[lane + 2 * CORNER + 8] - y, ws[lane + 2 * CORNER + 16] - z
            cx, cy, cz = ws[lane + 3 * CORNER] - x, ws[lane + 3 * CORNER + 8] - y, ws[lane + 3 * CORNER + 16] - z
            g1x, g1y, g1z = (by * cz - bz * cy) / 6.0, (bz * cx - bx * cz) / 6.0, (bx * cy - by * cx) / 6.0
            g2x, g2y, g2z = (cy * az - cz * ay) / 6.0, (cz * ax - cx * az) / 6.0, (cx * ay - cy * ax) / 6.0
            g3x, g3y, g3z = (ay * bz - az * by) / 6.0, (az * bx - ax * bz) / 6.0, (ax * by - ay * bx) / 6.0
            g0x, g0y, g0z = -(g1x + g2x + g3x), -(g1y + g2y + g3y), -(g1z + g2z + g3z)
            w0, w1 = ws[lane + 24], ws[lane + CORNER + 24]
            w2, w3 = ws[lane + 2 * CORNER + 24], ws[lane + 3 * CORNER + 24]
            weight = w0 * (g0x * g0x + g0y * g0y + g0z * g0z) + w1 * (g1x * g1x + g1y * g1y + g1z * g1z)
            weight += w2 * (g2x * g2x + g2y * g2y + g2z * g2z) + w3 * (g3x * g3x + g3y * g3y + g3z * g3z)
            value = ax * g1x + ay * g1y + az * g1z - ws[REST + lane]
            step = -share * value / (weight if weight > 0.0 else 1.0)  # eq. (1)
            step = step if weight > 0.0 else 0.0
            ws[LAMBDA + lane] += step
            ws[lane] += w0 * step * g0x
            ws[lane + 8] += w0 * step * g0y
            ws[lane + 16] += w0 * step * g0z
            ws[lane + CORNER] += w1 * step * g1x
            ws[lane + CORNER + 8] += w1 * step * g1y
            ws[lane + CORNER + 16] += w1 * step * g1z
            ws[lane + 2 * CORNER] += w2 * step * g2x
            ws[lane + 2 * CORNER + 8] += w2 * step * g2y
            ws[lane + 2 * CORNER + 16] += w2 * step * g2z
            ws[lane + 3 * CORNER] += w3 * step * g3x
            ws[lane + 3 * CORNER + 8] += w3 * step * g3y
            ws[lane + 3 * CORNER + 16] += w3 * step * g3z
        for four in range(0, WIDTH, 4):
            for corner in range(4):
                scatter_corner(ws, xw, nodes, batch, corner, four)
            move_four(lam, WIDTH * batch + four, ws, LAMBDA + four)


@batch_kernel
def measure_volumes(xw, nodes, row, rest, lam, h, result):
    """How well volumes are met: result (6,) in place, as of `distance.measure_distances`: a violation is |C|/V_0, and
    so is a strain; the last counts tetrahedra that lost their shape."""
    energy, worst, total, count, crushed = 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            volume = cofactors(three_edges(xw, i, j, k, m))[1] / 6.0
            value = volume - rest[batch, lane]
            energy -= 0.5 * value * lam[batch, lane] / (h * h)
            worst = max(worst, abs(value) / rest[batch, lane])
            total += abs(value) / rest[batch, lane]
            count += 1.0
            crushed += 1.0 if volume < CRUSHED * rest[batch, lane] else 0.0
    result[0], result[1], result[2], result[3], result[4], result[5] = energy, worst, total, worst, count, crushed
