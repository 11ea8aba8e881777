"""Where a simulation stands: how often it was cut, how many steps it took, and the headers that say so."""

from __future__ import annotations

from dataclasses import dataclass

from softseam_protocol.messages.header import SCHEMA_VERSION, Header


@dataclass(slots=True)
class Clock:
    """The numbers by which the messages of one session are told apart."""

    session: str
    dt: float
    """length of a step [s]"""
    epoch: int = -1
    """cuts made so far, less one; what participants of another cut are asked, they refuse"""
    step: int = 0
    """steps committed"""

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.step * self.dt

    def start(self, step: int) -> None:
        """Stand after so many steps."""
        self.step = step

    def at_pace(self, dt: float) -> Clock:
        """Itself, of steps of another length [s]."""
        self.dt = dt
        return self

    def now(self) -> Header:
        """Names the simulation as it stands."""
        return Header(SCHEMA_VERSION, self.session, "", self.epoch, self.step, 0, self.time)

    def last_step(self) -> Header:
        """Names the last step by its number and the time at its start."""
        at = max(self.step - 1, 0)
        return Header(SCHEMA_VERSION, self.session, "", self.epoch, at, 0, at * self.dt)
