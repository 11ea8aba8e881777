"""What steps damp of bounces, body by body, see `orchestrator.step_losses`."""

from softseam_coupling.kept_kernels import njit

KINETIC, STRAIN, DISSIPATION, DRIVE_WORK = range(4)
"""rows of what a step did to each body [J]"""
FREE, CAME, LOST, LARGEST, TAKEN, WORST, TOUCHED, TOUCHING = range(8)
"""rows of what evolves"""


@njit(cache=True, error_model="numpy")
def follow_bounces(state, step, touches, least, watched, limit, rest, shares):
    """A step did this to b bodies (4, b) [J], which tools touch or do not (b,): `state` (8, b), in place; how many
    bounces ended in which more was lost than ever.

    least    energy above which a body comes fast (b,) [J]; watched: whether its losses are the steps' (b,)
    limit    of a loss that may be, rest: of the energy below which a body rests, as shares [1]
    shares   (b,) <- what such a bounce lost of the energy with which the body came, 0 of others [1]
    """
    n = 0
    for body in range(state.shape[1]):
        shares[body] = 0.0
        kinetic, dissipation = step[KINETIC, body], step[DISSIPATION, body]
        state[TAKEN, body] += dissipation
        state[LARGEST, body] = max(state[LARGEST, body], kinetic + step[STRAIN, body])
        if not touches[body] and state[CAME, body] == 0.0 and state[TOUCHING, body] == 0.0:
            state[FREE, body] = kinetic
            continue
        if touches[body] and state[TOUCHING, body] == 0.0:
            state[CAME, body] = state[FREE, body] if state[FREE, body] > least[body] else 0.0
            state[LOST, body] = 0.0
        state[TOUCHING, body] = 1.0 if touches[body] else 0.0
        if touches[body]:
            state[TOUCHED, body] = 1.0
            if step[DRIVE_WORK, body] != 0.0:
                state[CAME, body] = 0.0
            if state[CAME, body] > 0.0:
                state[LOST, body] += dissipation
        came = state[CAME, body]
        if came > 0.0 and watched[body] and (not touches[body] or kinetic < rest * came):
            share, state[CAME, body] = state[LOST, body] / came, 0.0
            if share > max(limit, state[WORST, body]):
                state[WORST, body] = shares[body] = share
                n += 1
        if not touches[body]:
            state[FREE, body] = kinetic
    return n
