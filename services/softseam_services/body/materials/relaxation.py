"""Stress that relaxes: springs in series with dashpots, beside the spring of an elastic law (generalised Maxwell).

Each branch is an isochoric neo-Hookean spring mu that fades in the time tau; the elastic law beside them has what lasts
of the shear modulus, and all of the bulk modulus. With C_bar = J^(-2/3) C, g = J^(-2/3), and the viscous C_i of each
branch (symmetric, det 1, in the frame at rest, so that nothing is to turn),
  dC_i/dt = (C_bar - tr(C_bar C_i^-1)/3 C_i)/tau                                                                  (1)
Over a step dt in which C_bar goes straight, x = dt/tau, k = e^-x, m = (1 - k)/x:
  A = k C_i + (m - k) C_bar_0 + (1 - m) C_bar,  D = det A,  C_i <- D^(-1/3) A,  M = D^(1/3) A^-1 = C_i^-1          (2)
  S = mu (g M - (C_bar : M)/3 C^-1),  the derivative 2 dW/dC of W = 3 mu/(2 (1 - m)) (D^(1/3) - 1)                 (3)
so stress has a potential in every step, and its tangent is symmetric. With N = M C_bar M, a = C_bar : M,
b = C_bar : N, c = (1 - m) D^(-1/3) and (X o X) dC = X dC X,
  2 dS/dC = 2 mu {c g^2/3 M M - (g/3 + c g a/9)(M C^-1 + C^-1 M) + c g/3 (N C^-1 + C^-1 N)
            + (a/9 + c a^2/27 - c b/9) C^-1 C^-1 - c g^2 M o M + a/3 C^-1 o C^-1}                                  (4)
where XY is the outer product. A branch stores mu/2 (a - 3). Its dev tau/(2 mu) = q fades to k q and grows with the
strain; where it goes from q_0 to q_1 in the step it dissipates 2 mu/tau times the integral of q^2, with
p = (q_1 - k q_0)/(1 - k),
  2 mu {q_0^2 (1 - k^2)/2 + q_0 p (1 - k)^2 + p^2 (x - 3/2 + 2 k - k^2/2)} >= 0                                    (5)
exact in small strains, and where the strain is held. Products of q are those of dev S in the metric of the step's end.

Form (2) of the evolution is the integral of Reese and Govindjee's equation (Int. J. Solids Struct. 35, 3455, 1998) for
a straight way, made unimodular; it keeps the limit mu tau D of a step that is long beside tau. State of an octant:
C_bar - I of the last step's end, then C_i - I of each branch, six numbers each, xx yy zz yz xz xy. One branch may have
a slider in its dashpot's place, whose k and m are of how far it slips (`plasticity`); its plastic strain is the last
number. Where the volume ratio is below J_MIN of the elastic law, g and 1/J stay what they are there.
"""

import numpy as np

from softseam_services.body.materials import plasticity
from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.jit import njit

SIX = 6
BRANCHES = 4
"""place in a law's parameters of mu [Pa] and tau [s] of the first branch; those of the elastic law are before it"""
YIELDS = BRANCHES + 2 * 5
"""place of the stress at which the slider yields, and of how it hardens [Pa]; its branch's tau is 0"""
MU, KEEP, START, END, YIELD, HARDENING, COLUMNS = 0, 1, 2, 3, 4, 5, 6
"""columns of what a branch does in a step: mu [Pa], the coefficients of eq. (2), and those of a slider [Pa] or 0"""
BAR, INVERSE, FACING, CROSSED, STRESS, VISCOUS, SIDE, SIZE = 0, 6, 12, 18, 24, 30, 36, 42
"""places in a workspace: C_bar - I, C^-1, M, N, S, C_i - I, and what C^-1 is multiplied with"""
I_OF, J_OF = (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)
OF = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""number of the entry ij of a symmetric tensor"""


@njit(cache=True, error_model="numpy")
def coefficients(dt, time):
    """k, m - k and 1 - m of eq. (2)."""
    if dt == 0.0:
        return 1.0, 0.0, 0.0
    x = dt / time
    keep = np.exp(-x)
    mean = -np.expm1(-x) / x
    return keep, mean - keep, 1.0 - mean


@njit(cache=True, error_model="numpy")
def write_step(parameters, dt, step):
    """step (n, COLUMNS) <- what the first n branches of a law with these parameters do in a step of dt [s]."""
    for n in range(len(step)):
        mu, time = parameters[BRANCHES + 2 * n], parameters[BRANCHES + 2 * n + 1]
        step[n, MU] = mu
        step[n, KEEP], step[n, START], step[n, END] = coefficients(dt, time) if time > 0.0 else (1.0, 0.0, 0.0)
        slides = mu > 0.0 and time == 0.0 and dt > 0.0
        step[n, YIELD], step[n, HARDENING] = (parameters[YIELDS], parameters[YIELDS + 1]) if slides else (0.0, 0.0)


@njit(cache=True, error_model="numpy")
def inverse_cube_root(D):
    """D^(-1/3), by Newton's method y <- y (4 - D y^3)/3 near 1."""
    if not 0.6 < D < 1.7:
        return max(D, 1e-300) ** (-1.0 / 3.0)
    d = D - 1.0
    y = 1.0 - d * (1.0 / 3.0 - d * (2.0 / 9.0 - d * (14.0 / 81.0)))
    for _ in range(3 if abs(d) < 0.2 else 5):
        y *= (4.0 - D * y * y * y) * (1.0 / 3.0)
    return y


@njit(cache=True, error_model="numpy")
def strain(F, at, w):
    """C_bar - I and C^-1 of the three columns at `at` of F into the workspace; returns g."""
    f00, f01, f02 = F[0, at], F[0, at + 1], F[0, at + 2]
    f10, f11, f12 = F[1, at], F[1, at + 1], F[1, at + 2]
    f20, f21, f22 = F[2, at], F[2, at + 1], F[2, at + 2]
    h00, h01, h02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    h10, h11, h12 = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
    h20, h21, h22 = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
    J = max(f00 * h00 + f01 * h01 + f02 * h02, J_MIN)
    less = np.expm1(-2.0 / 3.0 * np.log(J))
    g = 1.0 + less
    a, b, c = f00 - 1.0, f11 - 1.0, f22 - 1.0
    w[BAR] = g * (2.0 * a + a * a + f10 * f10 + f20 * f20) + less
    w[BAR + 1] = g * (2.0 * b + b * b + f01 * f01 + f21 * f21) + less
    w[BAR + 2] = g * (2.0 * c + c * c + f02 * f02 + f12 * f12) + less
    w[BAR + 3] = g * (f01 * f02 + f11 * f12 + f21 * f22)
    w[BAR + 4] = g * (f00 * f02 + f10 * f12 + f20 * f22)
    w[BAR + 5] = g * (f00 * f01 + f10 * f11 + f20 * f21)
    s = 1.0 / (J * J)
    w[INVERSE] = s * (h00 * h00 + h10 * h10 + h20 * h20)
    w[INVERSE + 1] = s * (h01 * h01 + h11 * h11 + h21 * h21)
    w[INVERSE + 2] = s * (h02 * h02 + h12 * h12 + h22 * h22)
    w[INVERSE + 3] = s * (h01 * h02 + h11 * h12 + h21 * h22)
    w[INVERSE + 4] = s * (h00 * h02 + h10 * h12 + h20 * h22)
    w[INVERSE + 5] = s * (h00 * h01 + h10 * h11 + h20 * h21)
    return g


@njit(cache=True, error_model="numpy")
def _unimodular(w, keep, start, end, state, branch):
    """Eq. (2): M and C_i - I into the workspace, of a branch whose octant remembers `state`; returns D^(-1/3)."""
    at = SIX * (1 + branch)
    a0 = keep * state[at] + start * state[0] + end * w[BAR]
    a1 = keep * state[at + 1] + start * state[1] + end * w[BAR + 1]
    a2 = keep * state[at + 2] + start * state[2] + end * w[BAR + 2]
    a3 = keep * state[at + 3] + start * state[3] + end * w[BAR + 3]
    a4 = keep * state[at + 4] + start * state[4] + end * w[BAR + 4]
    a5 = keep * state[at + 5] + start * state[5] + end * w[BAR + 5]
    p, q, r = 1.0 + a0, 1.0 + a1, 1.0 + a2
    m0, m1, m2 = q * r - a3 * a3, p * r - a4 * a4, p * q - a5 * a5
    m3, m4, m5 = a4 * a5 - p * a3, a3 * a5 - q * a4, a3 * a4 - r * a5
    y = inverse_cube_root(p * m0 + a5 * m5 + a4 * m4)
    s = y * y
    w[FACING], w[FACING + 1], w[FACING + 2] = s * m0, s * m1, s * m2
    w[FACING + 3], w[FACING + 4], w[FACING + 5] = s * m3, s * m4, s * m5
    w[VISCOUS], w[VISCOUS + 1], w[VISCOUS + 2] = y * p - 1.0, y * q - 1.0, y * r - 1.0
    w[VISCOUS + 3], w[VISCOUS + 4], w[VISCOUS + 5] = y * a3, y * a4, y * a5
    return y


@njit(cache=True, error_model="numpy")
def _moved(w, g, step, state, branch):
    """Eq. (2) of a branch, M and C_i - I into the workspace: D^(-1/3) and 1 - m; and of a slider (1) to (3) of
    `plasticity`: its slip, sigma [Pa] and the curvature there [Pa], else 0, 0 and 1."""
    keep, start, end = step[branch, KEEP], step[branch, START], step[branch, END]
    a, sigma, curvature = 0.0, 0.0, 1.0
    if step[branch, YIELD] > 0.0:
        _unimodular(w, 1.0, 0.0, 0.0, state, branch)
        p, r = contracted(w, BAR, FACING) - 3.0, contracted(w, VISCOUS, INVERSE) / g - 3.0
        strength = step[branch, YIELD] + step[branch, HARDENING] * state[len(state) - 1]
        a, sigma, curvature = plasticity.slip(p, r, step[branch, MU], strength, step[branch, HARDENING])
        keep, end = 1.0 / (1.0 + a), a / (1.0 + a)
    return _unimodular(w, keep, start, end, state, branch), end, a, sigma, curvature


@njit(cache=True, error_model="numpy")
def contracted(w, one, other):
    """(I + X) : Y of the symmetric X and Y in the workspace."""
    total = w[other] + w[other + 1] + w[other + 2]
    for n in range(3):
        total += w[one + n] * w[other + n] + 2.0 * w[one + 3 + n] * w[other + 3 + n]
    return total


@njit(cache=True, error_model="numpy")
def write_stress(w, g, step, state):
    """S of all branches, eq. (3), into the workspace [Pa], where `strain` came before; returns what they store [Pa]."""
    for n in range(SIX):
        w[STRESS + n] = 0.0
    stored = pressure = 0.0
    for branch in range(len(step)):
        mu = step[branch, MU]
        if mu == 0.0:
            continue
        _moved(w, g, step, state, branch)
        a = contracted(w, BAR, FACING)
        stored += 0.5 * mu * (a - 3.0)
        pressure += mu * a / 3.0
        for n in range(SIX):
            w[STRESS + n] += mu * g * w[FACING + n]
    for n in range(SIX):
        w[STRESS + n] -= pressure * w[INVERSE + n]
    return stored


@njit(cache=True, error_model="numpy")
def add_stress(F, at, weight, w, P):
    """P += weight F S at the three columns at `at` of both, in place, of S in the workspace."""
    s0, s1, s2 = weight * w[STRESS], weight * w[STRESS + 1], weight * w[STRESS + 2]
    s3, s4, s5 = weight * w[STRESS + 3], weight * w[STRESS + 4], weight * w[STRESS + 5]
    for i in range(3):
        a, b, c = F[i, at], F[i, at + 1], F[i, at + 2]
        P[i, at] += a * s0 + b * s5 + c * s4
        P[i, at + 1] += a * s5 + b * s1 + c * s3
        P[i, at + 2] += a * s4 + b * s3 + c * s2


@njit(cache=True, error_model="numpy")
def _cross(w):
    """N = M C_bar M into the workspace."""
    m0, m1, m2 = w[FACING], w[FACING + 1], w[FACING + 2]
    m3, m4, m5 = w[FACING + 3], w[FACING + 4], w[FACING + 5]
    c0, c1, c2 = 1.0 + w[BAR], 1.0 + w[BAR + 1], 1.0 + w[BAR + 2]
    c3, c4, c5 = w[BAR + 3], w[BAR + 4], w[BAR + 5]
    t00, t01, t02 = m0 * c0 + m5 * c5 + m4 * c4, m0 * c5 + m5 * c1 + m4 * c3, m0 * c4 + m5 * c3 + m4 * c2
    t10, t11, t12 = m5 * c0 + m1 * c5 + m3 * c4, m5 * c5 + m1 * c1 + m3 * c3, m5 * c4 + m1 * c3 + m3 * c2
    t20, t21, t22 = m4 * c0 + m3 * c5 + m2 * c4, m4 * c5 + m3 * c1 + m2 * c3, m4 * c4 + m3 * c3 + m2 * c2
    w[CROSSED] = t00 * m0 + t01 * m5 + t02 * m4
    w[CROSSED + 1] = t10 * m5 + t11 * m1 + t12 * m3
    w[CROSSED + 2] = t20 * m4 + t21 * m3 + t22 * m2
    w[CROSSED + 3] = t10 * m4 + t11 * m3 + t12 * m2
    w[CROSSED + 4] = t00 * m4 + t01 * m3 + t02 * m2
    w[CROSSED + 5] = t00 * m5 + t01 * m1 + t02 * m3


@njit(cache=True, error_model="numpy")
def _add_products(w, one, outer, circled, D):
    """D (6, 6), its lower triangle, += outer X X + circled X o X, in place, X symmetric in the workspace."""
    x0, x1, x2, x3, x4, x5 = w[one], w[one + 1], w[one + 2], w[one + 3], w[one + 4], w[one + 5]
    half, both = 0.5 * circled, outer + circled
    D[0, 0] += both * x0 * x0
    D[1, 1] += both * x1 * x1
    D[2, 2] += both * x2 * x2
    D[1, 0] += outer * x0 * x1 + circled * x5 * x5
    D[2, 0] += outer * x0 * x2 + circled * x4 * x4
    D[2, 1] += outer * x1 * x2 + circled * x3 * x3
    D[3, 0] += outer * x0 * x3 + circled * x5 * x4
    D[3, 1] += both * x1 * x3
    D[3, 2] += both * x2 * x3
    D[4, 0] += both * x0 * x4
    D[4, 1] += outer * x1 * x4 + circled * x5 * x3
    D[4, 2] += both * x2 * x4
    D[5, 0] += both * x0 * x5
    D[5, 1] += both * x1 * x5
    D[5, 2] += outer * x2 * x5 + circled * x4 * x3
    D[3, 3] += (outer + half) * x3 * x3 + half * x1 * x2
    D[4, 4] += (outer + half) * x4 * x4 + half * x0 * x2
    D[5, 5] += (outer + half) * x5 * x5 + half * x0 * x1
    D[4, 3] += (outer + half) * x3 * x4 + half * x5 * x2
    D[5, 3] += (outer + half) * x3 * x5 + half * x1 * x4
    D[5, 4] += (outer + half) * x4 * x5 + half * x0 * x3


@njit(cache=True, error_model="numpy")
def write_stiffness(w, g, step, state, weight, definite, D):
    """S into the workspace, and 2 dS/dC of all branches, eq. (4), into D (6, 6), both by `weight` [Pa], where `strain`
    came before; definite: of (4) what is left where C_i is about C_bar, which is positive semi-definite."""
    D[:] = 0.0
    for n in range(SIX):
        w[STRESS + n] = 0.0
    pressure = both = alone = 0.0
    side = w[SIDE : SIDE + SIX]
    side[:] = 0.0
    for branch in range(len(step)):
        mu = weight * step[branch, MU]
        if mu == 0.0:
            continue
        y, end, slipped, _, curvature = _moved(w, g, step, state, branch)
        c = end * y
        a = contracted(w, BAR, FACING)
        pressure += mu * a / 3.0
        for n in range(SIX):
            w[STRESS + n] += mu * g * w[FACING + n]
        if definite:
            alone += 2.0 * mu * (1.0 - end) * a / 3.0
            both -= 2.0 * mu * (1.0 - end) * a / 9.0
            continue
        _cross(w)
        b = contracted(w, BAR, CROSSED)
        alone += 2.0 * mu * a / 3.0
        both += 2.0 * mu * (a / 9.0 + c * a * a / 27.0 - c * b / 9.0)
        of_m, of_n = 2.0 * mu * (g / 3.0 + c * g * a / 9.0), 2.0 * mu * c * g / 3.0
        outer = 2.0 * mu * c * g * g
        _add_products(w, FACING, outer / 3.0, -outer, D)
        for n in range(SIX):
            side[n] += of_n * w[CROSSED + n] - of_m * w[FACING + n]
        if slipped > 0.0:
            s = step[branch, MU] * y / (1.0 + slipped)
            of_c = (a * a / 3.0 - b) / 3.0
            for n in range(SIX):
                w[CROSSED + n] = s * (g * (a / 3.0 * w[FACING + n] - w[CROSSED + n]) - of_c * w[INVERSE + n])
            _add_products(w, CROSSED, -weight / curvature, 0.0, D)
    _add_products(w, INVERSE, both, alone, D)
    for n in range(SIX):
        w[STRESS + n] -= pressure * w[INVERSE + n]
        for m in range(n + 1):
            D[n, m] += side[n] * w[INVERSE + m] + w[INVERSE + n] * side[m]
            D[m, n] = D[n, m]


@njit(cache=True, error_model="numpy")
def write_half(F, at, D, half):
    """half (6, 9) <- dS_n/dF_km in column 3 k + m, of 2 dS/dC = D (6, 6) at the three columns at `at` of F."""
    for n in range(SIX):
        d0, d1, d2, d3, d4, d5 = D[n, 0], D[n, 1], D[n, 2], D[n, 3], D[n, 4], D[n, 5]
        for k in range(3):
            f, g, h = F[k, at], F[k, at + 1], F[k, at + 2]
            half[n, 3 * k] = d0 * f + d5 * g + d4 * h
            half[n, 3 * k + 1] = d5 * f + d1 * g + d3 * h
            half[n, 3 * k + 2] = d4 * f + d3 * g + d2 * h


@njit(cache=True, error_model="numpy")
def add_tangent(F, at, w, half, geometric, A):
    """A (9, 9) += d(F S)/dF at the three columns at `at` of F, of what `write_half` has.

    geometric: with what S adds
    """
    for i in range(3):
        a, b, c = F[i, at], F[i, at + 1], F[i, at + 2]
        for m in range(9):
            A[3 * i, m] += a * half[0, m] + b * half[5, m] + c * half[4, m]
            A[3 * i + 1, m] += a * half[5, m] + b * half[1, m] + c * half[3, m]
            A[3 * i + 2, m] += a * half[4, m] + b * half[3, m] + c * half[2, m]
    if not geometric:
        return
    s0, s1, s2, s3, s4, s5 = w[STRESS], w[STRESS + 1], w[STRESS + 2], w[STRESS + 3], w[STRESS + 4], w[STRESS + 5]
    for i in range(0, 9, 3):
        A[i, i] += s0
        A[i + 1, i + 1] += s1
        A[i + 2, i + 2] += s2
        A[i, i + 1] += s5
        A[i + 1, i] += s5
        A[i, i + 2] += s4
        A[i + 2, i] += s4
        A[i + 1, i + 2] += s3
        A[i + 2, i + 1] += s3


@njit(cache=True, error_model="numpy")
def advance(w, g, step, parameters, dt, state, following):
    """The state that follows on `state` in a step of dt [s], where `strain` came before; returns what the branches
    store then, and what they dissipated in the step by eq. (5), or as they slipped [Pa]."""
    stored = dissipated = 0.0
    following[len(state) - 1] = state[len(state) - 1]
    for n in range(SIX):
        following[n] = w[BAR + n] if dt > 0.0 else state[n]
    start, dev0, dev1 = np.empty(SIZE), np.empty((3, 3)), np.empty((3, 3))
    for branch in range(len(step)):
        at, mu = SIX * (1 + branch), step[branch, MU]
        if mu == 0.0:
            following[at : at + SIX] = 0.0
            continue
        _, _, slipped, sigma, _ = _moved(w, g, step, state, branch)
        for n in range(SIX):
            following[at + n] = w[VISCOUS + n] if dt > 0.0 else state[at + n]
        stored += 0.5 * mu * (contracted(w, BAR, FACING) - 3.0)
        if dt == 0.0:
            continue
        if step[branch, YIELD] > 0.0:
            more = slipped * sigma / (3.0 * mu)
            following[len(state) - 1] += more
            dissipated += sigma * more
            continue
        keep = step[branch, KEEP]
        _elastic_strain(w, w, dev1)
        start[BAR : BAR + SIX] = state[:SIX]
        _unimodular(start, 1.0, 0.0, 0.0, state, branch)
        _elastic_strain(start, w, dev0)
        old = new = cross = 0.0
        for i in range(3):
            for j in range(3):
                old += dev0[i, j] * dev0[j, i]
                new += dev1[i, j] * dev1[j, i]
                cross += dev0[i, j] * dev1[j, i]
        dissipated += 2.0 * mu * _faded(old, cross, new, keep, dt / parameters[BRANCHES + 2 * branch + 1])
    return stored, dissipated


@njit(cache=True, error_model="numpy")
def _elastic_strain(own, end, dev):
    """dev (3, 3) <- q of eq. (5) as Y C_bar, with Y = (M - (C_bar : M)/3 C_bar^-1)/2 of what `own` has, and C_bar of
    the step's end."""
    M, Y = np.empty((3, 3)), np.empty((3, 3))
    a = contracted(own, BAR, FACING) / 3.0
    p, q, r = 1.0 + own[BAR], 1.0 + own[BAR + 1], 1.0 + own[BAR + 2]
    s, t, u = own[BAR + 3], own[BAR + 4], own[BAR + 5]
    M[0, 0], M[1, 1], M[2, 2] = q * r - s * s, p * r - t * t, p * q - u * u
    M[1, 2], M[0, 2], M[0, 1] = t * u - p * s, s * u - q * t, s * t - r * u
    det = p * M[0, 0] + u * M[0, 1] + t * M[0, 2]
    for n in range(SIX):
        i, j = I_OF[n], J_OF[n]
        Y[i, j] = 0.5 * (own[FACING + n] - a * M[i, j] / det)
        Y[j, i] = Y[i, j]
    for i in range(3):
        for j in range(3):
            dev[i, j] = Y[i, j]
            for k in range(3):
                dev[i, j] += Y[i, k] * end[BAR + OF[k, j]]


@njit(cache=True, error_model="numpy")
def _faded(old, cross, new, keep, x):
    """Eq. (5) over 2 mu, of q_0 q_0, q_0 q_1, q_1 q_1."""
    lost = -np.expm1(-x)
    along = (cross - keep * old) / lost
    across = (new - 2.0 * keep * cross + keep * keep * old) / (lost * lost)
    third = x - 1.5 + 2.0 * keep - 0.5 * keep * keep
    if x < 1e-2:  # where digits cancel
        third = x * x * x * (1.0 / 3.0 - x * (0.25 - x * (7.0 / 60.0)))
    return 0.5 * old * lost * (1.0 + keep) + along * lost * lost + across * third
