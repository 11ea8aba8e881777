"""Whether a step can be believed, and what is done at once where it cannot: the monitor of the PBD participant."""

from enum import Enum

from softseam_protocol.messages.outcomes import Detail, Status
from softseam_services.body.body import Floats

from .kernels import summary as k
from .kernels import trust

GROWS = "the residual grows"
FEEDS = "the energy rises where tools touch"
GAINS = "gains energy where tools touch: shorter substeps while they do"


class Fault(Enum):
    """Outcome of a step, in words that name the remedy, and in one."""

    NONE = "converged", Status.CONVERGED
    INPUT = "the request cannot be served", Status.REFUSED
    ANCHOR = (
        "PBD takes a seam force that is constant over the step: leave coupling_target empty on this side",
        Status.REFUSED,
    )
    DIVERGED = (
        "the blocks diverged: take a shorter step, more substeps or sweeps, or make the region fem",
        Status.DIVERGED,
    )
    HASTE = "leapfrog's substep is beyond its limit: take more substeps, or method: xpbd", Status.DOUBTFUL
    ENERGY = (
        "the energy rises without work: take a shorter step, more substeps or sweeps, or make the region fem",
        Status.DOUBTFUL,
    )

    def __init__(self, text: str, status: Status) -> None:
        self.text, self.status = text, status

    @property
    def why(self) -> str:
        """What is wrong and the remedy; '' where nothing is."""
        return "" if self is Fault.NONE else self.text


FAULTS = (Fault.NONE, Fault.DIVERGED, Fault.HASTE, Fault.ENERGY)
"""by the numbers of `kernels.trust`"""


def settle(monitor: Floats, result: Floats) -> None:
    """A step was settled: monitor (N_MONITOR,) <- the energies that it has now."""
    monitor[trust.KINETIC], monitor[trust.STRAIN] = result[k.KINETIC], result[k.STRAIN]
    monitor[trust.GRAVITY] = result[k.GRAVITY]


def check(result: Floats, monitor: Floats, floor: float) -> Fault:
    """Whether a step with this result (N_RESULTS,) can follow one that left `monitor`; floor [J] is roundoff."""
    return FAULTS[trust.fault_of(result, monitor, floor)]


def alarm(
    cause: str, result: Floats, monitor: Floats, attempt: int, n_substeps: int, n_sweeps: int, unfinished: int = 0
) -> dict[Detail, str]:
    """What the monitor saw and did in a step from a state that left `monitor`, empty where that was nothing.

    No sweeps: an explicit step. unfinished: substeps whose sweeps ended before the scene's residual was reached.
    """
    said = {}
    if attempt > 0:
        cold = ", carried forces dropped" if attempt >= trust.COLD else ""
        swept = f", sweeps {n_sweeps}{cold}" if n_sweeps else ""
        said[Detail.REPEATED] = f"{cause}: repeated with {n_substeps} substeps{swept}"
    elif n_sweeps and trust.needs_two_sweeps(monitor):
        said[Detail.SWEEPS] = f"blocks are crushed, torn or lag behind: solved {n_sweeps} times a substep"
    if unfinished:
        said[Detail.UNFINISHED] = (
            f"residual not reached in {unfinished} of {n_substeps} substeps with {n_sweeps} sweeps"
        )
    if result[k.RESIDUAL] > trust.LAGGING:
        said[Detail.UNCONVERGED] = f"not converged, stress is {min(result[k.RESIDUAL], 99.0):.0%} off its shape"
    return said
