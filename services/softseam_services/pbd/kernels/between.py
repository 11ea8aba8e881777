"""Contact between bodies of a pile, within each substep: points of either press on faces of the other, and rub.

A point x_p, of half the area A that it stands for, is from the nearest face, that looks towards it, g = n . d away,
d = x_p - sum_i s_i x_i, with the face's corners x_i, the weights s of the nearest place and the normal n there: as they
will be if bodies go on as they do, kept over the step (`touch`). Its force f = p n + t is solved as that of a point on
a tool with compliance, eq. (3) of `contact`, with 1/r of both bodies (softseam_coupling.interfaces.contact):

    c = h^2 (w_p + sum_i s_i^2 w_i),  alpha = 1/r
    p = max(0, p_old - (g + alpha p_old)/(c + alpha)),  t = t_old - (d' + alpha (t_old - t_0))/(c + alpha)        (1)

cut off to |t| <= mu p, d' being how far d went across n in the substep and t_0 the force as it began: what sticks under
a force that stays does not creep. The point moves by h^2 w_p df, the corners by -h^2 s_i w_i df: no pair of bodies
gains momentum. Forces stay in the nodes' accelerations from one substep to the next, and by points from one step to the
next. Rows are solved by eights that share no node (`eights`).
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import njit, record

from . import eights as col
from .lanes import LANES, aligned, batch_kernel, lane_kernel, move_four, transpose_four
from .pairs import EIGHT
from .touch import CORNER, GIVES, PLACE, POINT, SIDE, stand

W = 3
"""row of the workspace with the points' inverse masses [1/kg]; their places are in those before, and the three corners
follow likewise"""
_SOLVED, _SINCE, _SUMS = 16, 16 + col.N_SOLVED, 16 + col.N_SOLVED + col.N_SINCE
N_SUMS = 8
"""of the rows of a body's points in a meeting: f (3) [N], x_p x f (3) [N m], work on that body [J], and on both [J]"""
_FELT = _SUMS + N_SUMS
N_WORKSPACE = (_FELT + 1) * EIGHT

DEPTH, LARGEST, WORK, IMPULSE = 0, 1, 2, 3
N_MET = 6
"""of a meeting in a step: how deep points are inside the other body at its end [m], the largest force on one [N], work
on both bodies [J], and the impulse on the first (3,) [N s]"""


@record
class Books(NamedTuple):
    """What rows did in a step, to b bodies in m meetings."""

    work: Floats
    """on each body (b,) [J]"""
    turned: Floats
    """angular momentum that they gave each, about its centre (b, 3) [kg m^2/s]"""
    met: Floats
    """of each meeting, see `N_MET` (m, N_MET)"""
    sums: Floats
    """of the points of each body in a meeting, of the substep that is over, see `N_SUMS` (2 m, N_SUMS)"""
    centre: Floats
    """of each body, as the substep began (b, 3) [m]"""
    ws: Floats
    """scratch (N_WORKSPACE,)"""
    lanes: int
    """EIGHT, which the compiler does not know here: it would write loops over so few lanes out, number by number"""


def new_books(b: int, m: int) -> Books:
    """Of b bodies in m meetings."""
    met, sums = np.zeros((m, N_MET)), np.zeros((2 * m, N_SUMS))
    return Books(np.zeros(b), np.zeros((b, 3)), met, sums, np.zeros((b, 3)), aligned(N_WORKSPACE), EIGHT)


@lane_kernel
def _gather(ws, xw, laid, eight):
    """Positions and inverse masses of the points and corners of an eight."""
    for half in range(0, 4 * EIGHT, LANES):
        at, of = 4 * EIGHT * (half // EIGHT) + half % EIGHT, col.NODE + half
        transpose_four(
            *(ws, at, at + EIGHT, at + 2 * EIGHT, at + 3 * EIGHT, xw),
            *(4 * laid[eight, of], 4 * laid[eight, of + 1], 4 * laid[eight, of + 2], 4 * laid[eight, of + 3]),
        )


@lane_kernel
def _scatter(ws, xw, laid, eight):
    """The way back of `_gather`."""
    for half in range(0, 4 * EIGHT, LANES):
        at, of = 4 * EIGHT * (half // EIGHT) + half % EIGHT, col.NODE + half
        transpose_four(
            *(xw, 4 * laid[eight, of], 4 * laid[eight, of + 1], 4 * laid[eight, of + 2], 4 * laid[eight, of + 3]),
            *(ws, at, at + EIGHT, at + 2 * EIGHT, at + 3 * EIGHT),
        )


@lane_kernel
def _load(ws, to, numbers, eight, count):
    """Numbers of an eight, so many for each row, into the workspace."""
    for four in range(0, EIGHT * count, LANES):
        move_four(ws, EIGHT * to + four, numbers, EIGHT * count * eight + four)


@lane_kernel
def _store(ws, of, numbers, eight, count, first, end):
    """Those from first to end - 1 the way back."""
    for four in range(EIGHT * first, EIGHT * end, LANES):
        move_four(numbers, EIGHT * count * eight + four, ws, EIGHT * of + four)


@lane_kernel
def _away(ws, lane, c):
    """Component c of d."""
    at = lane + EIGHT * c
    share = lane + EIGHT * (_SOLVED + col.OF_SHARE)
    way = ws[at] - ws[share] * ws[at + 4 * EIGHT]
    return way - ws[share + EIGHT] * ws[at + 8 * EIGHT] - ws[share + 2 * EIGHT] * ws[at + 12 * EIGHT]


@lane_kernel
def _solve(ws, lane, hh):
    """Eq. (1) for one row: force, point and corners are moved."""
    row = lane + EIGHT * _SOLVED
    nx, ny = ws[row + EIGHT * col.OF_NORMAL], ws[row + EIGHT * (col.OF_NORMAL + 1)]
    nz = ws[row + EIGHT * (col.OF_NORMAL + 2)]
    fx, fy, fz = ws[row + EIGHT * col.FORCE], ws[row + EIGHT * (col.FORCE + 1)], ws[row + EIGHT * (col.FORCE + 2)]
    soft, stiff, rub = ws[row + EIGHT * col.OF_SOFT], ws[row + EIGHT * col.STIFF], ws[row + EIGHT * col.OF_RUB]
    dx, dy, dz = _away(ws, lane, 0), _away(ws, lane, 1), _away(ws, lane, 2)
    old = max(0.0, fx * nx + fy * ny + fz * nz)
    p = max(0.0, old - (dx * nx + dy * ny + dz * nz + soft * old) * stiff)
    tx = fx - (dx - ws[row + EIGHT * col.REST] + soft * fx) * stiff
    ty = fy - (dy - ws[row + EIGHT * (col.REST + 1)] + soft * fy) * stiff
    tz = fz - (dz - ws[row + EIGHT * (col.REST + 2)] + soft * fz) * stiff
    tn = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - tn * nx, ty - tn * ny, tz - tn * nz
    square, bound = tx * tx + ty * ty + tz * tz, rub * p
    sticks = square <= bound * bound
    scale = 1.0 if sticks else bound / np.sqrt(1.0 if sticks else square)
    gx, gy, gz = p * nx + scale * tx, p * ny + scale * ty, p * nz + scale * tz
    ws[row + EIGHT * col.FORCE], ws[row + EIGHT * (col.FORCE + 1)], ws[row + EIGHT * (col.FORCE + 2)] = gx, gy, gz
    gx, gy, gz = gx - fx, gy - fy, gz - fz
    step = hh * ws[lane + EIGHT * W]
    ws[lane] += step * gx
    ws[lane + EIGHT] += step * gy
    ws[lane + EIGHT * 2] += step * gz
    step = hh * ws[row + EIGHT * col.OF_SHARE] * ws[lane + EIGHT * (4 + W)]
    ws[lane + EIGHT * 4] -= step * gx
    ws[lane + EIGHT * 5] -= step * gy
    ws[lane + EIGHT * 6] -= step * gz
    step = hh * ws[row + EIGHT * (col.OF_SHARE + 1)] * ws[lane + EIGHT * (8 + W)]
    ws[lane + EIGHT * 8] -= step * gx
    ws[lane + EIGHT * 9] -= step * gy
    ws[lane + EIGHT * 10] -= step * gz
    step = hh * ws[row + EIGHT * (col.OF_SHARE + 2)] * ws[lane + EIGHT * (12 + W)]
    ws[lane + EIGHT * 12] -= step * gx
    ws[lane + EIGHT * 13] -= step * gy
    ws[lane + EIGHT * 14] -= step * gz


@lane_kernel
def _feel(ws, lane):
    """FELT of a row: positive where it is pressed, or was."""
    row = lane + EIGHT * _SOLVED
    gap = _away(ws, lane, 0) * ws[row + EIGHT * col.OF_NORMAL]
    gap += _away(ws, lane, 1) * ws[row + EIGHT * (col.OF_NORMAL + 1)]
    gap += _away(ws, lane, 2) * ws[row + EIGHT * (col.OF_NORMAL + 2)]
    fx, fy, fz = ws[row + EIGHT * col.FORCE], ws[row + EIGHT * (col.FORCE + 1)], ws[row + EIGHT * (col.FORCE + 2)]
    ws[lane + EIGHT * _FELT] = max(0.0, -gap) + abs(fx) + abs(fy) + abs(fz)


@batch_kernel
def _is_open(ws, lanes):
    """Whether no row of an eight is pressed, or was."""
    for lane in range(lanes):
        _feel(ws, lane)
    felt = 0.0
    for lane in range(EIGHT):
        felt += ws[lane + EIGHT * _FELT]
    return felt == 0.0


@batch_kernel
def _solve_eight(ws, lanes, hh):
    for lane in range(lanes):
        _solve(ws, lane, hh)


@batch_kernel
def project_rows(eights, first, end, books, xw, hh):
    """Solve (1) for the eights first .. end - 1, one after the other; hh is the substep squared [s^2]. xw is moved."""
    laid, solved, ws, lanes = eights.laid, eights.solved, books.ws, books.lanes
    for eight in range(first, end):
        _gather(ws, xw, laid, eight)
        _load(ws, _SOLVED, solved, eight, col.N_SOLVED)
        if _is_open(ws, lanes):
            continue
        _solve_eight(ws, lanes, hh)
        _store(ws, _SOLVED, solved, eight, col.N_SOLVED, col.FORCE, col.N_SOLVED)
        _scatter(ws, xw, laid, eight)


@lane_kernel
def _look(ws, lane):
    """What a row did in the substep that is over, and BEGAN, AWAY, REST for the next."""
    row, since, sums = lane + EIGHT * _SOLVED, lane + EIGHT * _SINCE, lane + EIGHT * _SUMS
    px, py, pz = ws[lane], ws[lane + EIGHT], ws[lane + 2 * EIGHT]
    dx, dy, dz = _away(ws, lane, 0), _away(ws, lane, 1), _away(ws, lane, 2)
    fx, fy, fz = ws[row + EIGHT * col.FORCE], ws[row + EIGHT * (col.FORCE + 1)], ws[row + EIGHT * (col.FORCE + 2)]
    ws[sums], ws[sums + EIGHT], ws[sums + 2 * EIGHT] = fx, fy, fz
    ws[sums + 3 * EIGHT], ws[sums + 4 * EIGHT] = py * fz - pz * fy, pz * fx - px * fz
    ws[sums + 5 * EIGHT] = px * fy - py * fx
    work = fx * (px - ws[since + EIGHT * col.BEGAN]) + fy * (py - ws[since + EIGHT * (col.BEGAN + 1)])
    ws[sums + 6 * EIGHT] = work + fz * (pz - ws[since + EIGHT * (col.BEGAN + 2)])
    work = fx * (dx - ws[since + EIGHT * col.AWAY]) + fy * (dy - ws[since + EIGHT * (col.AWAY + 1)])
    ws[sums + 7 * EIGHT] = work + fz * (dz - ws[since + EIGHT * (col.AWAY + 2)])
    ws[since + EIGHT * col.BEGAN], ws[since + EIGHT * (col.BEGAN + 1)], ws[since + EIGHT * (col.BEGAN + 2)] = px, py, pz
    ws[since + EIGHT * col.AWAY], ws[since + EIGHT * (col.AWAY + 1)], ws[since + EIGHT * (col.AWAY + 2)] = dx, dy, dz
    soft = ws[row + EIGHT * col.OF_SOFT]
    ws[row + EIGHT * col.REST], ws[row + EIGHT * (col.REST + 1)] = dx + soft * fx, dy + soft * fy
    ws[row + EIGHT * (col.REST + 2)] = dz + soft * fz


@batch_kernel
def _look_at_eight(ws, lanes):
    for lane in range(lanes):
        _look(ws, lane)


@batch_kernel
def look_at_rows(eights, first, end, books, xw):
    """A substep is over at xw, or the first one begins: what the eights first .. end - 1 did is added to the sums."""
    laid, solved, since = eights.laid, eights.solved, eights.since
    ws, lanes, sums = books.ws, books.lanes, books.sums
    for eight in range(first, end):
        _gather(ws, xw, laid, eight)
        _load(ws, _SOLVED, solved, eight, col.N_SOLVED)
        _load(ws, _SINCE, since, eight, col.N_SINCE)
        _look_at_eight(ws, lanes)
        _store(ws, _SOLVED, solved, eight, col.N_SOLVED, col.REST, col.FORCE)
        _store(ws, _SINCE, since, eight, col.N_SINCE, 0, col.N_SINCE)
        for lane in range(EIGHT):
            side, of = laid[eight, col.OF_SIDE + lane], EIGHT * _SUMS + lane
            for k in range(N_SUMS):
                sums[side, k] += ws[of + EIGHT * k]


@njit(cache=True, error_model="numpy")
def account_rows(touch, meetings, books, h):
    """A substep of h [s] is over: enter what rows did, by their sums, which are 0 then.

    Force and reaction are on one line, and count about where the body's centre was as the substep began: where sweeps
    leave a remainder, `turning.give_back` sees to it.
    """
    sums, centre = books.sums, books.centre
    for meeting in meetings:
        for side in range(2):
            own, other = touch.pair[meeting, side], touch.pair[meeting, 1 - side]
            row = sums[2 * meeting + side]
            for c in range(3):
                j, k = (c + 1) % 3, (c + 2) % 3
                books.turned[own, c] += h * (row[3 + c] - (centre[own, j] * row[k] - centre[own, k] * row[j]))
                books.turned[other, c] -= h * (row[3 + c] - (centre[other, j] * row[k] - centre[other, k] * row[j]))
            books.work[own] += row[6]
            books.work[other] += row[7] - row[6]
            books.met[meeting, WORK] += row[7]
            for c in range(3):
                books.met[meeting, IMPULSE + c] += h * row[c] if side == 0 else -h * row[c]
            row[:] = 0.0


@njit(cache=True, error_model="numpy")
def begin_rows(touch, eights, first, end, now, cold, hh):
    """An attempt at a step begins, in substeps of hh squared [s^2]: rows carry what they did, or nothing where it is
    cold."""
    held, ints, rows = touch.forces[now], touch.ints, touch.rows
    for eight in range(first, end):
        solved = eights.solved[eight]
        for lane in range(EIGHT):
            r = eights.laid[eight, col.ROW + lane]
            if r < 0:
                continue
            gives = rows[r, GIVES]
            solved[EIGHT * col.STIFF + lane] = (
                1.0 / (hh * gives + solved[EIGHT * col.OF_SOFT + lane]) if gives > 0.0 else 0.0
            )
            for c in range(3):
                solved[EIGHT * (col.FORCE + c) + lane] = 0.0 if cold else held[ints[r, PLACE], c]


@njit(cache=True, error_model="numpy")
def pull_rows(members, touch, meetings, now):
    """Add the forces that rows carry to what blocks pull with, see `substep.carried`."""
    held = touch.forces[now]
    for meeting in meetings:
        if touch.visits[meeting]:
            continue
        for r in range(touch.start[meeting], touch.start[meeting + 1]):
            ints, row = touch.ints[r], touch.rows[r]
            side, place = ints[SIDE] % 2, ints[PLACE]
            own, other = touch.pair[meeting, side], touch.pair[meeting, 1 - side]
            mine, theirs = members[own].scratch.pull, members[other].scratch.pull
            for c in range(3):
                mine[ints[POINT] - touch.row[own], c] += held[place, c]
                for k in range(3):
                    theirs[ints[CORNER + k] - touch.row[other], c] -= row[k] * held[place, c]


@njit(cache=True, error_model="numpy")
def end_rows(touch, eights, first, end, meetings, books, now, lost):
    """A step is over, or was lost: what is kept of it."""
    kept = touch.forces[1 - now]
    for meeting in meetings:
        if lost:  # what diverged stays where it was, and numbers that are none are not carried on
            stand(touch, meeting, now, 1.0)
            books.met[meeting, :] = 0.0
        else:
            touch.carries[1 - now, meeting] = True
    if lost:
        return
    for eight in range(first, end):
        solved, since = eights.solved[eight], eights.since[eight]
        for lane in range(EIGHT):
            r = eights.laid[eight, col.ROW + lane]
            if r < 0:
                continue
            depth, square, met = 0.0, 0.0, books.met[touch.ints[r, SIDE] // 2]
            for c in range(3):
                f = solved[EIGHT * (col.FORCE + c) + lane]
                square += f * f
                depth -= solved[EIGHT * (col.OF_NORMAL + c) + lane] * since[EIGHT * (col.AWAY + c) + lane]
                kept[touch.ints[r, PLACE], c] = f
            met[DEPTH], met[LARGEST] = max(met[DEPTH], depth), max(met[LARGEST], np.sqrt(square))
