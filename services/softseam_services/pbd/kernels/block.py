"""One XPBD block constraint per hexahedral block, in stress form, for eight blocks side by side.

A block is a box with edges l, volume V and node signs xi, eta, zeta = +-1. It stores the stress that it applies,
Lambda_P (3, 3) [N m] and Lambda_m (4, 3) [N], and moves its nodes until that equals the stress that its shape asks for:

b_i = (xi_i/4 l_x, eta_i/4 l_y, zeta_i/4 l_z),  F = sum x_i b_i^T,  q_m = 1/8 sum h_mi x_i                       (1)
h = (eta zeta, xi zeta, xi eta, xi eta zeta)
U = V psi(F) + 1/2 q^T K q,  q_m -> F^T q_m for a finite-strain material                                      (2)
P = V (mu F + s cof F) + sum_m q_m t_m^T,  t = K F^T q,  T_m = F t_m,  f_i = -(P b_i + sum_m h_mi T_m/8)       (3)

Local solve. Moving the nodes by x_i -= h^2 w_i (dL_P b_i + sum_m h_mi dL_m/8) changes F by about -dL_P diag(G) and q_m
by about -g_q dL_m, G_b = g/(16 l_b^2), g_q = g/64, g = kappa h^2 sum w_i (exact for equal masses, kappa = 1). With
R = P - Lambda_P, D_b = 1/(1 + V (mu + |s| sqrt(I)) G_b), I = max(1, F:F/3), and the rank-one term V ds cof F cof F^T
kept by the Sherman-Morrison formula:
z = V ds sum G_b D_b C_ab R_ab / (1 + V ds sum G_b D_b C_ab^2),  dL_ab = D_b (R_ab - z C_ab)                    (4)
dL_m = (T_m - Lambda_m)/(1 + g_q k_m I),  k_m = max_c sum |K_(m,c),.|                                         (5)
Whatever the approximations of (4) and (5), the fixed point is Lambda = (P, T): statics are exact.

The workspace `ws` is flat, row r of lane l at 8 r + l, because only then does the compiler use vector instructions.
Rows: 0..23 positions (node, component), 24..31 h^2 w_i, 32..52 Lambda (P row by row, then T), 53 g,
54 fill V, 55 J, 56 s, 57 ds, 58..66 F, 67..78 q, 79..87 P and
88..99 T as the shape asks for them, 100 I.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softseam_services.body.materials.neo_hookean import volumetric

LANES = 8
ROWS = 108

# Entries of the constants array, see `hourglass.block_constants`.
MU, LAM, B, G, PAIR, SHEAR, TWIST, BOUND = 0, 1, 2, 5, 8, 17, 23, 26
N_CONSTANTS = 30


@njit(cache=True, error_model="numpy", forceinline=True)
def _spread(ws, l, c, k):
    """Move component c of the nodes: x_i -= g_i (dL_P b_i + sum_m h_mi dL_m/8), g_i = h^2 w_i in rows 24..31."""
    cx, cy, cz = (
        ws[l + 8 * (79 + 3 * c)] * k[B],
        ws[l + 8 * (80 + 3 * c)] * k[B + 1],
        ws[l + 8 * (81 + 3 * c)] * k[B + 2],
    )
    m0, m1 = 0.125 * ws[l + 8 * (88 + c)], 0.125 * ws[l + 8 * (91 + c)]
    m2, m3 = 0.125 * ws[l + 8 * (94 + c)], 0.125 * ws[l + 8 * (97 + c)]
    c0, c1, c2, c3 = m0 - cy - cz, cy - cz - m0, cz - cy - m0, cy + cz + m0
    e0, e1, e2, e3 = cx - m2 - m1 + m3, cx + m2 - m1 - m3, cx - m2 + m1 - m3, cx + m2 + m1 + m3
    ws[l + 8 * c] -= ws[l + 192] * (c0 - e0)
    ws[l + 8 * (3 + c)] -= ws[l + 200] * (c0 + e0)
    ws[l + 8 * (6 + c)] -= ws[l + 208] * (c1 - e1)
    ws[l + 8 * (9 + c)] -= ws[l + 216] * (c1 + e1)
    ws[l + 8 * (12 + c)] -= ws[l + 224] * (c2 - e2)
    ws[l + 8 * (15 + c)] -= ws[l + 232] * (c2 + e2)
    ws[l + 8 * (18 + c)] -= ws[l + 240] * (c3 - e3)
    ws[l + 8 * (21 + c)] -= ws[l + 248] * (c3 + e3)


@njit(cache=True, error_model="numpy")
def move_lanes(ws, k):
    """Move the nodes of eight blocks by the dLambda that stands in the rows of P and T. A loop of its own: together
    with `solve_lanes` it is more than the compiler vectorises."""
    for l in range(len(ws) // ROWS):
        _spread(ws, l, 0, k)
        _spread(ws, l, 1, k)
        _spread(ws, l, 2, k)


@njit(cache=True, error_model="numpy", forceinline=True)
def _transform(ws, l, c, k):
    """Rows of F and q of component c: the 8-point Walsh-Hadamard transform of the nodes, eq. (1)."""
    u0 = ws[l + 8 * c]
    u1 = ws[l + 8 * (3 + c)]
    u2 = ws[l + 8 * (6 + c)]
    u3 = ws[l + 8 * (9 + c)]
    u4 = ws[l + 8 * (12 + c)]
    u5 = ws[l + 8 * (15 + c)]
    u6 = ws[l + 8 * (18 + c)]
    u7 = ws[l + 8 * (21 + c)]
    s0, d0 = u0 + u1, u1 - u0
    s1, d1 = u2 + u3, u3 - u2
    s2, d2 = u4 + u5, u5 - u4
    s3, d3 = u6 + u7, u7 - u6
    sa, sb, sc, sd = s0 + s1, s1 - s0, s2 + s3, s3 - s2
    da, db, dc, dd = d0 + d1, d1 - d0, d2 + d3, d3 - d2
    ws[l + 8 * (58 + 3 * c)] = (da + dc) * k[B]
    ws[l + 8 * (59 + 3 * c)] = (sb + sd) * k[B + 1]
    ws[l + 8 * (60 + 3 * c)] = (sc - sa) * k[B + 2]
    ws[l + 8 * (67 + c)] = (sd - sb) * 0.125
    ws[l + 8 * (70 + c)] = (dc - da) * 0.125
    ws[l + 8 * (73 + c)] = (db + dd) * 0.125
    ws[l + 8 * (76 + c)] = (dd - db) * 0.125


@njit(cache=True, error_model="numpy")
def shape_lanes(ws, k):
    """F, q and J of eight blocks, eq. (1)."""
    for l in range(len(ws) // ROWS):
        _transform(ws, l, 0, k)
        _transform(ws, l, 1, k)
        _transform(ws, l, 2, k)
        f00, f01, f02 = ws[l + 464], ws[l + 472], ws[l + 480]
        f10, f11, f12 = ws[l + 488], ws[l + 496], ws[l + 504]
        f20, f21, f22 = ws[l + 512], ws[l + 520], ws[l + 528]
        ws[l + 440] = f00 * (f11 * f22 - f12 * f21) + f01 * (f12 * f20 - f10 * f22) + f02 * (f10 * f21 - f11 * f20)


@njit(cache=True, error_model="numpy")
def volumetric_lanes(ws, k):
    """s and ds of eight blocks; scalar, because a logarithm is not vectorised."""
    for l in range(len(ws) // ROWS):
        _, s, ds = volumetric(ws[l + 440], k[MU], k[LAM])
        ws[l + 448] = s
        # Past J = exp(1 + mu/lambda) psi_J is concave; the local solve stays definite without its negative curvature.
        ws[l + 456] = max(ds, 0.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _hourglass(ws, l, k, q, V):
    """t = K q (12 values, mode by mode) for q (12 values)."""
    x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3 = q
    return (
        V * (k[SHEAR] * x0 + k[SHEAR + 3] * y1 + k[SHEAR + 4] * z2),
        V * (k[PAIR + 1] * y0 + k[PAIR + 2] * x1),
        V * (k[PAIR + 4] * z0 + k[PAIR + 5] * x2),
        V * (k[PAIR] * x1 + k[PAIR + 2] * y0),
        V * (k[SHEAR + 3] * x0 + k[SHEAR + 1] * y1 + k[SHEAR + 5] * z2),
        V * (k[PAIR + 7] * z1 + k[PAIR + 8] * y2),
        V * (k[PAIR + 3] * x2 + k[PAIR + 5] * z0),
        V * (k[PAIR + 6] * y2 + k[PAIR + 8] * z1),
        V * (k[SHEAR + 4] * x0 + k[SHEAR + 5] * y1 + k[SHEAR + 2] * z2),
        V * k[TWIST] * x3,
        V * k[TWIST + 1] * y3,
        V * k[TWIST + 2] * z3,
    )


@njit(cache=True, error_model="numpy")
def stress_lanes(ws, k):
    """P and T that the shapes of eight blocks ask for, eq. (3), and I of eq. (4)."""
    for l in range(len(ws) // ROWS):
        f00, f01, f02 = ws[l + 464], ws[l + 472], ws[l + 480]
        f10, f11, f12 = ws[l + 488], ws[l + 496], ws[l + 504]
        f20, f21, f22 = ws[l + 512], ws[l + 520], ws[l + 528]
        x0, y0, z0 = ws[l + 536], ws[l + 544], ws[l + 552]
        x1, y1, z1 = ws[l + 560], ws[l + 568], ws[l + 576]
        x2, y2, z2 = ws[l + 584], ws[l + 592], ws[l + 600]
        x3, y3, z3 = ws[l + 608], ws[l + 616], ws[l + 624]
        V, s = ws[l + 432], ws[l + 448]
        t = _hourglass(
            ws,
            l,
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
        ws[l + 632] = mu * f00 + s * (f11 * f22 - f12 * f21) + x0 * t[0] + x1 * t[3] + x2 * t[6] + x3 * t[9]
        ws[l + 640] = mu * f01 + s * (f12 * f20 - f10 * f22) + x0 * t[1] + x1 * t[4] + x2 * t[7] + x3 * t[10]
        ws[l + 648] = mu * f02 + s * (f10 * f21 - f11 * f20) + x0 * t[2] + x1 * t[5] + x2 * t[8] + x3 * t[11]
        ws[l + 656] = mu * f10 + s * (f02 * f21 - f01 * f22) + y0 * t[0] + y1 * t[3] + y2 * t[6] + y3 * t[9]
        ws[l + 664] = mu * f11 + s * (f00 * f22 - f02 * f20) + y0 * t[1] + y1 * t[4] + y2 * t[7] + y3 * t[10]
        ws[l + 672] = mu * f12 + s * (f01 * f20 - f00 * f21) + y0 * t[2] + y1 * t[5] + y2 * t[8] + y3 * t[11]
        ws[l + 680] = mu * f20 + s * (f01 * f12 - f02 * f11) + z0 * t[0] + z1 * t[3] + z2 * t[6] + z3 * t[9]
        ws[l + 688] = mu * f21 + s * (f02 * f10 - f00 * f12) + z0 * t[1] + z1 * t[4] + z2 * t[7] + z3 * t[10]
        ws[l + 696] = mu * f22 + s * (f00 * f11 - f01 * f10) + z0 * t[2] + z1 * t[5] + z2 * t[8] + z3 * t[11]
        ws[l + 704] = f00 * t[0] + f01 * t[1] + f02 * t[2]
        ws[l + 712] = f10 * t[0] + f11 * t[1] + f12 * t[2]
        ws[l + 720] = f20 * t[0] + f21 * t[1] + f22 * t[2]
        ws[l + 728] = f00 * t[3] + f01 * t[4] + f02 * t[5]
        ws[l + 736] = f10 * t[3] + f11 * t[4] + f12 * t[5]
        ws[l + 744] = f20 * t[3] + f21 * t[4] + f22 * t[5]
        ws[l + 752] = f00 * t[6] + f01 * t[7] + f02 * t[8]
        ws[l + 760] = f10 * t[6] + f11 * t[7] + f12 * t[8]
        ws[l + 768] = f20 * t[6] + f21 * t[7] + f22 * t[8]
        ws[l + 776] = f00 * t[9] + f01 * t[10] + f02 * t[11]
        ws[l + 784] = f10 * t[9] + f11 * t[10] + f12 * t[11]
        ws[l + 792] = f20 * t[9] + f21 * t[10] + f22 * t[11]
        square = f00 * f00 + f01 * f01 + f02 * f02 + f10 * f10 + f11 * f11 + f12 * f12
        square += f20 * f20 + f21 * f21 + f22 * f22
        ws[l + 800] = max(1.0, square / 3.0)


@njit(cache=True, error_model="numpy")
def solve_lanes(ws, k):
    """Add dLambda to Lambda and leave it in the rows of P and T, eq. (4) and (5)."""
    for l in range(len(ws) // ROWS):
        f00, f01, f02 = ws[l + 464], ws[l + 472], ws[l + 480]
        f10, f11, f12 = ws[l + 488], ws[l + 496], ws[l + 504]
        f20, f21, f22 = ws[l + 512], ws[l + 520], ws[l + 528]
        g, V, I = ws[l + 424], ws[l + 432], ws[l + 800]
        c = V * (k[MU] + abs(ws[l + 448]) * np.sqrt(I))
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
        r00 = ws[l + 632] - ws[l + 256]
        r01 = ws[l + 640] - ws[l + 264]
        r02 = ws[l + 648] - ws[l + 272]
        r10 = ws[l + 656] - ws[l + 280]
        r11 = ws[l + 664] - ws[l + 288]
        r12 = ws[l + 672] - ws[l + 296]
        r20 = ws[l + 680] - ws[l + 304]
        r21 = ws[l + 688] - ws[l + 312]
        r22 = ws[l + 696] - ws[l + 320]
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
        bulk = V * ws[l + 456]
        z = bulk * over / (1.0 + bulk * under)
        g = g * V * I * 0.015625
        n0 = 1.0 / (1.0 + g * k[BOUND + 0])
        n1 = 1.0 / (1.0 + g * k[BOUND + 1])
        n2 = 1.0 / (1.0 + g * k[BOUND + 2])
        n3 = 1.0 / (1.0 + g * k[BOUND + 3])
        p0 = d0 * (r00 - z * c00)
        p1 = d1 * (r01 - z * c01)
        p2 = d2 * (r02 - z * c02)
        m0 = n0 * (ws[l + 704] - ws[l + 328])
        m1 = n1 * (ws[l + 728] - ws[l + 352])
        m2 = n2 * (ws[l + 752] - ws[l + 376])
        m3 = n3 * (ws[l + 776] - ws[l + 400])
        ws[l + 256] += p0
        ws[l + 632] = p0
        ws[l + 264] += p1
        ws[l + 640] = p1
        ws[l + 272] += p2
        ws[l + 648] = p2
        ws[l + 328] += m0
        ws[l + 704] = m0
        ws[l + 352] += m1
        ws[l + 728] = m1
        ws[l + 376] += m2
        ws[l + 752] = m2
        ws[l + 400] += m3
        ws[l + 776] = m3
        p0 = d0 * (r10 - z * c10)
        p1 = d1 * (r11 - z * c11)
        p2 = d2 * (r12 - z * c12)
        m0 = n0 * (ws[l + 712] - ws[l + 336])
        m1 = n1 * (ws[l + 736] - ws[l + 360])
        m2 = n2 * (ws[l + 760] - ws[l + 384])
        m3 = n3 * (ws[l + 784] - ws[l + 408])
        ws[l + 280] += p0
        ws[l + 656] = p0
        ws[l + 288] += p1
        ws[l + 664] = p1
        ws[l + 296] += p2
        ws[l + 672] = p2
        ws[l + 336] += m0
        ws[l + 712] = m0
        ws[l + 360] += m1
        ws[l + 736] = m1
        ws[l + 384] += m2
        ws[l + 760] = m2
        ws[l + 408] += m3
        ws[l + 784] = m3
        p0 = d0 * (r20 - z * c20)
        p1 = d1 * (r21 - z * c21)
        p2 = d2 * (r22 - z * c22)
        m0 = n0 * (ws[l + 720] - ws[l + 344])
        m1 = n1 * (ws[l + 744] - ws[l + 368])
        m2 = n2 * (ws[l + 768] - ws[l + 392])
        m3 = n3 * (ws[l + 792] - ws[l + 416])
        ws[l + 304] += p0
        ws[l + 680] = p0
        ws[l + 312] += p1
        ws[l + 688] = p1
        ws[l + 320] += p2
        ws[l + 696] = p2
        ws[l + 344] += m0
        ws[l + 720] = m0
        ws[l + 368] += m1
        ws[l + 744] = m1
        ws[l + 392] += m2
        ws[l + 768] = m2
        ws[l + 416] += m3
        ws[l + 792] = m3


@njit(cache=True, error_model="numpy")
def stress_lanes_linear(ws, k):
    """P and T of eight blocks of small strain: P = V (mu (F + F^T - 2 I) + lambda tr(F - I) I), T = K q."""
    for l in range(len(ws) // ROWS):
        f00, f01, f02 = ws[l + 464], ws[l + 472], ws[l + 480]
        f10, f11, f12 = ws[l + 488], ws[l + 496], ws[l + 504]
        f20, f21, f22 = ws[l + 512], ws[l + 520], ws[l + 528]
        V = ws[l + 432]
        mu = V * k[MU]
        bulk = V * k[LAM] * (f00 + f11 + f22 - 3.0) - 2.0 * mu
        ws[l + 632] = 2.0 * mu * f00 + bulk
        ws[l + 640] = mu * (f01 + f10)
        ws[l + 648] = mu * (f02 + f20)
        ws[l + 656] = mu * (f10 + f01)
        ws[l + 664] = 2.0 * mu * f11 + bulk
        ws[l + 672] = mu * (f12 + f21)
        ws[l + 680] = mu * (f20 + f02)
        ws[l + 688] = mu * (f21 + f12)
        ws[l + 696] = 2.0 * mu * f22 + bulk
        q = (
            ws[l + 536],
            ws[l + 544],
            ws[l + 552],
            ws[l + 560],
            ws[l + 568],
            ws[l + 576],
            ws[l + 584],
            ws[l + 592],
            ws[l + 600],
            ws[l + 608],
            ws[l + 616],
            ws[l + 624],
        )
        t = _hourglass(ws, l, k, q, V)
        ws[l + 704] = t[0]
        ws[l + 712] = t[1]
        ws[l + 720] = t[2]
        ws[l + 728] = t[3]
        ws[l + 736] = t[4]
        ws[l + 744] = t[5]
        ws[l + 752] = t[6]
        ws[l + 760] = t[7]
        ws[l + 768] = t[8]
        ws[l + 776] = t[9]
        ws[l + 784] = t[10]
        ws[l + 792] = t[11]


@njit(cache=True, error_model="numpy")
def solve_lanes_linear(ws, k):
    """As `solve_lanes`; P is linear, so dL_P solves (1 + V C G) dL_P = R exactly: 2 x 2 for shear, rank one for tr."""
    for l in range(len(ws) // ROWS):
        g, V = ws[l + 424], ws[l + 432]
        mu, bulk = V * k[MU], V * k[LAM]
        g0 = g * k[G + 0]
        g1 = g * k[G + 1]
        g2 = g * k[G + 2]
        r00 = ws[l + 632] - ws[l + 256]
        r01 = ws[l + 640] - ws[l + 264]
        r02 = ws[l + 648] - ws[l + 272]
        r10 = ws[l + 656] - ws[l + 280]
        r11 = ws[l + 664] - ws[l + 288]
        r12 = ws[l + 672] - ws[l + 296]
        r20 = ws[l + 680] - ws[l + 304]
        r21 = ws[l + 688] - ws[l + 312]
        r22 = ws[l + 696] - ws[l + 320]
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
        m0 = n0 * (ws[l + 704] - ws[l + 328])
        m1 = n1 * (ws[l + 728] - ws[l + 352])
        m2 = n2 * (ws[l + 752] - ws[l + 376])
        m3 = n3 * (ws[l + 776] - ws[l + 400])
        ws[l + 256] += p00
        ws[l + 632] = p00
        ws[l + 264] += p01
        ws[l + 640] = p01
        ws[l + 272] += p02
        ws[l + 648] = p02
        ws[l + 328] += m0
        ws[l + 704] = m0
        ws[l + 352] += m1
        ws[l + 728] = m1
        ws[l + 376] += m2
        ws[l + 752] = m2
        ws[l + 400] += m3
        ws[l + 776] = m3
        m0 = n0 * (ws[l + 712] - ws[l + 336])
        m1 = n1 * (ws[l + 736] - ws[l + 360])
        m2 = n2 * (ws[l + 760] - ws[l + 384])
        m3 = n3 * (ws[l + 784] - ws[l + 408])
        ws[l + 280] += p10
        ws[l + 656] = p10
        ws[l + 288] += p11
        ws[l + 664] = p11
        ws[l + 296] += p12
        ws[l + 672] = p12
        ws[l + 336] += m0
        ws[l + 712] = m0
        ws[l + 360] += m1
        ws[l + 736] = m1
        ws[l + 384] += m2
        ws[l + 760] = m2
        ws[l + 408] += m3
        ws[l + 784] = m3
        m0 = n0 * (ws[l + 720] - ws[l + 344])
        m1 = n1 * (ws[l + 744] - ws[l + 368])
        m2 = n2 * (ws[l + 768] - ws[l + 392])
        m3 = n3 * (ws[l + 792] - ws[l + 416])
        ws[l + 304] += p20
        ws[l + 680] = p20
        ws[l + 312] += p21
        ws[l + 688] = p21
        ws[l + 320] += p22
        ws[l + 696] = p22
        ws[l + 344] += m0
        ws[l + 720] = m0
        ws[l + 368] += m1
        ws[l + 744] = m1
        ws[l + 392] += m2
        ws[l + 768] = m2
        ws[l + 416] += m3
        ws[l + 792] = m3


@njit(cache=True, error_model="numpy")
def project_blocks(ws, k, linear):
    """One local solve of eight blocks: rows 0..23 and 32..52 updated in place."""
    shape_lanes(ws, k)
    if linear:
        stress_lanes_linear(ws, k)
        solve_lanes_linear(ws, k)
    else:
        volumetric_lanes(ws, k)
        stress_lanes(ws, k)
        solve_lanes(ws, k)
    move_lanes(ws, k)
