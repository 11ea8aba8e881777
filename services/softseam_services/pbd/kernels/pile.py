"""A step of many bodies that each are a region of their own: those that are awake, one after the other.

Each is advanced as `pbd.step` advances one alone, by the same kernels, tried again as often, and comes out the same to
the bit.
"""

import numpy as np

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
    feeds,
    grows,
    needs_two_sweeps,
    remember,
)

ATTEMPT, CAUSE, FAULT, SUBSTEPS, SWEEPS, SWEPT, UNFINISHED, HALVED, WAS_FED = range(9)
N_NOTES = 9
"""of a body's step: its last attempt; why that was made, a fault's number, `LAGGED` or `FED`; what is wrong with it;
its substeps and sweeps in each; sweeps of all attempts; substeps that did not reach the residual; whether the next take
half as long; whether it was made again as the energy rose where tools touch"""
LAGGED, FED = 4, 5
"""causes: the residual grew; the energy rose where tools touch"""


@njit(cache=True, error_model="numpy")
def substeps_and_sweeps(member, number):
    """Of an attempt of this number at a step of a body."""
    n_sweeps = member.sweeps + number
    if needs_two_sweeps(member.before.monitor):
        n_sweeps = max(n_sweeps, 2)
    return member.substeps << (number + int(member.before.monitor[HALVINGS])), n_sweeps


@njit(cache=True, error_model="numpy")
def begin_attempt(member, inputs, number, dt):
    """An attempt at a step of a body begins in `after` where `before` is."""
    model, parameters, scratch, work = member.model, member.parameters, member.scratch, member.after
    work.buffer[:] = member.before.buffer
    if work.monitor[STRETCH] < COLLAPSED:
        give_shape(work.x, parameters.x_rest)
    if number >= COLD:
        work.stress[:] = 0.0
        work.a[:] = 0.0
        work.force[:] = 0.0
        work.steady[:] = 0.0
    scratch.used[:] = 0
    find_slow(
        *(member.own_mass, work.v, inputs.position, inputs.position_next, dt, member.slowly),
        *(scratch.contacts.slow,),
    )
    find_patches(model, parameters, work.x, scratch.contacts.patch)


@njit(cache=True, error_model="numpy")
def end_attempt(member, number, dt, n_substeps, n_sweeps, turned, notes):
    """An attempt at a step of a body came to its end; turned (3,) is what other bodies gave it of angular momentum
    about its centre [kg m^2/s]."""
    parameters, scratch, outputs = member.parameters, member.scratch, member.outputs
    before, work = member.before, member.after
    if number == 0 and member.turns:
        alone = parameters.mass_rate == 0.0
        for tool in range(len(outputs.wrench)):
            for c in range(6):
                alone = alone and outputs.wrench[tool, c] == 0.0
        if give_back(parameters.mass, before.x, before.v, work.x, work.v, -1, dt, n_substeps, alone, turned):
            summarise_motion(parameters, work.x, work.v, outputs.result)
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
def judge(member, number, notes):
    """Whether an attempt at a step of a body is to be made again, and why. notes: what is wrong with it, in place."""
    result, monitor = member.outputs.result, member.before.monitor
    fault = fault_of(result, monitor, member.roundoff)
    notes[ATTEMPT], notes[FAULT] = number, fault
    lagging = number == 0 and grows(result, monitor)
    fed = number == 0 and feeds(result, monitor, member.roundoff)
    notes[WAS_FED] = notes[WAS_FED] or fed
    return fault != NONE or lagging or fed, fault if fault != NONE else LAGGED if lagging else FED


@njit(cache=True, error_model="numpy")
def keep_figures(member, notes):
    """The last attempt stands: remember its figures in `after`."""
    if notes[FAULT] != DIVERGED:
        fed = notes[WAS_FED] > 0
        notes[HALVED] = remember(member.after.monitor, member.outputs.result, member.roundoff, member.plans, fed)


@njit(cache=True, error_model="numpy")
def _step(member, inputs, dt, team, ws, notes):
    """A step of a body, tried until it is believed; see `pbd.step.step`."""
    free = np.zeros(3)
    notes[:] = 0
    cause = NONE
    for number in range(RETRIES + 1):
        begin_attempt(member, inputs, number, dt)
        n_substeps, n_sweeps = substeps_and_sweeps(member, number)
        advance_step(
            *(member.model, member.parameters, member.after, inputs, member.scratch, member.outputs, dt),
            *(n_substeps, n_sweeps, member.all, team, 0, ws),
        )
        end_attempt(member, number, dt, n_substeps, n_sweeps, free, notes)
        again, next_cause = judge(member, number, notes)
        notes[CAUSE] = cause
        if not again:
            break
        cause = next_cause
    keep_figures(member, notes)


@njit(cache=True, error_model="numpy", nogil=True)
def advance_bodies(members, awake, inputs, dt, team, ws, notes):
    """A step of dt [s] of the bodies that are awake, from their `before` into their `after`.

    members  rows of `records.Member`
    awake    numbers of the bodies that take it, ascending (k,)
    notes    of each body (b, N_NOTES), overwritten for those
    """
    for body in awake:
        _step(members[body], inputs, dt, team, ws, notes[body])
