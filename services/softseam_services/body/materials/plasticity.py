"""Stress that yields: a spring in series with a slider, beside the spring of an elastic law (von Mises).

The spring is the isochoric neo-Hookean mu of a branch in `relaxation`, the slider holds until von Mises' stress of the
spring reaches sigma = yield + hardening alpha, alpha the equivalent plastic strain. What lasts of the shear modulus
beside it is kinematic hardening. C_i goes straight towards C_bar by the slip a >= 0 of a step, eq. (2) there with
k = 1/(1 + a), m = k, and with det C_i = det C_bar = 1, p = C_i^-1 : C_bar - 3, r = C_i : C_bar^-1 - 3,
  W(a) = 3 mu/2 G(X) (p + a r)/(1 + a)^2,  X = a (p + a r)/(1 + a)^3,  G(X) = ((1 + X)^(1/3) - 1)/X               (1)
is (3) there without its digits lost. Of a step that yields a makes W + integral of sigma^2/(6 mu) stationary:
  -dW/da = sigma(a)^2/(6 mu),  sigma(a) = (yield + hardening alpha_0)/(1 - a hardening/(3 mu))                    (2)
  alpha = alpha_0 + a sigma/(3 mu)                                                                                (3)
-dW/da at a = 0 is |dev tau|^2/(4 mu), so yielding begins where von Mises' does; in small strains (2) is the radial
return (Simo and Taylor, Comput. Methods Appl. Mech. Eng. 48, 101, 1985). As a is stationary, stress is the derivative
of the potential with a held, and the tangent is symmetric, (4) of `relaxation` less S_a S_a/(W_aa + (sigma^2/6 mu)_a),
  S_a = mu D^(-1/3) {g (m/3 M - N) - (m^2/3 - n)/3 C^-1},  m = C_bar : M,  n = C_bar : N                          (4)
A step dissipates sigma (alpha - alpha_0) >= 0, which has in it what hardening stores.
"""

import numpy as np

from softseam_services.jit import njit

MOST_ITERATIONS = 60
"""of Newton's method in a bracket, which halves where Newton leaves it"""


@njit(cache=True, error_model="numpy")
def slip(p, r, mu, strength, hardening):
    """a of eq. (2), sigma(a) [Pa] and the curvature W_aa + (sigma^2/6 mu)_a [Pa]; 0 where the slider holds.

    strength: yield + hardening alpha_0 [Pa]
    """
    slope, _ = _derivatives(p, r, 0.0)
    drive = np.sqrt(max(0.0, -9.0 * slope)) * mu
    if drive <= strength:
        return 0.0, strength, 1.0
    most = 3.0 * mu / hardening if hardening > 0.0 else np.inf
    low, high = 0.0, most
    a = (drive - strength) / (strength + hardening * drive / (3.0 * mu))
    sigma = curvature = 0.0
    for _ in range(MOST_ITERATIONS):
        softer = 1.0 - a / most
        sigma = strength / softer
        slope, bent = _derivatives(p, r, a)
        off = 1.5 * mu * slope + sigma * sigma / (6.0 * mu)
        curvature = 1.5 * mu * bent + sigma * sigma / (3.0 * mu * most * softer)
        if off < 0.0:
            low = a
        else:
            high = a
        further = -off / curvature if curvature > 0.0 else np.inf
        if abs(further) <= 1e-14 * a:  # rounding
            break
        a += further
        if not low < a < high:
            a = 2.0 * low + 1.0 if high == np.inf else 0.5 * (low + high)
    return a, sigma, curvature


@njit(cache=True, error_model="numpy")
def _derivatives(p, r, a):
    """First and second derivative by a of G (p + a r)/(1 + a)^2, eq. (1)."""
    b = 1.0 / (1.0 + a)
    u, b2 = p + a * r, b * b
    b3 = b2 * b
    y = np.cbrt(max(1e-12, 1.0 + a * u * b3))
    q = y * y + y + 1.0  # G = 1/q
    first, second = 1.0 / (3.0 * y * y), -2.0 / (9.0 * y**5)  # of y by X
    of_y, twice = -(2.0 * y + 1.0) / (q * q), -2.0 / (q * q) + 2.0 * (2.0 * y + 1.0) ** 2 / (q * q * q)
    G, G_x, G_xx = 1.0 / q, of_y * first, twice * first * first + of_y * second
    x = (u + a * r) * b3 - 3.0 * a * u * b3 * b
    x_a = 2.0 * r * b3 - 6.0 * (u + a * r) * b3 * b + 12.0 * a * u * b3 * b2
    f = u * b2
    f_a = r * b2 - 2.0 * u * b3
    f_aa = -4.0 * r * b3 + 6.0 * u * b3 * b
    return G_x * x * f + G * f_a, (G_xx * x * x + G_x * x_a) * f + 2.0 * G_x * x * f_a + G * f_aa
