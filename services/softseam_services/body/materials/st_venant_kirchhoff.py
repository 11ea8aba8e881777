"""St. Venant-Kirchhoff solid: Hooke's law between Green strain and second Piola-Kirchhoff stress.

psi(F) = mu E : E + lambda/2 (tr E)^2,  E = (F^T F - I)/2                                                      (1)
With i1 = I1 - 3, i2 = I2 - 3:  E : E = (i1^2 + 4 i1 - 2 i2)/4,  tr E = i1/2                                   (2)
P = F (2 mu E + lambda tr(E) I)                                                                                (3)

Valid: any rotation, strains of some ten percent. It weakens in compression (uniaxial strain: beyond a stretch of
1/sqrt(3) = 0.577 the force falls) and does not resist a cell that is crushed or turned inside out: choose
neo_hookean or stable_neo_hookean where tools squeeze. mu > 0, lambda > -2/3 mu [Pa].
"""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def response(i1, i2, j, parameters):
    """psi [Pa] of eq. (1) by eq. (2), and its derivatives by the invariants, as `invariants` asks."""
    mu, lam = parameters[0], parameters[1]
    psi = 0.25 * mu * (i1 * i1 + (4.0 * i1 - 2.0 * i2)) + 0.125 * lam * i1 * i1
    d1 = 0.5 * mu * (i1 + 2.0) + 0.25 * lam * i1
    return psi, d1, -0.5 * mu, 0.0, 0.5 * mu + 0.25 * lam, 0.0, 0.0, 0.0, 0.0, 0.0
