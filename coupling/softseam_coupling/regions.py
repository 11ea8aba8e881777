"""Which cells are near: distance to tools and urgency, with hysteresis and patience, cleaned to whole patches.

A cell has a *reason* to be near when it lies in a static box, when a tool is (or, at its approach speed, soon will be)
closer than `within`, or when it is near and a tool is closer than `release * within`; and where it is *urgent*: a
measure of it, such as its stress over a threshold, exceeds 1, or, while it is near, `kept`. It stays near for
`patience` steps after its last reason. Every switch rebuilds both regions: so cells are lowered in batches, at most
once in `patience` steps; for a tool they are raised at once, together with those that it will soon be close to. For
urgency they are raised a few at a time, the most urgent first: a switch changes the energy, and the next look at the
body sees what the last one brought.

`RegionRule` is the configuration, `CellGrid` the model, `RegionState` what evolves, `RegionChoice` the answer.
Deterministic: no choice depends on anything but the arguments, ties go to the lower cell id.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.patches import fill_islands, mend_contacts
from softseam_coupling.kernels.reasons import count_reasons

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

__all__ = ["CellGrid", "RegionChoice", "RegionRule", "RegionState"]


@dataclass(frozen=True)
class CellGrid:
    """How C cells of a uniform grid lie beside each other; built once from a body."""

    neighbours: Ints
    """face neighbours -x +x -y +y -z +z, -1 for none (C, 6)"""
    blocks: Ints
    """cells around each lattice point where at least two meet, -1 for none (b, 8)"""
    pinned: Mask
    """cells that are always near (C,)"""

    @classmethod
    def build(cls, cell_grid: Ints, centres: Floats | None = None, boxes: Floats | None = None) -> CellGrid:
        """cell_grid (C, 3) grid indices; centres (C, 3) [m] at rest; boxes (k, 2, 3) min and max [m], always near."""
        indices = np.asarray(cell_grid, dtype=np.int64)
        n_cells = len(indices)
        low = indices.min(axis=0) - 1
        extent = indices.max(axis=0) - low + 2
        lattice = np.full(tuple(extent), -1, dtype=np.int32)
        at = indices - low
        lattice[at[:, 0], at[:, 1], at[:, 2]] = np.arange(n_cells, dtype=np.int32)
        neighbours = np.empty((n_cells, 6), dtype=np.int32)
        for face in range(6):
            other = at.copy()
            other[:, face // 2] += 2 * (face % 2) - 1
            neighbours[:, face] = lattice[other[:, 0], other[:, 1], other[:, 2]]
        a, b, c = (int(e) - 1 for e in extent)
        around = [lattice[i : i + a, j : j + b, k : k + c].ravel() for k in (0, 1) for j in (0, 1) for i in (0, 1)]
        blocks = np.stack(around, axis=1)
        blocks = np.ascontiguousarray(blocks[(blocks >= 0).sum(axis=1) >= 2])
        pinned = np.zeros(n_cells, dtype=np.bool_)
        if boxes is not None and len(boxes):
            if centres is None:
                raise ValueError("static boxes need the centres of the cells")
            for box in boxes:
                pinned |= ((centres >= box[0]) & (centres <= box[1])).all(axis=1)
        return cls(neighbours, blocks, pinned)

    @property
    def n_cells(self) -> int:
        return len(self.pinned)


@dataclass(slots=True)
class RegionState:
    """What evolves (C cells)."""

    near: Mask
    """cells that are near now (C,)"""
    idle: Ints
    """steps since each cell's last reason to be near (C,)"""
    since_lowered: int = 0
    """steps since cells were last lowered"""
    whole: bool = False
    """whether `near` is known to have clean shapes already"""

    def to_arrays(self) -> dict[str, NDArray[np.int32]]:
        return {
            "near": self.near.astype(np.int32),
            "idle": self.idle.copy(),
            "since_lowered": np.array([self.since_lowered], dtype=np.int32),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> RegionState:
        idle = arrays["idle"].astype(np.int32)
        return cls(arrays["near"].astype(np.bool_), idle, int(arrays["since_lowered"].astype(np.int32)[0]))


@dataclass(frozen=True, slots=True)
class RegionChoice:
    """What the rule asks for; it holds once `RegionRule.accept` is called."""

    near: Mask
    """(C,)"""
    n_raised: int
    n_lowered: int
    reason: str

    @property
    def switches(self) -> bool:
        return self.n_raised + self.n_lowered > 0


@dataclass(frozen=True)
class RegionRule:
    """Distance rule with hysteresis."""

    within: float
    """distance to a tool that makes a cell near [m]; 0 leaves only the static boxes"""
    release: float = 1.5
    """a near cell keeps its reason up to release * within [1]"""
    patience: int = 20
    """steps a cell stays near after its last reason"""
    min_patch: int = 4
    """far patches beside the near region with fewer cells (or fewer than a sixth of a small body's) become near"""
    batch: float = 1.3
    """where a cell is raised, so are all up to batch * within, which a tool on its way would raise one step later"""
    max_cells: int | None = None
    """most cells raised in one switch, closest first, before patches are cleaned; None for all"""
    kept: float = 0.3
    """urgency that keeps a near cell near [1]"""
    share: float = 0.05
    """of all cells, that urgency raises in one switch at most, but at least `min_patch` cells"""

    def init(self, grid: CellGrid, distance: Floats) -> RegionState:
        """The state at the start, chosen without hysteresis.

        distance  (C,)  least distance of each cell to a tool that makes cells near [m]
        """
        state = RegionState(np.zeros(grid.n_cells, dtype=np.bool_), np.zeros(grid.n_cells, dtype=np.int32))
        near = grid.pinned | (distance < self.within)
        state.near = self._clean(grid, near, near, distance)
        state.whole = True
        return state

    def choose(
        self,
        state: RegionState,
        grid: CellGrid,
        distance: Floats,
        approach: Floats | None = None,
        urgency: Mapping[str, Floats] | None = None,
    ) -> RegionChoice:
        """Say which cells should be near after this step; counts idle steps in `state`, and switches nothing.

        distance  (C,)  as in `init` [m]
        approach  (C,)  by how much the distance will shrink within the horizon that the caller has in mind [m]
        urgency         measures (C,) by name [1]: see the module
        """
        ahead = distance if approach is None else distance - np.maximum(approach, 0.0)
        urgent = self._urgent(state, grid, ahead, urgency or {})
        state.since_lowered += 1
        may_lower = state.since_lowered >= self.patience
        wanted, reason = np.empty((2, grid.n_cells), dtype=np.bool_)
        moves = count_reasons(
            distance, ahead, urgent, self.kept, grid.pinned, state.near, self.within, self.release * self.within,
            may_lower, self.patience, state.idle, wanted, reason,
        )  # fmt: skip
        if state.whole and not moves:
            return RegionChoice(state.near, 0, 0, "")
        raised = wanted & ~state.near
        by_tool = raised & (ahead < self.within)
        if by_tool.any():
            wanted |= ahead < min(self.batch, self.release) * self.within
            raised = wanted & ~state.near
        if self.max_cells is not None and np.count_nonzero(raised) > self.max_cells:
            order = np.argsort(np.where(raised, ahead, np.inf), kind="stable")
            raised[order[self.max_cells :]] = False
        kept = state.near & (reason | (state.idle < self.patience)) if may_lower else state.near
        near = self._clean(grid, kept | raised, state.near, distance)
        gained, lost = near & ~state.near, state.near & ~near
        n_raised, n_lowered = int(np.count_nonzero(gained)), int(np.count_nonzero(lost))
        state.whole = n_raised + n_lowered == 0
        parts = []
        if n_raised:
            parts.append(f"{n_raised} cells raised ({self._causes(gained, wanted, ahead, urgent, urgency or {})})")
        if n_lowered:
            parts.append(f"{n_lowered} cells lowered (no reason for {int(state.idle[lost].min())} steps or more)")
        return RegionChoice(near, n_raised, n_lowered, "; ".join(parts))

    def _urgent(self, state: RegionState, grid: CellGrid, ahead: Floats, urgency: Mapping[str, Floats]) -> Floats:
        """The greatest urgency of each cell (C,); not above 1 where others are raised first: those beside near cells,
        so that patches grow before islands come up, and then the most urgent."""
        urgent = np.zeros(grid.n_cells)
        if not urgency:
            return urgent
        for measure in urgency.values():
            np.maximum(urgent, measure, out=urgent)
        asked = np.flatnonzero((urgent > 1.0) & ~state.near & ~grid.pinned & ~(ahead < self.within))
        most = max(self.min_patch, int(np.ceil(self.share * grid.n_cells)))
        if len(asked) > most:
            there = np.concatenate([state.near, [False]])  # the last is for neighbours that are none
            apart = ~there[grid.neighbours[asked]].any(axis=1)
            order = np.lexsort((-urgent[asked], apart))
            urgent[asked[order[most:]]] = 1.0
        return urgent

    def _causes(self, gained: Mask, wanted: Mask, ahead: Floats, urgent: Floats, urgency: Mapping[str, Floats]) -> str:
        """How many of the cells gained were raised by what."""
        by_tool = gained & wanted & (ahead < self.batch * self.within)
        rest = gained & ~by_tool & (urgent > 1.0)
        parts = []
        if by_tool.any() or not rest.any():
            closest = f", closest {1e3 * float(ahead[by_tool].min()):.1f} mm" if by_tool.any() else ""
            parts.append(f"{int(by_tool.sum())} by a tool{closest}")
        for name, measure in urgency.items():
            most = rest & (measure >= urgent)
            if most.any():
                parts.append(f"{int(most.sum())} by {name}, up to {float(measure[most].max()):.2g} of its bound")
                rest &= ~most
        n_mended = int(gained.sum()) - int((by_tool | (gained & (urgent > 1.0))).sum())
        return ", ".join([*parts, f"{n_mended} to mend patches"])

    def accept(self, state: RegionState, choice: RegionChoice) -> None:
        """The switch was made: the choice's cells are near from now on."""
        state.near = choice.near.copy()
        state.whole = True
        if choice.n_lowered:
            state.since_lowered = 0

    def _clean(self, grid: CellGrid, near: Mask, was_near: Mask, distance: Floats) -> Mask:
        """The smallest growth of `near` found that has no far islands and no edge or corner contacts."""
        near = near.copy()
        label, stack = np.empty((2, grid.n_cells), dtype=np.int32)
        min_patch = min(self.min_patch, max(1, grid.n_cells // 6))
        while True:
            added = fill_islands(near, grid.neighbours, min_patch, label, stack)
            added += mend_contacts(near, was_near, distance, grid.blocks)
            if added == 0:
                return near
