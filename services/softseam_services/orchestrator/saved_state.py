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

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_CELLS, _SEAM, _PART = "regions.", "seam.", "part."
"""how the names of such entries of a body begin"""
_BODY, _JOINED, _SLEEPING, _RUNG = "bodies/", "joined/", "sleeping/", "rung/"


@dataclass(frozen=True, slots=True)
class SavedBody:
    """One of its bodies."""

    lift_base: float
    """[m]"""
    slip: float
    """as of the last step in which tools that move had the body [m]"""
    felt: bool
    """whether that was the last step"""
    ledger: LedgerState | None
    """None before the first step"""
    begun: Energies
    """with which the body begins, before the first step"""
    errors: Floats
    """see `ErrorEstimator.to_array`"""
    cells: dict[str, NDArray[np.generic]]
    """see `NearCells.to_arrays`"""
    seam: dict[str, Floats]
    """see `Coupling.to_arrays`; empty where nothing is tied"""
    participants: dict[str, bytes]
    """state of each part, by id"""

    def entries(self) -> dict[str, NDArray[np.generic] | bytes]:
        """What `read` makes it of."""
        found: dict[str, NDArray[np.generic] | bytes] = {
            "lift_base": np.array([self.lift_base]),
            "slip": np.array([self.slip, self.felt]),
            "ledger": np.array([] if self.ledger is None else self.ledger.to_list(), dtype=np.float64),
            "begun": np.array([self.begun.kinetic, self.begun.strain, self.begun.gravity]),
            "errors": self.errors,
        }
        found.update({_CELLS + name: array for name, array in self.cells.items()})
        found.update({_SEAM + name: array for name, array in self.seam.items()})
        found.update({_PART + name: state for name, state in self.participants.items()})
        return found

    @classmethod
    def read(cls, entries: dict[str, NDArray[np.generic]]) -> SavedBody:
        """From `entries`. Raises KeyError, ValueError or TypeError where anything is missing."""
        ledger = entries["ledger"].astype(np.float64).tolist()
        return cls(
            lift_base=float(entries["lift_base"].astype(np.float64)[0]),
            slip=float(entries["slip"].astype(np.float64)[0]),
            felt=bool(entries["slip"].astype(np.float64)[1]),
            ledger=LedgerState.from_list(ledger) if ledger else None,
            begun=Energies(*entries["begun"].astype(np.float64).tolist()),
            errors=entries["errors"].astype(np.float64),
            cells=_named(entries, _CELLS),
            seam={name: array.astype(np.float64) for name, array in _named(entries, _SEAM).items()},
            participants={name: state.tobytes() for name, state in _named(entries, _PART).items()},
        )


@dataclass(frozen=True, slots=True)
class SavedBodies:
    """All of them."""

    named: dict[str, SavedBody]
    """by name"""
    joined: dict[str, dict[str, Floats]]
    """see `JoinedBodies.save`, by island"""
    sleeping: dict[str, NDArray[np.generic]]
    """see `Sleeping.save`"""
    rungs: dict[str, int]
    """on which each body that has rungs is, by name"""

    def entries(self) -> dict[str, NDArray[np.generic] | bytes]:
        """What `read` makes it of."""
        found: dict[str, NDArray[np.generic] | bytes] = {}
        for body, saved in self.named.items():
            found |= {f"{_BODY}{body}/{name}": entry for name, entry in saved.entries().items()}
        for island, arrays in self.joined.items():
            found |= {f"{_JOINED}{island}/{name}": array for name, array in arrays.items()}
        found |= {f"{_SLEEPING}{name}": entry for name, entry in self.sleeping.items()}
        return found | {f"{_RUNG}{name}": np.array([rung]) for name, rung in self.rungs.items()}

    @classmethod
    def read(cls, entries: dict[str, NDArray[np.generic]]) -> SavedBodies:
        """From `entries`. Raises KeyError, ValueError or TypeError where anything is missing."""
        bodies, islands = _by_name(_named(entries, _BODY)), _by_name(_named(entries, _JOINED))
        return cls(
            {name: SavedBody.read(of_it) for name, of_it in bodies.items()},
            {
                island: {name: array.astype(np.float64) for name, array in arrays.items()}
                for island, arrays in islands.items()
            },
            _named(entries, _SLEEPING),
            {name: int(rung.flat[0]) for name, rung in _named(entries, _RUNG).items()},
        )


@dataclass(frozen=True, slots=True)
class SavedTools:
    """Its tools."""

    progress: Progress
    lifting: bool
    """whether a tool has risen that touched a body"""
    position: Floats
    """(t, 3) [m]"""
    orientation: Floats
    """(t, 4)"""
    drives: Floats
    gripping: NDArray[np.int8]
    """1 for tools that hold particles (t,)"""
    grips: Floats
    """see `Grips.save`"""


@dataclass(frozen=True, slots=True)
class SavedState:
    """A simulation between two steps."""

    scene: str
    """in JSON"""
    step: int
    seed: int
    tools: SavedTools
    bodies: SavedBodies

    def pack(self) -> bytes:
        """As bytes, which `unpack` reads."""
        tools, progress = self.tools, self.tools.progress
        numbers = [self.step, progress.phase, progress.elapsed, tools.lifting, self.seed]
        numbers += progress.search.to_list()
        entries: dict[str, NDArray[np.generic] | bytes] = {
            "schema": np.array([SCHEMA_VERSION]),
            "scene": self.scene.encode(),
            "numbers": np.array(numbers, dtype=np.float64),
            "position": tools.position,
            "orientation": tools.orientation,
            "drives": tools.drives,
            "gripping": tools.gripping,
            "grips": tools.grips,
        }
        entries.update(self.bodies.entries())
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
            step, phase, elapsed, lifting, seed, *search = entries["numbers"].astype(np.float64).tolist()
            return cls(
                scene=entries["scene"].tobytes().decode(),
                step=int(step),
                seed=int(seed),
                tools=SavedTools(
                    progress=Progress(int(phase), elapsed, ForceSearch.from_list(search)),
                    lifting=bool(lifting),
                    position=entries["position"].astype(np.float64),
                    orientation=entries["orientation"].astype(np.float64),
                    drives=entries["drives"].astype(np.float64),
                    gripping=entries["gripping"].astype(np.int8),
                    grips=entries["grips"].astype(np.float64),
                ),
                bodies=SavedBodies.read(entries),
            )
        except (KeyError, ValueError, TypeError) as error:
            raise ArchiveError(f"the saved state is incomplete ({error}); pass what `snapshot` returned") from error


def _named(entries: dict[str, NDArray[np.generic]], begin: str) -> dict[str, NDArray[np.generic]]:
    """Entries whose names begin like this, by the rest of their names."""
    return {name.removeprefix(begin): array for name, array in entries.items() if name.startswith(begin)}


def _by_name(entries: dict[str, NDArray[np.generic]]) -> dict[str, dict[str, NDArray[np.generic]]]:
    """Entries `NAME/REST`, by name and rest."""
    names = dict.fromkeys(key.partition("/")[0] for key in entries)
    return {name: _named(entries, f"{name}/") for name in names}
