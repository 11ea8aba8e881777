"""What blocks that relax remember, brought up to date every few substeps, and what folds it for those to come.

State of a block is that of an octant (`body.materials.relaxation`), C_bar and C_i of each branch, and likewise of its
hourglass modes q = F^T q_m and the stress h = mu q_elastic of each branch, which is of K/mu (`hourglass`). Since the
last time an interval d went by in which both went straight: C_i by eq. (2) there, and with k, m of x = d/tau
h <- k h + mu m (q - q_0)                                                                                       (1)
For the substeps to come all branches become the Q, G and r of `relaxing`. To first order in what C_bar will do
M = m unimod(w C_i + (1 - w) C_bar)^-1 + (1 - m) C_bar^-1,  w = k/m,
of the time at their middle, and the last term has no stress; so with what does not relax, mu_inf of mu_0,
Q = sum m mu unimod(w C_i + (1 - w) C_bar)^-1,  G = (mu_inf + sum m mu)/mu_0,  r = sum (k h - m mu q)/mu_0       (2)
The rest of the step's end is 0 substeps away: k = m = 1, (1) of `relaxing` is what the block stores, and HELD what that
leaves out, sum (u K u/(2 mu mu_0) - 3/2 mu), u = h - mu q.

What a branch with the elastic strain e dissipates, mu/2 |dev C_bar M|^2/tau a second, and likewise h K h/(mu mu_0)/tau,
is weighted at the interval's ends: by y = x/(1 - e^-2x) - 1/2 at its end, and x - y at its start, both >= 0: exact
where strain is held, and where stress is. So it is >= 0 in every block.
"""

import numpy as np

from softseam_services.body.materials.relaxation import BRANCHES, coefficients
from softseam_services.jit import njit

from .block import gather, hoist, hoisted, hourglass, of_batch, of_lane, parameters_of, shape
from .block_rows import (
    FACING,
    FOLD,
    HELD,
    LOST,
    MU,
    N_FOLD,
    NOW,
    OF_BENDING,
    OF_STRAIN,
    REMEMBERED,
    REST,
    SHARE,
    STIFF,
)
from .lanes import LANES, batch_kernel, lane_kernel, move_four
from .neo_hookean import cofactors, logarithm, turned_back
from .relaxing import bar, exponential, lasting, twelve

MOST = 8
"""substeps between two renewals"""
N_COEFFICIENTS = 8
"""of a branch: mu; k, m - k, 1 - m of the interval; k, mu m, w of the time to come; weight of what is dissipated"""


@njit(cache=True, error_model="numpy")
def renewed_every(parameters, h):
    """Substeps of h [s] between two renewals; 0 where nothing relaxes."""
    if parameters.renewed == 0.0:
        return 0
    return max(1, min(MOST, int(parameters.renewed / h)))


@njit(cache=True, error_model="numpy")
def _end_weight(x):
    """y above."""
    if x < 1e-4:
        return 0.5 * x
    return -x / np.expm1(-2.0 * x) - 0.5


@njit(cache=True, error_model="numpy")
def write_coefficients(parameters, elapsed, ahead, middle, found):
    """found (n, N_COEFFICIENTS) <- of the first n branches of a law with these parameters, as of `renew`."""
    for n in range(len(found)):
        mu, time = parameters[BRANCHES + 2 * n], parameters[BRANCHES + 2 * n + 1]
        found[n, 0] = mu
        if mu == 0.0:
            continue
        found[n, 1], found[n, 2], found[n, 3] = coefficients(elapsed, time)
        keep, start, _ = coefficients(middle, time)
        found[n, 4], found[n, 5], found[n, 6] = keep, mu * (keep + start), keep / (keep + start)
        found[n, 7] = _end_weight(elapsed / time) + ahead / time - _end_weight(ahead / time)


@lane_kernel
def _six(ws, lane, row):
    a = lane + LANES * row
    return ws[a], ws[a + LANES], ws[a + 2 * LANES], ws[a + 3 * LANES], ws[a + 4 * LANES], ws[a + 5 * LANES]


@lane_kernel
def _unimodular(a):
    """X = (1 + a) det(1 + a)^(-1/3) of a symmetric a, less 1, and X^-1 (6 values each)."""
    a0, a1, a2, a3, a4, a5 = a
    p, q, r = 1.0 + a0, 1.0 + a1, 1.0 + a2
    m0, m1, m2 = q * r - a3 * a3, p * r - a4 * a4, p * q - a5 * a5
    m3, m4, m5 = a4 * a5 - p * a3, a3 * a5 - q * a4, a3 * a4 - r * a5
    y = exponential(logarithm(p * m0 + a5 * m5 + a4 * m4) * (-1.0 / 3.0))
    s = y * y
    return (
        (y * p - 1.0, y * q - 1.0, y * r - 1.0, y * a3, y * a4, y * a5),
        (s * m0, s * m1, s * m2, s * m3, s * m4, s * m5),
    )


@lane_kernel
def _mixed(u, a, v, b, w, c):
    """u a + v b + w c of six values each."""
    return (
        *(u * a[0] + v * b[0] + w * c[0], u * a[1] + v * b[1] + w * c[1], u * a[2] + v * b[2] + w * c[2]),
        *(u * a[3] + v * b[3] + w * c[3], u * a[4] + v * b[4] + w * c[4], u * a[5] + v * b[5] + w * c[5]),
    )


@lane_kernel
def deviator_squared(m, c):
    """tr(X X) - tr(X)^2/3 of X = M C of symmetric M (6 values) and C, less 1 (6 values)."""
    m0, m1, m2, m3, m4, m5 = m
    c0, c1, c2, c3, c4, c5 = 1.0 + c[0], 1.0 + c[1], 1.0 + c[2], c[3], c[4], c[5]
    x00, x01, x02 = m0 * c0 + m5 * c5 + m4 * c4, m0 * c5 + m5 * c1 + m4 * c3, m0 * c4 + m5 * c3 + m4 * c2
    x10, x11, x12 = m5 * c0 + m1 * c5 + m3 * c4, m5 * c5 + m1 * c1 + m3 * c3, m5 * c4 + m1 * c3 + m3 * c2
    x20, x21, x22 = m4 * c0 + m3 * c5 + m2 * c4, m4 * c5 + m3 * c1 + m2 * c3, m4 * c4 + m3 * c3 + m2 * c2
    a, b, c = x00 - x11, x11 - x22, x22 - x00
    return (a * a + b * b + c * c) * (1.0 / 3.0) + 2.0 * (x01 * x10 + x02 * x20 + x12 * x21)


@batch_kernel
def see_shapes(ws, constants):
    """Rows NOW of four blocks: C_bar, less 1, and the hourglass modes q."""
    own = hoisted(constants)
    for lane in range(LANES):
        f, modes = shape(ws, lane, of_lane(ws, lane, own))
        g = bar(cofactors(f)[1])[0]
        at = lane + LANES * NOW
        ws[at] = g * (f[0] * f[0] + f[3] * f[3] + f[6] * f[6]) - 1.0
        ws[at + LANES] = g * (f[1] * f[1] + f[4] * f[4] + f[7] * f[7]) - 1.0
        ws[at + 2 * LANES] = g * (f[2] * f[2] + f[5] * f[5] + f[8] * f[8]) - 1.0
        ws[at + 3 * LANES] = g * (f[1] * f[2] + f[4] * f[5] + f[7] * f[8])
        ws[at + 4 * LANES] = g * (f[0] * f[2] + f[3] * f[5] + f[6] * f[8])
        ws[at + 5 * LANES] = g * (f[0] * f[1] + f[3] * f[4] + f[6] * f[7])
        q = turned_back(f, modes)
        at = lane + LANES * (NOW + OF_STRAIN)
        for m in range(OF_BENDING):
            ws[at + LANES * m] = q[m]


@batch_kernel
def _renew_strain(ws, at, k):
    """C_i of a branch, whose row in the workspace is `at`, and what it adds to Q and LOST; k: its coefficients."""
    mu, keep, start, end, level, weight = k[0], k[1], k[2], k[3], k[5], k[6]
    loss, rest = 0.5 * mu * k[7], 1.0 - weight
    for lane in range(LANES):
        now = _six(ws, lane, NOW)
        viscous, inverse = _unimodular(_mixed(keep, _six(ws, lane, at), start, _six(ws, lane, REMEMBERED), end, now))
        ws[lane + LANES * LOST] += loss * deviator_squared(inverse, now)
        to = lane + LANES * at
        ws[to], ws[to + LANES], ws[to + 2 * LANES] = viscous[0], viscous[1], viscous[2]
        ws[to + 3 * LANES], ws[to + 4 * LANES], ws[to + 5 * LANES] = viscous[3], viscous[4], viscous[5]
        _, q = _unimodular(_mixed(weight, viscous, rest, now, 0.0, now))
        to = lane + LANES * FACING
        ws[to] += level * q[0]
        ws[to + LANES] += level * q[1]
        ws[to + 2 * LANES] += level * q[2]
        ws[to + 3 * LANES] += level * q[3]
        ws[to + 4 * LANES] += level * q[4]
        ws[to + 5 * LANES] += level * q[5]


@lane_kernel
def _twice_stored(k, h):
    """h K h of twelve values."""
    t = hourglass(k, h)
    low = h[0] * t[0] + h[1] * t[1] + h[2] * t[2] + h[3] * t[3] + h[4] * t[4] + h[5] * t[5]
    return low + (h[6] * t[6] + h[7] * t[7] + h[8] * t[8] + h[9] * t[9] + h[10] * t[10] + h[11] * t[11])


@batch_kernel
def _renew_bending(ws, constants, was, at, c):
    """h of a branch, whose row is `at`, that of q_0 being `was`, and what it adds to r, LOST and HELD."""
    own = hoisted(constants)
    mu, keep, gain = c[0], c[1], c[0] * (c[1] + c[2])
    fade, level, per, loss = c[4], c[5], 1.0 / own[MU], c[7] / (c[0] * own[MU])
    held = 0.5 / (c[0] * own[MU])
    for lane in range(LANES):
        k = of_lane(ws, lane, own)
        q, p, o = twelve(ws, lane, NOW + OF_STRAIN), twelve(ws, lane, was), twelve(ws, lane, at)
        h = (
            *(keep * o[0] + gain * (q[0] - p[0]), keep * o[1] + gain * (q[1] - p[1])),
            *(keep * o[2] + gain * (q[2] - p[2]), keep * o[3] + gain * (q[3] - p[3])),
            *(keep * o[4] + gain * (q[4] - p[4]), keep * o[5] + gain * (q[5] - p[5])),
            *(keep * o[6] + gain * (q[6] - p[6]), keep * o[7] + gain * (q[7] - p[7])),
            *(keep * o[8] + gain * (q[8] - p[8]), keep * o[9] + gain * (q[9] - p[9])),
            *(keep * o[10] + gain * (q[10] - p[10]), keep * o[11] + gain * (q[11] - p[11])),
        )
        u = (
            *(h[0] - mu * q[0], h[1] - mu * q[1], h[2] - mu * q[2], h[3] - mu * q[3], h[4] - mu * q[4]),
            *(h[5] - mu * q[5], h[6] - mu * q[6], h[7] - mu * q[7], h[8] - mu * q[8], h[9] - mu * q[9]),
            *(h[10] - mu * q[10], h[11] - mu * q[11]),
        )
        ws[lane + LANES * LOST] += loss * _twice_stored(k, h)
        ws[lane + LANES * HELD] += held * _twice_stored(k, u) - 1.5 * level
        to, rest = lane + LANES * at, lane + LANES * REST
        for m in range(OF_BENDING):
            ws[to + LANES * m] = h[m]
            ws[rest + LANES * m] += per * (fade * h[m] - level * q[m])


@batch_kernel
def _end_fold(ws, share):
    """STIFF and SHARE of four blocks."""
    for lane in range(LANES):
        at = lane + LANES * FACING
        ws[lane + LANES * STIFF] = max(ws[at], max(ws[at + LANES], ws[at + 2 * LANES]))
        ws[lane + LANES * SHARE] = share


@njit(cache=True, error_model="numpy", aside=())
def renew(ws, xw, nodes, constants, memory, elapsed, ahead, middle, first, end):
    """What the blocks of batches first .. end - 1 remember, and what folds it.

    memory   (b, n, LANES)  as it was `elapsed` [s] ago, and as it is now; where that is 0 it stays, whatever xw says
    ahead    for how long the fold will do [s], 0 to look at the blocks
    middle   how far off the time is for which it is exact [s]
    What blocks dissipate is added up since the last time that elapsed was 0.
    """
    n = memory.shape[1]
    branches = n // (OF_STRAIN + OF_BENDING) - 1
    bending, fold = REMEMBERED + OF_STRAIN * (1 + branches), constants.fold
    known, k = -1, np.empty((branches, N_COEFFICIENTS))
    for batch in range(first, end):
        own = of_batch(constants, batch)
        if constants.number[batch] != known:
            known = constants.number[batch]
            write_coefficients(parameters_of(own), elapsed, ahead, middle, k)
        for row in range(n):
            move_four(ws, LANES * (REMEMBERED + row), memory, LANES * (n * batch + row))
        for row in range(LANES * FOLD, LANES * (FOLD + N_FOLD)):
            ws[row] = 0.0
        material = hoist(ws, own)
        if elapsed > 0.0:
            move_four(ws, LANES * LOST, fold, LANES * (N_FOLD * batch + LOST - FOLD))
            gather(ws, xw, nodes, batch)
            see_shapes(ws, own)
        else:
            for row in range(OF_STRAIN):
                move_four(ws, LANES * (NOW + row), ws, LANES * (REMEMBERED + row))
            for row in range(OF_BENDING):
                move_four(ws, LANES * (NOW + OF_STRAIN + row), ws, LANES * (bending + row))
        share = lasting(own)[0] / material[MU]
        for branch in range(branches):
            if k[branch, 0] == 0.0:
                continue
            share += k[branch, 5] / material[MU]
            _renew_strain(ws, REMEMBERED + OF_STRAIN * (1 + branch), k[branch])
            _renew_bending(ws, own, bending, bending + OF_BENDING * (1 + branch), k[branch])
        _end_fold(ws, share)
        if elapsed > 0.0:
            for row in range(OF_STRAIN):
                move_four(memory, LANES * (n * batch + row), ws, LANES * (NOW + row))
            for row in range(OF_BENDING):
                place = n * batch + OF_STRAIN * (1 + branches) + row
                move_four(memory, LANES * place, ws, LANES * (NOW + OF_STRAIN + row))
            for branch in range(branches):
                for row in range(OF_STRAIN):
                    at = OF_STRAIN * (1 + branch) + row
                    move_four(memory, LANES * (n * batch + at), ws, LANES * (REMEMBERED + at))
                for row in range(OF_BENDING):
                    at = OF_STRAIN * (1 + branches) + OF_BENDING * (1 + branch) + row
                    move_four(memory, LANES * (n * batch + at), ws, LANES * (REMEMBERED + at))
        for row in range(N_FOLD):
            move_four(fold, LANES * (N_FOLD * batch + row), ws, LANES * (FOLD + row))


@njit(cache=True, error_model="numpy", aside=())
def begin_bending(ws, xw, nodes, constants, memory):
    """What octants handed over does not say: of the shapes now, q, and of each branch h = mu e q, 1 at most
    e = |dev C_i^-1 C_bar|/|dev C_bar|: as much of bending has faded as of strain. memory (b, n, LANES) in place."""
    n = memory.shape[1]
    branches = n // (OF_STRAIN + OF_BENDING) - 1
    bending = OF_STRAIN * (1 + branches)
    for batch in range(len(nodes)):
        own = of_batch(constants, batch)
        parameters = parameters_of(own)
        gather(ws, xw, nodes, batch)
        hoist(ws, own)
        see_shapes(ws, own)
        for lane in range(LANES):
            now = _six(ws, lane, NOW)
            whole = deviator_squared((1.0, 1.0, 1.0, 0.0, 0.0, 0.0), now)
            for m in range(OF_BENDING):
                memory[batch, bending + m, lane] = ws[lane + LANES * (NOW + OF_STRAIN + m)]
            for branch in range(branches):
                at = OF_STRAIN * (1 + branch)
                _, inverse = _unimodular(
                    (
                        *(memory[batch, at, lane], memory[batch, at + 1, lane], memory[batch, at + 2, lane]),
                        *(memory[batch, at + 3, lane], memory[batch, at + 4, lane], memory[batch, at + 5, lane]),
                    )
                )
                left = np.sqrt(max(0.0, deviator_squared(inverse, now)) / whole) if whole > 1e-20 else 1.0
                mu = parameters[BRANCHES + 2 * branch] * min(1.0, left)
                for m in range(OF_BENDING):
                    to = bending + OF_BENDING * (1 + branch) + m
                    memory[batch, to, lane] = mu * ws[lane + LANES * (NOW + OF_STRAIN + m)]
