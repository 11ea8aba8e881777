"""What a law with state does at a point: one of softseam's own, which the compiler puts in line, or an extension's.

A law is known by a number: of one from outside the address of its `respond`; minus that of an elastic law in `point`
where branches that relax or yield are beside it (`relaxation`). Other parts of a law that remember, such as damage,
have their place here.
"""

import numpy as np

from softseam_services.body.materials import relaxation
from softseam_services.body.materials.point import energy, stress, tangent
from softseam_services.body.materials.prototype import RESPOND
from softseam_services.jit import njit

_call_respond = RESPOND.call


@njit(cache=True, error_model="numpy")
def respond(law, F, state, dt, parameters, P, A, following, definite):
    """Energy density, and what the step dissipated of it [Pa], as `prototype.RESPOND`; P, A = dP/dF and the state at
    the end of dt in place. definite: A is positive semi-definite, if the law can."""
    if law > 0:
        return _call_respond(law, len(following), F, state, dt, parameters, P, A, following)
    w, D, half = np.empty(relaxation.SIZE), np.empty((6, 6)), np.empty((6, 9))
    step = np.empty((len(state) // relaxation.SIX - 1, relaxation.COLUMNS))
    relaxation.write_step(parameters, dt, step)
    stress(-law, parameters, F, P)
    tangent(-law, parameters, F, A, definite)
    g = relaxation.strain(F, 0, w)
    relaxation.write_stiffness(w, g, step, state, 1.0, definite, D)
    relaxation.add_stress(F, 0, 1.0, w, P)
    relaxation.write_half(F, 0, D, half)
    relaxation.add_tangent(F, 0, w, half, not definite, A)
    stored, dissipated = relaxation.advance(w, g, step, parameters, dt, state, following)
    return energy(-law, parameters, F) + stored, dissipated


@njit(cache=True, error_model="numpy")
def stress_at_end(law, F, state, dt, parameters, P, A, following):
    """P (3, 3) of `respond` alone; A and following are workspace."""
    if law > 0:
        _call_respond(law, len(following), F, state, dt, parameters, P, A, following)
        return
    w = np.empty(relaxation.SIZE)
    step = np.empty((len(state) // relaxation.SIX - 1, relaxation.COLUMNS))
    relaxation.write_step(parameters, dt, step)
    stress(-law, parameters, F, P)
    g = relaxation.strain(F, 0, w)
    relaxation.write_stress(w, g, step, state)
    relaxation.add_stress(F, 0, 1.0, w, P)
