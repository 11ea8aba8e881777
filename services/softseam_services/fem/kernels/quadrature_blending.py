"""Cells of hex27 and hex27_reduced that are squeezed hard pass from split to full quadrature.

Under uniform squeeze split quadrature has modes of negative stiffness below a principal stretch of about 0.45, full
quadrature has none. With the least principal stretch s of a cell's mean deformation gradient at the start of a step,
  U_cell = (1 - b) U_split + b U_full
  b += FOLLOWS (r^2 (3 - 2 r) - b),  r = (FIRST - s)/(FIRST - LAST) within 0 .. 1                                  (1)
b follows with a memory, as a cell in full quadrature is stiffer, so less squeezed when the next step begins: with all
of it at once thin parts that fold passed to and fro from step to step. It stays over the step: the force is that of an
energy. What its change adds to the energy at the step's start is reported.
Cells that are joined to others (kernels/joints.py) stay: full quadrature has no group of octants.
"""

import numpy as np

from softseam_services.jit import njit

from .cells import least_square_stretch
from .elements import strain_energy

FIRST, LAST = 0.55, 0.45
FOLLOWS = 0.3
# A share that is as near as this is there.
_NEAR = 1e-3


@njit(cache=True, error_model="numpy")
def share_cells(x, before, follows, model, parameters, work, share):
    """Set work.part, work.full (c,) and their count work.mixed by eq. (1) from x (n, 3), the start of a step; returns
    what that adds to the strain energy there [J]. work.energy, and what elements are looked at with, are overwritten.

    before   b over the last step, negative where there was none, and then b follows at once (c,)
    follows  FOLLOWS, or 1: without memory
    share    <- b (c,), updated in place
    """
    if not model.blends:
        return 0.0
    mean, changed = np.empty((3, 3)), False
    for cell in range(len(before)):
        last = max(before[cell], 0.0)
        b = _due(x, cell, model, parameters, mean)
        if before[cell] >= 0.0 and abs(b - last) > _NEAR:
            b = last + follows * (b - last)
        share[cell] = b
        changed = changed or b != last
    if not changed:
        _set(share, work)
        return 0.0
    _set(before, work)
    added = -strain_energy(x, model, parameters, work)
    _set(share, work)
    return added + strain_energy(x, model, parameters, work)


@njit(cache=True, error_model="numpy")
def _set(share, work):
    """work.part, work.full, work.mixed <- of these shares (c,), none where negative."""
    work.mixed[0] = 0
    for cell in range(len(share)):
        b = max(share[cell], 0.0)
        work.full[cell], work.part[cell] = b, 1.0 - b
        work.mixed[0] += b > 0.0


@njit(cache=True, error_model="numpy")
def _due(x, cell, model, parameters, mean):
    """What b of eq. (1) goes to in a cell at x (n, 3); mean (3, 3) is overwritten by its mean deformation gradient."""
    if model.joined[cell]:
        return 0.0
    gradient = parameters.mean_gradient[parameters.full.shape[cell]]
    centre = model.cell_nodes[cell, 13]
    mean[:] = 0.0
    for a in range(27):
        node = model.cell_nodes[cell, a]
        for i in range(3):
            away = x[node, i] - x[centre, i]
            for j in range(3):
                mean[i, j] += away * gradient[a, j]
    square = 0.0
    for i in range(3):
        for j in range(3):
            d = mean[i, j] - (1.0 if i == j else 0.0)
            square += d * d
    # the least stretch is at least 1 - |F - I|
    if square <= (1.0 - FIRST) ** 2:
        return 0.0
    r = min(1.0, max(0.0, (FIRST - np.sqrt(least_square_stretch(mean, 0))) / (FIRST - LAST)))
    return r * r * (3.0 - 2.0 * r)
