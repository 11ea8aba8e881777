"""A step of bodies of a pile that touch one another: all are at the same substep, and their contacts are solved in it.

A body's own part of it is that of one alone (`substep`, `relax`, `pile`), with the substeps and sweeps of whichever
needs most. Contacts between bodies (`between`) come before those with tools, so that no point ends inside a tool. Where
one body's step is not believed, all are tried again.
"""

import numpy as np

from softseam_services.jit import njit

from .between import account_rows, begin_rows, end_rows, look_at_rows, project_rows, pull_rows
from .contact import account_pairs, project_contacts
from .damping import damping_share
from .fours import end_fours, form_fours, soften_lane, sweep_four
from .guests import begin_guests, end_guests, place_guests, project_patches, push_guests
from .hold import soften_held_blocks
from .lanes import LANES
from .pairs import EIGHT
from .patches import (
    account_patches,
    begin_patches,
    clear_patches,
    keep_patches,
    open_patches,
    pull_patches,
    settle_patches,
)
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

ALONE = 8
"""substeps, and sweeps of each, of guests that touch none but one another"""


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
def _open(one, body, touch, books, xw, inputs, dt, n_substeps, n_sweeps, substep, team, ws):
    """A substep of a body begins, until rows are to be solved."""
    h = dt / n_substeps
    share = damping_share(one.parameters.stiffness_time, one.parameters.lag, h, n_sweeps)
    _find_centre(one, xw, touch.row[body], books.centre[body])
    open_substep(one.model, one.parameters, one.after, inputs, one.scratch, dt, h, substep, n_substeps)
    predict_all(one.model, one.parameters, one.after, one.scratch, h, substep, n_substeps, share, team, 0, 0, 0, ws)
    _sweep(one, 0, share, h, team, ws)


@njit(cache=True, error_model="numpy")
def _sweep(one, round_, share, h, team, ws):
    model, parameters, stress, scratch = one.model, one.parameters, one.after.stress, one.scratch
    sweep_round(model, parameters, stress, scratch, round_, share, h, one.all, 0, team, 0, 0, ws)


@njit(cache=True, error_model="numpy")
def _close(one, share, h, n_substeps, team):
    """A substep of a body is over."""
    if share > 0.0:
        end_together(one.model, one.after.stress, one.scratch, share, 0, team, 0, 0)
    finish_all(one.after, one.scratch, h, team, 0, 0, 0)
    account_pairs(one.model, one.parameters, one.scratch.contacts, one.scratch.xw, 1.0 / n_substeps)


@njit(cache=True, error_model="numpy")
def _open_visits(members, group, touch, visits, xw, substep, n_substeps):
    """A substep of patches and guests begins."""
    patches, guests = visits
    open_patches(members, touch, patches, group[1], group[0], xw, guests)
    place_guests(guests, group[4], patches, group[1], substep, n_substeps)


@njit(cache=True, error_model="numpy")
def _close_visits(group, visits, touch, books, xw, h, n_substeps):
    """And is over."""
    patches, guests = visits
    push_guests(guests, group[4], patches, group[1])
    for meeting in group[1]:
        account_patches(touch, books, patches, meeting, xw, guests, h, n_substeps)


@njit(cache=True, error_model="numpy")
def _between_rows(one, h, softens):
    """Contacts of a body with tools, and which of its blocks these hold, between two solves of the rows."""
    contacts = one.scratch.contacts
    project_contacts(one.model, one.parameters, contacts, one.scratch.xw, h * h, True)
    if softens:
        soften_held_blocks(one.model, one.parameters, contacts, one.scratch.softness)


@njit(cache=True, error_model="numpy")
def _four(members, fours, four, xw, h, sweeps, ws):
    """What comes between two solves of the rows, of the bodies of a four."""
    for lane in range(LANES):
        body = fours.bodies[four, lane]
        if body < 0:
            break
        _between_rows(members[body], h, sweeps)
        if sweeps:
            soften_lane(members[body], fours, four, lane)
    if sweeps:
        sweep_four(members[fours.bodies[four, 0]], fours, four, xw, h, ws)


@njit(cache=True, error_model="numpy")
def _substeps(members, group, touch, eights, fours, visits, books, xw, inputs, dt, n_substeps, n_sweeps, team, ws):
    """All substeps of bodies that meet. What is a body's own between two solves of the rows comes at one go, while its
    numbers are in the cache: those of many bodies are not."""
    bodies, meetings, first, end, _ = group
    patches, guests = visits
    h = dt / n_substeps
    alone = np.empty(len(bodies), dtype=np.int64)
    n_fours, n_alone = form_fours(members, touch.row, fours, bodies, len(xw) - EIGHT, alone)
    _open_visits(members, group, touch, visits, xw, 0, n_substeps)
    for body in bodies:
        _open(members[body], body, touch, books, xw, inputs, dt, n_substeps, n_sweeps, 0, team, ws)
    for substep in range(n_substeps):
        for round_ in range(n_sweeps + 1):
            project_rows(eights, first, end, books, xw, h * h)
            project_patches(members, touch, patches, meetings, bodies, xw, h * h, guests, n_substeps)
            for four in range(n_fours):
                _four(members, fours, four, xw, h, round_ < n_sweeps, ws)
            for i in range(n_alone):
                one = members[alone[i]]
                _between_rows(one, h, round_ < n_sweeps)
                if round_ < n_sweeps:
                    share = damping_share(one.parameters.stiffness_time, one.parameters.lag, h, n_sweeps)
                    _sweep(one, round_ + 1, share, h, team, ws)
        look_at_rows(eights, first, end, books, xw)
        account_rows(touch, meetings, books, h)
        _close_visits(group, visits, touch, books, xw, h, n_substeps)
        if substep + 1 < n_substeps:
            _open_visits(members, group, touch, visits, xw, substep + 1, n_substeps)
        for body in bodies:
            one = members[body]
            share = damping_share(one.parameters.stiffness_time, one.parameters.lag, h, n_sweeps)
            _close(one, share, h, n_substeps, team)
            if substep + 1 < n_substeps:
                _open(one, body, touch, books, xw, inputs, dt, n_substeps, n_sweeps, substep + 1, team, ws)
    end_fours(members, fours, n_fours)


@njit(cache=True, error_model="numpy")
def _attempt(members, group, touch, eights, fours, visits, now, books, xw, inputs, number, dt, team, ws, notes):
    """One attempt at a step of bodies that touch."""
    bodies, meetings, first, end, which = group
    patches, guests = visits
    n_substeps, n_sweeps = (1, 0) if len(bodies) else (ALONE, ALONE)
    for body in bodies:
        begin_attempt(members[body], inputs, number, dt)
        own_substeps, own_sweeps = substeps_and_sweeps(members[body], number)
        n_substeps, n_sweeps = max(n_substeps, own_substeps), max(n_sweeps, own_sweeps)
    h = dt / n_substeps
    for body in bodies:
        one = members[body]
        open_step(one.model, one.parameters, one.after, inputs, one.scratch, dt, h)
        pull_blocks(one.model, one.parameters, one.after, one.scratch, one.all, team, 0, 0, 0, ws)
    begin_rows(touch, eights, first, end, now, number >= COLD, h * h)
    if number < COLD:
        pull_rows(members, touch, meetings, now)
    begin_patches(patches, meetings, touch.forces[now], number >= COLD)
    pull_patches(members, touch, patches, meetings)
    begin_guests(guests, which, patches, meetings, n_substeps)
    settle_patches(touch, patches, meetings, touch.forces[now], xw, guests)
    clear_patches(members, touch, patches, meetings, xw, guests)
    for body in bodies:
        one = members[body]
        carried(one.model, one.parameters, one.after, one.scratch.xw, one.scratch.pull)
    look_at_rows(eights, first, end, books, xw)
    _clear(books, bodies, meetings)
    _substeps(members, group, touch, eights, fours, visits, books, xw, inputs, dt, n_substeps, n_sweeps, team, ws)
    end_guests(guests, which, n_substeps, False)
    for body in bodies:
        one = members[body]
        share = damping_share(one.parameters.stiffness_time, one.parameters.lag, h, n_sweeps)
        look_at_blocks(one.model, one.parameters, one.after, one.scratch, h, n_substeps, share, team, 0, 0, 0, ws)
        close_step(one.model, one.parameters, one.after, inputs, one.scratch, one.outputs, n_substeps, 0.0)
        one.outputs.result[SEAM_WORK] = books.work[body]
        end_attempt(one, number, dt, n_substeps, n_sweeps, books.turned[body], notes[body])


@njit(cache=True, error_model="numpy")
def _clear(books, bodies, meetings):
    """No substep is over yet."""
    for body in bodies:
        books.work[body] = 0.0
        books.turned[body, :] = 0.0
    for meeting in meetings:
        books.met[meeting, :] = 0.0
        books.sums[2 * meeting : 2 * meeting + 2, :] = 0.0


@njit(cache=True, error_model="numpy")
def _advance(members, group, touch, eights, fours, visits, now, books, xw, inputs, dt, team, ws, notes):
    """A step of bodies that touch, tried until all are believed."""
    bodies, meetings, first, end, which = group
    patches, guests = visits
    for body in bodies:
        notes[body, :] = 0
    causes = np.full(len(bodies), NONE)
    for number in range(RETRIES + 1):
        _attempt(members, group, touch, eights, fours, visits, now, books, xw, inputs, number, dt, team, ws, notes)
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
    end_rows(touch, eights, first, end, meetings, books, now, lost)
    if lost:
        end_guests(guests, which, 1, True)
        return
    for meeting in meetings:
        keep_patches(touch, patches, meeting, touch.forces[1 - now])


@njit(cache=True, error_model="numpy", nogil=True)
def advance_touching(
    members, n_groups, groups, touch, eights, fours, now, books, patches, guests, xw, inputs, dt, team, ws, notes
):
    """A step of dt [s] of the bodies of all groups, from their `before` into their `after`, group after group.

    groups, eights  so many groups, of the rows in `touch`; guests are among their bodies, and meet them by patches
    fours           see `fours`, of all bodies of the pile
    now             which of the forces between bodies the step begins with; the others are what it ends with
    xw              positions and inverse masses of all bodies of the pile
    notes           of each body (b, N_NOTES), overwritten for these
    """
    for at in range(n_groups):
        bodies = groups.bodies[groups.first_body[at] : groups.first_body[at + 1]]
        meetings = groups.meetings[groups.first_meeting[at] : groups.first_meeting[at + 1]]
        n_own = np.searchsorted(bodies, guests.n_own[0])
        which = bodies[n_own:] - guests.n_own[0]
        group = bodies[:n_own], meetings, groups.first_eight[at], groups.first_eight[at + 1], which
        visits = patches, guests
        _advance(members, group, touch, eights, fours, visits, now, books, xw, inputs, dt, team, ws, notes)
