"""Whether a step can be believed, and what is done at once where it cannot: the monitor of the PBD participant."""

import math
from enum import Enum

from softseam_protocol.messages.outcomes import Detail, Status
from softseam_services.body.body import Floats

from .kernels import summary as k

RETRIES = 3
"""how often a failed step is tried again, each time with twice the substeps and one more sweep"""
COLD = 2
"""attempt from which on carried forces start from zero, because those of a torn shape throw the nodes apart"""
RISE = 0.5
"""largest rise of the energy in a step beyond the work done on it, relative to energy plus work; impacts reach 0.1"""
CRUSHED, STRETCHED, LAGGING = 0.3, 3.0, 0.6
"""a volume ratio below, a stretch or a residual above these takes two sweeps in the next step: one is not always enough
to turn a block right side out"""
GROWTH = 1.5
"""a residual above LAGGING that grew by more than this in a step has the step repeated once"""
COLLAPSED = 1e-4
"""largest stretch below which a body has no shape left, and none of its forces a direction"""

GAIN = 0.02
"""energy from nowhere, added up while tools touch and relative to what is there, that takes shorter substeps"""
SHORTEST = 2
"""how often substeps are halved for it"""
GAINS = "gains energy where tools touch: shorter substeps while they do"
LITTLE = 1e4
"""energy that counts as there at least, times the roundoff: that of 1 % shear"""

LEAST_J, KINETIC, STRAIN, GRAVITY, UNSHARED, RESIDUAL, STRETCH, CREATED, HALVINGS = range(9)
N_MONITOR = 9
"""what a state remembers of its last step: least volume ratio, energies [J], 1 where contact forces wait to be shared
out among tools, residual, largest stretch, energy from nowhere since it was last least [J], halvings of the substep"""


class Fault(Enum):
    """Outcome of a step; the text names the remedy."""

    NONE = "converged"
    INPUT = "the request cannot be served"
    ANCHOR = "PBD takes a seam force that is constant over the step: leave coupling_target empty on this side"
    DIVERGED = "the blocks diverged: take a shorter step, more substeps or sweeps, or make the region fem"
    HASTE = "leapfrog's substep is beyond its limit: take more substeps, or method: xpbd"
    ENERGY = "the energy rises without work: take a shorter step, more substeps or sweeps, or make the region fem"

    @property
    def status(self) -> Status:
        """The same in a word."""
        return _STATUS[self]


_STATUS = {
    Fault.NONE: Status.CONVERGED,
    Fault.INPUT: Status.REFUSED,
    Fault.ANCHOR: Status.REFUSED,
    Fault.DIVERGED: Status.DIVERGED,
    Fault.HASTE: Status.DOUBTFUL,
    Fault.ENERGY: Status.DOUBTFUL,
}


def remember(monitor: Floats, result: Floats, floor: float) -> bool:
    """monitor (N_MONITOR,) <- the figures of a step; what waits to be shared out stays. floor [J] is roundoff.

    A body that gains energy while tools touch it takes half the substep until none does; returns whether that begins
    or is halved once more.
    """
    created = max(0.0, monitor[CREATED] + _rise(result, monitor) - result[k.PUSHED])
    touched = result[k.N_CONTACTS] > 0
    there = max(result[k.KINETIC] + result[k.STRAIN], LITTLE * floor)
    halves = bool(touched and created > GAIN * there and monitor[HALVINGS] < SHORTEST)
    monitor[HALVINGS] = monitor[HALVINGS] + halves if touched else 0.0
    monitor[CREATED] = created if touched and not halves else 0.0
    monitor[LEAST_J], monitor[RESIDUAL], monitor[STRETCH] = result[k.LEAST_J], result[k.RESIDUAL], result[k.STRETCH]
    monitor[KINETIC], monitor[STRAIN], monitor[GRAVITY] = result[k.KINETIC], result[k.STRAIN], result[k.GRAVITY]
    return halves


def settle(monitor: Floats, result: Floats) -> None:
    """A step was settled: monitor (N_MONITOR,) <- the energies that it has now."""
    monitor[KINETIC], monitor[STRAIN], monitor[GRAVITY] = result[k.KINETIC], result[k.STRAIN], result[k.GRAVITY]


def _rise(result: Floats, monitor: Floats) -> float:
    """By how much the energy rose beyond the work that was done on the body [J]."""
    now, before = result.tolist(), monitor.tolist()
    rise = now[k.KINETIC] + now[k.STRAIN] + now[k.GRAVITY] - before[KINETIC] - before[STRAIN] - before[GRAVITY]
    return float(rise - now[k.TOOL_WORK] - now[k.SEAM_WORK] - now[k.APPARENT])


def needs_two_sweeps(monitor: Floats) -> bool:
    """Whether the step after this one must solve more than once a substep."""
    least_j, stretch, residual = monitor[LEAST_J], monitor[STRETCH], monitor[RESIDUAL]
    return bool(least_j < CRUSHED or stretch > STRETCHED or residual > LAGGING)


def check(result: Floats, monitor: Floats, floor: float) -> Fault:
    """Whether a step with this result (N_RESULTS,) can follow one that left `monitor`; floor [J] is roundoff."""
    now = result.tolist()
    if not math.isfinite(sum(now)):
        return Fault.DIVERGED
    kinetic, strain = float(monitor[KINETIC]), float(monitor[STRAIN])
    tools, seam = now[k.TOOL_WORK], now[k.SEAM_WORK]
    scale = kinetic + strain + abs(tools) + abs(seam) + now[k.PUSHED] + floor
    if now[k.HASTE] > now[k.STRAIN] + floor:
        return Fault.HASTE
    return Fault.ENERGY if _rise(result, monitor) > RISE * scale else Fault.NONE


def grows(result: Floats, monitor: Floats) -> bool:
    """Whether the residual of a step that may be believed grew so much that it is worth repeating."""
    return bool(result[k.RESIDUAL] > max(LAGGING, GROWTH * monitor[RESIDUAL]))


def alarm(
    cause: str, result: Floats, monitor: Floats, attempt: int, n_substeps: int, n_sweeps: int, unfinished: int = 0
) -> dict[Detail, str]:
    """What the monitor saw and did in a step from a state that left `monitor`, empty where that was nothing.

    No sweeps: an explicit step. unfinished: substeps whose sweeps ended before the scene's residual was reached.
    """
    said = {}
    if attempt > 0:
        cold = ", carried forces dropped" if attempt >= COLD else ""
        swept = f", sweeps {n_sweeps}{cold}" if n_sweeps else ""
        said[Detail.REPEATED] = f"{cause}: repeated with {n_substeps} substeps{swept}"
    elif n_sweeps and needs_two_sweeps(monitor):
        said[Detail.SWEEPS] = f"blocks are crushed, torn or lag behind: solved {n_sweeps} times a substep"
    if unfinished:
        said[Detail.UNFINISHED] = (
            f"residual not reached in {unfinished} of {n_substeps} substeps with {n_sweeps} sweeps"
        )
    if result[k.RESIDUAL] > LAGGING:
        said[Detail.UNCONVERGED] = f"not converged, stress is {min(result[k.RESIDUAL], 99.0):.0%} off its shape"
    return said
