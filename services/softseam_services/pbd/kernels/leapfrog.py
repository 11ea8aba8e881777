"""One macro step by explicit leapfrog on the blocks' own forces: no sweep, no dissipation, and a limit.

v_1/2 = v_0 + h/2 (A_0 + g);  x_k+1 = x_k + h v_k+1/2;  v_k+3/2 = v_k+1/2 + h (A_k+1 + g),  half of it at the end    (1)

with A = M^-1 f(x), known at the start from the step before (Stoermer-Verlet; Hairer, Lubich and Wanner 2003). Where f
is linear with an eigenfrequency omega, its mode swings with

sin(omega' h/2) = omega h/2                                                                                    (2)

and  E - h^2/8 f^T M^-1 f,  E the energy and f all forces, is kept to rounding. It is stable while omega_max h < 2:
while h^2/8 f^T M^-1 f of the blocks' forces is less than their strain energy, whatever the shape.
Damping at the rate r per mass takes the velocity in the middle of a kick:

(1 + r h/2) v_k+3/2 = (1 - r h/2) v_k+1/2 + h (A_k+1 + g)                                                      (3)

Tools and seams are the sweeps': here nothing is solved for that could hold them.
"""

import numpy as np

from softseam_services.jit import njit

from .block import gather, hoisted, node_softness, of_batch, of_lane, read_row, scatter, spread, store_stress
from .block_rows import VOLUME, WANTED
from .hanging import follow
from .lanes import LANES, lane_kernel, move_four
from .laws import write_stress
from .monitor import batch_residuals, residual
from .summary import APPARENT, HASTE, LEAST_J, RESIDUAL, STRAIN, STRETCH, summarise_motion
from .sweep import batch_energies, block_forces, strain_energy
from .thread_team import done, first_range, next_range, wait_for

LEAST, LEAST_BATCHES = 256, 8
"""nodes and batches that a thread takes at least"""


@lane_kernel
def _push_lane(ws, lane, k, g):
    """Rows of the nodes' velocities += g_i f_i, with P and T of the rows WANTED."""
    spread(ws, lane, 0, k, g, read_row(ws, lane, WANTED, 0))
    spread(ws, lane, 1, k, g, read_row(ws, lane, WANTED, 1))
    spread(ws, lane, 2, k, g, read_row(ws, lane, WANTED, 2))


@njit(cache=True, error_model="numpy")
def kick(model, parameters, place, speed, h, first, end, ws):
    """v_i += h w_i f_i for the blocks of batches first .. end - 1.

    place  (n + 8, 4)  positions [m]; the fourth column is not used
    speed  (n + 8, 4)  velocities [m/s], updated in place, and inverse masses [1/kg]
    """
    for batch in range(first, end):
        own = of_batch(parameters.constants, batch)
        gather(ws, place, model.blocks, batch)
        move_four(ws, LANES * VOLUME, parameters.volume, LANES * batch)
        write_stress(ws, own, parameters.law)
        gather(ws, speed, model.blocks, batch)
        constants = hoisted(own)
        for lane in range(LANES):
            k = of_lane(ws, lane, constants)
            _push_lane(ws, lane, k, node_softness(ws, lane, h))
        scatter(ws, speed, model.blocks, batch)


@njit(cache=True, error_model="numpy")
def note_stress(model, parameters, place, stress, first, end, ws):
    """Lambda = (P, T) of the shapes of the blocks in batches first .. end - 1 into stress (b, N_STRESS)."""
    for batch in range(first, end):
        gather(ws, place, model.blocks, batch)
        move_four(ws, LANES * VOLUME, parameters.volume, LANES * batch)
        write_stress(ws, of_batch(parameters.constants, batch), parameters.law)
        store_stress(ws, WANTED, stress, batch)


@njit(cache=True, error_model="numpy")
def drift(place, speed, push, gain, h, first, end):
    """v += gain push, then x += h v, for the nodes first .. end - 1; push (n, 4) is g of free nodes [m/s^2]."""
    place, speed, push = place.reshape(-1), speed.reshape(-1), push.reshape(-1)
    for i in range(4 * first, 4 * end):
        moved = speed[i] + gain * push[i]
        speed[i] = moved
        place[i] += h * moved


@njit(cache=True, error_model="numpy")
def drag(speed, kept, first, end):
    """v *= kept for the nodes first .. end - 1."""
    for i in range(first, end):
        for c in range(3):
            speed[i, c] *= kept


@njit(cache=True, error_model="numpy")
def begin(state, leap, h, half_drag):
    """Positions and v_1/2 of eq. (1) into the scratch; without g, which the first drift adds.

    Returns h^2/8 f^T M^-1 f of all forces [J].
    """
    total = 0.0
    for i in range(len(state.x)):
        free = leap.speed[i, 3] > 0.0
        for c in range(3):
            leap.place[i, c] = state.x[i, c]
            leap.speed[i, c] = (1.0 - half_drag) * state.v[i, c] + 0.5 * h * state.a[i, c] if free else 0.0
            if free:
                total += (state.a[i, c] + leap.push[i, c]) ** 2 / leap.speed[i, 3]
        leap.place[i, 3] = 0.0
    return 0.125 * h * h * total


@njit(cache=True, error_model="numpy")
def end_step(state, leap, h, half_drag):
    """x, v and A at the end of the step into the state, from forces leap.pull (n + 8, 4) [N].

    Returns h^2/8 f^T M^-1 f of all forces, and of the blocks' [J].
    """
    total, own = 0.0, 0.0
    for i in range(len(state.x)):
        weight = leap.speed[i, 3]
        for c in range(3):
            a = weight * leap.pull[i, c]
            own += leap.pull[i, c] * a
            if weight > 0.0:
                total += (a + leap.push[i, c]) ** 2 / weight
            state.a[i, c] = a
            state.v[i, c] = (leap.speed[i, c] + 0.5 * h * (a + leap.push[i, c])) / (1.0 + half_drag)
            state.x[i, c] = leap.place[i, c]
    return 0.125 * h * h * total, 0.125 * h * h * own


@njit(cache=True, error_model="numpy", nogil=True)
def advance_leapfrog(model, parameters, state, leap, outputs, dt, m, parts, team, worker, ws):
    """Advance the state by dt in m substeps; the results are those of `advance_step` for a body that nothing touches.

    Run by one thread, or by two with a workspace `ws` each and the same `team`; what is not shared is worker 0's.
    """
    n, h, drag_rate, result = len(state.x), dt / m, parameters.mass_rate, outputs.result
    half_drag = 0.5 * h * drag_rate
    gain = h / (1.0 + half_drag)
    before, stretch = 1, 0
    apparent = 0.0
    if worker == 0:
        apparent = begin(state, leap, h, half_drag)
        outputs.distance[:] = np.inf
        done(team, worker, 1)
    for substep in range(m):
        first, end = first_range(team, before, stretch, n, worker, LEAST)
        while first < end:
            drift(leap.place, leap.speed, leap.push, gain if substep > 0 else 0.5 * h, h, first, end)
            if drag_rate > 0.0 and substep < m - 1:
                drag(leap.speed, (1.0 - half_drag) / (1.0 + half_drag), first, end)
            first, end = next_range(team, stretch, worker, end - first, LEAST)
        before, stretch = before + n, stretch + 1
        if substep == m - 1:
            break
        for part in range(len(parts) - 1):
            start, n_batches = parts[part], parts[part + 1] - parts[part]
            first, end = first_range(team, before, stretch, n_batches, worker, LEAST_BATCHES)
            while first < end:
                kick(model, parameters, leap.place, leap.speed, gain, start + first, start + end, ws)
                first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
            before, stretch = before + n_batches, stretch + 1
    if worker == 0:
        wait_for(team, before)
        leap.pull[:] = 0.0
        done(team, worker, 1)
    before += 1
    for part in range(len(parts) - 1):
        start, n_batches = parts[part], parts[part + 1] - parts[part]
        first, end = first_range(team, before, stretch, n_batches, worker, LEAST_BATCHES)
        while first < end:
            low, high = start + first, start + end
            at = ws, leap.place, model.blocks, parameters.volume
            constants, law = parameters.constants, parameters.law
            note_stress(model, parameters, leap.place, state.stress, low, high, ws)
            block_forces(ws, model.blocks, state.stress, constants, leap.pull, low, high)
            batch_energies(*at, constants, law, low, high, leap.figures)
            batch_residuals(*at, state.stress, constants, law, low, high, leap.figures)
            first, end = next_range(team, stretch, worker, end - first, LEAST_BATCHES)
        before, stretch = before + n_batches, stretch + 1
    if worker > 0:
        return
    wait_for(team, before)
    total, own = end_step(state, leap, h, half_drag)
    result[:] = 0.0
    result[APPARENT], result[HASTE] = total - apparent, own
    follow(state.x, state.v, model.hanging)
    summarise_motion(parameters, state.x, state.v, result)
    result[STRAIN], result[LEAST_J] = strain_energy(leap.figures)
    result[RESIDUAL], result[STRETCH] = residual(leap.figures)
