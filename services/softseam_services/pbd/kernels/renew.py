"""What blocks that relax remember, brought up to date every few substeps, and what folds it for those to come.

State of a block is that of an octant (`body.materials.relaxation`), C_bar and C_i of each branch; likewise, of its
hourglass modes, q = F^T q_m and the stress h = mu q_elastic of each branch, which is of K/mu_0 (`hourglass`); and J.
A branch with a slider is that of `sliding`: brought up to date after every substep, as it stays in between.
Since the last time an interval went by in which both went straight: C_i by eq. (2) there, and with its k and m
h <- k h + mu m (q - q_0)                                                                                       (1)
For the substeps to come all branches become T, mu', G and r of `relaxing`. To first order in what C_bar will do
M = m unimod(w C_i + (1 - w) C_bar)^-1 + (1 - m) C_bar^-1,  w = k/m,
of the time at their middle, and the last term has no stress; so with what does not relax, mu_inf of mu_0,
Q = sum m mu unimod(w C_i + (1 - w) C_bar)^-1,  G = (mu_inf + sum m mu)/mu_0,  r = sum (k h - m mu q)/mu_0      (2)
As the step ends, which is 0 substeps away, k = m = 1, and eq. (1) of `relaxing` is what the block stores with HELD,
which is what that leaves out: sum u K u/(2 mu mu_0), u = h - mu q, and what depends on J' and on no shape.

What a branch with the elastic strain e dissipates, mu/2 |dev C_bar M|^2/tau a second, and likewise h K h/(mu mu_0)/tau,
is weighted at the interval's ends: by y = x/(1 - e^-2x) - 1/2 at its end, and x - y at its start, both >= 0: exact
where strain is held, and where stress is. So it is >= 0 in every block.
"""

import numpy as np

from softseam_services.body.materials.neo_hookean import J_MIN
from softseam_services.body.materials.relaxation import BRANCHES, YIELDS, coefficients
from softseam_services.jit import njit

from .block import gather, hoist, hoisted, hourglass, of_batch, of_lane, parameters_of, shape
from .block_rows import (
    BRANCH,
    FACING,
    FOLD,
    HELD,
    LAM,
    LOST,
    MU,
    N_FOLD,
    NOW,
    OF_BENDING,
    OF_STRAIN,
    PRESSED,
    REMEMBERED,
    REST,
    SHARE,
    SLIPPED,
    STIFF,
    VOLUME_NOW,
)
from .lanes import LANES, batch_kernel, lane_kernel, move_four
from .neo_hookean import cofactors, logarithm, turned_back, volumetric
from .relaxing import exponential, inner_twelve, lasting, put_twelve, twelve
from .sliding import slide_bending, slide_strain
from .tensors import mixed, six, sum_of_twelve, unimodular

MOST = 16
"""substeps between two renewals"""
N_COEFFICIENTS = 8
"""of a branch: mu; k, m - k, 1 - m of the interval; k, mu m, w of the time to come; weight of what is dissipated"""


@njit(cache=True, error_model="numpy")
def renewed_every(parameters, h, n_substeps):
    """Substeps of h [s] between two renewals in a step of n; 0 where nothing relaxes. As even as can be, and up to a
    quarter more than `MOST` and `parameters.renewed` say where that saves one."""
    if parameters.renewed == 0.0:
        return 0
    most = max(1, min(MOST, int(parameters.renewed / h)))
    stretches = max(1, int(n_substeps / most + 0.75))
    return (n_substeps + stretches - 1) // stretches


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
        if time == 0.0:  # a slider, or none
            found[n, 5] = mu
            continue
        found[n, 1], found[n, 2], found[n, 3] = coefficients(elapsed, time)
        keep, start, _ = coefficients(middle, time)
        found[n, 4], found[n, 5], found[n, 6] = keep, mu * (keep + start), keep / (keep + start)
        found[n, 7] = _end_weight(elapsed / time) + ahead / time - _end_weight(ahead / time)


@njit(cache=True, error_model="numpy")
def begin_of_bending(n):
    """Where of n numbers that a block remembers those of its hourglass modes begin; the plastic strain is before them,
    where there is a slider."""
    branches = n // (OF_STRAIN + OF_BENDING) - 1
    return n - 1 - OF_BENDING * (1 + branches)


@lane_kernel
def bar(J):
    """J^(-2/3), and J where it is not below J_MIN."""
    inside = J if J > J_MIN else J_MIN
    return exponential(logarithm(inside) * (-2.0 / 3.0)), inside


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
    """Rows NOW of four blocks: C_bar, less 1, the hourglass modes q, and J, less 1."""
    own = hoisted(constants)
    for lane in range(LANES):
        f, modes = shape(ws, lane, of_lane(ws, lane, own))
        _, J = cofactors(f)
        g, _ = bar(J)
        ws[lane + LANES * VOLUME_NOW] = J - 1.0
        at = lane + LANES * NOW
        ws[at] = g * (f[0] * f[0] + f[3] * f[3] + f[6] * f[6]) - 1.0
        ws[at + LANES] = g * (f[1] * f[1] + f[4] * f[4] + f[7] * f[7]) - 1.0
        ws[at + 2 * LANES] = g * (f[2] * f[2] + f[5] * f[5] + f[8] * f[8]) - 1.0
        ws[at + 3 * LANES] = g * (f[1] * f[2] + f[4] * f[5] + f[7] * f[8])
        ws[at + 4 * LANES] = g * (f[0] * f[2] + f[3] * f[5] + f[6] * f[8])
        ws[at + 5 * LANES] = g * (f[0] * f[1] + f[3] * f[4] + f[6] * f[7])
        put_twelve(ws, lane, NOW + OF_STRAIN, turned_back(f, modes))


@batch_kernel
def _renew_strain(ws, mu, keep, start, end, level, weight, loss):
    """C_i of a branch in BRANCH, and what it adds to Q and LOST; the rest as of `write_coefficients`."""
    rest, loss = 1.0 - weight, 0.5 * mu * loss
    for lane in range(LANES):
        now = six(ws, lane, NOW)
        begun, before = six(ws, lane, BRANCH), six(ws, lane, REMEMBERED)
        viscous, inverse = unimodular(mixed(keep, begun, start, before, end, now))
        ws[lane + LANES * LOST] += loss * deviator_squared(inverse, now)
        _, q = unimodular(mixed(weight, viscous, rest, now, 0.0, now))
        to = lane + LANES * BRANCH
        ws[to], ws[to + LANES], ws[to + 2 * LANES] = viscous[0], viscous[1], viscous[2]
        ws[to + 3 * LANES], ws[to + 4 * LANES], ws[to + 5 * LANES] = viscous[3], viscous[4], viscous[5]
        to = lane + LANES * FACING
        ws[to] += level * q[0]
        ws[to + LANES] += level * q[1]
        ws[to + 2 * LANES] += level * q[2]
        ws[to + 3 * LANES] += level * q[3]
        ws[to + 4 * LANES] += level * q[4]
        ws[to + 5 * LANES] += level * q[5]


@batch_kernel
def _renew_bending(ws, constants, mu, keep, gain, fade, level, loss):
    """h of a branch in BRANCH, and what it adds to r, LOST and HELD; the rest as of `write_coefficients`."""
    own = hoisted(constants)
    per, held = 1.0 / own[MU], 0.5 / (mu * own[MU])
    loss = loss / (mu * own[MU])
    for lane in range(LANES):
        k = of_lane(ws, lane, own)
        q, before = twelve(ws, lane, NOW + OF_STRAIN), twelve(ws, lane, REMEMBERED + OF_STRAIN)
        moved = sum_of_twelve(1.0, q, -1.0, before)
        h = sum_of_twelve(keep, twelve(ws, lane, BRANCH + OF_STRAIN), gain, moved)
        u = sum_of_twelve(1.0, h, -mu, q)
        ws[lane + LANES * LOST] += loss * inner_twelve(h, hourglass(k, h))
        ws[lane + LANES * HELD] += held * inner_twelve(u, hourglass(k, u))
        put_twelve(ws, lane, BRANCH + OF_STRAIN, h)
        r = sum_of_twelve(fade * per, h, -level * per, q)
        put_twelve(ws, lane, REST, sum_of_twelve(1.0, twelve(ws, lane, REST), 1.0, r))


@batch_kernel
def _end_fold(ws, mu, lam, quick_mu, quick_lam, left):
    """From Q in the place of T to the fold of four blocks; mu and lambda of what lasts and of a quick load [Pa], and
    what is left of mu. Eq. (2) of `relaxing`."""
    for lane in range(LANES):
        J, c, q = 1.0 + ws[lane + LANES * VOLUME_NOW], six(ws, lane, NOW), six(ws, lane, FACING)
        g, inside = bar(J)
        trace = q[0] + q[1] + q[2] + q[0] * c[0] + q[1] * c[1] + q[2] * c[2]
        trace += 2.0 * (q[3] * c[3] + q[4] * c[4] + q[5] * c[5])
        at = lane + LANES * FACING
        x, y, z = mu + g * q[0], mu + g * q[1], mu + g * q[2]
        ws[at], ws[at + LANES], ws[at + 2 * LANES] = x, y, z
        ws[at + 3 * LANES], ws[at + 4 * LANES], ws[at + 5 * LANES] = g * q[3], g * q[4], g * q[5]
        ws[lane + LANES * STIFF] = max(x, max(y, z))
        # s of `volumetric` is -mu A + lambda B; A = 1/J and B = ln J/J but below J_MIN.
        over, log = 1.0 / inside, logarithm(inside)
        below = (J - inside) * over
        pressed = mu + trace * (1.0 / 3.0) + (quick_lam - lam) * (log + below * (1.0 - log)) / (1.0 - below)
        of_lasting, _, _ = volumetric(J, mu, lam)
        of_fold, _, _ = volumetric(J, pressed, quick_lam)
        ws[lane + LANES * PRESSED] = pressed
        ws[lane + LANES * HELD] += of_lasting - of_fold - 1.5 * left
        ws[lane + LANES * SHARE] = left / quick_mu


@lane_kernel
def _move(to, row, source, at, n):
    """n rows of a batch from `at` on to those from `row` on."""
    for i in range(n):
        move_four(to, LANES * (row + i), source, LANES * (at + i))


@njit(cache=True, error_model="numpy", aside=())
def renew(ws, xw, nodes, constants, memory, elapsed, ahead, middle, first, end):
    """What the blocks of batches first .. end - 1 remember, and what folds it.

    memory   (b, n, LANES)  as it was `elapsed` [s] ago, and as it is now; where that is 0 it stays, whatever xw says
    ahead    for how long the fold will do [s], 0 to look at the blocks
    middle   how far off the time is for which it is exact [s]
    What blocks dissipate is added up since the last time that elapsed was 0.
    """
    n = memory.shape[1]
    branches, bending = n // (OF_STRAIN + OF_BENDING) - 1, begin_of_bending(n)
    fold = constants.fold
    known, k = -1, np.empty((branches, N_COEFFICIENTS))
    for batch in range(first, end):
        own, at = of_batch(constants, batch), n * batch
        parameters = parameters_of(own)
        if constants.number[batch] != known:
            known = constants.number[batch]
            write_coefficients(parameters, elapsed, ahead, middle, k)
        _move(ws, REMEMBERED, memory, at, OF_STRAIN)
        _move(ws, REMEMBERED + OF_STRAIN, memory, at + bending, OF_BENDING)
        for row in range(LANES * FOLD, LANES * (FOLD + N_FOLD)):
            ws[row] = 0.0
        material = hoist(ws, own)
        if elapsed > 0.0:
            _move(ws, LOST, fold, N_FOLD * batch + LOST - FOLD, 1)
            gather(ws, xw, nodes, batch)
            see_shapes(ws, own)
            _move(memory, at, ws, NOW, OF_STRAIN)
            _move(memory, at + bending, ws, NOW + OF_STRAIN, OF_BENDING)
            _move(memory, at + n - 1, ws, VOLUME_NOW, 1)
        else:
            _move(ws, NOW, ws, REMEMBERED, OF_STRAIN + OF_BENDING)
            _move(ws, VOLUME_NOW, memory, at + n - 1, 1)
        mu_lasting, lam = lasting(own)
        left = mu_lasting
        for branch in range(branches):
            mu, keep, start, last = k[branch, 0], k[branch, 1], k[branch, 2], k[branch, 3]
            fade, level, weight, loss = k[branch, 4], k[branch, 5], k[branch, 6], k[branch, 7]
            if mu == 0.0:
                continue
            left += level
            strain, modes = at + OF_STRAIN * (1 + branch), at + bending + OF_BENDING * (1 + branch)
            _move(ws, BRANCH, memory, strain, OF_STRAIN)
            _move(ws, BRANCH + OF_STRAIN, memory, modes, OF_BENDING)
            if parameters[BRANCHES + 2 * branch + 1] == 0.0:
                _move(ws, SLIPPED, memory, at + bending - 1, 1)
                slide_strain(ws, mu, parameters[YIELDS], parameters[YIELDS + 1], elapsed > 0.0)
                slide_bending(ws, own, mu)
                if elapsed > 0.0:
                    _move(memory, at + bending - 1, ws, SLIPPED, 1)
                    _move(memory, strain, ws, BRANCH, OF_STRAIN)
                    _move(memory, modes, ws, BRANCH + OF_STRAIN, OF_BENDING)
                continue
            _renew_strain(ws, mu, keep, start, last, level, weight, loss)
            _renew_bending(ws, own, mu, keep, mu * (keep + start), fade, level, loss)
            if elapsed > 0.0:
                _move(memory, strain, ws, BRANCH, OF_STRAIN)
                _move(memory, modes, ws, BRANCH + OF_STRAIN, OF_BENDING)
        _end_fold(ws, mu_lasting, lam, material[MU], material[LAM], left)
        _move(fold, N_FOLD * batch, ws, FOLD, N_FOLD)


@njit(cache=True, error_model="numpy", aside=())
def begin_bending(ws, xw, nodes, constants, memory):
    """What octants handed over does not say: of the shapes now, q and J, and of each branch h = mu e q, 1 at most
    e = |dev C_i^-1 C_bar|/|dev C_bar|: as much of bending has faded as of strain. memory (b, n, LANES) in place."""
    n = memory.shape[1]
    branches, bending = n // (OF_STRAIN + OF_BENDING) - 1, begin_of_bending(n)
    for batch in range(len(nodes)):
        own = of_batch(constants, batch)
        parameters = parameters_of(own)
        gather(ws, xw, nodes, batch)
        hoist(ws, own)
        see_shapes(ws, own)
        for lane in range(LANES):
            now = six(ws, lane, NOW)
            whole = deviator_squared((1.0, 1.0, 1.0, 0.0, 0.0, 0.0), now)
            for m in range(OF_BENDING):
                memory[batch, bending + m, lane] = ws[lane + LANES * (NOW + OF_STRAIN + m)]
            memory[batch, n - 1, lane] = ws[lane + LANES * VOLUME_NOW]
            for branch in range(branches):
                at = OF_STRAIN * (1 + branch)
                _, inverse = unimodular(
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
