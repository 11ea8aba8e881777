"""The frame that turns with a body: what steps of implicit Euler lose of a rotation is given back.

A step takes its force at its end, x1 = x0 + h v1, and so bends the way of what turns by too much: it loses h sum v1 x f
of angular momentum, and of the angle. In a frame that turns with the body nothing of this happens. With the centre c,
the inertia I and the spin S about c, and

    w0 = I^-1 S,  w = H I^-1 H^T S at mid-step, H = exp(h w/2),  R = exp(h w),  dw0 = -I^-1 (w0 x S)               (1)

the step in that frame, with its centrifugal, Euler's and Coriolis' forces, is the step with another velocity before it
and another one after it, r = x - c (s = 1 + a h of a drag a, else 1):

    v0 <- v0 + G r0,   G = (s/h) (R (1 - (h^2/s) (w0 w0 + dw0)) - 1) - w0                                         (2)
    v1 <- (x1 - x0)/h + D r1,   D = w + (R^T - 1)/h + w_c                                                         (3)

where vectors stand for their cross products, and w_c is what is left: I1 w_c + S1 = (S0 + h T)/s with the torque T of
all that acts from outside, about c1. D and G move no centre. Both are smooth functions of sums over nodes, which
complex numbers differentiate (fem/turning.py). Of steps in substeps of h, one of dt loses w (w . S) h dt in
all, and w_c alone is enough.
"""

import numpy as np

from softseam_services.jit import njit

MASS, PLACE, MOTION, ANGULAR, SECOND = 0, 1, 4, 7, 10
N_SUMS = 16
"""of nodes: m, m x, m v, m x x v, m x x^T as xx yy zz yz xz xy"""
LEAST_TURN = 1e-3
"""angle of a step below which it is taken as it is [rad]: its square is lost of a spin then"""
_THIN = 1e-9
"""share of the largest moment that the least one counts with at least, as of a straight rope [1]"""


@njit(cache=True, error_model="numpy")
def add_up(mass, x, v, sums):
    """sums (N_SUMS,) <- of nodes with masses (n,) [kg] at x (n, 3) [m] with velocities v (n, 3) [m/s]."""
    sums[:] = 0.0
    for i in range(len(mass)):
        m, px, py, pz, ux, uy, uz = mass[i], x[i, 0], x[i, 1], x[i, 2], v[i, 0], v[i, 1], v[i, 2]
        sums[0] += m
        sums[1] += m * px
        sums[2] += m * py
        sums[3] += m * pz
        sums[4] += m * ux
        sums[5] += m * uy
        sums[6] += m * uz
        sums[7] += m * (py * uz - pz * uy)
        sums[8] += m * (pz * ux - px * uz)
        sums[9] += m * (px * uy - py * ux)
        sums[10] += m * px * px
        sums[11] += m * py * py
        sums[12] += m * pz * pz
        sums[13] += m * py * pz
        sums[14] += m * px * pz
        sums[15] += m * px * py


@njit(cache=True, error_model="numpy")
def flatten(axis, sums):
    """sums as of nodes pressed into a plane of symmetry across an axis: the body turns about it alone; in place."""
    if axis < 0:
        return
    j, k = (axis + 1) % 3, (axis + 2) % 3
    sums[1 + axis] = sums[4 + axis] = sums[7 + j] = sums[7 + k] = sums[10 + axis] = sums[13 + j] = sums[13 + k] = 0.0


@njit(cache=True, error_model="numpy")
def _about_centre(sums, spin, second):
    """spin (3,), second (3, 3) <- S and sum m r r^T about the centre of mass."""
    m = sums[0]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        spin[i] = sums[7 + i] - (sums[1 + j] * sums[4 + k] - sums[1 + k] * sums[4 + j]) / m
        second[i, i] = sums[10 + i] - sums[1 + i] * sums[1 + i] / m
        second[j, k] = second[k, j] = sums[13 + i] - sums[1 + j] * sums[1 + k] / m


@njit(cache=True, error_model="numpy")
def _invert_inertia(second, inverse):
    """inverse (3, 3) <- I^-1 of I = tr(C) 1 - C, C = second (3, 3)."""
    trace = second[0, 0] + second[1, 1] + second[2, 2]
    whole = (1.0 + _THIN) * trace
    a, b, c = whole - second[0, 0], whole - second[1, 1], whole - second[2, 2]
    d, e, f = -second[1, 2], -second[0, 2], -second[0, 1]
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = b * c - d * d, a * c - e * e, a * b - f * f
    inverse[0, 1] = inverse[1, 0] = d * e - c * f
    inverse[0, 2] = inverse[2, 0] = f * d - b * e
    inverse[1, 2] = inverse[2, 1] = e * f - a * d
    size = a * inverse[0, 0] + f * inverse[0, 1] + e * inverse[0, 2]
    for i in range(3):
        for j in range(3):
            inverse[i, j] /= size


@njit(cache=True, error_model="numpy")
def _times(matrix, vector, out):
    """out (3,) <- matrix (3, 3) vector (3,)."""
    for i in range(3):
        out[i] = matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2]


@njit(cache=True, error_model="numpy")
def _multiply(first, second, out):
    """out (3, 3) <- first (3, 3) second (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@njit(cache=True, error_model="numpy")
def _add_cross(vector, factor, matrix):
    """matrix (3, 3) += factor times the matrix of vector's cross product."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        matrix[k, j] += factor * vector[i]
        matrix[j, k] -= factor * vector[i]


@njit(cache=True, error_model="numpy")
def _turn(vector, time, out):
    """out (3, 3) <- exp(time vector), Rodrigues."""
    square = time * time * (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    angle = np.sqrt(square)
    first, half = np.sin(angle) / angle, np.sin(0.5 * angle) / angle
    out[:] = 0.0
    for i in range(3):
        out[i, i] = 1.0 - 2.0 * half * half * square
        for j in range(3):
            out[i, j] += 2.0 * half * half * time * time * vector[i] * vector[j]
    _add_cross(vector, first * time, out)


@njit(cache=True, error_model="numpy")
def find_turn(sums, dt, slowed, before, after):
    """before (3, 3) <- G, after (3, 3) <- w + (R^T - 1)/h of eq. (2) and (3), of the sums as a step begins."""
    spin, turning, middle = np.empty_like(sums[:3]), np.empty_like(sums[:3]), np.empty_like(sums[:3])
    rate, arm = np.empty_like(sums[:3]), np.empty_like(sums[:3])
    second, inverse, turn, back = (
        np.empty_like(before),
        np.empty_like(before),
        np.empty_like(before),
        np.empty_like(before),
    )
    _about_centre(sums, spin, second)
    _invert_inertia(second, inverse)
    _times(inverse, spin, turning)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        arm[i] = turning[j] * spin[k] - turning[k] * spin[j]
        middle[i] = turning[i]
    _times(inverse, arm, rate)
    for _ in range(2):
        _turn(middle, 0.5 * dt / slowed, turn)
        back[:] = turn.T
        _times(back, spin, arm)
        _times(inverse, arm, middle)
        arm[:] = middle
        _times(turn, arm, middle)
    for i in range(3):
        middle[i] /= slowed
    _turn(middle, dt, turn)
    after[:] = 0.0
    _add_cross(middle, 1.0, after)
    pull, bent = np.zeros_like(before), np.zeros_like(before)
    _add_cross(turning, 1.0, pull)
    _multiply(pull, pull, bent)
    _add_cross(rate, -1.0, bent)
    for i in range(3):
        for j in range(3):
            one = 1.0 if i == j else 0.0
            after[i, j] += (turn[j, i] - one) / dt
            bent[i, j] = one - dt * dt / slowed * bent[i, j]
    _multiply(turn, bent, before)
    for i in range(3):
        before[i, i] -= 1.0
        for j in range(3):
            before[i, j] *= slowed / dt
    _add_cross(turning, -1.0, before)


@njit(cache=True, error_model="numpy")
def find_rest(start, sums, torque, slowed, after):
    """after (3, 3) <- D of eq. (3), in place: its last part w_c is added to what is there.

    start, sums: as the step begins, and as it ended before eq. (3); torque (3,): h T, about the centre then.
    """
    spin, turning, second = np.empty_like(sums[:3]), np.empty_like(sums[:3]), np.empty_like(after)
    carried, inverse = np.empty_like(after), np.empty_like(after)
    _about_centre(start, turning, second)
    _about_centre(sums, spin, second)
    _multiply(after, second, carried)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turning[i] = (turning[i] + torque[i]) / slowed - spin[i] - (carried[k, j] - carried[j, k])
    _invert_inertia(second, inverse)
    _times(inverse, turning, spin)
    _add_cross(spin, 1.0, after)


@njit(cache=True, error_model="numpy")
def find_lost(sums, out):
    """out (3,) <- w (w . S), what a body that turns so loses of S in a second, over the length of its substeps."""
    second, inverse, spin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _about_centre(sums, spin, second)
    _invert_inertia(second, inverse)
    _times(inverse, spin, out)
    twice = out[0] * spin[0] + out[1] * spin[1] + out[2] * spin[2]
    for i in range(3):
        out[i] *= twice


@njit(cache=True, error_model="numpy")
def spin_and_inverse(sums):
    """S (3,) and I^-1 (3, 3) about the centre."""
    spin, second, inverse = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    _about_centre(sums, spin, second)
    _invert_inertia(second, inverse)
    return spin, inverse


@njit(cache=True, error_model="numpy")
def turning_rate(mass, x, v, axis, sums):
    """|w0| [rad/s] and, into sums (N_SUMS,), what it is of, see `add_up`; 0 where nothing has extent."""
    add_up(mass, x, v, sums)
    flatten(axis, sums)
    return rate_of(sums)


@njit(cache=True, error_model="numpy")
def rate_of(sums):
    """|w0| [rad/s]."""
    spin, turning, second, inverse = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    _about_centre(sums, spin, second)
    _invert_inertia(second, inverse)
    _times(inverse, spin, turning)
    rate = np.sqrt(turning[0] ** 2 + turning[1] ** 2 + turning[2] ** 2)
    return rate if np.isfinite(rate) else 0.0


@njit(cache=True, error_model="numpy")
def add_field(matrix, sums, x, v, out):
    """out (n, 3) <- v + matrix (x - c), c the centre of the sums; out may be v."""
    cx, cy, cz = sums[1] / sums[0], sums[2] / sums[0], sums[3] / sums[0]
    for i in range(len(x)):
        rx, ry, rz = x[i, 0] - cx, x[i, 1] - cy, x[i, 2] - cz
        for k in range(3):
            out[i, k] = v[i, k] + (matrix[k, 0] * rx + matrix[k, 1] * ry + matrix[k, 2] * rz)


@njit(cache=True, error_model="numpy")
def give_back(mass, x_before, v_before, x, v, axis, dt, n_substeps, known, turned):
    """w_c of eq. (3) after a step of dt [s] in so many substeps, of v (n, 3) in place; whether it was given.

    x_before, v_before: as the step began; known: whether what acted from outside gave no angular momentum about the
    centre but turned (3,) [kg m^2/s], so that what the sweeps made of a spin goes, too
    """
    start, end = np.zeros(N_SUMS), np.zeros(N_SUMS)
    began = turning_rate(mass, x_before, v_before, axis, start)
    rate = turning_rate(mass, x, v, axis, end)
    if not (began * dt > LEAST_TURN or (known and rate * dt > LEAST_TURN)):
        return False
    torque, lost, after = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    if known:
        for i in range(3):
            torque[i] = turned[i]
    else:
        find_lost(start, lost)
        for i in range(3):
            torque[i] += 0.5 * dt * dt / n_substeps * lost[i]
        find_lost(end, lost)
        for i in range(3):
            torque[i] += 0.5 * dt * dt / n_substeps * lost[i]
    find_rest(start if known else end, end, torque, 1.0, after)
    add_field(after, end, x, v, v)
    return True


@njit(cache=True, error_model="numpy")
def torque_of(wrench, place, axis, sums, dt, out):
    """out (3,) <- h T of what a body puts on tools at (t, 3) [m], wrench (t, 6) [N, N m], about the sums' centre; that
    about `axis` alone where it is not -1."""
    out[:] = 0.0
    for tool in range(len(wrench)):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            arm_j = place[tool, j] - sums[1 + j] / sums[0]
            arm_k = place[tool, k] - sums[1 + k] / sums[0]
            out[i] -= dt * (wrench[tool, 3 + i] + arm_j * wrench[tool, k] - arm_k * wrench[tool, j])
    for i in range(3):
        if axis >= 0 and i != axis:
            out[i] = 0.0
