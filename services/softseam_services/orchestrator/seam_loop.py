"""One step of the seam: exchange until the two sides agree.

Three ways. *Linked* (`linked`): both sides advance at once, each with what the other is expected to answer, and what
was missed is made up by their linear answers; one exchange where it is little. Where it is not, or where a side cannot
be settled, the other two take over. *Direct*: both sides advance at once with the predicted multiplier, and the gap
corrects it through the compliance of both (`softseam_coupling.seam`). *Condensed*: where the near side answers unevenly
(points that begin to touch, stick or slip), it is given the far side as a linear model, and the far side then feels the
force that the near side found:

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
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.kernels.stiffness import learn_stiffness
from softseam_coupling.mortar import SeamTie, stiffness_of
from softseam_coupling.seam import Outcome, SeamSolver, SeamState
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.linked import Link
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
    largest,
)
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]

_DIRECT_EXCHANGES = 2
"""least number tried before the near side is condensed"""
_SLOW = 0.3
"""share of the gap that an exchange may leave without the near side being condensed [1]"""
_REPEATS = 2
"""steps in contact in a row that took more than one exchange after which the near side is condensed: it is then asked
once a step where the far side, the cheaper one, is asked twice"""
_PATIENCE = 64
"""condensed steps before both sides are tried at once again"""
_TOIL = 60
"""iterations of the near side alone after which it is condensed at once: held by friction only it may need hundreds,
where a handful is enough with the far side's stiffness"""
_STRICT, _SLACK = 8, 3.0
"""exchanges of a condensed step after which it may leave so many tolerances: the gap does not add up, and cutting the
step, which is next, costs much more [1]"""
_CALM, _CALM_STEPS = 0.1, 3
"""in so many condensed steps in a row the far side moved by no more than this share of the tolerance when it was told
the force that the near side had found: the prediction was as good, and both sides are tried at once again [1]"""
_WORSE = 1.5
"""growth of the gap after which the model is stiffened and the best round so far taken up again [1]"""
_WORTH = 0.25
"""share of what a round moved that it may leave before the near side is given what was learned: it then has to factor
anew [1]"""


@dataclass(frozen=True, slots=True)
class _Round:
    """One condensed round: what the near side was given, what came out."""

    gap: float
    lambda_: Floats
    anchor: Floats
    stiffness: Floats
    found: Floats
    image: Floats


def _touches(replies: dict[str, Advanced]) -> bool:
    return replies[NEAR].n_contacts + replies[FAR].n_contacts > 0


class SeamLoop:
    """Ties two sides for one epoch.

    mobility     1/mass of the seam's nodes on both sides (3s,) [1/kg]: a guess where no compliance is to be asked for
    condensable  whether the near side takes the far side's stiffness into its own solve (FEM does)
    most         exchanges a step
    """

    def __init__(
        self, solver: SeamSolver, tie: SeamTie, mobility: Floats, first: Floats | None, condensable: bool, most: int
    ):
        self._solver, self._tie, self._mobility, self._most = solver, tie, mobility, most
        self.state: SeamState = solver.init(len(mobility) // 3, first)
        self._blind = isinstance(solver, AcceleratedSeam)
        self._condensable = condensable and not self._blind
        self._condensed = False
        self._wait = 0
        self._repeated = 0  # steps in a row that touched and took more than one exchange or, condensed, were calm
        self._fresh = not self._blind
        self._stiffness: Floats | None = None
        self._base: Floats | None = None
        self._used: Floats | None = None
        self._touched = False
        self._stale = False
        self._told: Floats | None = None
        self._may_cut = False
        self._n_contacts = 0
        self._resumed = False  # to advance both at once again: the near side's compliance is old
        self._far_compliance = np.zeros((0, 0))
        self._dt = 0.0  # of the last step, 0 before the first [s]
        self._link = Link(tie, solver.tolerance, len(mobility) // 3)
        self.pace = Pace()
        """how finely the steps are cut"""

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""
        return self.state.multiplier

    def solve(self, ask: Ask, dt: float, may_cut: bool = False) -> SeamSolution:
        """Exchange until the gap is within the solver's tolerance. Raises SeamDiverged.

        dt       length of the step [s]; where it is another than before, compliances are asked for again
        may_cut  where a step will not converge, raise SeamUnsettled and commit nothing; else keep its best round
        """
        self._may_cut = may_cut
        if dt != self._dt:
            if isinstance(self._solver, AcceleratedSeam):
                self._solver.guess(self.state, dt * dt * self._mobility)
            elif self._dt > 0.0 and self._condensable and self._stiffness is not None:
                self._stale = self._condensed = True
                self._wait = _PATIENCE
            else:
                self._fresh = True
            self._dt = dt
        lambda_ = self._solver.predict(self.state)
        if self._condensable and self.pace.parts == 1 and self._link.due():
            old = self._fresh or self._stiffness is None or self._stale or self._link.worn
            if not old and self._touched == (self._n_contacts > 0):
                return self._linked(ask, lambda_, may_cut)
            far = ask({FAR: SideRequest(self._tie.far_force(lambda_), True, fields=False)})[FAR]
            taken = self._take_far(far, lambda_)
            if taken:
                self._fresh, self._resumed = False, True
            if taken and far.settles:
                return self._linked(ask, lambda_, may_cut, far)
            return self._unlinked(ask, lambda_, may_cut, 1, far)
        return self._unlinked(ask, lambda_, may_cut)

    def _unlinked(
        self, ask: Ask, lambda_: Floats, may_cut: bool, before: int = 0, far: Advanced | None = None
    ) -> SeamSolution:
        """A step, condensed or direct, in which there were exchanges `before`, and in them what far said to lambda_."""
        if self._condensed and not self._fresh:
            exchanges = before
            if far is None:
                renew = self._stale or (self._touched and self._n_contacts == 0)
                far = ask({FAR: SideRequest(self._tie.far_force(lambda_), renew)})[FAR]
                self._take_far(far, lambda_)
                exchanges += 1
            return self._condense(ask, lambda_, far, exchanges, before + self._most)
        known = {} if far is None else {FAR: far}
        for exchange in range(1, self._most + 1):
            compliance = self._fresh
            wanted = {
                NEAR: SideRequest(lambda_, compliance or self._resumed),
                FAR: SideRequest(self._tie.far_force(lambda_), compliance),
            }
            replies = known | ask({name: side for name, side in wanted.items() if name not in known})
            known = {}
            if compliance or self._resumed:
                self._rebuild(replies, lambda_)
            answer = self._solver.update(self.state, lambda_, self._tie.gap(replies[NEAR].seam_x, replies[FAR].seam_x))
            if answer.outcome is Outcome.NOT_FINITE:
                raise SeamDiverged(answer.outcome.value)
            if answer.outcome is Outcome.ACCEPT:
                self._repeated = self._repeated + 1 if exchange > 1 and _touches(replies) else 0
                if self._repeated >= _REPEATS:
                    self._condense_on()
                return self._agree(replies, lambda_, answer.gap, before + exchange, "")
            # without contact the answers are smooth, and the solver's corrections learn them faster
            rough = _touches(replies)
            slow = rough and exchange >= _DIRECT_EXCHANGES and answer.kappa > _SLOW
            toil = rough and replies[NEAR].iterations > _TOIL
            if (slow or toil) and self._condensable and self._stiffness is not None:
                self._condense_on()
                return self._condense(ask, lambda_, replies[FAR], before + exchange, before + self._most)
            if exchange < self._most:
                self._fresh = answer.outcome is Outcome.REBUILD and not compliance
                lambda_ = answer.lambda_
        if may_cut:
            raise SeamUnsettled
        return self._agree(replies, lambda_, answer.gap, before + self._most, "the sides' exchanges did not converge")

    def _linked(self, ask: Ask, lambda_: Floats, may_cut: bool, far: Advanced | None = None) -> SeamSolution:
        """A step with both sides at once, or with the near side first where the `far` one has answered to lambda_.

        Where it does not work out, it goes on as one that is not linked.
        """
        base = self._base
        assert base is not None

        def coupled(multiplier: Floats, anchor: Floats) -> SideRequest:
            return replace(self._coupled(multiplier, anchor, base), fields=False)

        before = 0 if far is None else 1
        step = self._link.solve(ask, lambda_, self._dt, coupled, self._n_contacts, far)
        exchanges = before + step.exchanges
        if not step.agreed:
            if _touches(step.replies):
                self._condense_on()
            return self._unlinked(ask, step.lambda_, may_cut, exchanges, step.replies[FAR])
        self._solver.commit(self.state, step.lambda_)
        self._n_contacts = step.replies[FAR].n_contacts
        return SeamSolution(step.replies, step.lambda_, step.gap, exchanges, "", settle=step.settle)

    def _condense_on(self) -> None:
        """Condense the near side in the steps to come, if it can be."""
        if self._condensable and self._stiffness is not None:
            self._condensed, self._wait, self._repeated = True, _PATIENCE, 0

    def _condense(
        self, ask: Ask, lambda_: Floats, far: Advanced, exchanges: int, most: int | None = None
    ) -> SeamSolution:
        """Go on from the far side's answer to lambda_, after so many exchanges of the `most` that are allowed."""
        most = self._most if most is None else most
        strict = _STRICT + most - self._most
        assert self._stiffness is not None and self._base is not None and self._used is not None
        tolerance = self._solver.tolerance
        renewed = False
        anchor = self._tie.image(far.seam_x)
        best: _Round | None = None
        while True:
            if far.n_contacts > 0 and not self._touched and not renewed:
                # the far side found ground since its compliance was taken: a model too soft for it would overshoot
                far = ask({FAR: SideRequest(self._tie.far_force(lambda_), True)})[FAR]
                exchanges += 1
                renewed = True
                self._take_far(far, lambda_)
            near = ask({NEAR: self._coupled(lambda_, anchor, self._used)})[NEAR]
            self._link.hear(near)
            if best is None:
                self._wait -= 1
                self._condensed = self._wait > 0
                self._resumed = not self._condensed
            found = near.seam_force
            far = ask({FAR: SideRequest(self._tie.far_force(found))})[FAR]
            exchanges += 2
            image = self._tie.image(far.seam_x)
            self._link.learn(found - lambda_, image - anchor)
            gap = largest(near.seam_x - image)
            if not math.isfinite(gap):
                raise SeamDiverged(Outcome.NOT_FINITE.value)
            if gap <= tolerance or (exchanges > strict and gap <= _SLACK * tolerance):
                calm = best is None and largest(image - anchor) <= _CALM * tolerance
                self._repeated = self._repeated + 1 if calm else 0
                if calm:
                    self._link.resume({NEAR: near, FAR: far})
                if self._condensed and self._repeated == _CALM_STEPS:
                    self._condensed, self._resumed = False, True
                if not self._condensed:
                    self._repeated = 0
                return self._agree({NEAR: near, FAR: far}, found, gap, exchanges, "")
            if best is None or gap < best.gap:
                best = _Round(gap, lambda_, anchor, self._used, found, image)
            if exchanges + 4 > most:
                if self._may_cut:
                    raise SeamUnsettled
                return self._settle(ask, best, gap, {NEAR: near, FAR: far}, found, exchanges)
            learn_stiffness(self._stiffness, (image - anchor).reshape(-1), (lambda_ - found).reshape(-1))
            if gap > _WORSE * best.gap:
                # a model that is too soft overshoots, one that is too stiff is only slow
                self._stiffness += self._base
                self._used = self._stiffness.copy()
                lambda_, anchor = best.found, best.image
            else:
                if gap > _WORTH * float(np.abs(near.seam_x - anchor).max()):
                    self._used = self._stiffness.copy()
                lambda_, anchor = found, image

    def _coupled(self, lambda_: Floats, anchor: Floats, stiffness: Floats) -> SideRequest:
        """Ask the near side with the far side's stiffness, which is sent only where it is another than before."""
        told = stiffness is self._told
        self._told = stiffness
        return SideRequest(lambda_, False, anchor, None if told else stiffness)

    def forget_told(self) -> None:
        """The near side no longer knows the stiffness that it was sent: it took a snapshot or was restored."""
        self._told = None

    def _settle(
        self, ask: Ask, best: _Round, gap: float, replies: dict[str, Advanced], found: Floats, exchanges: int
    ) -> SeamSolution:
        """Keep the best round of a step that would not converge; forget what the others taught."""
        assert self._base is not None
        self._stiffness, self._used = self._base.copy(), self._base
        if best.gap < 0.7 * gap:
            near = ask({NEAR: self._coupled(best.lambda_, best.anchor, best.stiffness)})[NEAR]
            self._link.hear(near)
            found = near.seam_force
            far = ask({FAR: SideRequest(self._tie.far_force(found))})[FAR]
            replies, exchanges = {NEAR: near, FAR: far}, exchanges + 2
            gap = largest(self._tie.gap(near.seam_x, far.seam_x))
        return self._agree(replies, found, gap, exchanges, "the far side's contact jumps with the seam's force")

    def _take_far(self, far: Advanced, lambda_: Floats) -> bool:
        """Keep the far side's answer to a request for its compliance; whether there is one."""
        taken = far.compliance.size > 0 and bool(np.isfinite(far.compliance).all())
        if taken:
            self._far_compliance = far.compliance
            self._base = stiffness_of(self._tie.far_compliance(far.compliance))
            self._stiffness, self._used = self._base.copy(), self._base
            self._touched = far.n_contacts > 0
            self._stale = False
            self._link.renew(far, self._base, lambda_)
        return taken

    def _rebuild(self, replies: dict[str, Advanced], lambda_: Floats) -> None:
        near, far = replies[NEAR].compliance, replies[FAR].compliance
        if far.size == 0:
            far = self._far_compliance
        if near.size == 0 or near.size != far.size or not np.isfinite(near + far).all():
            return  # a solve that failed has no compliance; ask again
        self._solver.reset(self.state, self._tie.compliance(near, far))
        self._fresh = self._resumed = False
        if self._condensable:
            self._take_far(replies[FAR], lambda_)

    def _agree(
        self, replies: dict[str, Advanced], lambda_: Floats, gap: float, exchanges: int, note: str
    ) -> SeamSolution:
        self._solver.commit(self.state, lambda_)
        self._n_contacts = replies[FAR].n_contacts
        self._link.note(replies, lambda_)
        return SeamSolution(replies, lambda_, gap, exchanges, note)

    def to_arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that evolves, for a snapshot."""
        arrays = self.state.to_arrays()
        arrays["stiffness"] = np.zeros((0, 0)) if self._stiffness is None else self._stiffness
        arrays["far_compliance"] = self._far_compliance
        arrays["used"] = np.zeros((0, 0)) if self._used is None else self._used
        arrays["base"] = np.zeros((0, 0)) if self._base is None else self._base
        flags = [
            self._condensed,
            self._wait,
            self._repeated,
            self._fresh,
            self._resumed,
            self._touched,
            self._n_contacts,
            self._stale,
            self._dt,
            *self.pace.to_list(),
        ]
        arrays["flags"] = np.array(flags, dtype=np.float64)
        return arrays | self._link.to_arrays()

    def take(self, arrays: dict[str, NDArray[np.float64]]) -> None:
        """Continue from `to_arrays`."""
        self.state = SeamState.from_arrays(arrays)
        self._told = None
        stiffness = arrays["stiffness"]
        self._stiffness = np.array(stiffness) if stiffness.size else None
        used = arrays["used"]
        self._used = np.array(used) if used.size else None
        base = arrays["base"]
        self._base = np.array(base) if base.size else None
        self._far_compliance = np.array(arrays["far_compliance"])
        condensed, wait, repeated, fresh, resumed, touched, n_contacts, stale, dt, *pace = arrays["flags"]
        self._condensed, self._wait, self._repeated = bool(condensed), int(wait), int(repeated)
        self._fresh, self._resumed = bool(fresh), bool(resumed)
        self._touched, self._n_contacts, self._stale = bool(touched), int(n_contacts), bool(stale)
        self._dt = float(dt)
        self.pace.take([float(number) for number in pace])
        self._link.take(arrays, self._far_compliance, self._base)
