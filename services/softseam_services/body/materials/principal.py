"""The principal frame of a deformation gradient, and tangents of isotropic solids in it.

F = U diag(s) V^T with rotations U, V and s_0 >= s_1 >= |s_2|: an inverted F has a negative s_2 (Irving, Teran &
Fedkiw, Invertible Finite Elements, SCA 2004).                                                                 (1)

psi(F) = psi(s) makes dP/dF block-diagonal in nine modes (Smith, de Goes & Kim, Analytic Eigensystems for Isotropic
Distortion Energies, ACM Trans. Graph. 38(1), 2019), with i, j the other two of k and p = dpsi/ds:
  u_k v_k^T                                  a 3 x 3 block  h_ij = d2psi/ds_i ds_j                             (2)
  (u_i v_j^T + u_j v_i^T)/sqrt(2)            minus_k = (p_i - p_j)/(s_i - s_j)                                 (3)
  (u_i v_j^T - u_j v_i^T)/sqrt(2)            plus_k  = (p_i + p_j)/(s_i + s_j)                                 (4)
The positive semi-definite tangent is the one with the negative eigenvalues of these blocks raised to zero: the
nearest such matrix in the Frobenius norm.
"""

import numpy as np

from softseam_services.jit import njit

_MOST_SWEEPS = 30
_ROUNDING = 1e-16


@njit(cache=True, error_model="numpy")
def _rotation(a, b, c):
    """Cosine and sine of the Jacobi rotation that annihilates c of the symmetric [[a, c], [c, b]]."""
    zeta = (b - a) / (2.0 * c)
    t = 1.0 / (abs(zeta) + np.hypot(1.0, zeta))
    if zeta < 0.0:
        t = -t
    cosine = 1.0 / np.hypot(1.0, t)
    return cosine, t * cosine


@njit(cache=True, error_model="numpy")
def _turn(cosine, sine, M, p, q, vectors):
    """Turn columns p, q of M and `vectors`."""
    for i in range(3):
        m, n = M[i, p], M[i, q]
        M[i, p], M[i, q] = cosine * m - sine * n, sine * m + cosine * n
        m, n = vectors[i, p], vectors[i, q]
        vectors[i, p], vectors[i, q] = cosine * m - sine * n, sine * m + cosine * n


@njit(cache=True, error_model="numpy")
def _identity(M):
    for i in range(3):
        for j in range(3):
            M[i, j] = 1.0 if i == j else 0.0


@njit(cache=True, error_model="numpy")
def signed_svd(F, U, stretch, V):
    """Eq. (1) by one-sided Jacobi rotations, which find small stretches to full relative precision.

    F (3, 3); U (3, 3), stretch (3,), V (3, 3) updated in place
    """
    _identity(V)
    for i in range(3):
        for j in range(3):
            U[i, j] = F[i, j]
    for _ in range(_MOST_SWEEPS):
        turned = False
        for p in range(2):
            for q in range(p + 1, 3):
                a = b = c = 0.0
                for i in range(3):
                    a += U[i, p] * U[i, p]
                    b += U[i, q] * U[i, q]
                    c += U[i, p] * U[i, q]
                if abs(c) > _ROUNDING * np.sqrt(a * b):
                    turned = True
                    cosine, sine = _rotation(a, b, c)
                    _turn(cosine, sine, U, p, q, V)
        if not turned:
            break
    for k in range(3):
        stretch[k] = np.sqrt(U[0, k] * U[0, k] + U[1, k] * U[1, k] + U[2, k] * U[2, k])
    for first in range(2):
        for k in range(2 - first):
            if stretch[k] < stretch[k + 1]:
                stretch[k], stretch[k + 1] = stretch[k + 1], stretch[k]
                for i in range(3):  # one column changes its sign, so that V stays a rotation
                    U[i, k], U[i, k + 1] = U[i, k + 1], -U[i, k]
                    V[i, k], V[i, k + 1] = V[i, k + 1], -V[i, k]
    _complete(U, stretch)


@njit(cache=True, error_model="numpy")
def _complete(U, stretch):
    """Columns U diag(stretch) to a rotation U, with any directions where a stretch is zero; both in place."""
    if stretch[0] == 0.0:
        _identity(U)
        return
    for i in range(3):
        U[i, 0] /= stretch[0]
    if stretch[1] > 0.0:
        for i in range(3):
            U[i, 1] /= stretch[1]
    else:
        small = 0
        for i in range(1, 3):
            if abs(U[i, 0]) < abs(U[small, 0]):
                small = i
        size = np.sqrt(1.0 - U[small, 0] * U[small, 0])
        for i in range(3):
            U[i, 1] = ((1.0 if i == small else 0.0) - U[small, 0] * U[i, 0]) / size
    third = 0.0
    for i in range(3):
        m, n = (i + 1) % 3, (i + 2) % 3
        normal = U[m, 0] * U[n, 1] - U[n, 0] * U[m, 1]
        third += normal * U[i, 2]
        U[i, 2] = normal
    stretch[2] = third


@njit(cache=True, error_model="numpy")
def raise_to_zero(h):
    """The nearest positive semi-definite matrix to the symmetric h (3, 3), in place."""
    least = min(h[0, 0], h[1, 1], h[2, 2])
    minor = h[0, 0] * h[1, 1] - h[0, 1] * h[0, 1]
    det = h[2, 2] * minor - h[0, 0] * h[1, 2] ** 2 - h[1, 1] * h[0, 2] ** 2 + 2.0 * h[0, 1] * h[0, 2] * h[1, 2]
    if least > 0.0 and minor > 0.0 and det > 0.0:
        return
    vectors = np.empty((3, 3))
    _identity(vectors)
    for _ in range(_MOST_SWEEPS):
        size = h[0, 1] ** 2 + h[0, 2] ** 2 + h[1, 2] ** 2
        if not size > _ROUNDING * _ROUNDING * (h[0, 0] ** 2 + h[1, 1] ** 2 + h[2, 2] ** 2):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if h[p, q] != 0.0:
                    _two_sided(h, p, q, vectors)
    e0, e1, e2 = max(h[0, 0], 0.0), max(h[1, 1], 0.0), max(h[2, 2], 0.0)
    for i in range(3):
        for j in range(3):
            h[i, j] = (
                e0 * vectors[i, 0] * vectors[j, 0]
                + e1 * vectors[i, 1] * vectors[j, 1]
                + e2 * vectors[i, 2] * vectors[j, 2]
            )


@njit(cache=True, error_model="numpy")
def _two_sided(h, p, q, vectors):
    """One Jacobi rotation of the symmetric h that makes h_pq zero; h and the eigenvectors in place."""
    cosine, sine = _rotation(h[p, p], h[q, q], h[p, q])
    _turn(cosine, sine, h, p, q, vectors)  # columns
    for i in range(3):  # rows
        m, n = h[p, i], h[q, i]
        h[p, i], h[q, i] = cosine * m - sine * n, sine * m + cosine * n
    h[p, q] = h[q, p] = 0.0


@njit(cache=True, error_model="numpy")
def assemble(U, V, h, minus, plus, definite, A):
    """dP/dF of the blocks (2)-(4), A (9, 9) [Pa] updated in place; definite: h, minus, plus are made so in place."""
    if definite:
        raise_to_zero(h)
        for k in range(3):
            minus[k], plus[k] = max(minus[k], 0.0), max(plus[k], 0.0)
    modes = np.empty((6, 9))  # two of each k, or three and their sums with h
    for k in range(3):
        for i in range(3):
            for j in range(3):
                modes[k, 3 * i + j] = U[i, k] * V[j, k]
    for m in range(9):
        a, b, c = modes[0, m], modes[1, m], modes[2, m]
        for k in range(3):
            modes[3 + k, m] = h[k, 0] * a + h[k, 1] * b + h[k, 2] * c
    for m in range(9):
        for n in range(9):
            A[m, n] = modes[0, m] * modes[3, n] + modes[1, m] * modes[4, n] + modes[2, m] * modes[5, n]
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        for i in range(3):
            for j in range(3):
                ahead, back = U[i, p] * V[j, q], U[i, q] * V[j, p]
                modes[0, 3 * i + j], modes[1, 3 * i + j] = ahead + back, ahead - back
        f, g = 0.5 * minus[k], 0.5 * plus[k]
        for m in range(9):
            a, b = f * modes[0, m], g * modes[1, m]
            for n in range(9):
                A[m, n] += a * modes[0, n] + b * modes[1, n]
