"""Points of a material with state: its response, and what the octants remember at the end of a step.

State is an octant's. A point sees the mean of the octants that it stands for, by `rule.share`; an octant takes over the
mean of its points' next states, by their shares and weights. work.material_state is that at the start of the step, and
work.material_dt its length; 0 to look at what the state is.
"""

from softseam_services.body.materials.prototype import RESPOND
from softseam_services.jit import njit

_call_respond = RESPOND.call


@njit(cache=True, error_model="numpy")
def respond(model, rule, work, cell, point, parameters, F, state, P, A, following):
    """Energy density, and what the step dissipated, at a point of a cell, numbered through its elements [Pa].

    P (3, 3), A (9, 9) and following (n,) in place; state (n,): workspace.
    """
    n_points = rule.share.shape[1]
    share = rule.share[point // n_points, point % n_points]
    state[:] = 0.0
    for octant in range(8):
        for n in range(model.n_state):
            state[n] += share[octant] * work.material_state[cell, octant, n]
    return _call_respond(model.respond, model.n_state, F, state, work.material_dt[0], parameters, P, A, following)
