"""Stress and local solve of the block constraint for the neo-Hookean energy; equations and rows as in `block`."""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.body.materials.neo_hookean import volumetric

from .block import BOUND, LAM, MU, ROWS, G, hourglass


@njit(cache=True, error_model="numpy")
def volumetric_lanes(ws, k):
    """s and ds of eight blocks; scalar, because a logarithm is not vectorised."""
    for lane in range(len(ws) // ROWS):
        _, s, ds = volumetric(ws[lane + 440], k[MU], k[LAM])
        ws[lane + 448] = s
        # Past J = exp(1 + mu/lambda) psi_J is concave; the local solve stays definite without its negative curvature.
        ws[lane + 456] = max(ds, 0.0)


@njit(cache=True, error_model="numpy")
def stress_lanes(ws, k):
    """P and T that the shapes of eight blocks ask for, eq. (3), and I of eq. (4)."""
    for lane in range(len(ws) // ROWS):
        f00, f01, f02 = ws[lane + 464], ws[lane + 472], ws[lane + 480]
        f10, f11, f12 = ws[lane + 488], ws[lane + 496], ws[lane + 504]
        f20, f21, f22 = ws[lane + 512], ws[lane + 520], ws[lane + 528]
        x0, y0, z0 = ws[lane + 536], ws[lane + 544], ws[lane + 552]
        x1, y1, z1 = ws[lane + 560], ws[lane + 568], ws[lane + 576]
        x2, y2, z2 = ws[lane + 584], ws[lane + 592], ws[lane + 600]
        x3, y3, z3 = ws[lane + 608], ws[lane + 616], ws[lane + 624]
        V, s = ws[lane + 432], ws[lane + 448]
        t = hourglass(
            k,
            (
                f00 * x0 + f10 * y0 + f20 * z0,
                f01 * x0 + f11 * y0 + f21 * z0,
                f02 * x0 + f12 * y0 + f22 * z0,
                f00 * x1 + f10 * y1 + f20 * z1,
                f01 * x1 + f11 * y1 + f21 * z1,
                f02 * x1 + f12 * y1 + f22 * z1,
                f00 * x2 + f10 * y2 + f20 * z2,
                f01 * x2 + f11 * y2 + f21 * z2,
                f02 * x2 + f12 * y2 + f22 * z2,
                f00 * x3 + f10 * y3 + f20 * z3,
                f01 * x3 + f11 * y3 + f21 * z3,
                f02 * x3 + f12 * y3 + f22 * z3,
            ),
            V,
        )
        mu, s = V * k[MU], V * s
        ws[lane + 632] = mu * f00 + s * (f11 * f22 - f12 * f21) + x0 * t[0] + x1 * t[3] + x2 * t[6] + x3 * t[9]
        ws[lane + 640] = mu * f01 + s * (f12 * f20 - f10 * f22) + x0 * t[1] + x1 * t[4] + x2 * t[7] + x3 * t[10]
        ws[lane + 648] = mu * f02 + s * (f10 * f21 - f11 * f20) + x0 * t[2] + x1 * t[5] + x2 * t[8] + x3 * t[11]
        ws[lane + 656] = mu * f10 + s * (f02 * f21 - f01 * f22) + y0 * t[0] + y1 * t[3] + y2 * t[6] + y3 * t[9]
        ws[lane + 664] = mu * f11 + s * (f00 * f22 - f02 * f20) + y0 * t[1] + y1 * t[4] + y2 * t[7] + y3 * t[10]
        ws[lane + 672] = mu * f12 + s * (f01 * f20 - f00 * f21) + y0 * t[2] + y1 * t[5] + y2 * t[8] + y3 * t[11]
        ws[lane + 680] = mu * f20 + s * (f01 * f12 - f02 * f11) + z0 * t[0] + z1 * t[3] + z2 * t[6] + z3 * t[9]
        ws[lane + 688] = mu * f21 + s * (f02 * f10 - f00 * f12) + z0 * t[1] + z1 * t[4] + z2 * t[7] + z3 * t[10]
        ws[lane + 696] = mu * f22 + s * (f00 * f11 - f01 * f10) + z0 * t[2] + z1 * t[5] + z2 * t[8] + z3 * t[11]
        ws[lane + 704] = f00 * t[0] + f01 * t[1] + f02 * t[2]
        ws[lane + 712] = f10 * t[0] + f11 * t[1] + f12 * t[2]
        ws[lane + 720] = f20 * t[0] + f21 * t[1] + f22 * t[2]
        ws[lane + 728] = f00 * t[3] + f01 * t[4] + f02 * t[5]
        ws[lane + 736] = f10 * t[3] + f11 * t[4] + f12 * t[5]
        ws[lane + 744] = f20 * t[3] + f21 * t[4] + f22 * t[5]
        ws[lane + 752] = f00 * t[6] + f01 * t[7] + f02 * t[8]
        ws[lane + 760] = f10 * t[6] + f11 * t[7] + f12 * t[8]
        ws[lane + 768] = f20 * t[6] + f21 * t[7] + f22 * t[8]
        ws[lane + 776] = f00 * t[9] + f01 * t[10] + f02 * t[11]
        ws[lane + 784] = f10 * t[9] + f11 * t[10] + f12 * t[11]
        ws[lane + 792] = f20 * t[9] + f21 * t[10] + f22 * t[11]
        square = f00 * f00 + f01 * f01 + f02 * f02 + f10 * f10 + f11 * f11 + f12 * f12
        square += f20 * f20 + f21 * f21 + f22 * f22
        ws[lane + 800] = max(1.0, square / 3.0)


@njit(cache=True, error_model="numpy")
def solve_lanes(ws, k):
    """Add dLambda to Lambda and leave it in the rows of P and T, eq. (4) and (5)."""
    for lane in range(len(ws) // ROWS):
        f00, f01, f02 = ws[lane + 464], ws[lane + 472], ws[lane + 480]
        f10, f11, f12 = ws[lane + 488], ws[lane + 496], ws[lane + 504]
        f20, f21, f22 = ws[lane + 512], ws[lane + 520], ws[lane + 528]
        g, V, bound = ws[lane + 424], ws[lane + 432], ws[lane + 800]
        c = V * (k[MU] + abs(ws[lane + 448]) * np.sqrt(bound))
        g0 = g * k[G + 0]
        g1 = g * k[G + 1]
        g2 = g * k[G + 2]
        d0 = 1.0 / (1.0 + c * g0)
        d1 = 1.0 / (1.0 + c * g1)
        d2 = 1.0 / (1.0 + c * g2)
        c00 = f11 * f22 - f12 * f21
        c01 = f12 * f20 - f10 * f22
        c02 = f10 * f21 - f11 * f20
        c10 = f02 * f21 - f01 * f22
        c11 = f00 * f22 - f02 * f20
        c12 = f01 * f20 - f00 * f21
        c20 = f01 * f12 - f02 * f11
        c21 = f02 * f10 - f00 * f12
        c22 = f00 * f11 - f01 * f10
        r00 = ws[lane + 632] - ws[lane + 256]
        r01 = ws[lane + 640] - ws[lane + 264]
        r02 = ws[lane + 648] - ws[lane + 272]
        r10 = ws[lane + 656] - ws[lane + 280]
        r11 = ws[lane + 664] - ws[lane + 288]
        r12 = ws[lane + 672] - ws[lane + 296]
        r20 = ws[lane + 680] - ws[lane + 304]
        r21 = ws[lane + 688] - ws[lane + 312]
        r22 = ws[lane + 696] - ws[lane + 320]
        e0 = g0 * d0
        e1 = g1 * d1
        e2 = g2 * d2
        over = (
            e0 * (c00 * r00 + c10 * r10 + c20 * r20)
            + e1 * (c01 * r01 + c11 * r11 + c21 * r21)
            + e2 * (c02 * r02 + c12 * r12 + c22 * r22)
        )
        under = (
            e0 * (c00 * c00 + c10 * c10 + c20 * c20)
            + e1 * (c01 * c01 + c11 * c11 + c21 * c21)
            + e2 * (c02 * c02 + c12 * c12 + c22 * c22)
        )
        bulk = V * ws[lane + 456]
        z = bulk * over / (1.0 + bulk * under)
        g = g * V * bound * 0.015625
        n0 = 1.0 / (1.0 + g * k[BOUND + 0])
        n1 = 1.0 / (1.0 + g * k[BOUND + 1])
        n2 = 1.0 / (1.0 + g * k[BOUND + 2])
        n3 = 1.0 / (1.0 + g * k[BOUND + 3])
        p0 = d0 * (r00 - z * c00)
        p1 = d1 * (r01 - z * c01)
        p2 = d2 * (r02 - z * c02)
        m0 = n0 * (ws[lane + 704] - ws[lane + 328])
        m1 = n1 * (ws[lane + 728] - ws[lane + 352])
        m2 = n2 * (ws[lane + 752] - ws[lane + 376])
        m3 = n3 * (ws[lane + 776] - ws[lane + 400])
        ws[lane + 256] += p0
        ws[lane + 632] = p0
        ws[lane + 264] += p1
        ws[lane + 640] = p1
        ws[lane + 272] += p2
        ws[lane + 648] = p2
        ws[lane + 328] += m0
        ws[lane + 704] = m0
        ws[lane + 352] += m1
        ws[lane + 728] = m1
        ws[lane + 376] += m2
        ws[lane + 752] = m2
        ws[lane + 400] += m3
        ws[lane + 776] = m3
        p0 = d0 * (r10 - z * c10)
        p1 = d1 * (r11 - z * c11)
        p2 = d2 * (r12 - z * c12)
        m0 = n0 * (ws[lane + 712] - ws[lane + 336])
        m1 = n1 * (ws[lane + 736] - ws[lane + 360])
        m2 = n2 * (ws[lane + 760] - ws[lane + 384])
        m3 = n3 * (ws[lane + 784] - ws[lane + 408])
        ws[lane + 280] += p0
        ws[lane + 656] = p0
        ws[lane + 288] += p1
        ws[lane + 664] = p1
        ws[lane + 296] += p2
        ws[lane + 672] = p2
        ws[lane + 336] += m0
        ws[lane + 712] = m0
        ws[lane + 360] += m1
        ws[lane + 736] = m1
        ws[lane + 384] += m2
        ws[lane + 760] = m2
        ws[lane + 408] += m3
        ws[lane + 784] = m3
        p0 = d0 * (r20 - z * c20)
        p1 = d1 * (r21 - z * c21)
        p2 = d2 * (r22 - z * c22)
        m0 = n0 * (ws[lane + 720] - ws[lane + 344])
        m1 = n1 * (ws[lane + 744] - ws[lane + 368])
        m2 = n2 * (ws[lane + 768] - ws[lane + 392])
        m3 = n3 * (ws[lane + 792] - ws[lane + 416])
        ws[lane + 304] += p0
        ws[lane + 680] = p0
        ws[lane + 312] += p1
        ws[lane + 688] = p1
        ws[lane + 320] += p2
        ws[lane + 696] = p2
        ws[lane + 344] += m0
        ws[lane + 720] = m0
        ws[lane + 368] += m1
        ws[lane + 744] = m1
        ws[lane + 392] += m2
        ws[lane + 768] = m2
        ws[lane + 416] += m3
        ws[lane + 792] = m3
