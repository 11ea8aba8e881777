"""Volume of a tetrahedron: C = V - V_0 with V = (x_1 - x_0) x (x_2 - x_0) . (x_3 - x_0)/6.

Gradients: grad_1 = (x_2 - x_0) x (x_3 - x_0)/6 and so on in turn, grad_0 = -(grad_1 + grad_2 + grad_3). For a bulk
modulus K the energy is 1/2 K V_0 (V/V_0 - 1)^2 = 1/2 C^2/alpha with alpha = V_0/K [m^3/Pa]. (A compliance of 1/(K V_0)
belongs to the constraint V/V_0 - 1, which has no unit.)
"""

from __future__ import annotations

from softseam_services.pbd.kernels.lanes import batch_kernel

from .corners import project_corners, three_edges

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
            corners = nodes[batch, 0, lane], nodes[batch, 1, lane], nodes[batch, 2, lane], nodes[batch, 3, lane]
            ax, ay, az, bx, by, bz, cx, cy, cz = three_edges(xw, *corners)
            p = (by * cz - bz * cy) / 6.0, (bz * cx - bx * cz) / 6.0, (bx * cy - by * cx) / 6.0
            q = (cy * az - cz * ay) / 6.0, (cz * ax - cx * az) / 6.0, (cx * ay - cy * ax) / 6.0
            r = (ay * bz - az * by) / 6.0, (az * bx - ax * bz) / 6.0, (ax * by - ay * bx) / 6.0
            o = -p[0] - q[0] - r[0], -p[1] - q[1] - r[1], -p[2] - q[2] - r[2]
            value = ax * p[0] + ay * p[1] + az * p[2] - rest[batch, lane]
            project_corners(xw, corners, (o, p, q, r), value, soft[batch, lane], share, lam, batch, lane)
