"""What blocks that yield remember of their slider, brought up to date after every substep; the rest is `renew`'s.

In a substep the slider holds. Then, at the shape that came of it, it slips by a of eq. (2) of
`body.materials.plasticity`, and C_i and the plastic strain alpha follow as there, eq. (3); Q gets mu C_i^-1. Of the
hourglass modes as much slips: with the change dq of q = F^T q_m since, and K/mu_0 as in `renew`,
h <- (h + mu dq)/(1 + a),  r gets (h - mu q)/mu_0                                                              (1)
It dissipates sigma (alpha - alpha_0) of strain, a h K h/(mu mu_0) of bending, both >= 0. What it stores in the substep
beyond that, as stress goes past sigma, is the integrator's; it is of second order in the strain of a substep, as in
FEM in that of a step.
"""

from softseam_services.body.materials.plasticity import slip

from .block import hoisted, hourglass, of_lane
from .block_rows import BRANCH, FACING, HELD, LOST, MU, NOW, OF_STRAIN, REMEMBERED, REST, SLIP, SLIPPED
from .lanes import LANES, batch_kernel
from .relaxing import inner_twelve, put_twelve, twelve
from .tensors import contracted, mixed, six, sum_of_twelve, unimodular


@batch_kernel
def slide_strain(ws, mu, strength, hardening, moves):
    """C_i in BRANCH, alpha in SLIPPED and a in SLIP of four blocks, and what they add to Q and LOST.

    strength  yield stress of the slider [Pa]
    moves     whether time has passed; otherwise nothing slips
    """
    for lane in range(LANES):
        now, viscous = six(ws, lane, NOW), six(ws, lane, BRANCH)
        (_, inverse), (_, back) = unimodular(viscous), unimodular(now)
        p, r = contracted(now, inverse) - 3.0, contracted(viscous, back) - 3.0
        sigma = strength + hardening * ws[lane + LANES * SLIPPED]
        # -9 mu^2 times the slope of G (p + a r)/(1 + a)^2 at a = 0, with which `slip` begins, less a little.
        ws[lane + LANES * SLIP] = mu * mu * (p * (p + 6.0) - 3.0 * r) - 0.99 * sigma * sigma
        to = lane + LANES * FACING
        ws[to] += mu * inverse[0]
        ws[to + LANES] += mu * inverse[1]
        ws[to + 2 * LANES] += mu * inverse[2]
        ws[to + 3 * LANES] += mu * inverse[3]
        ws[to + 4 * LANES] += mu * inverse[4]
        ws[to + 5 * LANES] += mu * inverse[5]
    for lane in range(LANES):
        a = 0.0
        if moves and ws[lane + LANES * SLIP] > 0.0:
            now, viscous = six(ws, lane, NOW), six(ws, lane, BRANCH)
            (_, begun), (_, back) = unimodular(viscous), unimodular(now)
            p, r, alpha = contracted(now, begun) - 3.0, contracted(viscous, back) - 3.0, ws[lane + LANES * SLIPPED]
            a, sigma, _ = slip(p, r, mu, strength + hardening * alpha, hardening)
            keep, more = 1.0 / (1.0 + a), a * sigma / (3.0 * mu)
            if a > 0.0:
                viscous, inverse = unimodular(mixed(keep, viscous, 1.0 - keep, now, 0.0, now))
                ws[lane + LANES * SLIPPED] = alpha + more
                ws[lane + LANES * LOST] += sigma * more
                for n in range(OF_STRAIN):
                    ws[lane + LANES * (BRANCH + n)] = viscous[n]
                    ws[lane + LANES * (FACING + n)] += mu * (inverse[n] - begun[n])
        ws[lane + LANES * SLIP] = a


@batch_kernel
def slide_bending(ws, constants, mu):
    """h in BRANCH of four blocks by the slip in SLIP, eq. (1), and what it adds to r, LOST and HELD."""
    own = hoisted(constants)
    per, each = 1.0 / own[MU], 1.0 / (mu * own[MU])
    for lane in range(LANES):
        k, a = of_lane(ws, lane, own), ws[lane + LANES * SLIP]
        keep = 1.0 / (1.0 + a)
        q, before = twelve(ws, lane, NOW + OF_STRAIN), twelve(ws, lane, REMEMBERED + OF_STRAIN)
        moved = sum_of_twelve(keep * mu, q, -keep * mu, before)
        h = sum_of_twelve(keep, twelve(ws, lane, BRANCH + OF_STRAIN), 1.0, moved)
        u = sum_of_twelve(1.0, h, -mu, q)
        ws[lane + LANES * LOST] += a * each * inner_twelve(h, hourglass(k, h))
        ws[lane + LANES * HELD] += 0.5 * each * inner_twelve(u, hourglass(k, u))
        put_twelve(ws, lane, BRANCH + OF_STRAIN, h)
        put_twelve(ws, lane, REST, sum_of_twelve(1.0, twelve(ws, lane, REST), per, u))
