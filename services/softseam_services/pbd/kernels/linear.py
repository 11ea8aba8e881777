"""Stress and local solve of the block constraint for small strain; rows as in `block`."""

from __future__ import annotations

from numba import njit

from .block import BOUND, LAM, MU, ROWS, G, hourglass


@njit(cache=True, error_model="numpy")
def stress_lanes_linear(ws, k):
    """P and T of eight blocks of small strain: P = V (mu (F + F^T - 2 I) + lambda tr(F - I) I), T = K q."""
    for lane in range(len(ws) // ROWS):
        f00, f01, f02 = ws[lane + 464], ws[lane + 472], ws[lane + 480]
        f10, f11, f12 = ws[lane + 488], ws[lane + 496], ws[lane + 504]
        f20, f21, f22 = ws[lane + 512], ws[lane + 520], ws[lane + 528]
        V = ws[lane + 432]
        mu = V * k[MU]
        bulk = V * k[LAM] * (f00 + f11 + f22 - 3.0) - 2.0 * mu
        ws[lane + 632] = 2.0 * mu * f00 + bulk
        ws[lane + 640] = mu * (f01 + f10)
        ws[lane + 648] = mu * (f02 + f20)
        ws[lane + 656] = mu * (f10 + f01)
        ws[lane + 664] = 2.0 * mu * f11 + bulk
        ws[lane + 672] = mu * (f12 + f21)
        ws[lane + 680] = mu * (f20 + f02)
        ws[lane + 688] = mu * (f21 + f12)
        ws[lane + 696] = 2.0 * mu * f22 + bulk
        q = (
            ws[lane + 536],
            ws[lane + 544],
            ws[lane + 552],
            ws[lane + 560],
            ws[lane + 568],
            ws[lane + 576],
            ws[lane + 584],
            ws[lane + 592],
            ws[lane + 600],
            ws[lane + 608],
            ws[lane + 616],
            ws[lane + 624],
        )
        t = hourglass(k, q, V)
        ws[lane + 704] = t[0]
        ws[lane + 712] = t[1]
        ws[lane + 720] = t[2]
        ws[lane + 728] = t[3]
        ws[lane + 736] = t[4]
        ws[lane + 744] = t[5]
        ws[lane + 752] = t[6]
        ws[lane + 760] = t[7]
        ws[lane + 768] = t[8]
        ws[lane + 776] = t[9]
        ws[lane + 784] = t[10]
        ws[lane + 792] = t[11]


@njit(cache=True, error_model="numpy")
def solve_lanes_linear(ws, k):
    """As `solve_lanes`; P is linear, so dL_P solves (1 + V C G) dL_P = R exactly: 2 x 2 for shear, rank one for tr."""
    for lane in range(len(ws) // ROWS):
        g, V = ws[lane + 424], ws[lane + 432]
        mu, bulk = V * k[MU], V * k[LAM]
        g0 = g * k[G + 0]
        g1 = g * k[G + 1]
        g2 = g * k[G + 2]
        r00 = ws[lane + 632] - ws[lane + 256]
        r01 = ws[lane + 640] - ws[lane + 264]
        r02 = ws[lane + 648] - ws[lane + 272]
        r10 = ws[lane + 656] - ws[lane + 280]
        r11 = ws[lane + 664] - ws[lane + 288]
        r12 = ws[lane + 672] - ws[lane + 296]
        r20 = ws[lane + 680] - ws[lane + 304]
        r21 = ws[lane + 688] - ws[lane + 312]
        r22 = ws[lane + 696] - ws[lane + 320]
        d0 = 1.0 / (1.0 + 2.0 * mu * g0)
        d1 = 1.0 / (1.0 + 2.0 * mu * g1)
        d2 = 1.0 / (1.0 + 2.0 * mu * g2)
        z = bulk * (g0 * d0 * r00 + g1 * d1 * r11 + g2 * d2 * r22) / (1.0 + bulk * (g0 * d0 + g1 * d1 + g2 * d2))
        p00 = d0 * (r00 - z)
        p11 = d1 * (r11 - z)
        p22 = d2 * (r22 - z)
        z = mu * (g1 * r01 + g0 * r10) / (1.0 + mu * (g0 + g1))
        p01, p10 = r01 - z, r10 - z
        z = mu * (g2 * r02 + g0 * r20) / (1.0 + mu * (g0 + g2))
        p02, p20 = r02 - z, r20 - z
        z = mu * (g2 * r12 + g1 * r21) / (1.0 + mu * (g1 + g2))
        p12, p21 = r12 - z, r21 - z
        g = g * V * 0.015625
        n0 = 1.0 / (1.0 + g * k[BOUND + 0])
        n1 = 1.0 / (1.0 + g * k[BOUND + 1])
        n2 = 1.0 / (1.0 + g * k[BOUND + 2])
        n3 = 1.0 / (1.0 + g * k[BOUND + 3])
        m0 = n0 * (ws[lane + 704] - ws[lane + 328])
        m1 = n1 * (ws[lane + 728] - ws[lane + 352])
        m2 = n2 * (ws[lane + 752] - ws[lane + 376])
        m3 = n3 * (ws[lane + 776] - ws[lane + 400])
        ws[lane + 256] += p00
        ws[lane + 632] = p00
        ws[lane + 264] += p01
        ws[lane + 640] = p01
        ws[lane + 272] += p02
        ws[lane + 648] = p02
        ws[lane + 328] += m0
        ws[lane + 704] = m0
        ws[lane + 352] += m1
        ws[lane + 728] = m1
        ws[lane + 376] += m2
        ws[lane + 752] = m2
        ws[lane + 400] += m3
        ws[lane + 776] = m3
        m0 = n0 * (ws[lane + 712] - ws[lane + 336])
        m1 = n1 * (ws[lane + 736] - ws[lane + 360])
        m2 = n2 * (ws[lane + 760] - ws[lane + 384])
        m3 = n3 * (ws[lane + 784] - ws[lane + 408])
        ws[lane + 280] += p10
        ws[lane + 656] = p10
        ws[lane + 288] += p11
        ws[lane + 664] = p11
        ws[lane + 296] += p12
        ws[lane + 672] = p12
        ws[lane + 336] += m0
        ws[lane + 712] = m0
        ws[lane + 360] += m1
        ws[lane + 736] = m1
        ws[lane + 384] += m2
        ws[lane + 760] = m2
        ws[lane + 408] += m3
        ws[lane + 784] = m3
        m0 = n0 * (ws[lane + 720] - ws[lane + 344])
        m1 = n1 * (ws[lane + 744] - ws[lane + 368])
        m2 = n2 * (ws[lane + 768] - ws[lane + 392])
        m3 = n3 * (ws[lane + 792] - ws[lane + 416])
        ws[lane + 304] += p20
        ws[lane + 680] = p20
        ws[lane + 312] += p21
        ws[lane + 688] = p21
        ws[lane + 320] += p22
        ws[lane + 696] = p22
        ws[lane + 344] += m0
        ws[lane + 720] = m0
        ws[lane + 368] += m1
        ws[lane + 744] = m1
        ws[lane + 392] += m2
        ws[lane + 768] = m2
        ws[lane + 416] += m3
        ws[lane + 792] = m3
