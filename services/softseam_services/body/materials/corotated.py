"""Corotated linear elasticity: Hooke's law in the frame that turns with the material.

F = R S, R the rotation nearest to F; with the signed stretches of `principal`, F = U diag(s) V^T:
psi(F) = mu |F - R|^2 + lambda/2 (tr(S) - 3)^2 = mu sum (s_i - 1)^2 + lambda/2 t^2,  t = sum (s_i - 1)         (1)
P = 2 mu (F - R) + lambda t R = U diag(p) V^T,  p_i = 2 mu (s_i - 1) + lambda t                                (2)
In the principal frame (`principal.assemble`), exact, the turning of R included:
h_ij = 2 mu d_ij + lambda,  minus_k = 2 mu,  plus_k = 2 mu + 2 (lambda t - 2 mu)/(s_i + s_j)                   (3)

R stays a rotation where F is flat or inverted (the least stretch is then negative), so the force turns such a state
right side out again. It jumps where s_i + s_j = 0; there the sum in eq. (3) is kept above LEAST_SUM.
Valid: any rotation, strains of some ten percent; it does not stiffen when crushed. mu > 0, lambda > -2/3 mu [Pa].
"""

import numpy as np

from softseam_services.body.materials.principal import assemble, signed_svd
from softseam_services.jit import njit

LEAST_SUM = 1e-3


@njit(cache=True, error_model="numpy")
def energy(parameters, F):
    """Energy density psi [Pa] of the deformation gradient F (3, 3), eq. (1)."""
    U, stretch, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    signed_svd(F, U, stretch, V)
    square = trace = 0.0
    for i in range(3):
        trace += stretch[i] - 1.0
        square += (stretch[i] - 1.0) ** 2
    return parameters[0] * square + 0.5 * parameters[1] * trace * trace


@njit(cache=True, error_model="numpy")
def stress(parameters, F, P):
    """First Piola-Kirchhoff stress, eq. (2); P (3, 3) [Pa] updated in place."""
    mu, lam = parameters[0], parameters[1]
    U, stretch, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    signed_svd(F, U, stretch, V)
    pressure = lam * (stretch[0] + stretch[1] + stretch[2] - 3.0) - 2.0 * mu
    for i in range(3):
        for j in range(3):
            R = U[i, 0] * V[j, 0] + U[i, 1] * V[j, 1] + U[i, 2] * V[j, 2]
            P[i, j] = 2.0 * mu * F[i, j] + pressure * R


@njit(cache=True, error_model="numpy")
def tangent(parameters, F, A, definite):
    """dP/dF by eq. (3), positive semi-definite where `definite`; A (9, 9) [Pa] updated in place."""
    mu, lam = parameters[0], parameters[1]
    U, stretch, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    h, minus, plus = np.empty((3, 3)), np.empty(3), np.empty(3)
    signed_svd(F, U, stretch, V)
    turned = lam * (stretch[0] + stretch[1] + stretch[2] - 3.0) - 2.0 * mu
    for k in range(3):
        for i in range(3):
            h[k, i] = lam + (2.0 * mu if k == i else 0.0)
        minus[k] = 2.0 * mu
        plus[k] = 2.0 * mu + 2.0 * turned / max(stretch[(k + 1) % 3] + stretch[(k + 2) % 3], LEAST_SUM)
    assemble(U, V, h, minus, plus, definite, A)
