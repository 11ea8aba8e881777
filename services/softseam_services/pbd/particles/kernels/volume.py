"""Volume of a tetrahedron: C = V - V_0 with V = (x_1 - x_0) x (x_2 - x_0) . (x_3 - x_0)/6.

Gradients: grad_1 = (x_2 - x_0) x (x_3 - x_0)/6 and so on in turn, grad_0 = -(grad_1 + grad_2 + grad_3). For a bulk
modulus K the energy is 1/2 K V_0 (V/V_0 - 1)^2 = 1/2 C^2/alpha with alpha = V_0/K [m^3/Pa]. (A compliance of 1/(K V_0)
belongs to the constraint V/V_0 - 1, which has no unit.)
"""

from __future__ import annotations

from softseam_services.pbd.kernels.lanes import batch_kernel

WIDTH = 8


@batch_kernel
def project_volumes(xw, nodes, row, rest, soft, share, lam):
    """Project every volume once.

    nodes (b, 4, 8); rest (b, 8) V_0 [m^3]; soft (b, 8) alpha/h^2; lam (b, 8) in place; share of a violation that
    classic PBD removes, 1 for XPBD
    """
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            ax, ay, az = xw[j, 0] - xw[i, 0], xw[j, 1] - xw[i, 1], xw[j, 2] - xw[i, 2]
            bx, by, bz = xw[k, 0] - xw[i, 0], xw[k, 1] - xw[i, 1], xw[k, 2] - xw[i, 2]
            cx, cy, cz = xw[m, 0] - xw[i, 0], xw[m, 1] - xw[i, 1], xw[m, 2] - xw[i, 2]
            px, py, pz = (by * cz - bz * cy) / 6.0, (bz * cx - bx * cz) / 6.0, (bx * cy - by * cx) / 6.0
            qx, qy, qz = (cy * az - cz * ay) / 6.0, (cz * ax - cx * az) / 6.0, (cx * ay - cy * ax) / 6.0
            rx, ry, rz = (ay * bz - az * by) / 6.0, (az * bx - ax * bz) / 6.0, (ax * by - ay * bx) / 6.0
            ox, oy, oz = -px - qx - rx, -py - qy - ry, -pz - qz - rz
            value = ax * px + ay * py + az * pz - rest[batch, lane]
            weight = xw[i, 3] * (ox * ox + oy * oy + oz * oz) + xw[j, 3] * (px * px + py * py + pz * pz)
            weight += xw[k, 3] * (qx * qx + qy * qy + qz * qz) + xw[m, 3] * (rx * rx + ry * ry + rz * rz)
            if weight == 0.0:
                continue
            alpha = soft[batch, lane]
            change = -share * (value + alpha * lam[batch, lane]) / (weight + alpha)  # eq. (1)
            lam[batch, lane] += change
            wi, wj, wk, wm = change * xw[i, 3], change * xw[j, 3], change * xw[k, 3], change * xw[m, 3]
            xw[i, 0], xw[i, 1], xw[i, 2] = xw[i, 0] + wi * ox, xw[i, 1] + wi * oy, xw[i, 2] + wi * oz
            xw[j, 0], xw[j, 1], xw[j, 2] = xw[j, 0] + wj * px, xw[j, 1] + wj * py, xw[j, 2] + wj * pz
            xw[k, 0], xw[k, 1], xw[k, 2] = xw[k, 0] + wk * qx, xw[k, 1] + wk * qy, xw[k, 2] + wk * qz
            xw[m, 0], xw[m, 1], xw[m, 2] = xw[m, 0] + wm * rx, xw[m, 1] + wm * ry, xw[m, 2] + wm * rz
