"""How far the stress that blocks apply is from what their shapes ask for, and how far they are stretched."""

import numpy as np

from softseam_services.body.materials.point import LINEAR
from softseam_services.jit import njit

from .block import gather, hoisted, load_stress, of_batch, of_lane, shape
from .block_rows import MU, STRESS, VOLUME, WANTED
from .lanes import LANES, lane_kernel, move_four
from .laws import write_stress
from .relaxing import bring_fold

ENERGY, LEAST_J, LAG, SIZE, STRETCH = 0, 1, 2, 3, 4
N_FIGURES = 5
"""of a batch: energy [J], least J, sum of |P - Lambda|^2 and of |P|^2 [N^2 m^2], largest stretch squared"""
LEAST_STRAIN = 0.01
"""stress less than that of so much shear is no measure: a body at rest is never far off"""


@lane_kernel
def _largest_strain(f):
    """(1 + e)^2 with a bound of the largest strain of the linear law, which does not see rotations, nor does this."""
    xy, xz, yz = 0.5 * abs(f[1] + f[3]), 0.5 * abs(f[2] + f[6]), 0.5 * abs(f[5] + f[7])
    return max(f[0] + xy + xz, f[4] + xy + yz, f[8] + xz + yz) ** 2


@njit(cache=True, error_model="numpy")
def batch_residuals(ws, xw, nodes, volume, stress, constants, law, first, end, figures):
    """LAG, SIZE and STRETCH of the batches first .. end - 1 into figures (b, N_FIGURES).

    The largest stretch is bounded by Gershgorin's rows of F^T F: exact at rest and along the axes, never too small.
    """
    for batch in range(first, end):
        own = of_batch(constants, batch)
        material = hoisted(own)
        least = 2.0 * LEAST_STRAIN * material[MU]
        gather(ws, xw, nodes, batch)
        load_stress(ws, stress, batch)
        move_four(ws, LANES * VOLUME, volume, LANES * batch)
        bring_fold(ws, constants, batch)
        write_stress(ws, own, law)
        lag, size, stretch = 0.0, 0.0, 0.0
        for lane in range(LANES):
            if volume[batch, lane] == 0.0:
                continue
            for row in range(9):
                wanted = ws[LANES * (WANTED + row) + lane]
                lag += (wanted - ws[LANES * (STRESS + row) + lane]) ** 2
                size += wanted * wanted
            size += (least * volume[batch, lane]) ** 2
            f = shape(ws, lane, of_lane(ws, lane, material))[0]
            if law == LINEAR:
                stretch = max(stretch, _largest_strain(f))
                continue
            xx = f[0] * f[0] + f[3] * f[3] + f[6] * f[6]
            yy = f[1] * f[1] + f[4] * f[4] + f[7] * f[7]
            zz = f[2] * f[2] + f[5] * f[5] + f[8] * f[8]
            xy = abs(f[0] * f[1] + f[3] * f[4] + f[6] * f[7])
            xz = abs(f[0] * f[2] + f[3] * f[5] + f[6] * f[8])
            yz = abs(f[1] * f[2] + f[4] * f[5] + f[7] * f[8])
            stretch = max(stretch, xx + xy + xz, yy + xy + yz, zz + xz + yz)
        figures[batch, LAG], figures[batch, SIZE], figures[batch, STRETCH] = lag, size, stretch


@njit(cache=True, error_model="numpy")
def residual(figures):
    """sqrt(sum |P - Lambda|^2 / sum (|P|^2 + (2 mu e V)^2)) with e = LEAST_STRAIN, and the largest stretch."""
    lag, size, stretch = 0.0, 0.0, 0.0
    for batch in range(len(figures)):
        lag += figures[batch, LAG]
        size += figures[batch, SIZE]
        stretch = max(stretch, figures[batch, STRETCH])
    return np.sqrt(lag / size), np.sqrt(stretch)
