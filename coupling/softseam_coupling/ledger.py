"""Where every joule went, step by step.

    dK + dU + dG = tool_work + seam_work_near + seam_work_far - material - dissipation + switch        (1)

K, U, G: kinetic, strain and gravity energy of both sides. `tool_work` is what contact does to the body; the tools'
motion does more, by what sliding friction takes. `material` is what a material with internal state dissipated, by its
own account. `dissipation` is what (1) leaves: the numerical dissipation of the
integrators, and their solvers' residuals, beside what they give back to a rotation. `switch` is the energy that a
change of model added, of regions or of the quadrature of cells.

What one step creates and others take is a fluctuation; a scheme that creates energy does so again and again. So the
alarm goes by a cumulated sum (E. S. Page, Continuous inspection schemes, Biometrika 41, 1954),
    created <- max(0, created - dissipation)                                                (2)
which is what was created since the run was last lowest. The same holds of contact, which gives the body no more than
the tools' motion puts in: sum(contact_loss) >= 0, but for the little that points which yield give back.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

__all__ = ["Alarm", "Energies", "EnergyLedger", "LedgerEntry", "LedgerState"]


class Alarm(Enum):
    """What the ledger warns of; the text names the remedy, where shorter steps are one as `said` has it."""

    SEAM_WORK = "the seam does more work than 0.1 % of the energy: tighten its tolerance, or shorten the step"
    CREATED = (
        "steps add energy that neither tools nor gravity put in, in sum more than a hundredth of the most that moved "
        "or was strained: {shorten}"
    )
    CONTACT = "contact does more work on the body than the tools' motion puts in: {shorten}, or slow the tools down"
    SWITCH = "the region switch cost more than its share of the energy: switch earlier or let the body calm down"

    def said(self, substeps: bool) -> str:
        """In words; substeps: whether the body moves in substeps, which are as long in shorter steps."""
        return self.value.format(shorten="take more models.pbd.substeps" if substeps else "shorten the step")


class Energies(NamedTuple):
    """Energies of the whole body [J]."""

    kinetic: float
    strain: float
    gravity: float

    @property
    def total(self) -> float:
        return self.kinetic + self.strain + self.gravity


@dataclass(slots=True)
class LedgerState:
    """What evolves: the last balance and the sums since the start [J]."""

    last: Energies
    scale: float = 0.0
    """largest kinetic + strain energy + work of the tools seen"""
    tool_work: float = 0.0
    seam_work: float = 0.0
    dissipation: float = 0.0
    switch: float = 0.0
    pending: float = 0.0
    """change by switches since the last step"""
    created: float = 0.0
    """by steps since the run was last lowest, eq. (2)"""
    contact_loss: float = 0.0
    """what contact took of the work of the tools' motion: friction, and what points that yield may give back"""

    def to_list(self) -> list[float]:
        """Numbers for a checkpoint, in the order `from_list` expects."""
        sums = [self.scale, self.tool_work, self.seam_work, self.dissipation, self.switch, self.pending]
        return [self.last.kinetic, self.last.strain, self.last.gravity, *sums, self.created, self.contact_loss]

    @classmethod
    def from_list(cls, numbers: list[float]) -> LedgerState:
        """Continue from `to_list`. Raises ValueError where these are other numbers."""
        kinetic, strain, gravity, scale, tool_work, seam_work, dissipation, switch, pending, created, contact = numbers
        last = Energies(kinetic, strain, gravity)
        return cls(last, scale, tool_work, seam_work, dissipation, switch, pending, created, contact)


class LedgerEntry(NamedTuple):
    """The balance of one step [J]."""

    kinetic: float
    """change, as for the next two"""
    strain: float
    gravity: float
    tool_work: float
    seam_work: float
    dissipation: float
    switch: float
    scale: float
    """energy that the alarms compare with"""
    alarms: tuple[Alarm, ...]


@dataclass(frozen=True)
class EnergyLedger:
    """Bounds of the alarms, relative to the energy scale."""

    seam_limit: float = 1e-3
    """of the work of the seam, in a step and in sum [1]"""
    created_limit: float = 1e-2
    """of what steps create, in sum [1]"""
    contact_limit: float = 0.05
    """of what contact does beyond what the tools' motion puts in, in sum [1]"""
    switch_limit: float = 1e-2
    """of a switch, relative to the scale and `standing` together [1]"""
    standing: float = 0.0
    """energy that the body has because it stands on its base: its weight times its centre's height [J]"""
    floor: float = 1e-9
    """least energy scale: below it nothing is worth an alarm [J]"""

    def share_of_switch(self, state: LedgerState | None, change: float) -> float:
        """A switch's change of energy [J] over all the energy that the body has [1].

        Two models that are a tenth apart in how they sag differ by a tenth of the little that sagging stores. Measured
        by that alone, hardly a body at rest could be handed over before a tool comes and does work.
        """
        scale = self.floor if state is None else state.scale
        return abs(change) / (scale + self.standing)

    def open(self, energies: Energies, contact_loss: float = 0.0) -> LedgerState:
        """After the first step, which counts for what contact took alone [J]."""
        scale = max(self.floor, energies.kinetic + energies.strain)
        return LedgerState(energies, scale=scale, contact_loss=contact_loss)

    def switched(self, state: LedgerState, energies: Energies) -> float:
        """Book a region switch after which the body has these energies; returns the change [J]."""
        change = energies.total - state.last.total
        state.last = energies
        state.pending += change
        return change

    def step(
        self,
        state: LedgerState,
        energies: Energies,
        tool_work: float,
        seam_work_near: float,
        seam_work_far: float,
        passing: float = 0.0,
        contact_loss: float = 0.0,
        given: float = 0.0,
        material: float = 0.0,
    ) -> LedgerEntry:
        """Book a committed step, and any switch since the last one, by eq. (1).

        passing       what cells gained as they passed between quadratures [J]
        contact_loss  work of the tools' motion that did not arrive in the body [J]
        given         what integrators gave back to a rotation, beside contact's work [J]: it is no dissipation less
        material      what the material dissipated [J]: it is none of the integrators'

        Sides that interpolate in different ways are handed the same nodes, and are apart between them. The first step
        after a switch closes that gap: what the seam does in it counts as a part of the switch.
        """
        last = state.last
        seam_work = seam_work_near + seam_work_far
        dissipation = tool_work + seam_work + passing + given - material - (energies.total - last.total)
        switch = state.pending
        state.last, state.pending = energies, 0.0
        state.tool_work += tool_work
        seam_alone = 0.0 if switch else seam_work
        state.seam_work += seam_alone
        state.dissipation += dissipation
        state.switch += switch + passing
        state.created = max(0.0, state.created - dissipation)
        state.contact_loss += contact_loss
        state.scale = max(state.scale, energies.kinetic + energies.strain, abs(state.tool_work))
        alarms = []
        if max(abs(seam_alone), abs(state.seam_work)) > self.seam_limit * state.scale:
            alarms.append(Alarm.SEAM_WORK)
        if state.created > self.created_limit * state.scale:
            alarms.append(Alarm.CREATED)
        if -state.contact_loss > self.contact_limit * state.scale:
            alarms.append(Alarm.CONTACT)
        if self.share_of_switch(state, switch + (seam_work - seam_alone)) > self.switch_limit:
            alarms.append(Alarm.SWITCH)
        return LedgerEntry(
            energies.kinetic - last.kinetic,
            energies.strain - last.strain,
            energies.gravity - last.gravity,
            tool_work,
            seam_work,
            dissipation,
            switch + passing,
            state.scale,
            tuple(alarms),
        )
