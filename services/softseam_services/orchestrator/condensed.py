"""Condensed rounds: the near side solves with the far side as a linear model, which then feels the force so found.

    far advances with lambda                       -> x_far
    near solves with lambda + S (P x_far + c - x)  -> x_near, lambda'        S = (P H_far P^T)^-1
    far advances with lambda'                      -> x_far', gap x_near - P x_far' - c

The gap is what the linear model misses, however rough the near side's contact is, and both sides feel the same force.
Each round teaches the model (BFGS on S with the far side's answer to the change of lambda), so that it learns where
points of the far side slip. A condensed step asks the near side once and the far side twice, a direct one that needs
two exchanges both sides twice, and the near side is the dearer: so in contact two such steps in a row are enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.far_stiffness import FarStiffness
from softseam_services.orchestrator.linked import Link
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
    largest,
)
from softseam_services.orchestrator.sides import FAR, NEAR
from softseam_services.orchestrator.turns import Turns

Floats = NDArray[np.float64]

_STRICT, _SLACK = 8, 3.0
"""exchanges of a condensed step after which it may leave so many tolerances: the gap does not add up, and cutting the
step, which is next, costs much more [1]"""
_CALM = 0.1
"""a condensed step is calm where the far side moved by no more than this share of the tolerance when it was told the
force that the near side had found: the prediction was as good [1]"""
_WORSE = 1.5
"""growth of the gap after which the model is stiffened and the best round so far taken up again [1]"""
_WORTH = 0.25
"""share of what a round moved that it may leave before the near side is given what was learned: it then has to factor
anew [1]"""


@dataclass(frozen=True, slots=True)
class _Round:
    """What the near side was given, and what came out."""

    gap: float
    lambda_: Floats
    anchor: Floats
    stiffness: Floats
    found: Floats
    far: Advanced
    """its answer to what was found"""


class CondensedRounds:
    """tolerance: of the gap [m]; most: exchanges a step; link: learns from every round."""

    def __init__(self, tie: SeamTie, tolerance: float, most: int, stiffness: FarStiffness, link: Link, turns: Turns):
        self._tie, self._tolerance, self._most = tie, tolerance, most
        self._stiffness, self._link, self._turns = stiffness, link, turns

    def solve(
        self, ask: Ask, lambda_: Floats, far: Advanced, before: int, exchanges: int, may_cut: bool
    ) -> SeamSolution:
        """Go on from the far side's answer to lambda_, after so many exchanges, of which those `before` do not count.

        Where the step will not converge, its best round is kept or, where it may be cut, SeamUnsettled raised.
        """
        tie, tolerance, stiffness, turns = self._tie, self._tolerance, self._stiffness, self._turns
        most, strict = self._most + before, _STRICT + before
        renewed = False
        anchor = tie.image(far.seam_x)
        best: _Round | None = None
        while True:
            if far.n_contacts > 0 and not stiffness.touched and not renewed:
                # the far side found ground since its compliance was taken: a model too soft for it would overshoot
                far = ask({FAR: SideRequest(tie.far_force(lambda_), True)})[FAR]
                exchanges += 1
                renewed = True
                stiffness.take(far, lambda_)
            near = ask({NEAR: stiffness.coupled(lambda_, anchor, stiffness.used)})[NEAR]
            self._link.hear(near)
            if best is None:
                turns.condensed_begun()
            found = near.seam_force
            told, far = far, ask({FAR: SideRequest(tie.far_force(found))})[FAR]
            exchanges += 2
            image = tie.image(far.seam_x)
            gap = largest(near.seam_x - image)
            if not math.isfinite(gap):
                raise SeamDiverged(Outcome.NOT_FINITE.value)
            self._link.learn(found - lambda_, told, far)
            if gap <= tolerance or (exchanges > strict and gap <= _SLACK * tolerance):
                calm = best is None and largest(image - anchor) <= _CALM * tolerance
                if calm:
                    self._link.resume({NEAR: near, FAR: far})
                turns.condensed_ended(calm)
                return SeamSolution({NEAR: near, FAR: far}, found, gap, exchanges, "")
            if best is None or gap < best.gap:
                best = _Round(gap, lambda_, anchor, stiffness.used, found, far)
            if exchanges + 4 > most:
                if may_cut:
                    raise SeamUnsettled(exchanges)
                return self._keep(ask, best, gap, {NEAR: near, FAR: far}, found, exchanges)
            stiffness.learn(image - anchor, lambda_ - found)
            if gap > _WORSE * best.gap:
                # a model that is too soft overshoots, one that is too stiff is only slow
                stiffness.stiffen()
                lambda_, far = best.found, best.far
                anchor = tie.image(far.seam_x)
            else:
                if gap > _WORTH * float(np.abs(near.seam_x - anchor).max()):
                    stiffness.use_learned()
                lambda_, anchor = found, image

    def _keep(
        self, ask: Ask, best: _Round, gap: float, replies: dict[str, Advanced], found: Floats, exchanges: int
    ) -> SeamSolution:
        """Keep the best round of a step that would not converge; forget what the others taught."""
        tie, stiffness = self._tie, self._stiffness
        stiffness.unlearn()
        if best.gap < 0.7 * gap:
            near = ask({NEAR: stiffness.coupled(best.lambda_, best.anchor, best.stiffness)})[NEAR]
            self._link.hear(near)
            found = near.seam_force
            far = ask({FAR: SideRequest(tie.far_force(found))})[FAR]
            replies, exchanges = {NEAR: near, FAR: far}, exchanges + 2
            gap = largest(tie.gap(near.seam_x, far.seam_x))
        return SeamSolution(replies, found, gap, exchanges, "the far side's contact jumps with the seam's force")
