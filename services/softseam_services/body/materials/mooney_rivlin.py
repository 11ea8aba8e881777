"""Mooney-Rivlin solid in the isochoric invariants, with a volumetric energy beside it.

psi(F) = c10 (J^(-2/3) I1 - 3) + c01 (J^(-4/3) I2 - 3) + U(J),  U = K/4 (J^2 - 1 - 2 ln J)                     (1)
I1 = tr C, I2 = ((tr C)^2 - tr C^2)/2, C = F^T F. U: Simo & Miehe, Comput. Methods Appl. Mech. Eng. 98, 1992.
c10 = (1 - ratio) mu/2,  c01 = ratio mu/2,  K = lambda + 2/3 mu                                                (2)
so the small-strain limit is Hooke's law with mu, lambda; ratio 0 is an (isochoric) neo-Hookean solid.

Below J_MIN the three functions of J continue as parabolas with the same value, slope and curvature (C2): an inverted
state has a finite energy and a force that turns it right side out again.

Valid: any F; data of rubber fit up to stretches of about 2. 0 <= ratio <= 1, mu > 0, K > 0 [Pa].
"""

import numpy as np

from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def _power(J, log, power):
    """f = J^power - 1, f', f''; log = ln J."""
    f = np.expm1(power * log)
    df = power * (f + 1.0) / J
    return f, df, (power - 1.0) * df / J


@njit(cache=True, error_model="numpy")
def response(i1, i2, j, parameters):
    """psi [Pa] of eq. (1) and its derivatives by the invariants, as `invariants` asks; parameters mu, lambda, ratio."""
    mu, lam, ratio = parameters[0], parameters[1], parameters[2]
    c10, c01, bulk = 0.5 * mu * (1.0 - ratio), 0.5 * mu * ratio, lam + 2.0 / 3.0 * mu  # eq. (2)
    at = max(j, J_MIN - 1.0)
    d = j - at  # 0, or how far below J_MIN
    J, log = 1.0 + at, np.log1p(at)  # small strains keep their digits
    f, df, ddf = _power(J, log, -2.0 / 3.0)
    g, dg, ddg = _power(J, log, -4.0 / 3.0)
    u, du, ddu = 0.25 * (at * (2.0 + at) - 2.0 * log), 0.5 * (J - 1.0 / J), 0.5 * (1.0 + 1.0 / (J * J))
    f, df = f + d * (df + 0.5 * d * ddf), df + d * ddf
    g, dg = g + d * (dg + 0.5 * d * ddg), dg + d * ddg
    u, du = u + d * (du + 0.5 * d * ddu), du + d * ddu
    first, second = i1 + 3.0, i2 + 3.0
    psi = c10 * (first * f + i1) + c01 * (second * g + i2) + bulk * u
    dJ = c10 * first * df + c01 * second * dg + bulk * du
    dJJ = c10 * first * ddf + c01 * second * ddg + bulk * ddu
    return psi, c10 * (f + 1.0), c01 * (g + 1.0), dJ, 0.0, 0.0, 0.0, c10 * df, c01 * dg, dJJ
