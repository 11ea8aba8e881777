"""The displacement by which finite elements would correct PBD, by conjugate gradients without a matrix."""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def _apply(u, cell_nodes, turn, scale, stiffness, held, own, image, out):
    """out (n, 3) <- K u of the turned cells; rows of held nodes are zero. own, image (81,) are scratch."""
    out[:] = 0.0
    for cell in range(len(cell_nodes)):
        R = turn[cell]
        for a in range(27):
            node = cell_nodes[cell, a]
            for i in range(3):
                own[3 * a + i] = R[0, i] * u[node, 0] + R[1, i] * u[node, 1] + R[2, i] * u[node, 2]
        image[:] = 0.0
        for material in range(len(stiffness)):
            if scale[cell, material] > 0.0:
                for column in range(81):
                    factor = scale[cell, material] * own[column]
                    for row in range(81):
                        image[row] += factor * stiffness[material, column, row]
        for a in range(27):
            node = cell_nodes[cell, a]
            if not held[node]:
                for i in range(3):
                    out[node, i] += R[i, 0] * image[3 * a] + R[i, 1] * image[3 * a + 1] + R[i, 2] * image[3 * a + 2]


@njit(cache=True, error_model="numpy")
def correct(r, cell_nodes, turn, scale, stiffness, held, tolerance, most, u, energy):
    """Solve K u = r and write 1/2 u_e . K_e u_e of each cell into energy (c,) [J]; returns the iterations.

    r          (n, 3)    residual forces [N], overwritten; those on held nodes do not count
    turn       (c, 3, 3) rotation of each cell
    scale      (c, m)    share of the cell that each material fills
    stiffness  (m, 81, 81) of a cell full of that material, at rest
    held       (n,)      nodes that keep their place
    tolerance            share of the energy 1/2 r . u that the last ten iterations together may add
    u          (n, 3)    updated in place

    Scaled by the diagonal. K may be singular, as of a free body, since no r pulls at rigid motions; the energy grows
    with every iteration towards 1/2 r . K^-1 r.
    """
    n = len(r)
    own, image = np.empty(81), np.empty(81)
    diagonal, q, p = np.zeros(n), np.empty((n, 3)), np.zeros((n, 3))
    for cell in range(len(cell_nodes)):
        for material in range(len(stiffness)):
            for a in range(27):
                for i in range(3 * a, 3 * a + 3):
                    diagonal[cell_nodes[cell, a]] += scale[cell, material] * stiffness[material, i, i] / 3.0
    u[:] = 0.0
    before = 0.0
    for node in range(n):
        for i in range(3):
            if held[node] or diagonal[node] == 0.0:
                r[node, i] = 0.0
            else:
                p[node, i] = r[node, i] / diagonal[node]
                before += r[node, i] * p[node, i]
    gained, recent, count = 0.0, 0.0, 0
    while count < most and before > 0.0:
        _apply(p, cell_nodes, turn, scale, stiffness, held, own, image, q)
        curve = 0.0
        for node in range(n):
            for i in range(3):
                curve += p[node, i] * q[node, i]
        if not curve > 0.0:
            break
        alpha, now = before / curve, 0.0
        for node in range(n):
            for i in range(3):
                u[node, i] += alpha * p[node, i]
                r[node, i] -= alpha * q[node, i]
                if diagonal[node] > 0.0:
                    now += r[node, i] * r[node, i] / diagonal[node]
        gained += 0.5 * alpha * before
        recent += 0.5 * alpha * before
        count += 1
        if count % 10 == 0:
            if recent <= tolerance * gained:
                break
            recent = 0.0
        for node in range(n):
            for i in range(3):
                step = r[node, i] / diagonal[node] if diagonal[node] > 0.0 else 0.0
                p[node, i] = step + now / before * p[node, i]
        before = now
    for cell in range(len(cell_nodes)):
        R = turn[cell]
        for a in range(27):
            node = cell_nodes[cell, a]
            for i in range(3):
                own[3 * a + i] = R[0, i] * u[node, 0] + R[1, i] * u[node, 1] + R[2, i] * u[node, 2]
        energy[cell] = 0.0
        for material in range(len(stiffness)):
            for column in range(81):
                for row in range(81):
                    energy[cell] += (
                        0.5 * scale[cell, material] * own[row] * stiffness[material, column, row] * own[column]
                    )
    return count
