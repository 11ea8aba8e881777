"""One XPBD block constraint per hexahedral block, in stress form, for eight blocks side by side.

A block is a box with edges l, volume V and node signs xi, eta, zeta = +-1. It stores the stress that it applies,
Lambda_P (3, 3) [N m] and Lambda_m (4, 3) [N], and moves its nodes until that equals the stress that its shape asks for:

b_i = (xi_i/4 l_x, eta_i/4 l_y, zeta_i/4 l_z),  F = sum x_i b_i^T,  q_m = 1/8 sum h_mi x_i                       (1)
h = (eta zeta, xi zeta, xi eta, xi eta zeta)
U = V psi(F) + 1/2 q^T K q,  q_m -> F^T q_m for a finite-strain material                                      (2)
P = V (mu F + s cof F) + sum_m q_m t_m^T,  t = K F^T q,  T_m = F t_m,  f_i = -(P b_i + sum_m h_mi T_m/8)       (3)

Local solve. Moving the nodes by x_i -= h^2 w_i (dL_P b_i + sum_m h_mi dL_m/8) changes F by about -dL_P diag(G) and q_m
by about -g_q dL_m, G_b = g/(16 l_b^2), g_q = g/64, g = kappa h^2 8 max w_i (exact for equal masses, kappa = 1). With
R = P - Lambda_P, D_b = 1/(1 + V (mu + |s| sqrt(I)) G_b), I = max(1, F:F/3), and the rank-one term V ds cof F cof F^T
kept by the Sherman-Morrison formula:
z = V ds sum G_b D_b C_ab R_ab / (1 + V ds sum G_b D_b C_ab^2),  dL_ab = D_b (R_ab - z C_ab)                    (4)
dL_m = (T_m - Lambda_m)/(1 + g_q k_m I),  k_m = max_c sum |K_(m,c),.|                                         (5)
Whatever the approximations of (4) and (5), the fixed point is Lambda = (P, T): statics are exact.

The workspace `ws` is flat, row r of a lane at 8 r + lane, because only then does the compiler use vector instructions.
Rows: 0..23 positions (node, component), 24..31 h^2 w_i, 32..52 Lambda (P row by row, then T), 53 g,
54 fill V, 55 J, 56 s, 57 ds, 58..66 F, 67..78 q, 79..87 P and
88..99 T as the shape asks for them, 100 I.
"""

from __future__ import annotations

from numba import njit

LANES = 8
ROWS = 108

# Entries of the constants array, see `hourglass.block_constants`.
MU, LAM, B, G, PAIR, SHEAR, TWIST, BOUND = 0, 1, 2, 5, 8, 17, 23, 26
N_CONSTANTS = 30


@njit(cache=True, error_model="numpy", forceinline=True)
def _transform(ws, lane, c, k):
    """Rows of F and q of component c: the 8-point Walsh-Hadamard transform of the nodes, eq. (1)."""
    u0 = ws[lane + 8 * c]
    u1 = ws[lane + 8 * (3 + c)]
    u2 = ws[lane + 8 * (6 + c)]
    u3 = ws[lane + 8 * (9 + c)]
    u4 = ws[lane + 8 * (12 + c)]
    u5 = ws[lane + 8 * (15 + c)]
    u6 = ws[lane + 8 * (18 + c)]
    u7 = ws[lane + 8 * (21 + c)]
    s0, d0 = u0 + u1, u1 - u0
    s1, d1 = u2 + u3, u3 - u2
    s2, d2 = u4 + u5, u5 - u4
    s3, d3 = u6 + u7, u7 - u6
    sa, sb, sc, sd = s0 + s1, s1 - s0, s2 + s3, s3 - s2
    da, db, dc, dd = d0 + d1, d1 - d0, d2 + d3, d3 - d2
    ws[lane + 8 * (58 + 3 * c)] = (da + dc) * k[B]
    ws[lane + 8 * (59 + 3 * c)] = (sb + sd) * k[B + 1]
    ws[lane + 8 * (60 + 3 * c)] = (sc - sa) * k[B + 2]
    ws[lane + 8 * (67 + c)] = (sd - sb) * 0.125
    ws[lane + 8 * (70 + c)] = (dc - da) * 0.125
    ws[lane + 8 * (73 + c)] = (db + dd) * 0.125
    ws[lane + 8 * (76 + c)] = (dd - db) * 0.125


@njit(cache=True, error_model="numpy")
def shape_lanes(ws, k):
    """F, q and J of eight blocks, eq. (1)."""
    for lane in range(len(ws) // ROWS):
        _transform(ws, lane, 0, k)
        _transform(ws, lane, 1, k)
        _transform(ws, lane, 2, k)
        f00, f01, f02 = ws[lane + 464], ws[lane + 472], ws[lane + 480]
        f10, f11, f12 = ws[lane + 488], ws[lane + 496], ws[lane + 504]
        f20, f21, f22 = ws[lane + 512], ws[lane + 520], ws[lane + 528]
        ws[lane + 440] = f00 * (f11 * f22 - f12 * f21) + f01 * (f12 * f20 - f10 * f22) + f02 * (f10 * f21 - f11 * f20)


@njit(cache=True, error_model="numpy", forceinline=True)
def hourglass(k, q, V):
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


@njit(cache=True, error_model="numpy", forceinline=True)
def _spread(ws, lane, c, k):
    """Move component c of the nodes: x_i -= g_i (dL_P b_i + sum_m h_mi dL_m/8), g_i = h^2 w_i in rows 24..31."""
    cx, cy, cz = (
        ws[lane + 8 * (79 + 3 * c)] * k[B],
        ws[lane + 8 * (80 + 3 * c)] * k[B + 1],
        ws[lane + 8 * (81 + 3 * c)] * k[B + 2],
    )
    m0, m1 = 0.125 * ws[lane + 8 * (88 + c)], 0.125 * ws[lane + 8 * (91 + c)]
    m2, m3 = 0.125 * ws[lane + 8 * (94 + c)], 0.125 * ws[lane + 8 * (97 + c)]
    c0, c1, c2, c3 = m0 - cy - cz, cy - cz - m0, cz - cy - m0, cy + cz + m0
    e0, e1, e2, e3 = cx - m2 - m1 + m3, cx + m2 - m1 - m3, cx - m2 + m1 - m3, cx + m2 + m1 + m3
    ws[lane + 8 * c] -= ws[lane + 192] * (c0 - e0)
    ws[lane + 8 * (3 + c)] -= ws[lane + 200] * (c0 + e0)
    ws[lane + 8 * (6 + c)] -= ws[lane + 208] * (c1 - e1)
    ws[lane + 8 * (9 + c)] -= ws[lane + 216] * (c1 + e1)
    ws[lane + 8 * (12 + c)] -= ws[lane + 224] * (c2 - e2)
    ws[lane + 8 * (15 + c)] -= ws[lane + 232] * (c2 + e2)
    ws[lane + 8 * (18 + c)] -= ws[lane + 240] * (c3 - e3)
    ws[lane + 8 * (21 + c)] -= ws[lane + 248] * (c3 + e3)


@njit(cache=True, error_model="numpy")
def move_lanes(ws, k):
    """Move the nodes of eight blocks by the dLambda that stands in the rows of P and T. A loop of its own: together
    with `solve_lanes` it is more than the compiler vectorises."""
    for lane in range(len(ws) // ROWS):
        _spread(ws, lane, 0, k)
        _spread(ws, lane, 1, k)
        _spread(ws, lane, 2, k)
