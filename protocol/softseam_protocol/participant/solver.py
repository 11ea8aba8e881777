"""What the orchestrator may ask of a participant, whatever its model and wherever it runs.

States: (configure) -> [advance -> commit]* -> release. `advance` is tentative and idempotent: the header names it, the
last reply is kept, a repeated request gets the same reply. An `Advance` for step n + 1 commits the tentative step n;
one for the same step with a higher exchange number starts again from the committed state. A `Correct` moves the
tentative step on by its linear answer to a small force on the seam. A `Commit` or `Snapshot` for the tentative
step itself, not for the one that follows, discards it: it failed on the other side. `snapshot` commits first and drops
every cache that could change later bits (stale factors, warm starts), so that a run that was restored and one that was
not are bit-identical from there on. `requests` keeps that order, for every solver.
"""

from typing import Protocol

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Capabilities,
    Configure,
    Configured,
    Correct,
    Fields,
)


class Solver(Protocol):
    """One region with one model: `FemSolver`, `PbdSolver`, `Part`. Knows no bus, no header, no clock."""

    def advance(self, request: Advance) -> Advanced: ...

    def correct(self, request: Correct) -> Advanced:
        """Move the tentative step on by its linear answer to a force on the seam, if its reply said that it can be;
        the reply as it stands then. Raises ValueError where it does not."""

    @property
    def capabilities(self) -> Capabilities:
        """What it can do for its region."""

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""

    @property
    def strain(self) -> float:
        """Strain energy of the state as it stands [J]."""

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step; with `indicators` also its errors, of them only its `own` model's."""

    def snapshot(self) -> bytes: ...

    def restore(self, state: bytes) -> None:
        """Continue from a snapshot. Raises ValueError for bytes that are none of its own, and changes nothing then."""


class SolverFactory(Protocol):
    """Builds the solver of a part."""

    def __call__(self, request: Configure) -> tuple[Solver, Configured]:
        """The solver, and what it says of itself. Raises ValueError for a part that it cannot take."""
