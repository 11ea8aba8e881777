"""Small-strain linear elasticity: not objective, and the reference against which the seam is exact.

psi(F) = mu eps : eps + lambda/2 (tr eps)^2,  eps = (H + H^T)/2,  H = F - I                                    (1)
P = 2 mu eps + lambda tr(eps) I                                                                                (2)
dP_ij/dF_kl = mu (d_ik d_jl + d_il d_jk) + lambda d_ij d_kl                                                    (3)

With the same constant matrix mu/2 (I1 - 3) as the neo-Hookean solid taken out, what remains is
psi - mu/2 (I1 - 3) = mu/2 H_ij H_ji + lambda/2 (tr H)^2 - mu tr H                                             (4)
whose stress at rest is -mu I, as that of psi_J.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def energy(F, mu, lam):
    """Energy density psi [Pa] of the deformation gradient F (3, 3), eq. (1)."""
    square = 0.0
    for i in range(3):
        for j in range(3):
            e = 0.5 * (F[i, j] + F[j, i]) - (1.0 if i == j else 0.0)
            square += e * e
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    return mu * square + 0.5 * lam * trace * trace


@njit(cache=True, error_model="numpy")
def stress(F, mu, lam):
    """First Piola-Kirchhoff stress P (3, 3) [Pa], eq. (2); symmetric."""
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    P = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            P[i, j] = mu * (F[i, j] + F[j, i])
        P[i, i] += lam * trace - 2.0 * mu
    return P


@njit(cache=True, error_model="numpy")
def cauchy(F, mu, lam):
    """Cauchy stress (3, 3) [Pa]; in the small-strain limit it is P."""
    return stress(F, mu, lam)


@njit(cache=True, error_model="numpy")
def tangent(F, mu, lam):
    """dP/dF (3, 3, 3, 3) [Pa], index order P_ij F_kl, eq. (3); constant."""
    A = np.zeros((3, 3, 3, 3))
    for i in range(3):
        for j in range(3):
            A[i, j, i, j] += mu
            A[i, j, j, i] += mu
            A[i, i, j, j] += lam
    return A


@njit(cache=True, error_model="numpy")
def remainder_stress(F, mu, lam):
    """P - mu F (3, 3) [Pa]: what remains when mu/2 (I1 - 3) is integrated on its own, eq. (4)."""
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    P = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            P[i, j] = mu * F[j, i]
        P[i, i] += lam * trace - 2.0 * mu
    return P
