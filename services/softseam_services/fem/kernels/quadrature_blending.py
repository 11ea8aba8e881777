"""Cells of hex27 and hex27_reduced that are squeezed hard pass from split to full quadrature.

Under uniform squeeze split quadrature has modes of negative stiffness below a principal stretch of about 0.45, full
quadrature has none. With the least principal stretch s of a cell's mean deformation gradient at the start of a step,
  U_cell = (1 - b) U_split + b U_full,  b = r^2 (3 - 2 r),  r = (FIRST - s)/(FIRST - LAST) within 0 .. 1          (1)
Cells that are joined to others (kernels/joints.py) stay: full quadrature has no group of octants.
b stays over the step: the force is that of an energy, and a step's end depends on its start only.
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.cells import least_square_stretch
from softseam_services.jit import njit

FIRST, LAST = 0.55, 0.45


@njit(cache=True, error_model="numpy")
def share_cells(x, model, parameters, work):
    """Set work.part, work.full (c,) and their count work.mixed by eq. (1) from x (n, 3), the start of a step."""
    if not model.blends:
        return
    mean = np.empty((3, 3))
    work.mixed[0] = 0
    for cell in range(len(model.cell_nodes)):
        if model.joined[cell]:
            continue
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
        b = 0.0
        # the least stretch is at least 1 - |F - I|
        if square > (1.0 - FIRST) ** 2:
            r = min(1.0, max(0.0, (FIRST - np.sqrt(least_square_stretch(mean, 0))) / (FIRST - LAST)))
            b = r * r * (3.0 - 2.0 * r)
        work.full[cell], work.part[cell] = b, 1.0 - b
        work.mixed[0] += b > 0.0
