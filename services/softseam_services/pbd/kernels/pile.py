"""A step of many bodies that each are a region of their own: those that are awake, one after the other.

Each is advanced as `pbd.step` advances one alone, by the same kernels, tried again as often, and comes out the same to
the bit.
"""

from softseam_services.body.kernels.turning import give_back
from softseam_services.jit import njit

from .begin import find_patches, find_slow, give_shape
from .substep import advance_step
from .summary import summarise_motion
from .trust import (
    COLD,
    COLLAPSED,
    DIVERGED,
    HALVINGS,
    NONE,
    RETRIES,
    STRETCH,
    fault_of,
    grows,
    needs_two_sweeps,
    remember,
)

ATTEMPT, CAUSE, FAULT, SUBSTEPS, SWEEPS, SWEPT, UNFINISHED, HALVED = range(8)
N_NOTES = 8
"""of a body's step: its last attempt; why that was made, a fault's number or `LAGGED`; what is wrong with it; its
substeps and sweeps in each; sweeps of all attempts; substeps that did not reach the residual; whether the next take
half as long"""
LAGGED = 4
"""a cause: the residual grew"""


@njit(cache=True, error_model="numpy")
def _attempt(member, inputs, number, dt, team, ws, notes):
    """One attempt at a step of a body, from `before` into `after`; see `pbd.step.attempt`."""
    model, parameters, scratch, outputs = member.model, member.parameters, member.scratch, member.outputs
    before, work, result = member.before, member.after, member.outputs.result
    work.buffer[:] = before.buffer
    if work.monitor[STRETCH] < COLLAPSED:
        give_shape(work.x, parameters.x_rest)
    if number >= COLD:
        work.stress[:] = 0.0
        work.a[:] = 0.0
        work.force[:] = 0.0
        work.steady[:] = 0.0
    n_substeps = member.substeps << (number + int(work.monitor[HALVINGS]))
    n_sweeps = member.sweeps + number
    if needs_two_sweeps(work.monitor):
        n_sweeps = max(n_sweeps, 2)
    scratch.used[:] = 0
    find_slow(
        *(member.own_mass, work.v, inputs.position, inputs.position_next, dt, member.slowly),
        *(scratch.contacts.slow,),
    )
    find_patches(model, parameters, work.x, scratch.contacts.patch)
    advance_step(
        *(model, parameters, work, inputs, scratch, outputs, dt, n_substeps, n_sweeps, member.all, team, 0, ws),
    )
    if number == 0 and member.turns:
        alone = parameters.mass_rate == 0.0
        for tool in range(len(outputs.wrench)):
            for c in range(6):
                alone = alone and outputs.wrench[tool, c] == 0.0
        if give_back(parameters.mass, before.x, before.v, work.x, work.v, -1, dt, n_substeps, alone):
            summarise_motion(parameters, work.x, work.v, result)
    notes[SUBSTEPS], notes[SWEEPS] = n_substeps, n_sweeps
    notes[UNFINISHED] = 0
    swept = n_substeps * max(n_sweeps, 1)
    if parameters.tolerance > 0.0:
        swept = 0
        for substep in range(n_substeps):
            used = scratch.used[substep]
            swept += used if used > 0 else n_sweeps
            notes[UNFINISHED] += used == 0
    notes[SWEPT] += swept


@njit(cache=True, error_model="numpy")
def _step(member, inputs, dt, team, ws, notes):
    """A step of a body, tried until it is believed; see `pbd.step.step`."""
    result, monitor, floor = member.outputs.result, member.before.monitor, member.roundoff
    notes[:] = 0
    cause = NONE
    for number in range(RETRIES + 1):
        _attempt(member, inputs, number, dt, team, ws, notes)
        fault = fault_of(result, monitor, floor)
        notes[ATTEMPT], notes[CAUSE], notes[FAULT] = number, cause, fault
        lagging = number == 0 and grows(result, monitor)
        if fault == NONE and not lagging:
            break
        cause = fault if fault != NONE else LAGGED
    if notes[FAULT] != DIVERGED:
        notes[HALVED] = remember(member.after.monitor, result, floor)


@njit(cache=True, error_model="numpy", nogil=True)
def advance_bodies(members, awake, inputs, dt, team, ws, notes):
    """A step of dt [s] of the bodies that are awake, from their `before` into their `after`.

    members  rows of `records.Member`
    awake    numbers of the bodies that take it, ascending (k,)
    notes    of each body (b, N_NOTES), overwritten for those
    """
    for body in awake:
        _step(members[body], inputs, dt, team, ws, notes[body])
