"""Compressible neo-Hookean solid, the energy that both models share.

psi(F) = mu/2 (I1 - 3) + psi_J(J),  psi_J(J) = -mu ln J + lambda/2 (ln J)^2                                    (1)

I1 = F : F, J = det F. The first part is quadratic in F; everything nonlinear sits in the scalar psi_J.
First Piola-Kirchhoff stress                  P = dpsi/dF = mu F + s cof F,  s = dpsi_J/dJ                     (2)
Cauchy stress                                 sigma = P F^T / J = mu/J F F^T + s I                             (3)
Tangent         dP_ij/dF_kl = mu d_ik d_jl + ds cof_ij cof_kl + s e_ikm e_jln F_mn,  ds = d2psi_J/dJ2          (4)

Below J_MIN psi_J continues as the parabola with the same value, slope and curvature (C2), so that an inverted state
has a finite energy and a force that turns it right side out again.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Soft food that is nearly incompressible keeps J within 0.7 .. 1.3 far beyond its breaking strain, so 0.2 changes no
# result that means anything; there ds is about 60 times its value at rest, which an implicit step still digests.
J_MIN = 0.2


@njit(cache=True, error_model="numpy")
def volumetric(J, mu, lam):
    """psi_J [Pa], s = dpsi_J/dJ and ds = d2psi_J/dJ2 [Pa] at the volume ratio J, eq. (1); continued below J_MIN."""
    if J >= J_MIN:
        log = np.log(J)
        return log * (0.5 * lam * log - mu), (lam * log - mu) / J, (lam * (1.0 - log) + mu) / (J * J)
    log = np.log(J_MIN)
    s = (lam * log - mu) / J_MIN
    ds = (lam * (1.0 - log) + mu) / (J_MIN * J_MIN)
    d = J - J_MIN
    return log * (0.5 * lam * log - mu) + d * (s + 0.5 * d * ds), s + d * ds, ds


@njit(cache=True, error_model="numpy")
def cofactor(F):
    """cof F = dJ/dF (3, 3), and J = det F."""
    C = np.empty((3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            C[i, a] = F[j, b] * F[k, c] - F[j, c] * F[k, b]
    return C, F[0, 0] * C[0, 0] + F[0, 1] * C[0, 1] + F[0, 2] * C[0, 2]


@njit(cache=True, error_model="numpy")
def energy(F, mu, lam):
    """Energy density psi [Pa] of the deformation gradient F (3, 3), eq. (1)."""
    _, J = cofactor(F)
    i1 = 0.0
    for i in range(3):
        for j in range(3):
            i1 += F[i, j] * F[i, j]
    return 0.5 * mu * (i1 - 3.0) + volumetric(J, mu, lam)[0]


@njit(cache=True, error_model="numpy")
def stress(F, mu, lam):
    """First Piola-Kirchhoff stress P (3, 3) [Pa], eq. (2)."""
    C, J = cofactor(F)
    _, s, _ = volumetric(J, mu, lam)
    return mu * F + s * C


@njit(cache=True, error_model="numpy")
def cauchy(F, mu, lam):
    """Cauchy stress sigma (3, 3) [Pa], eq. (3)."""
    _, J = cofactor(F)
    _, s, _ = volumetric(J, mu, lam)
    sigma = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            b = F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2]
            sigma[i, j] = mu * b / J + (s if i == j else 0.0)
    return sigma


@njit(cache=True, error_model="numpy")
def tangent(F, mu, lam):
    """dP/dF (3, 3, 3, 3) [Pa], index order P_ij F_kl, eq. (4)."""
    C, J = cofactor(F)
    _, s, ds = volumetric(J, mu, lam)
    A = np.empty((3, 3, 3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    A[i, j, k, n] = ds * C[i, j] * C[k, n]
                    if i == k and j == n:
                        A[i, j, k, n] += mu
    for i in range(3):
        for k in range(3):
            if i == k:
                continue
            m = 3 - i - k
            e_rows = 1.0 if (k - i) % 3 == 1 else -1.0
            for j in range(3):
                for n in range(3):
                    if j == n:
                        continue
                    o = 3 - j - n
                    e_columns = 1.0 if (n - j) % 3 == 1 else -1.0
                    A[i, j, k, n] += s * e_rows * e_columns * F[m, o]
    return A
