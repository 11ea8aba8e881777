"""Viscosity of Kelvin and Voigt: what stress over its own rate adds to a step, from forces of cells alone.

A second Piola-Kirchhoff stress S + tau dS/dt has the forces f + tau F (dS/dt) grad N. Where a cell turns and stretches
by G over the step, those of S at its start are G f(x0) at its end: moments balance, and turning costs nothing. So
  f(x_t) + c (f(x_t) - G_t f(x0)),  G_t = 1 + share (G - 1),  c = tau'/(share dt)                                (1)
at x_t = x0 + share (x1 - x0) of the integrators, where tau' = tau - (2 share - 1) dt is what is left to add to what
they lose themselves: oscillations of omega show zeta = tau omega/2, up to a step of tau. G is foreseen, from the
velocity at the start (p: node positions about their mean):
  L = (sum dt v p^T) (sum p p^T)^-1,  sin n = axial vector of L,  G = 1 + L - 2 share (1 - cos) (1 - n n^T)       (2)
with the centripetal acceleration last: of a body that spins steadily under stress G is its turn, and nothing is damped.
G f(x0) is known when the step begins, so Newton's method solves for (1 + c) f(x_t), whose tangent is (1 + c) K.

Of a body without large turns this is damping in proportion to stiffness, Rayleigh's. The `linear` law has G = 1.
"""

from __future__ import annotations

import numpy as np

from softseam_services.compiled_once import njit
from softseam_services.fem.integrators.scheme import viscous_share
from softseam_services.fem.kernels import cells, points

_FLAT = 1e-12  # of (tr B/3)^3, below which det B says that a cell is flat and L is not known: G = 1


@njit(cache=True, error_model="numpy")
def _even_motion(p, d, share, G):
    """G_t (3, 3) of eqs. (1) and (2) from p and d = dt v (27, 3) of a cell's nodes about their mean; in place."""
    xx = yy = zz = xy = yz = zx = 0.0
    for a in range(27):
        x, y, z = p[a, 0], p[a, 1], p[a, 2]
        xx, yy, zz = xx + x * x, yy + y * y, zz + z * z
        xy, yz, zx = xy + x * y, yz + y * z, zx + z * x
    cxx, cyy, czz = yy * zz - yz * yz, zz * xx - zx * zx, xx * yy - xy * xy  # cofactors of B = sum p p^T
    cxy, cyz, czx = yz * zx - xy * zz, zx * xy - yz * xx, xy * yz - zx * yy
    det = xx * cxx + xy * cxy + zx * czx
    G[:] = 0.0
    G[0, 0] = G[1, 1] = G[2, 2] = 1.0
    if not det > _FLAT * ((xx + yy + zz) / 3.0) ** 3:
        return
    for i in range(3):
        u = v = w = 0.0
        for a in range(27):
            u, v, w = u + d[a, i] * p[a, 0], v + d[a, i] * p[a, 1], w + d[a, i] * p[a, 2]
        G[i, 0] = (u * cxx + v * cxy + w * czx) / det
        G[i, 1] = (u * cxy + v * cyy + w * cyz) / det
        G[i, 2] = (u * czx + v * cyz + w * czz) / det
    sx, sy, sz = 0.5 * (G[2, 1] - G[1, 2]), 0.5 * (G[0, 2] - G[2, 0]), 0.5 * (G[1, 0] - G[0, 1])
    sine = np.sqrt(sx * sx + sy * sy + sz * sz)
    if sine > 1.0:  # beyond 1 rad a step: a quarter turn
        sx, sy, sz, sine = sx / sine, sy / sine, sz / sine, 1.0
    cos = np.sqrt(1.0 - sine * sine)
    spin = (sx, sy, sz)
    for i in range(3):
        for j in range(3):
            inward = -spin[i] * spin[j] / (1.0 + cos)  # (1 - cos) n n^T, for sin^2 = (1 - cos) (1 + cos)
            if i == j:
                inward += 1.0 - cos
            G[i, j] = share * (G[i, j] - 2.0 * share * inward)
            if i == j:
                G[i, j] += 1.0


@njit(cache=True, error_model="numpy")
def _add_carried(x0, x_hat, share, c, part, model, work):
    """work.force += c G_t f(x0), the f of each cell with a part in work.fe (c, 3, 27)."""
    p, d, G = np.empty((27, 3)), np.empty((27, 3)), np.eye(3)
    for cell in range(len(model.cell_nodes)):
        if part[cell] == 0.0:
            continue
        fe, nodes = work.fe[cell], model.cell_nodes[cell]
        if not model.linear:
            for i in range(3):
                middle = way = 0.0
                for a in range(27):
                    middle += x0[nodes[a], i] / 27.0
                    way += (x_hat[nodes[a], i] - x0[nodes[a], i]) / 27.0
                for a in range(27):
                    p[a, i] = x0[nodes[a], i] - middle
                    d[a, i] = x_hat[nodes[a], i] - x0[nodes[a], i] - way
            _even_motion(p, d, share, G)
        for a in range(27):
            for i in range(3):
                work.force[nodes[a], i] += c * (G[i, 0] * fe[0, a] + G[i, 1] * fe[1, a] + G[i, 2] * fe[2, a])


@njit(cache=True, error_model="numpy")
def resist(scheme, dt, share, x0, model, work):
    """work.viscous <- c of eq. (1), and work.force (n, 3) += c G_t f(x0), once work.x_hat = x0 + dt v0 is known.

    work.r, work.xe and work.fe are overwritten where c is not 0
    """
    c = work.viscous[0] = viscous_share(scheme, dt, share)
    if c == 0.0:
        return
    if model.general:
        points.subtract_forces(x0, model, model.rule, work.part, work, work.r)
    else:
        cells.subtract_forces(x0, model, work, work.r)
    _add_carried(x0, work.x_hat, share, c, work.part, model, work)
    if work.mixed[0] > 0:
        points.subtract_forces(x0, model, model.full, work.full, work, work.r)
        _add_carried(x0, work.x_hat, share, c, work.full, model, work)
