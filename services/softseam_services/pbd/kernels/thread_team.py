"""Two threads at one step: both run the same kernel and share its loops by a common count, bit for bit as one would.

A step is a row of *stretches*, in each of which no item needs another's result: the batches of one colour, or nodes.
Thread 0 takes from the low end and thread 1 from the high end, each time half of what is left, so that each meets its
own part of the body again in every sweep and whoever is done first helps the other. A stretch opens when everything
before it is done. What is not shared (contacts, sums) is thread 0's and counts as one item. Nothing waits for a thread
that has not come: one that the system holds up, or never starts, costs nothing but its help.

The count `team` (TEAM,) int64 says at COUNT: the stretch and, of its items left, the first and the end; and at DONE and
DONE + LINE: items that each thread has done in this step. Alone, team[ALONE] is 1 and none of it is used.
"""

from typing import Any

import numpy as np
from numba import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from softseam_services.jit import njit

LINE = 16
"""numbers in two lines of the cache: so far apart, what one thread writes does not stop the other"""
COUNT, DONE, ALONE, TEAM = 0, LINE, 3 * LINE, 4 * LINE
BITS = 22
"""of a place in a stretch, which so has fewer than 4 million items; the 19 above two of them count stretches"""
MASK = (1 << BITS) - 1
PATIENCE = 2000
"""looks at the count before a waiting thread lets others have the core"""

_yield_core: Any = types.ExternalFunction("sched_yield", types.int32())


def new_team(alone: bool) -> NDArray[np.int64]:
    """A count for a step."""
    team = np.zeros(TEAM, dtype=np.int64)
    team[ALONE] = alone
    start_team(team)
    return team


def start_team(team: NDArray[np.int64]) -> None:
    """Nothing is open and nothing done; no thread may be at work."""
    team[COUNT], team[DONE], team[DONE + LINE] = -1, 0, 0


def _address(context, builder, kind, array, at):
    return builder.gep(context.make_array(kind)(context, builder, array).data, [at])


@intrinsic
def _look(typing, team, at):
    def generate(context, builder, signature, arguments):
        place = _address(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(place, ordering="acquire", align=8)

    return types.int64(team, at), generate


@intrinsic
def _add(typing, team, at, n):
    def generate(context, builder, signature, arguments):
        place = _address(context, builder, signature.args[0], *arguments[:2])
        builder.atomic_rmw("add", place, arguments[2], ordering="acq_rel")
        return context.get_dummy_value()

    return types.void(team, at, types.int64), generate


@intrinsic
def _replace(typing, team, at, old, new):
    def generate(context, builder, signature, arguments):
        place = _address(context, builder, signature.args[0], *arguments[:2])
        result = builder.cmpxchg(place, arguments[2], arguments[3], "acq_rel", "acquire")
        return builder.extract_value(result, 1)

    return types.boolean(team, at, types.int64, types.int64), generate


def _look_plain(team, at):
    return team[at]


def _add_plain(team, at, n):
    team[at] += n


def _replace_plain(team, at, old, new):
    same = team[at] == old
    if same:
        team[at] = new
    return same


def _yield_plain():
    return 0


_PLAIN: bool = vars(config)["DISABLE_JIT"]
look: Any = _look_plain if _PLAIN else _look
add: Any = _add_plain if _PLAIN else _add
replace: Any = _replace_plain if _PLAIN else _replace
yield_core: Any = _yield_plain if _PLAIN else _yield_core


@njit(cache=True, error_model="numpy")
def wait_for(team, before):
    """Come back when `before` items are done; alone, at once."""
    if team[ALONE]:
        return
    looks = 0
    while look(team, DONE) + look(team, DONE + LINE) < before:
        looks += 1
        if looks > PATIENCE:
            yield_core()


@njit(cache=True, error_model="numpy")
def done(team, worker, n):
    """n items are done: what they wrote is seen by whoever sees the new count. Alone, nothing."""
    if not team[ALONE]:
        add(team, DONE + LINE * worker, n)


@njit(cache=True, error_model="numpy")
def take(team, stretch, worker, least):
    """First and end of half the items that nobody has taken, or of `least`; (0, 0) where none are left."""
    while True:
        count = look(team, COUNT)
        low, high = (count >> BITS) & MASK, count & MASK
        if count >> (2 * BITS) != stretch or low >= high:
            return 0, 0
        part = min(high - low, max(least, (high - low + 1) // 2))
        if worker == 0:
            if replace(team, COUNT, count, count + (part << BITS)):
                return low, low + part
        elif replace(team, COUNT, count, count - part):
            return high - part, high


@njit(cache=True, error_model="numpy")
def first_range(team, before, stretch, n, worker, least):
    """Wait for the items before this stretch, open it if nobody else did, and take of its n items; alone, all."""
    if team[ALONE]:
        return 0, n
    wait_for(team, before)
    count = look(team, COUNT)
    if count >> (2 * BITS) < stretch:
        replace(team, COUNT, count, (stretch << (2 * BITS)) | n)
    return take(team, stretch, worker, least)


@njit(cache=True, error_model="numpy")
def next_range(team, stretch, worker, n_done, least):
    """Report items done and take more; alone, there are none."""
    if team[ALONE]:
        return 0, 0
    done(team, worker, n_done)
    return take(team, stretch, worker, least)
