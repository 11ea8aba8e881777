"""Energy, stress and tangent at one point of any material, for kernels.

A material is a number, its kind, and a flat array of parameters, whose order is the law's own. The kind of one of
softseam's laws is a branch here, which the compiler puts in line; that of a law from outside is the address of its
response (`law`), so no law falls through to another's. F (3, 3) is the deformation gradient. The derivative dP/dF is A
(9, 9), row 3 i + j for P_ij, column 3 k + l for F_kl; A is symmetric.
"""

import numpy as np

from softseam_services.body.materials import (
    corotated,
    linear,
    mooney_rivlin,
    neo_hookean,
    st_venant_kirchhoff,
    stable_neo_hookean,
)
from softseam_services.body.materials.invariants import invariants, principal_blocks, write_stress, write_tangent
from softseam_services.body.materials.principal import assemble, signed_svd
from softseam_services.body.materials.prototype import RESPONSE
from softseam_services.jit import njit

NEO_HOOKEAN, LINEAR, COROTATED, ST_VENANT_KIRCHHOFF, STABLE_NEO_HOOKEAN, MOONEY_RIVLIN = 1, 2, 3, 4, 5, 6
RELAXING = -NEO_HOOKEAN
"""of neo_hookean with branches beside it that relax, as of `with_state`"""
BRANCHES = frozenset({NEO_HOOKEAN, LINEAR, COROTATED, ST_VENANT_KIRCHHOFF, STABLE_NEO_HOOKEAN, MOONEY_RIVLIN})
"""numbers that have a branch in `response`, or in front of it; every other number is an address"""
_call_response = RESPONSE.call


@njit(cache=True, error_model="numpy")
def response(kind, parameters, i1, i2, j):
    """psi and its derivatives by the invariants (`invariants`); of the kinds that are written in these.

    Raises ValueError of kind 0.
    """
    if kind == NEO_HOOKEAN:
        return neo_hookean.response(i1, i2, j, parameters)
    if kind == ST_VENANT_KIRCHHOFF:
        return st_venant_kirchhoff.response(i1, i2, j, parameters)
    if kind == STABLE_NEO_HOOKEAN:
        return stable_neo_hookean.response(i1, i2, j, parameters)
    if kind == MOONEY_RIVLIN:
        return mooney_rivlin.response(i1, i2, j, parameters)
    return _call_response(kind, i1, i2, j, parameters)


@njit(cache=True, error_model="numpy")
def energy(kind, parameters, F):
    """Energy density psi [Pa], zero at rest."""
    if kind == LINEAR:
        return linear.energy(parameters, F)
    if kind == COROTATED:
        return corotated.energy(parameters, F)
    i1, i2, j = invariants(F)
    return response(kind, parameters, i1, i2, j)[0]


@njit(cache=True, error_model="numpy")
def stress(kind, parameters, F, P):
    """First Piola-Kirchhoff stress P = dpsi/dF; P (3, 3) [Pa] updated in place."""
    if kind == LINEAR:
        linear.stress(parameters, F, P)
    elif kind == COROTATED:
        corotated.stress(parameters, F, P)
    else:
        i1, i2, j = invariants(F)
        _, d1, d2, dJ, _, _, _, _, _, _ = response(kind, parameters, i1, i2, j)
        write_stress(F, i1, d1, d2, dJ, P)


@njit(cache=True, error_model="numpy")
def tangent(kind, parameters, F, A, definite):
    """A = dP/dF; A (9, 9) [Pa] updated in place.

    definite: its negative eigenvalues are raised to zero (`principal`), which Newton's method wants far from the
    solution; where there are none, both tangents are the same to rounding.
    """
    if kind == LINEAR:
        linear.tangent(parameters, A)
        return
    if kind == COROTATED:
        corotated.tangent(parameters, F, A, definite)
        return
    i1, i2, j = invariants(F)
    _, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ = response(kind, parameters, i1, i2, j)
    if not definite:
        write_tangent(F, i1, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ, A)
        return
    U, stretch, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    h, minus, plus = np.empty((3, 3)), np.empty(3), np.empty(3)
    signed_svd(F, U, stretch, V)
    principal_blocks(stretch, d1, d2, dJ, d11, d12, d22, d1J, d2J, dJJ, h, minus, plus)
    assemble(U, V, h, minus, plus, True, A)


@njit(cache=True, error_model="numpy")
def cauchy(kind, parameters, F, sigma):
    """Cauchy stress P F^T / J; sigma (3, 3) [Pa] updated in place. Of small strains ('linear') it is P."""
    if kind == LINEAR:
        linear.stress(parameters, F, sigma)
        return
    P = np.empty((3, 3))
    stress(kind, parameters, F, P)
    J = 1.0 + invariants(F)[2]
    for i in range(3):
        for j in range(3):
            sigma[i, j] = (P[i, 0] * F[j, 0] + P[i, 1] * F[j, 1] + P[i, 2] * F[j, 2]) / J
