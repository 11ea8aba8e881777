"""A step of bodies of a pile that touch one another: all are at the same substep, and their contacts are solved in it.

A body's own part of it is that of one alone (`substep`, `relax`, `pile`), with the substeps and sweeps of whichever
needs most. Contacts between bodies (`between`) come before those with tools, so that no point ends inside a tool. Where
one body's step is not believed, all are tried again.
"""

import numpy as np

from softseam_services.jit import njit

from .asleep import stand
from .between import account_rows, begin_rows, keep_rows, open_rows, project_rows, pull_rows
from .contact import account_pairs, project_contacts
from .damping import damping_share
from .hold import soften_held_blocks
from .pile import CAUSE, FAULT, begin_attempt, end_attempt, judge, keep_figures, substeps_and_sweeps
from .relax import end_together, sweep_round
from .substep import (
    carried,
    close_step,
    finish_all,
    look_at_blocks,
    open_step,
    open_substep,
    predict_all,
    pull_blocks,
)
from .summary import SEAM_WORK
from .trust import COLD, DIVERGED, NONE, RETRIES


@njit(cache=True, error_model="numpy")
def _share(member, h, n_sweeps):
    """`damping_share` of a body."""
    return damping_share(member.parameters.stiffness_time, member.parameters.lag, h, n_sweeps)


@njit(cache=True, error_model="numpy")
def _find_centre(member, xw, first, centre):
    """centre (3,) <- of the body whose nodes are rows of xw from `first` on [m]."""
    mass, total = member.parameters.mass, 0.0
    centre[:] = 0.0
    for i in range(len(mass)):
        total += mass[i]
        for c in range(3):
            centre[c] += mass[i] * xw[first + i, c]
    for c in range(3):
        centre[c] /= total


@njit(cache=True, error_model="numpy")
def _substep(members, bodies, meetings, touch, xw, centre, inputs, dt, n_substeps, n_sweeps, substep, team, ws):
    """A substep of bodies that meet."""
    h = dt / n_substeps
    open_rows(touch, meetings, xw)
    for body in bodies:
        one = members[body]
        _find_centre(one, xw, touch.row[body], centre[body])
        open_substep(one.model, one.parameters, one.after, inputs, one.scratch, dt, h, substep, n_substeps)
        share = _share(one, h, n_sweeps)
        predict_all(one.model, one.parameters, one.after, one.scratch, h, share, team, 0, 0, 0, ws)
    for round_ in range(n_sweeps + 1):
        for body in bodies:
            one = members[body]
            sweep_round(
                *(one.model, one.parameters, one.after.stress, one.scratch, round_, _share(one, h, n_sweeps), h),
                *(one.all, 0, team, 0, 0, ws),
            )
        project_rows(touch, meetings, xw, h * h)
        for body in bodies:
            one = members[body]
            project_contacts(one.model, one.parameters, one.scratch.contacts, one.scratch.xw, h * h, True)
            if round_ < n_sweeps:
                soften_held_blocks(one.model, one.parameters, one.scratch.contacts, one.scratch.softness)
    for body in bodies:
        one = members[body]
        share = _share(one, h, n_sweeps)
        if share > 0.0:
            end_together(one.model, one.after.stress, one.scratch, share, 0, team, 0, 0)
        finish_all(one.after, one.scratch, h, team, 0, 0, 0)
        account_pairs(one.model, one.parameters, one.scratch.contacts, one.scratch.xw, 1.0 / n_substeps)


@njit(cache=True, error_model="numpy")
def _attempt(members, bodies, meetings, touch, held, xw, centre, inputs, number, dt, team, ws, notes):
    """One attempt at a step of bodies that touch."""
    n_substeps, n_sweeps = 1, 0
    for body in bodies:
        begin_attempt(members[body], inputs, number, dt)
        own_substeps, own_sweeps = substeps_and_sweeps(members[body], number)
        n_substeps, n_sweeps = max(n_substeps, own_substeps), max(n_sweeps, own_sweeps)
    h = dt / n_substeps
    for body in bodies:
        one = members[body]
        touch.work[body] = 0.0
        for c in range(3):
            touch.turned[body, c] = 0.0
        open_step(one.model, one.parameters, one.after, inputs, one.scratch, dt, h)
        pull_blocks(one.model, one.parameters, one.after, one.scratch, one.all, team, 0, 0, 0, ws)
    begin_rows(touch, meetings, held, number >= COLD)
    pull_rows(members, touch, meetings)
    for meeting in meetings:
        touch.met[meeting, :] = 0.0
    for body in bodies:
        one = members[body]
        carried(one.model, one.parameters, one.after, one.scratch.xw, one.scratch.pull)
    for substep in range(n_substeps):
        _substep(*(members, bodies, meetings, touch, xw, centre, inputs, dt, n_substeps, n_sweeps, substep, team, ws))
        for meeting in meetings:
            account_rows(touch, meeting, xw, centre, h)
    for body in bodies:
        one = members[body]
        share = _share(one, h, n_sweeps)
        look_at_blocks(one.model, one.parameters, one.after, one.scratch, share, team, 0, 0, 0, ws)
        close_step(one.model, one.parameters, one.after, inputs, one.scratch, one.outputs, n_substeps, 0.0)
        one.outputs.result[SEAM_WORK] = touch.work[body]
        end_attempt(one, number, dt, n_substeps, n_sweeps, touch.turned[body], notes[body])


@njit(cache=True, error_model="numpy", nogil=True)
def advance_group(members, bodies, meetings, touch, held, kept, xw, centre, inputs, dt, team, ws, notes):
    """A step of dt [s] of bodies that touch, from their `before` into their `after`, tried until all are believed.

    bodies      their numbers, ascending (k,)
    meetings    between them, ascending (m,)
    held, kept  forces on points between bodies as the step begins, and as it ends (f, 3) [N]
    xw          positions and inverse masses of all bodies of the pile
    centre      scratch (b, 3)
    notes       of each body (b, N_NOTES), overwritten for these
    """
    for body in bodies:
        notes[body, :] = 0
    causes = np.full(len(bodies), NONE)
    for number in range(RETRIES + 1):
        _attempt(members, bodies, meetings, touch, held, xw, centre, inputs, number, dt, team, ws, notes)
        again = False
        for i in range(len(bodies)):
            body = bodies[i]
            own, cause = judge(members[body], number, notes[body])
            notes[body, CAUSE] = causes[i]
            if own:
                causes[i], again = cause, True
        if not again:
            break
    lost = False
    for body in bodies:
        keep_figures(members[body], notes[body])
        lost = lost or notes[body, FAULT] == DIVERGED
    for meeting in meetings:
        if lost:  # what diverged stays where it was, and numbers that are none are not carried on
            stand(touch, meeting, held, kept, 1.0)
            touch.met[meeting, :] = 0.0
        else:
            keep_rows(touch, meeting, kept)
