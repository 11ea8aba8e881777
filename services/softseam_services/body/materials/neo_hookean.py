"""Compressible neo-Hookean solid, the energy that both models share.

psi(F) = mu/2 (I1 - 3) + psi_J(J),  psi_J(J) = -mu ln J + lambda/2 (ln J)^2                                    (1)

I1 = F : F, J = det F. The first part is quadratic in F; everything nonlinear sits in the scalar psi_J.
First Piola-Kirchhoff stress                  P = dpsi/dF = mu F + s cof F,  s = dpsi_J/dJ                     (2)
Cauchy stress                                 sigma = P F^T / J = mu/J F F^T + s I                             (3)
Tangent         dP_ij/dF_kl = mu d_ik d_jl + ds cof_ij cof_kl + s e_ikm e_jln F_mn,  ds = d2psi_J/dJ2          (4)

Below J_MIN psi_J continues as the parabola with the same value, slope and curvature (C2), so that an inverted state
has a finite energy and a force that turns it right side out again.

Valid: any F. mu > 0, lambda > -2/3 mu [Pa].
"""

import numpy as np

from softseam_services.jit import njit

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
def response(i1, i2, j, parameters):
    """psi [Pa] of eq. (1) and its derivatives by the invariants, as `invariants` asks."""
    mu, lam = parameters[0], parameters[1]
    psi, s, ds = volumetric(1.0 + j, mu, lam)
    if 1.0 + j >= J_MIN:
        log = np.log1p(j)  # small strains keep their digits
        psi = log * (0.5 * lam * log - mu)
    return 0.5 * mu * i1 + psi, 0.5 * mu, 0.0, s, 0.0, 0.0, 0.0, 0.0, 0.0, ds
