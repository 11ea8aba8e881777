"""Stable neo-Hookean solid: finite and smooth for every F, flat or inverted too.

Smith, de Goes & Kim, Stable Neo-Hookean Flesh Simulation, ACM Trans. Graph. 37(2), 2018, doi 10.1145/3180491.
psi(F) = m/2 (I1 - 3) + l/2 (J - a)^2 - m/2 ln(I1 + 1) + constant,  a = 1 + 3 m/(4 l)                          (1)
The paper's m, l are not Lame's: its small-strain limit is Hooke's law with mu, lambda where
m = 4/3 mu,  l = lambda + 5/6 mu                                                                               (2)
(at rest d2psi = m (1 - 1/4) for shear and l + m (1/8 - 3/4) beside it), and the constant makes psi(I) = 0:
psi = m/2 i1 + l/2 j^2 - 3/4 m j - m/2 ln(1 + i1/4),  i1 = I1 - 3,  j = J - 1                                  (3)
P = m (1 - 1/(I1 + 1)) F + (l j - 3/4 m) cof F                                                                 (4)

Valid: any F; a crushed or inverted state costs a finite energy and is pushed back, softer than neo_hookean, so under
great pressure cells may turn over; F = 0 alone is a state without force. mu > 0, lambda > -2/3 mu [Pa].
"""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def response(i1, i2, j, parameters):
    """psi [Pa] of eq. (3) and its derivatives by the invariants, as `invariants` asks."""
    m = 4.0 / 3.0 * parameters[0]
    l_ = parameters[1] + 5.0 / 6.0 * parameters[0]  # eq. (2)
    inverse = 1.0 / (i1 + 4.0)
    psi = 0.5 * m * (i1 - np.log1p(0.25 * i1)) + j * (0.5 * l_ * j - 0.75 * m)
    d11 = 0.5 * m * inverse * inverse
    return psi, 0.5 * m * (1.0 - inverse), 0.0, l_ * j - 0.75 * m, d11, 0.0, 0.0, 0.0, 0.0, l_
