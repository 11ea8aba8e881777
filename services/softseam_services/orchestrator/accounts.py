"""Energy, momentum and time of every step, summed over the sides."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Alarm, Energies, EnergyLedger, LedgerState
from softseam_coupling.loops.loop import Outcome, largest
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.session import ErrorEstimate, RegionReport, SeamReport, StepReport
from softseam_services.orchestrator.sides import Sides

Floats = NDArray[np.float64]

SWITCH_LIMIT = 1e-2
"""share of the energy that a switch may change [1]"""


class Accounts:
    """What a step did to the energy (see `softseam_coupling.ledger`), and where its wall time went.

    dt        of a step [s]
    standing  energy that the body has because it stands on its base [J]
    """

    def __init__(self, dt: float, standing: float = 0.0) -> None:
        self._dt = dt
        self._book = EnergyLedger(switch_limit=SWITCH_LIMIT, standing=standing)
        self.reset()

    def reset(self) -> None:
        self.ledger: LedgerState | None = None
        """what evolves; None before the first step"""
        self.raised: tuple[Alarm, ...] = ()
        """alarms that the last step was the first of the run to raise"""
        self._told: set[Alarm] = set()
        self.begun = Energies(0.0, 0.0, 0.0)
        """with which the body begins, before the first step"""
        self.begin(perf_counter())

    def begin(self, now: float) -> None:
        """A step begins."""
        self._began = now
        self._seconds = {"fem": 0.0, "pbd": 0.0, "bus": 0.0}
        self._away = 0.0  # time in exchanges [s]

    def spent(self, model: str, seconds: float) -> None:
        """A participant worked this long on an exchange."""
        self._seconds[model] += seconds

    def exchanged(self, wall: float, work: Collection[float]) -> None:
        """An exchange took this long altogether; what exceeds the slowest participant's work is the bus's [s]."""
        self._seconds["bus"] += max(0.0, wall - max(work, default=0.0))
        self._away += wall

    def report(
        self,
        *,
        header: Header,
        sides: Sides,
        replies: Mapping[str, Advanced],
        phase: int,
        tool_position: Floats,
        tool_orientation: Floats,
        wrench: Floats,
        quantities: dict[str, float],
        seam: Outcome,
        done: bool,
        command: Floats,
        gripping: NDArray[np.int8],
        estimate: ErrorEstimate | None,
    ) -> StepReport:
        kinetic = strain = gravity = tool_work = seam_work = penetration = 0.0
        momentum: Floats | None = None
        angular: Floats | None = None
        regions = {}
        for name, reply in replies.items():
            kinetic += reply.kinetic
            strain += reply.strain
            gravity += reply.gravity
            tool_work += reply.tool_work
            seam_work += reply.seam_work
            momentum = reply.momentum if momentum is None else momentum + reply.momentum
            angular = reply.angular_momentum if angular is None else angular + reply.angular_momentum
            penetration = max(penetration, reply.penetration)
            regions[name] = RegionReport(
                sides.models[name],
                len(sides.cells[name]),
                sides.n_nodes[name],
                reply.kinetic,
                reply.strain,
                reply.gravity,
                reply.iterations,
                reply.seconds,
                reply.n_substeps,
                reply.n_rejected,
                reply.step_error,
            )
        assert momentum is not None and angular is not None
        energies = Energies(kinetic, strain, gravity)
        dissipation = switch = 0.0
        if self.ledger is None:
            self.ledger = self._book.open(energies)
        else:
            entry = self._book.step(self.ledger, energies, tool_work, seam_work, 0.0)
            dissipation, switch = entry.dissipation, entry.switch
            self.raised = tuple(alarm for alarm in entry.alarms if alarm not in self._told)
            self._told.update(self.raised)
        drive_work = -self._dt * float(np.vdot(wrench, command))
        total = perf_counter() - self._began
        seconds = dict(self._seconds)
        seconds["total"] = total
        seconds["coupling"] = max(0.0, total - self._away)
        return StepReport(
            header,
            phase,
            tool_position,
            tool_orientation,
            wrench,
            quantities,
            SeamReport(
                seam.gap,
                seam.exchanges,
                len(seam.multipliers),
                largest(seam.multipliers),
                seam_work,
            ),
            regions,
            {
                "kinetic": kinetic,
                "strain": strain,
                "gravity": gravity,
                "tool_work": tool_work,
                "seam_work": seam_work,
                "dissipation": dissipation,
                "switch": switch,
                "drive_work": drive_work,
                "contact_loss": drive_work - tool_work,
            },
            momentum,
            angular,
            penetration,
            seconds,
            done,
            command[:, :3].copy(),
            command[:, 3:].copy(),
            gripping,
            estimate,
        )

    def share_of_switch(self, change: float) -> float:
        """A switch's change of energy [J] over the body's [1]; beyond `SWITCH_LIMIT` it is better not made."""
        return self._book.share_of_switch(self.ledger, change)

    def switched(self, energies: Energies) -> float:
        """Regions switched after the last step, and the models that hold the body now have these energies; by how much
        the kinetic one changed [J]."""
        if self.ledger is None:
            change, self.begun = energies.kinetic - self.begun.kinetic, energies
            return change
        change = energies.kinetic - self.ledger.last.kinetic
        self._book.switched(self.ledger, energies)
        return change
