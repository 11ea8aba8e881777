"""What a simulation saves of itself: all that evolves, its participants' snapshots among it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Energies, LedgerState
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_services.orchestrator.archive import ArchiveError, pack, unpack
from softseam_services.orchestrator.force_search import ForceSearch
from softseam_services.orchestrator.program import Progress
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_CELLS, _SEAM, _PARTICIPANT = "regions.", "seam.", "participant."
"""how the names of such entries begin"""


@dataclass(frozen=True, slots=True)
class SavedState:
    """A simulation between two steps."""

    scene: str
    """in JSON"""
    step: int
    progress: Progress
    lift_base: float
    """[m]"""
    lifting: bool
    seed: int
    position: Floats
    """of tools (t, 3) [m]"""
    orientation: Floats
    """of tools (t, 4)"""
    ledger: LedgerState | None
    """None before the first step"""
    begun: Energies
    """with which the body begins, before the first step"""
    drives: Floats
    gripping: NDArray[np.int8]
    """1 for tools that hold particles (t,)"""
    trust: Floats
    """see `Trust.to_array`"""
    cells: dict[str, NDArray[np.generic]]
    """see `NearCells.to_arrays`"""
    seam: dict[str, Floats]
    """see `SeamLoop.to_arrays`; empty where there is no seam"""
    participants: dict[str, bytes]

    def pack(self) -> bytes:
        """As bytes, which `unpack` reads."""
        progress = self.progress
        numbers = [self.step, progress.phase, progress.elapsed, self.lift_base, self.lifting, self.seed]
        numbers += progress.search.to_list()
        entries: dict[str, NDArray[np.generic] | bytes] = {
            "schema": np.array([SCHEMA_VERSION]),
            "scene": self.scene.encode(),
            "numbers": np.array(numbers, dtype=np.float64),
            "position": self.position,
            "orientation": self.orientation,
            "ledger": np.array([] if self.ledger is None else self.ledger.to_list(), dtype=np.float64),
            "begun": np.array([self.begun.kinetic, self.begun.strain, self.begun.gravity]),
            "drives": self.drives,
            "gripping": self.gripping,
            "trust": self.trust,
        }
        entries.update({_CELLS + name: array for name, array in self.cells.items()})
        entries.update({_SEAM + name: array for name, array in self.seam.items()})
        entries.update({_PARTICIPANT + name: state for name, state in self.participants.items()})
        return pack(entries)

    @classmethod
    def unpack(cls, data: bytes) -> SavedState:
        """From bytes. Raises ArchiveError where it is of another schema, or anything is missing."""
        entries = unpack(data)
        schema = int(entries["schema"].flat[0]) if "schema" in entries and entries["schema"].size else 0
        if schema != SCHEMA_VERSION:
            raise ArchiveError(
                f"this state has schema version {schema}, this softseam reads {SCHEMA_VERSION}: load it with the "
                "softseam that saved it, or run the scene again and save it anew"
            )
        try:
            step, phase, elapsed, lift_base, lifting, seed, *search = entries["numbers"].astype(np.float64).tolist()
            near = entries[_CELLS + "cut"] != 0
            ledger = entries["ledger"].astype(np.float64).tolist()
            held = [name for name, cells in ((NEAR, near), (FAR, ~near)) if cells.any()] or [
                FAR
            ]  # a body without cells is far
            return cls(
                scene=entries["scene"].tobytes().decode(),
                step=int(step),
                progress=Progress(int(phase), elapsed, ForceSearch.from_list(search)),
                lift_base=lift_base,
                lifting=bool(lifting),
                seed=int(seed),
                position=entries["position"].astype(np.float64),
                orientation=entries["orientation"].astype(np.float64),
                ledger=LedgerState.from_list(ledger) if ledger else None,
                begun=Energies(*entries["begun"].astype(np.float64).tolist()),
                drives=entries["drives"].astype(np.float64),
                gripping=entries["gripping"].astype(np.int8),
                trust=entries["trust"].astype(np.float64),
                cells=dict(_named(entries, _CELLS)),
                seam={name: array.astype(np.float64) for name, array in _named(entries, _SEAM)},
                participants={name: entries[_PARTICIPANT + name].tobytes() for name in held},
            )
        except (KeyError, ValueError, TypeError) as error:
            raise ArchiveError(f"the saved state is incomplete ({error}); pass what `snapshot` returned") from error


def _named(entries: dict[str, NDArray[np.generic]], begin: str) -> list[tuple[str, NDArray[np.generic]]]:
    """Entries whose names begin like this, by the rest of their names."""
    return [(name.removeprefix(begin), array) for name, array in entries.items() if name.startswith(begin)]
