"""Direct rounds: both sides advance at once with the same multiplier, and the gap corrects it.

By the compliance of both sides (`softseam_coupling.seam`) or, blind, by what rounds tell (`.accelerated`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.far_stiffness import FarStiffness
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
    touches,
)
from softseam_services.orchestrator.sides import FAR, NEAR
from softseam_services.orchestrator.turns import Turns

Floats = NDArray[np.float64]

_LEAST = 2
"""exchanges tried before the near side is condensed"""
_SLOW = 0.3
"""share of the gap that an exchange may leave without the near side being condensed [1]"""
_TOIL = 60
"""iterations of the near side alone after which it is condensed at once: held by friction only it may need hundreds,
where a handful is enough with the far side's stiffness"""


class DirectRounds:
    """condensable: whether the near side could be condensed; most: exchanges a step."""

    def __init__(
        self, solver: SeamSolver, tie: SeamTie, stiffness: FarStiffness, turns: Turns, condensable: bool, most: int
    ):
        self._solver, self._tie, self._stiffness, self._turns = solver, tie, stiffness, turns
        self._condensable, self._most = condensable, most

    def solve(
        self, state: SeamState, ask: Ask, lambda_: Floats, before: int, far: Advanced | None, may_cut: bool
    ) -> SeamSolution:
        """One step, in which there were exchanges `before`, and in them what `far` said to lambda_.

        Not agreed where the near side is to be condensed instead, from here on.
        """
        solver, tie, turns = self._solver, self._tie, self._turns
        known = {} if far is None else {FAR: far}
        for exchange in range(1, self._most + 1):
            compliance = turns.fresh
            wanted = {
                NEAR: SideRequest(lambda_, compliance or turns.resumed),
                FAR: SideRequest(tie.far_force(lambda_), compliance),
            }
            replies = known | ask({name: side for name, side in wanted.items() if name not in known})
            known = {}
            if compliance or turns.resumed:
                self._rebuild(state, replies, lambda_)
            answer = solver.update(state, lambda_, tie.gap(replies[NEAR].seam_x, replies[FAR].seam_x))
            if answer.outcome is Outcome.NOT_FINITE:
                raise SeamDiverged(answer.outcome.value)
            if answer.outcome is Outcome.ACCEPT:
                if turns.direct_ended(exchange > 1 and touches(replies)) and self._stiffness.known:
                    turns.condense()
                return SeamSolution(replies, lambda_, answer.gap, before + exchange, "")
            # without contact the answers are smooth, and the solver's corrections learn them faster
            rough = touches(replies)
            slow = rough and exchange >= _LEAST and answer.kappa > _SLOW
            toil = rough and replies[NEAR].iterations > _TOIL
            if (slow or toil) and self._stiffness.known:
                turns.condense()
                return SeamSolution(replies, lambda_, answer.gap, before + exchange, "", agreed=False)
            if exchange < self._most:
                turns.fresh = answer.outcome is Outcome.REBUILD and not compliance
                lambda_ = answer.lambda_
        if may_cut:
            raise SeamUnsettled(before + self._most)
        note = "the sides' exchanges did not converge"
        return SeamSolution(replies, lambda_, answer.gap, before + self._most, note)

    def _rebuild(self, state: SeamState, replies: dict[str, Advanced], lambda_: Floats) -> None:
        near, told = replies[NEAR].compliance, replies[FAR].compliance
        known = self._stiffness.compliance
        far = told if told.size else known
        if near.size == 0 or near.size != far.size or not np.isfinite(near + far).all():
            return  # a solve that failed has no compliance; ask again
        self._solver.reset(state, self._tie.compliance(near, far))
        self._turns.know_both()
        if self._condensable and told is not known:
            self._stiffness.take(replies[FAR], lambda_)
