"""Angle between two triangles at their common edge: C = theta - theta_0, theta in (-pi, pi], 0 where they are flat.

Triangles (0, 1, 2) and (0, 3, 1) share the edge e = x_1 - x_0. With n_1 = (x_1 - x_0) x (x_2 - x_0) and
n_2 = (x_3 - x_0) x (x_1 - x_0): theta = atan2((n_1 x n_2) . e/|e|, n_1 . n_2), which has a slope everywhere, also
where the triangles are flat; arccos(n_1 . n_2), as textbooks write it, has none there: its derivative is infinite.
Gradients (Tamstorf and Grinspun 2013, "Discrete bending forces and their Jacobians"): grad_2 = -|e|
n_1/n_1^2, grad_3 = -|e| n_2/n_2^2, and those of 0 and 1 are the shares of these that keep the sum and its moment zero.
A hinge whose triangles are empty has no angle and is left alone. With energy 1/2 k C^2 the compliance is 1/k [1/J];
equilateral triangles bend as a plate of stiffness D for k = D |e|^2/A, A the area of both (Seung and Nelson 1988).
"""

from __future__ import annotations

import numpy as np

from softseam_services.pbd.kernels.lanes import batch_kernel

from .corners import project_corners, three_edges

WIDTH = 8


@batch_kernel
def project_dihedrals(xw, nodes, row, rest, soft, share, lam):
    """Project every angle once; arguments as in `project_volumes`, rest (b, 8) theta_0 [rad]."""
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            corners = nodes[batch, 0, lane], nodes[batch, 1, lane], nodes[batch, 2, lane], nodes[batch, 3, lane]
            ex, ey, ez, ax, ay, az, bx, by, bz = three_edges(xw, *corners)
            px, py, pz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            qx, qy, qz = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
            edge = ex * ex + ey * ey + ez * ez
            pp, qq = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
            if edge == 0.0 or pp == 0.0 or qq == 0.0:
                continue
            length = np.sqrt(edge)
            sine = (py * qz - pz * qy) * ex + (pz * qx - px * qz) * ey + (px * qy - py * qx) * ez
            angle = np.arctan2(sine / length, px * qx + py * qy + pz * qz)
            value = angle - rest[batch, lane]
            if value > np.pi:
                value -= 2.0 * np.pi
            elif value < -np.pi:
                value += 2.0 * np.pi
            s, t = -length / pp, -length / qq
            px, py, pz, qx, qy, qz = s * px, s * py, s * pz, t * qx, t * qy, t * qz
            u, w = (ex * ax + ey * ay + ez * az) / edge, (ex * bx + ey * by + ez * bz) / edge
            o = -(1.0 - u) * px - (1.0 - w) * qx, -(1.0 - u) * py - (1.0 - w) * qy, -(1.0 - u) * pz - (1.0 - w) * qz
            r = -u * px - w * qx, -u * py - w * qy, -u * pz - w * qz
            gradients = o, r, (px, py, pz), (qx, qy, qz)
            project_corners(xw, corners, gradients, value, soft[batch, lane], share, lam, batch, lane)
