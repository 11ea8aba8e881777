"""Stress and tangent of an isotropic solid psi(I1, I2, J) from its derivatives by the invariants.

C = F^T F, I1 = tr C, I2 = ((tr C)^2 - tr C^2)/2, J = det F, all as differences from rest,
i1 = I1 - 3, i2 = I2 - 3, j = J - 1, which small strains do not round away.
A material's `response(i1, i2, j, parameters)` returns psi and its derivatives in this order:
psi, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ [Pa].

With N = I1 F - F C:  dI1/dF = 2 F,  dI2/dF = 2 N,  dJ/dF = cof F                                              (1)
P = 2 d1 F + 2 d2 N + dJ cof F                                                                                 (2)
dP/dF = 2 d1 dF/dF + 2 d2 dN/dF + dJ dcof/dF + second derivatives times the products of (1)                    (3)
dN_ij/dF_kl = 2 F_ij F_kl + I1 d_ik d_jl - d_ik C_jl - F_il F_kj - (F F^T)_ik d_jl                             (4)
dcof_ij/dF_kl = e_ikm e_jln F_mn                                                                               (5)
"""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def invariants(F):
    """i1, i2, j of the deformation gradient F (3, 3)."""
    a, b, c = F[0, 0] - 1.0, F[1, 1] - 1.0, F[2, 2] - 1.0
    f01, f02, f10, f12, f20, f21 = F[0, 1], F[0, 2], F[1, 0], F[1, 2], F[2, 0], F[2, 1]
    g00 = 2.0 * a + a * a + f10 * f10 + f20 * f20  # C - I
    g11 = 2.0 * b + b * b + f01 * f01 + f21 * f21
    g22 = 2.0 * c + c * c + f02 * f02 + f12 * f12
    g01 = f01 + f10 + a * f01 + f10 * b + f20 * f21
    g02 = f02 + f20 + a * f02 + f10 * f12 + f20 * c
    g12 = f12 + f21 + f01 * f02 + b * f12 + f21 * c
    i1 = g00 + g11 + g22
    minors = g00 * g11 + g00 * g22 + g11 * g22 - g01 * g01 - g02 * g02 - g12 * g12
    j = a + b + c + (a * b - f01 * f10) + (a * c - f02 * f20) + (b * c - f12 * f21)
    j += a * (b * c - f12 * f21) - f01 * (f10 * c - f12 * f20) + f02 * (f10 * f21 - b * f20)
    return i1, 2.0 * i1 + minors, j


@njit(cache=True, error_model="numpy")
def cofactor(F, i, j):
    """Entry of cof F = dJ/dF."""
    k, m, a, b = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return F[k, a] * F[m, b] - F[k, b] * F[m, a]


@njit(cache=True, error_model="numpy")
def write_stress(F, i1, d1, d2, dJ, P):
    """Eq. (2); P (3, 3) [Pa] updated in place."""
    for i in range(3):
        for j in range(3):
            P[i, j] = 2.0 * d1 * F[i, j] + dJ * cofactor(F, i, j)
    if d2 != 0.0:
        for i in range(3):
            for j in range(3):
                P[i, j] += 2.0 * d2 * _second(F, 3.0 + i1, i, j)


@njit(cache=True, error_model="numpy")
def _second(F, first, i, j):
    """N_ij of eq. (1); first = I1."""
    total = first * F[i, j]
    for k in range(3):
        total -= F[i, k] * (F[0, k] * F[0, j] + F[1, k] * F[1, j] + F[2, k] * F[2, j])
    return total


@njit(cache=True, error_model="numpy")
def write_tangent(F, i1, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ, A):
    """Eq. (3); A (9, 9) [Pa], rows 3 i + j, columns 3 k + l, updated in place."""
    first, second, third = np.empty(9), np.empty(9), np.empty(9)  # eq. (1)
    for i in range(3):
        for j in range(3):
            first[3 * i + j] = 2.0 * F[i, j]
            second[3 * i + j] = 2.0 * _second(F, 3.0 + i1, i, j) if d2 != 0.0 else 0.0
            third[3 * i + j] = cofactor(F, i, j)
    for m in range(9):
        a = d11 * first[m] + d12 * second[m] + d1J * third[m]
        b = d12 * first[m] + d22 * second[m] + d2J * third[m]
        c = d1J * first[m] + d2J * second[m] + dJJ * third[m]
        for n in range(9):
            A[m, n] = a * first[n] + b * second[n] + c * third[n]
        A[m, m] += 2.0 * d1
    for i in range(3):
        for k in range(3):
            if i == k:
                continue
            # eq. (5): e_ikm is 1 where i, k, m are in cyclic order
            m, sign = 3 - i - k, 1.0 if (k - i) % 3 == 1 else -1.0
            for j in range(3):
                n, o = (j + 1) % 3, (j + 2) % 3
                A[3 * i + j, 3 * k + n] += sign * dJ * F[m, o]
                A[3 * i + j, 3 * k + o] -= sign * dJ * F[m, n]
    if d2 != 0.0:
        _add_second(F, 3.0 + i1, 2.0 * d2, A)


@njit(cache=True, error_model="numpy")
def _add_second(F, first, scale, A):
    """A += scale dN/dF, eq. (4), in place; first = I1."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    value = 2.0 * F[i, j] * F[k, n] - F[i, n] * F[k, j]
                    if i == k:
                        value -= F[0, j] * F[0, n] + F[1, j] * F[1, n] + F[2, j] * F[2, n]
                        if j == n:
                            value += first
                    if j == n:
                        value -= F[i, 0] * F[k, 0] + F[i, 1] * F[k, 1] + F[i, 2] * F[k, 2]
                    A[3 * i + j, 3 * k + n] += scale * value


@njit(cache=True, error_model="numpy")
def principal_blocks(s, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ, h, minus, plus):
    """Blocks of `principal.assemble` at the stretches s (3,), without a division: h (3, 3), minus, plus (3,) in place.

    dI1/ds_i = 2 s_i,  dI2/ds_i = 2 s_i (s_j^2 + s_k^2),  dJ/ds_i = s_j s_k                                    (6)
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = 2.0 * s[i], 2.0 * s[i] * (s[j] * s[j] + s[k] * s[k]), s[j] * s[k]
        for m in range(3):
            n, o = (m + 1) % 3, (m + 2) % 3
            e, f, g = 2.0 * s[m], 2.0 * s[m] * (s[n] * s[n] + s[o] * s[o]), s[n] * s[o]
            h[i, m] = a * (d11 * e + d12 * f + d1J * g) + b * (d12 * e + d22 * f + d2J * g)
            h[i, m] += c * (d1J * e + d2J * f + dJJ * g)
            if i == m:
                h[i, m] += 2.0 * d1 + 2.0 * d2 * (s[j] * s[j] + s[k] * s[k])
            else:
                h[i, m] += 4.0 * d2 * s[i] * s[m] + dJ * s[3 - i - m]
        minus[i] = 2.0 * d1 + 2.0 * d2 * (s[i] * s[i] - c) - s[i] * dJ
        plus[i] = 2.0 * d1 + 2.0 * d2 * (s[i] * s[i] + c) + s[i] * dJ
