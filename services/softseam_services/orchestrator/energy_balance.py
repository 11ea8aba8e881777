"""Energy and momentum of one body in every step, summed over its parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Alarm, Energies, EnergyLedger, LedgerState
from softseam_coupling.loops.loop import Outcome, largest
from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.session import InterfaceReport, PartReport
from softseam_services.orchestrator.archive import Arrays
from softseam_services.orchestrator.parts import Parts

Floats = NDArray[np.float64]

SWITCH_LIMIT = 1e-2
"""share of the energy that a switch may change [1]"""
CREATED_LIMIT = 2e-2
"""of what steps create, in sum [1]: what rolls on points that press by an energy gains and loses .016 by turns"""


class Entry(NamedTuple):
    """What a step did to a body."""

    parts: dict[str, PartReport]
    interfaces: dict[str, InterfaceReport]
    energy: dict[str, float]
    """ledger of the step, but for what depends on the tools' motion [J]"""
    momentum: Floats
    """(3,) [kg m/s]"""
    angular_momentum: Floats
    """about the world's origin (3,) [kg m^2/s]"""
    penetration: float
    """[m]"""
    drive_work: float
    """what the tools' motion put in [J]"""


class EnergyBalance:
    """What steps do to the energy of one body (see `softseam_coupling.ledger`).

    standing  energy that the body has because it stands on its base [J]
    inelastic  whether its material has internal state, so that it dissipates
    """

    def __init__(self, standing: float = 0.0, inelastic: bool = False) -> None:
        self.inelastic = inelastic
        self.limits = EnergyLedger(created_limit=CREATED_LIMIT, switch_limit=SWITCH_LIMIT, standing=standing)
        """by which it warns, and books"""
        self.reset()

    def reset(self) -> None:
        self.ledger: LedgerState | None = None
        """what evolves; None before the first step"""
        self.raised: tuple[Alarm, ...] = ()
        """alarms that the last step was the first of the run to raise"""
        self._told: set[Alarm] = set()
        self.begun = Energies(0.0, 0.0, 0.0)
        """with which the body begins, before the first step"""

    def book(self, parts: Parts, replies: Mapping[str, Advanced], solution: Outcome, drive_work: float) -> Entry:
        """A step was taken, in which the tools' motion put this in [J]."""
        kinetic = strain = gravity = tool_work = seam_work = passing = given = material = penetration = 0.0
        momentum, angular = np.zeros(3), np.zeros(3)
        reports = {}
        for name, reply in replies.items():
            kinetic += reply.kinetic
            strain += reply.strain
            gravity += reply.gravity
            tool_work += reply.tool_work
            seam_work += reply.coupling.work
            extra = reply.extras.get
            passing += extra(Figure.PASSING, 0.0)
            given += extra(Figure.GIVEN, 0.0)
            material += extra(Figure.DISSIPATED, 0.0)
            momentum += reply.momentum
            angular += reply.angular_momentum
            penetration = max(penetration, extra(Figure.PENETRATION, 0.0))
            reports[name] = PartReport(
                parts.body,
                parts.models[name],
                len(parts.cells[name]),
                parts.n_nodes[name],
                reply.kinetic,
                reply.strain,
                reply.gravity,
                int(extra(Figure.ITERATIONS, 1.0)),
                reply.seconds,
                int(extra(Figure.SUBSTEPS, 1.0)),
                int(extra(Figure.REJECTED, 0.0)),
                extra(Figure.STEP_ERROR, 0.0),
            )
        interfaces = {}
        if len(solution.multipliers):
            force = largest(solution.multipliers)
            sizes = solution.gap, solution.exchanges, len(solution.multipliers), force, seam_work
            told = InterfaceReport(*sizes, *solution.multipliers.sum(axis=0).tolist())
            interfaces[parts.interface] = told
        interface_work = 0.0
        if len(parts.joints):  # what other bodies do to this one
            interface_work, seam_work = seam_work, 0.0
        energies = Energies(kinetic, strain, gravity)
        contact_loss = 0.0 if _in_parts(parts, replies, solution) else drive_work - tool_work
        dissipation = switch = 0.0
        if self.ledger is None:
            self.ledger = self.limits.open(energies, contact_loss)
        else:
            entry = self.limits.step(
                self.ledger,
                energies,
                tool_work + interface_work,
                seam_work,
                0.0,
                passing,
                contact_loss,
                given,
                material,
            )
            dissipation, switch = entry.dissipation, entry.switch
            self.raised = tuple(alarm for alarm in entry.alarms if alarm not in self._told)
            self._told.update(self.raised)
        energy = {
            "kinetic": kinetic,
            "strain": strain,
            "gravity": gravity,
            "tool_work": tool_work,
            "seam_work": seam_work,
            **({"interface_work": interface_work} if len(parts.joints) else {}),
            "dissipation": dissipation,
            "switch": switch,
            **({"material": material} if self.inelastic else {}),
        }
        return Entry(reports, interfaces, energy, momentum, angular, penetration, drive_work)

    @property
    def energies(self) -> Energies:
        """Of the body as it stands."""
        return self.begun if self.ledger is None else self.ledger.last

    def save(self) -> Arrays:
        """What evolves of it, but for what was told."""
        ledger = [] if self.ledger is None else self.ledger.to_list()
        begun = [self.begun.kinetic, self.begun.strain, self.begun.gravity]
        return {"ledger": np.array(ledger, dtype=np.float64), "begun": np.array(begun)}

    def load(self, saved: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `save`. Raises KeyError, ValueError or TypeError, and changes nothing, where it is none."""
        ledger, begun = (saved[name].astype(np.float64).tolist() for name in ("ledger", "begun"))
        self.ledger, self.begun = LedgerState.from_list(ledger) if ledger else None, Energies(*begun)

    def take_over(self, other: EnergyBalance) -> None:
        """Go on with what was booked of the same body."""
        self.ledger, self.begun, self._told = other.ledger, other.begun, other._told

    def share_of_switch(self, change: float) -> float:
        """A switch's change of energy [J] over the body's [1]; beyond `SWITCH_LIMIT` it is better not made."""
        return self.limits.share_of_switch(self.ledger, change)

    def switched(self, energies: Energies) -> float:
        """Parts switched after the last step, and the models that hold the body now have these energies; by how much
        the kinetic one changed [J]."""
        if self.ledger is None:
            change, self.begun = energies.kinetic - self.begun.kinetic, energies
            return change
        change = energies.kinetic - self.ledger.last.kinetic
        self.limits.switched(self.ledger, energies)
        return change


def _in_parts(parts: Parts, replies: Mapping[str, Advanced], solution: Outcome) -> bool:
    """Whether a step was cut: its wrench is of one of its parts then, or a mean, and says nothing of their work."""
    return solution.parts > 1 or any(replies[name].figure(Figure.SUBSTEPS) > 1 for name in parts.cut_steps)
