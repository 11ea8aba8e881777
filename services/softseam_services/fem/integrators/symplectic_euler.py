"""Symplectic Euler: explicit, with an energy that swings but does not drift.

v1 = v0 + h M^-1 F(x0),  x1 = x0 + h v1                                                                        (1)
It is leapfrog with velocities half a step behind, so first order, and second where a motion starts without force.
Stable for h < 2/w, w the highest frequency of M^-1 K; a step is made of as many substeps as that asks for
(`table.longest_substep`, measured at rest; a crushed body is stiffer, so a share SAFETY of it is used). It solves no
equations and so cannot close contacts or a seam: an oracle for the implicit ones, and quick on small soft bodies.
"""

import numpy as np

from softseam_services.fem.kernels.elements import subtract_forces
from softseam_services.fem.kernels.newton import CONVERGED, LEAST_J, NOT_FINITE, WORST_CELL
from softseam_services.jit import njit

SAFETY = 0.6
_ROUNDS = 60
_SHAKE = 1e-6


@njit(cache=True, error_model="numpy")
def highest_frequency(model, parameters, work):
    """w = sqrt of the largest eigenvalue of M^-1 K at rest [1/s], by power iteration from a fixed start.

    It converges from below, by then to a few percent; work.r, work.dx and work.inside are overwritten.
    """
    r, shape = work.r, work.dx
    for i in range(len(shape)):
        shape[i] = 1.0 if (i * 2654435761) % 4294967296 < 2147483648 else -1.0  # signs without a pattern
    square = 0.0
    for _ in range(_ROUNDS):
        largest = 0.0
        for i in range(len(shape)):
            largest = max(largest, abs(shape[i]))
        scale = _SHAKE * parameters.edge / largest
        _displace(model, parameters, shape, scale, work.inside)
        r[:] = 0.0
        subtract_forces(work.inside, model, parameters, work, r)
        _displace(model, parameters, shape, -scale, work.inside)
        for i in range(len(r)):
            r[i] = -r[i]
        subtract_forces(work.inside, model, parameters, work, r)
        # r = 2 scale K shape to second order
        above = below = 0.0
        for node in range(len(model.order)):
            place = model.order[node]
            if place >= 0:
                for i in range(3):
                    force, was = 0.5 * r[3 * place + i], scale * shape[3 * place + i]
                    above += was * force
                    below += was * parameters.mass[node] * was
                    shape[3 * place + i] = force / parameters.mass[node]
        square = above / below
    return np.sqrt(square)


@njit(cache=True, error_model="numpy")
def _displace(model, parameters, shape, scale, x):
    """x (n, 3) <- rest + scale * shape, in place."""
    for node in range(len(model.order)):
        place = model.order[node]
        for i in range(3):
            x[node, i] = parameters.x_rest[node, i] + (scale * shape[3 * place + i] if place >= 0 else 0.0)


@njit(cache=True, error_model="numpy", aside=(int, int))
def march(longest, x0, v0, dt, model, parameters, work, x, v):
    """Eq. (1) over dt from x0, v0 into x, v (n, 3), under the forces work.force; returns a status and the substeps."""
    n_substeps = int(np.ceil(dt / longest * (1.0 - 1e-12)))
    h = dt / n_substeps
    for node in range(len(x0)):
        for i in range(3):
            x[node, i], v[node, i] = x0[node, i], v0[node, i]
    r = work.r
    for substep in range(n_substeps):
        for node in range(len(x0)):
            place = model.order[node]
            if place >= 0:
                for i in range(3):
                    r[3 * place + i] = work.force[node, i]
        work.memo[LEAST_J], work.memo[WORST_CELL] = subtract_forces(x, model, parameters, work, r)
        largest = 0.0
        for node in range(len(x0)):
            place = model.order[node]
            if place >= 0:
                for i in range(3):
                    v[node, i] += h * r[3 * place + i] / parameters.mass[node]
                    x[node, i] += h * v[node, i]
                    size = abs(v[node, i])
                    if not size <= largest:
                        largest = size
        if not np.isfinite(largest):
            return NOT_FINITE, substep + 1
    return CONVERGED, n_substeps
