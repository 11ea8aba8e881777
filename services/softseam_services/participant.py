"""What the orchestrator may ask of a participant, whatever its model and wherever it runs.

States: (configure) -> [advance -> commit]* -> release. `advance` is tentative and idempotent: the header names it, the
last reply is kept, a repeated request gets the same reply. An `Advance` for step n + 1 commits the tentative step n;
one for the same step with a higher exchange number starts again from the committed state. What commits may settle the
step first: move it on by its linear answer to a small force on the seam. A `Commit` or `Snapshot` for the tentative
step itself, not for the one that follows, discards it: it failed on the other side. `snapshot` commits first and drops
every cache that could change later bits (stale factors, warm starts), so that a run that was restored and one that was
not are bit-identical from there on.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages import (
    Advance,
    Advanced,
    Configure,
    Configured,
    Fields,
    Header,
)


class Solver(Protocol):
    """One region with one model: `FemSolver` and `PbdSolver`. Knows no bus, no header, no clock."""

    def advance(self, request: Advance) -> Advanced: ...

    def settle(self, force: NDArray[np.float64]) -> None:
        """Move the tentative step on by its linear answer to a force (s, 3) [N] on the seam, if its reply said that it
        settles. Raises ValueError where it does not."""

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

    def restore(self, state: bytes) -> None: ...


class SolverFactory(Protocol):
    def __call__(self, request: Configure) -> tuple[Solver, Configured]: ...
