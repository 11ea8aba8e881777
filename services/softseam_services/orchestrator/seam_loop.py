"""One step of the seam: exchange until the two sides agree.

Three ways. *Linked* (`linked`): both sides advance at once, each with what the other is expected to answer, and what
was missed is made up by their linear answers; one exchange where it is little. Where it is not, or where a side cannot
be settled, the other two take over. *Direct* (`direct`): both sides advance at once with the predicted multiplier, and
the gap corrects it through the compliance of both. *Condensed* (`condensed`): where the near side answers unevenly
(points that begin to touch, stick or slip), it is given the far side as a linear model, and the far side then feels the
force that the near side found. `turns` says which of the last two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import SeamSolver
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.condensed import CondensedRounds
from softseam_services.orchestrator.direct import DirectRounds
from softseam_services.orchestrator.far_stiffness import FarStiffness
from softseam_services.orchestrator.linked import Link
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import Ask, SeamSolution, SideRequest, touches
from softseam_services.orchestrator.sides import FAR
from softseam_services.orchestrator.turns import Turns

Floats = NDArray[np.float64]


class SeamLoop:
    """Ties two sides for one epoch.

    mobility     1/mass of the seam's nodes on both sides (3s,) [1/kg]: a guess where no compliance is to be asked for
    condensable  whether the near side takes the far side's stiffness into its own solve (FEM does)
    most         exchanges a step
    """

    def __init__(
        self, solver: SeamSolver, tie: SeamTie, mobility: Floats, first: Floats | None, condensable: bool, most: int
    ):
        n_nodes = len(mobility) // 3
        self._solver, self._tie, self._mobility = solver, tie, mobility
        self.state: SeamState = solver.init(n_nodes, first)
        blind = isinstance(solver, AcceleratedSeam)
        self._condensable = condensable and not blind
        self._turns = Turns(fresh=not blind)
        self._link = Link(tie, solver.tolerance, n_nodes)
        self._stiffness = stiffness = FarStiffness(tie, self._link)
        self._direct = DirectRounds(solver, tie, stiffness, self._turns, self._condensable, most)
        self._condensed = CondensedRounds(tie, solver.tolerance, most, stiffness, self._link, self._turns)
        self._n_contacts = 0  # of the far side, at the end of the last step
        self._dt = 0.0  # of the last step, 0 before the first [s]
        self.pace = Pace()
        """how finely the steps are cut"""

    def begin(self, x: Floats, way: Floats) -> None:
        """The cut begins with the seam's nodes at x, moving by `way` in a step (s, 3) [m]."""
        self._link.begin(x, way)

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""
        return self.state.multiplier

    def solve(self, ask: Ask, dt: float, may_cut: bool = False) -> SeamSolution:
        """Exchange until the gap is within the solver's tolerance. Raises SeamDiverged.

        dt       length of the step [s]; where it is another than before, compliances are asked for again
        may_cut  where a step will not converge, raise SeamUnsettled and commit nothing; else keep its best round
        """
        if dt != self._dt:
            self._change(dt)
        lambda_ = self._solver.predict(self.state)
        exchanges, far = 0, None
        if self._condensable and self.pace.parts == 1 and self._link.due():
            linkable = True
            if self._outdated():
                far = ask({FAR: SideRequest(self._tie.far_force(lambda_), True, fields=False)})[FAR]
                exchanges = 1
                linkable = self._stiffness.take(far, lambda_)
                if linkable:
                    self._turns.know_far()
                linkable = linkable and far.settles
            if linkable:
                step = self._link.solve(ask, lambda_, dt, self._coupled, self._n_contacts, exchanges, far)
                if step.agreed:
                    self._solver.commit(self.state, step.lambda_)
                    self._n_contacts = step.replies[FAR].n_contacts
                    return step
                if touches(step.replies) and self._stiffness.known:
                    self._turns.condense()
                lambda_, exchanges, far = step.lambda_, step.exchanges, step.replies[FAR]
        step = self._unlinked(ask, lambda_, exchanges, far, may_cut)
        self._solver.commit(self.state, step.lambda_)
        self._n_contacts = step.replies[FAR].n_contacts
        self._link.note(step.replies, step.lambda_)
        return step

    def _change(self, dt: float) -> None:
        """The step at hand is of another length [s] than the last."""
        if isinstance(self._solver, AcceleratedSeam):
            self._solver.guess(self.state, dt * dt * self._mobility)
        elif self._dt > 0.0 and self._stiffness.known:
            self._stiffness.stale = True
            self._turns.wait()
        else:
            self._turns.fresh = True
        self._link.change(dt / self._dt if self._dt > 0.0 else 1.0)
        self._dt = dt

    def _outdated(self) -> bool:
        """Whether a linked step wants a new compliance of the far side first."""
        stiffness = self._stiffness
        old = self._turns.fresh or not stiffness.known or stiffness.stale or self._link.worn
        return old or stiffness.touched != (self._n_contacts > 0)

    def _coupled(self, lambda_: Floats, anchor: Floats) -> SideRequest:
        """Of the near side, in a linked step."""
        return self._stiffness.coupled(lambda_, anchor, self._stiffness.base, fields=False)

    def _unlinked(self, ask: Ask, lambda_: Floats, before: int, far: Advanced | None, may_cut: bool) -> SeamSolution:
        """A step, condensed or direct, in which there were exchanges `before`, and in them what far said to lambda_."""
        exchanges = before
        if self._turns.fresh or not self._turns.condensed:
            step = self._direct.solve(self.state, ask, lambda_, before, far, may_cut)
            if step.agreed:
                return step
            lambda_, exchanges, far = step.lambda_, step.exchanges, step.replies[FAR]
        elif far is None:
            renew = self._stiffness.stale or (self._stiffness.touched and self._n_contacts == 0)
            far = ask({FAR: SideRequest(self._tie.far_force(lambda_), renew)})[FAR]
            self._stiffness.take(far, lambda_)
            exchanges += 1
        return self._condensed.solve(ask, lambda_, far, before, exchanges, may_cut)

    def forget_told(self) -> None:
        """The near side no longer knows the stiffness that it was sent: it took a snapshot or was restored."""
        self._stiffness.forget_told()

    def to_arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that evolves, for a snapshot."""
        stiffness = self._stiffness
        flags = [
            *self._turns.to_list(),
            stiffness.touched,
            self._n_contacts,
            stiffness.stale,
            self._dt,
            *self.pace.to_list(),
        ]
        arrays = self.state.to_arrays() | stiffness.to_arrays() | self._link.to_arrays()
        return arrays | {"flags": np.array(flags, dtype=np.float64)}

    def take(self, arrays: dict[str, NDArray[np.float64]]) -> None:
        """Continue from `to_arrays`."""
        self.state = SeamState.from_arrays(arrays)
        stiffness = self._stiffness
        condensed, wait, repeated, fresh, resumed, touched, n_contacts, stale, dt, *pace = arrays["flags"].tolist()
        self._turns.take([condensed, wait, repeated, fresh, resumed])
        stiffness.restore(arrays)
        stiffness.touched, self._n_contacts, stiffness.stale = bool(touched), int(n_contacts), bool(stale)
        self._dt = float(dt)
        self.pace.take(pace)
        self._link.take(arrays, stiffness.compliance, stiffness.base)
