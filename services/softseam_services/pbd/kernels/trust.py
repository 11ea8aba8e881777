"""Whether a step can be believed: what the monitor of a PBD region computes, see `pbd.watch` for its words."""

import numpy as np

from softseam_services.jit import njit

from . import summary as k

RETRIES = 3
"""how often a failed step is tried again, each time with twice the substeps and one more sweep"""
COLD = 2
"""attempt from which on carried forces start from zero, because those of a torn shape throw the nodes apart"""
COLLAPSED = 1e-4
"""largest stretch below which a body has no shape left, and none of its forces a direction"""
RISE = 0.5
"""largest rise of the energy in a step beyond the work done on it, relative to energy plus work; impacts reach 0.1"""
CRUSHED, STRETCHED, LAGGING = 0.3, 3.0, 0.6
"""a volume ratio below, a stretch or a residual above these takes two sweeps in the next step: one is not always enough
to turn a block right side out"""
GROWTH = 1.5
"""a residual above LAGGING that grew by more than this in a step has the step repeated once"""
GAIN = 0.02
"""energy from nowhere, added up while tools touch and relative to what is there, that takes shorter substeps"""
SHORTEST = 2
"""how often substeps are halved for it"""
PATIENCE = 8.0
"""steps after which nothing has come from nowhere, beyond roundoff, until substeps are twice as long again, the first
time; then twice as many each time"""
LITTLE = 1e4
"""energy that counts as there at least, times the roundoff: that of 1 % shear"""

LEAST_J, KINETIC, STRAIN, GRAVITY, UNSHARED, RESIDUAL, STRETCH, CREATED, HALVINGS, CALM, DOUBLINGS, STORED = range(12)
N_MONITOR = 12
"""what a state remembers of its last step: least volume ratio, energies [J], 1 where contact forces wait to be shared
out among tools, residual, largest stretch, energy from nowhere since it was last least [J], halvings of the substep,
calm steps since the last one, how often substeps became longer again, and what contact stores [J], below 0 where
that is not known"""
NONE, DIVERGED, HASTE, ENERGY = range(4)
"""what may be wrong with a step, see `pbd.watch.Fault`"""


@njit(cache=True, error_model="numpy")
def rise(result, monitor):
    """By how much the energy rose beyond the work that was done on the body, and what contact gave back [J]."""
    grown = result[k.KINETIC] + result[k.STRAIN] + result[k.GRAVITY]
    grown = grown - monitor[KINETIC] - monitor[STRAIN] - monitor[GRAVITY]
    return grown - result[k.TOOL_WORK] - result[k.SEAM_WORK] - result[k.APPARENT]


@njit(cache=True, error_model="numpy")
def there(result, floor):
    """Energy that counts as there as a step ends [J]; floor [J] is roundoff."""
    return max(result[k.KINETIC] + result[k.STRAIN], LITTLE * floor)


@njit(cache=True, error_model="numpy")
def fault_of(result, monitor, floor):
    """What is wrong with a step of this result (N_RESULTS,) after one that left `monitor`; floor [J] is roundoff."""
    total = 0.0
    for each in result:
        total += each
    if not np.isfinite(total):
        return DIVERGED
    tools, seam = result[k.TOOL_WORK], result[k.SEAM_WORK]
    scale = monitor[KINETIC] + monitor[STRAIN] + abs(tools) + abs(seam) + result[k.PUSHED] + floor
    if result[k.HASTE] > result[k.STRAIN] + floor:
        return HASTE
    return ENERGY if rise(result, monitor) > RISE * scale else NONE


@njit(cache=True, error_model="numpy")
def remember(monitor, result, floor, planned, fed):
    """monitor (N_MONITOR,) <- the figures of a step; what waits to be shared out stays. floor [J] is roundoff.

    A body that gains energy while tools touch it, or had to repeat a step for that (fed), takes half the substep until
    none does; returns whether that begins or is halved once more. Where its substeps are planned, and so are stable,
    what gained was a knock or the like: they are longer again once nothing has come from nowhere for a while,
    `PATIENCE`. If that was too early the next time comes twice as late, so that n steps see log2(n/8) such trials at
    most. Others may be unstable for good.
    """
    created = max(0.0, monitor[CREATED] + rise(result, monitor) - result[k.PUSHED])
    touched = result[k.N_CONTACTS] > 0.0
    halves = touched and (fed or created > GAIN * there(result, floor)) and monitor[HALVINGS] < SHORTEST
    calm = monitor[CALM] + 1.0 if created <= floor else 0.0
    longer = planned and monitor[HALVINGS] > 0.0 and calm >= PATIENCE * 2.0 ** monitor[DOUBLINGS]
    change = 1.0 if halves else -1.0 if longer else 0.0
    monitor[HALVINGS] = monitor[HALVINGS] + change if touched else 0.0
    monitor[CALM] = calm if touched and change == 0.0 else 0.0
    monitor[DOUBLINGS] = monitor[DOUBLINGS] + (1.0 if longer else 0.0) if touched else 0.0
    monitor[CREATED] = created if touched and not halves else 0.0
    monitor[LEAST_J], monitor[RESIDUAL], monitor[STRETCH] = result[k.LEAST_J], result[k.RESIDUAL], result[k.STRETCH]
    monitor[KINETIC], monitor[STRAIN], monitor[GRAVITY] = result[k.KINETIC], result[k.STRAIN], result[k.GRAVITY]
    monitor[STORED] = result[k.STORED]
    return halves


@njit(cache=True, error_model="numpy")
def needs_two_sweeps(monitor):
    """Whether the step after this one must solve more than once a substep."""
    return monitor[LEAST_J] < CRUSHED or monitor[STRETCH] > STRETCHED or monitor[RESIDUAL] > LAGGING


@njit(cache=True, error_model="numpy")
def grows(result, monitor):
    """Whether the residual of a step that may be believed grew so much that it is worth repeating."""
    return result[k.RESIDUAL] > max(LAGGING, GROWTH * monitor[RESIDUAL])


@njit(cache=True, error_model="numpy")
def feeds(result, monitor, floor):
    """Whether a step that may be believed, in which tools touch, gained so much that it is worth repeating."""
    gained = rise(result, monitor) - result[k.PUSHED]
    return result[k.N_CONTACTS] > 0.0 and gained > GAIN * there(result, floor)
