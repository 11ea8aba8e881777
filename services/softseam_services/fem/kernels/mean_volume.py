"""One volume ratio for a group of points: the material sees F_bar in place of F.

  F_bar = theta F,  theta = (j(J_bar)/j(J))^(1/3),  J = det F,  J_bar = sum w J / sum w over the group             (1)
with j(J) = J but for nearly inverted states, where it stays positive. Small-strain materials have instead
  F_bar = F + tau I,  tau = (t_bar - t)/3,  t = tr F,  t_bar = sum w t / sum w                                     (2)
With P_bar = dpsi/dF at F_bar, a = j'/j, H = dJ/dF = cof F, p = P_bar : F_bar / 3, the force of U = sum w psi(F_bar) is
  f = sum w (theta P_bar - p a H) : dF + (sum w p) a(J_bar) dJ_bar                                               (3)
and its tangent, with y = A_bar : F_bar, c = F_bar : y, h = a H/3, z = theta (y + P_bar), e = c + 3 p and
kappa = a(J_bar) sum w p/sum w - p a, is per point
  theta^2 A_bar - (z h + h z) + e h h - p a' H H + kappa d2J/dF2        for dF dF
  a(J_bar)/3 (z - e h)                                                  for dF dJ_bar, each way
  e a(J_bar)^2/9 + p a'(J_bar)                                          for dJ_bar dJ_bar                        (4)
For (2) put I for F_bar in p, y, c and for H, theta = a = 1, and z = y, e = c, a' = kappa = 0 in (4).
Gauss-Newton's part, which is positive semi-definite where A_bar is, leaves out the terms in P_bar and p.
"""

import numpy as np

from softseam_services.body.materials.invariants import cofactor
from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def positive_volume(J):
    """j, a = j'/j and a' at J: j = J from J_MIN on; below, twice differentiable, it falls to J_MIN/2 at most."""
    if J >= J_MIN:
        return J, 1.0 / J, -1.0 / (J * J)
    u = 2.0 * (1.0 - J / J_MIN)
    h = 1.0 / (1.0 + u + u * u)
    j = 0.5 * J_MIN * (1.0 + h)
    slope = (1.0 + 2.0 * u) * h * h
    curvature = -4.0 / J_MIN * h * h * (1.0 - (1.0 + 2.0 * u) ** 2 * h)
    a = slope / j
    return j, a, curvature / j - a * a


@njit(cache=True, error_model="numpy")
def volume_gradient(F, additive, H):
    """J and H = dJ/dF (3, 3), updated in place; of eq. (2): tr F and I."""
    if additive:
        for i in range(3):
            for j in range(3):
                H[i, j] = 1.0 if i == j else 0.0
        return F[0, 0] + F[1, 1] + F[2, 2]
    for i in range(3):
        for j in range(3):
            H[i, j] = cofactor(F, i, j)
    return F[0, 0] * H[0, 0] + F[0, 1] * H[0, 1] + F[0, 2] * H[0, 2]


@njit(cache=True, error_model="numpy")
def modify(F, J, J_bar, additive, F_bar):
    """F_bar (3, 3) of eq. (1) or (2), updated in place; returns theta, 1 for (2)."""
    if additive:
        for i in range(3):
            for j in range(3):
                F_bar[i, j] = F[i, j]
            F_bar[i, i] += (J_bar - J) / 3.0
        return 1.0
    theta = np.cbrt(positive_volume(J_bar)[0] / positive_volume(J)[0])
    for i in range(3):
        for j in range(3):
            F_bar[i, j] = theta * F[i, j]
    return theta


@njit(cache=True, error_model="numpy")
def mean_pressure(P_bar, F_bar, additive):
    """p = P_bar : F_bar / 3, of eq. (2) tr P_bar / 3."""
    if additive:
        return (P_bar[0, 0] + P_bar[1, 1] + P_bar[2, 2]) / 3.0
    p = 0.0
    for i in range(3):
        for j in range(3):
            p += P_bar[i, j] * F_bar[i, j]
    return p / 3.0


@njit(cache=True, error_model="numpy")
def modify_tangent(A, P_bar, F, F_bar, H, J, J_bar, theta, mean_p, additive, definite, coupled):
    """Eq. (4): A (9, 9) from A_bar in place, coupled (9,) the terms with dJ_bar; returns that of dJ_bar dJ_bar.

    mean_p = sum w p / sum w of the group
    """
    a = a_bar = 1.0
    da = da_bar = 0.0
    if not additive:
        _, a, da = positive_volume(J)
        _, a_bar, da_bar = positive_volume(J_bar)
    c = p = 0.0
    for m in range(9):
        i, j = m // 3, m % 3
        y = 0.0
        for n in range(9):
            direction = H[n // 3, n % 3] if additive else F_bar[n // 3, n % 3]
            y += A[m, n] * direction
        c += y * (H[i, j] if additive else F_bar[i, j])
        coupled[m] = theta * y
        if not (definite or additive):
            p += P_bar[i, j] * F_bar[i, j] / 3.0
            coupled[m] += theta * P_bar[i, j]
    e = c + 3.0 * p
    kappa = 0.0 if definite or additive else a_bar * mean_p - p * a
    for m in range(9):
        h_m = a / 3.0 * H[m // 3, m % 3]
        for n in range(9):
            h_n = a / 3.0 * H[n // 3, n % 3]
            A[m, n] = theta * theta * A[m, n] - coupled[m] * h_n - h_m * coupled[n] + e * h_m * h_n
            A[m, n] -= p * da * H[m // 3, m % 3] * H[n // 3, n % 3]
    if kappa != 0.0:
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for m in range(3):
                n, o = (m + 1) % 3, (m + 2) % 3
                # d2J/dF_jn dF_ko = F_im, and minus that for dF_jo dF_kn
                s = kappa * F[i, m]
                A[3 * j + n, 3 * k + o] += s
                A[3 * k + o, 3 * j + n] += s
                A[3 * j + o, 3 * k + n] -= s
                A[3 * k + n, 3 * j + o] -= s
    for m in range(9):
        coupled[m] = a_bar / 3.0 * (coupled[m] - e * a / 3.0 * H[m // 3, m % 3])
    return e * a_bar * a_bar / 9.0 + p * da_bar
