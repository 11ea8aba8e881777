"""Figures of a step that most regions and most steps do not have: there they are left out of the reply."""

from softseam_protocol.messages.outcomes import Figure

from .inputs import AT_ONCE
from .model import FemModel
from .state import FemState
from .step import Stepper
from .substeps import Substeps


def seldom(
    model: FemModel, stepper: Stepper, begun: FemState, end: FemState, taken: Substeps, times: int
) -> dict[str, float]:
    """Of a step that led from `begun` to `end` and was taken in these substeps, by the names of `Figure`; times: the
    region is so many times what is solved for."""
    found: dict[str, float] = {}
    if taken is not AT_ONCE:
        found[Figure.REJECTED], found[Figure.STEP_ERROR] = float(taken.n_rejected), taken.error
    if model.blends:
        found[Figure.BLENDED] = float(times * int(stepper.work.mixed[0]))
        found[Figure.PASSING] = times * float(end.passed[0] - begun.passed[0])
    if stepper.given:
        found[Figure.GIVEN] = stepper.given
    if model.n_state:
        found[Figure.DISSIPATED] = float(end.dissipated[0] - begun.dissipated[0])
    return found
