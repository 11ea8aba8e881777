"""Small-strain linear elasticity: not objective, and the reference against which the seam is exact.

psi(F) = mu eps : eps + lambda/2 (tr eps)^2,  eps = (H + H^T)/2,  H = F - I                                    (1)
P = 2 mu eps + lambda tr(eps) I                                                                                (2)
dP_ij/dF_kl = mu (d_ik d_jl + d_il d_jk) + lambda d_ij d_kl                                                    (3)

The tangent is constant and positive semi-definite: eigenvalues 3 lambda + 2 mu, 2 mu, and 0 for rotations.
Valid: strains and rotations below a few percent; a body that turns by an angle a gains the strain 1 - cos a.
mu > 0, lambda > -2/3 mu [Pa].
"""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def energy(parameters, F):
    """Energy density psi [Pa] of the deformation gradient F (3, 3), eq. (1)."""
    square = 0.0
    for i in range(3):
        for j in range(3):
            e = 0.5 * (F[i, j] + F[j, i]) - (1.0 if i == j else 0.0)
            square += e * e
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    return parameters[0] * square + 0.5 * parameters[1] * trace * trace


@njit(cache=True, error_model="numpy")
def stress(parameters, F, P):
    """First Piola-Kirchhoff stress, eq. (2), symmetric; P (3, 3) [Pa] updated in place."""
    mu, lam = parameters[0], parameters[1]
    pressure = lam * (F[0, 0] + F[1, 1] + F[2, 2] - 3.0) - 2.0 * mu
    for i in range(3):
        for j in range(3):
            P[i, j] = mu * (F[i, j] + F[j, i])
        P[i, i] += pressure


@njit(cache=True, error_model="numpy")
def tangent(parameters, A):
    """dP/dF, eq. (3); A (9, 9) [Pa], rows 3 i + j, columns 3 k + l, updated in place."""
    mu, lam = parameters[0], parameters[1]
    A[:] = 0.0
    for i in range(3):
        for j in range(3):
            A[3 * i + j, 3 * i + j] += mu
            A[3 * i + j, 3 * j + i] += mu
            A[4 * i, 4 * j] += lam
