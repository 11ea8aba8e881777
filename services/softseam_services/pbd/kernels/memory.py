"""What blocks of a material with internal state remember: rows of their constants, which a step renews.

Such blocks have forms of their own (`form`), and below the rows of a form, for each lane: for how long the step went on
when the substep ends, 0 where the state is looked at; what the material dissipated in the step [J]; whether the law
knows small strains only; and the n numbers that it remembers as the step begins. The state is the block's: one F, one
state.

Sweeps of a substep solve for the stress at its end, which the law finds from the state at the start of the step and the
time since; once the step is solved, the state that follows takes its place (`general.remember_lanes`). So a step does
to the state what it does in FEM, whose law sees the same two ends: of parts beside each other none relaxes before the
other. `law` is the address of the law's `respond`. What hourglass modes store stays elastic, and does not fade.
"""

import numpy as np

from softseam_services.body.materials.prototype import RESPOND
from softseam_services.jit import njit

from .form import N_FORM

LENGTH, LOST, SMALL, MEMORY = N_FORM, N_FORM + 1, N_FORM + 2, N_FORM + 3
"""rows of the constants, below those of a form; the state from MEMORY on"""
_call_respond = RESPOND.call


@njit(cache=True, error_model="numpy")
def remembers(k):
    """Whether the blocks of these constants have state; never those of boxes, which have no constants of their own."""
    if k.ndim == 1:
        return False
    return len(k) > N_FORM


@njit(cache=True, error_model="numpy")
def begun_before(table, time):
    """The substep to come ends so long after the start of its step [s]; into the table of constants, where blocks
    remember."""
    if table.ndim > 2 and table.shape[1] > N_FORM:
        table[:, LENGTH] = time


@njit(cache=True, error_model="numpy")
def small(k, lane):
    """Whether the law knows small strains only."""
    if k.ndim == 1:
        return False
    return k[SMALL, lane] > 0.0


@njit(cache=True, error_model="numpy")
def respond(k, law, lane, parameters, F, P, A):
    """Energy density of a lane's block at F (3, 3) [Pa]; P (3, 3), A (9, 9) in place."""
    if k.ndim == 1:
        return 0.0
    return _ends(k, law, lane, parameters, F, P, A, np.empty(len(k) - MEMORY))[0]


@njit(cache=True, error_model="numpy")
def follow(k, law, lane, parameters, F, volume):
    """The state of a lane's block of this volume [m^3] at the end F (3, 3) of the step takes the place of that at its
    start, which is to be looked at from now on; and what the material dissipated is noted."""
    if k.ndim == 1:
        return
    following = np.empty(len(k) - MEMORY)
    _, dissipated = _ends(k, law, lane, parameters, F, np.empty((3, 3)), np.empty((9, 9)), following)
    k[LOST, lane], k[LENGTH, lane] = volume * dissipated, 0.0
    for n in range(len(following)):
        k[MEMORY + n, lane] = following[n]


@njit(cache=True, error_model="numpy")
def _ends(k, law, lane, parameters, F, P, A, following):
    """What `respond` of the law returns and fills."""
    state = np.empty(len(following))
    for n in range(len(following)):
        state[n] = k[MEMORY + n, lane]
    return _call_respond(law, len(following), F, state, k[LENGTH, lane], parameters, P, A, following)
