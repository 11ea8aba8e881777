"""How urgently each cell wants to be near: its stress and its model error over the scene's bounds.

  stress  the largest von Mises stress recovered at its nodes, over the bound `stress`
  goal    what PBD does in the cell to the scene's goal, at most and relative to it (`GoalWatch`), over its share 1/C
          of the bound `error`, where the scene has a goal; and else
  error   (eta_e C / U)^(1/2) over the bound `error`, with the energy eta_e of the error that PBD makes in the cell,
          or would make, C cells and the strain energy U: where no PBD cell is above 1, the whole body's model error in
          the energy norm, (sum eta_e / U)^(1/2), is within the bound

Looked at every few steps; in between, the last look counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.messages.participant import Fields
from softseam_protocol.models import facts_of
from softseam_protocol.scene.regions import NearSpec
from softseam_services.body.body import Body
from softseam_services.body.hardly_filled import HardlyFilled
from softseam_services.body.recover import nodal_recovery, von_mises
from softseam_services.orchestrator.indicators import told
from softseam_services.orchestrator.parts import Parts

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STRESS, ERROR, GOAL = "stress", "model error", "goal"


class RefinementIndicators:
    """What the last look at the fields found."""

    def __init__(self, body: Body, near: NearSpec | None, goal: str | None = None) -> None:
        self._body = body
        bounds = {STRESS: near and near.stress, GOAL if goal else ERROR: near and near.error}
        self._bounds = {name: bound for name, bound in bounds.items() if bound}
        self._recovery: tuple[Mask, list[csr_array]] | None = None
        self.reset()

    @cached_property
    def _hardly_filled(self) -> HardlyFilled:
        return HardlyFilled(self._body)

    @property
    def wanted(self) -> bool:
        """Whether the scene has a bound of what the parts' fields tell."""
        return not self._bounds.keys() <= {GOAL}

    @property
    def wants_errors(self) -> bool:
        return ERROR in self._bounds

    @property
    def wants_goal(self) -> bool:
        return GOAL in self._bounds

    def reset(self) -> None:
        self.measures: dict[str, Floats] = {name: np.zeros(self._body.n_cells) for name in self._bounds}
        """(C,) by name, 1 at the bound [1]"""

    def look(self, parts: Parts, fields: Mapping[str, Fields], cut: Mask) -> None:
        """Take over what the parts found; cut (C,) are the near cells."""
        body = self._body
        if STRESS in self._bounds:
            cauchy, sample = np.empty((body.n_cells, 8, 6)), np.empty(body.n_cells)
            for name, side in fields.items():
                cauchy[parts.cells[name]] = side.cauchy
                sample[parts.cells[name]] = facts_of(parts.models[name]).stress_at
            if self._recovery is None or not np.array_equal(self._recovery[0], cut):
                fits = [nodal_recovery(body, sample, number) for number in range(len(body.materials))]
                self._recovery = cut.copy(), fits
            cauchy = self._hardly_filled.replaced(cauchy)
            nodal = np.max([von_mises(fit @ cauchy.reshape(-1, 6)) for fit in self._recovery[1]], axis=0)
            self.measures[STRESS] = nodal[body.cell_nodes].max(axis=1) / self._bounds[STRESS]
        if ERROR in self._bounds:
            error, strain = np.zeros(body.n_cells), 0.0
            for name, side in fields.items():
                error[parts.cells[name]] = told(side.model_error, len(parts.cells[name]))
                strain += float(side.cell_energy.sum())
            share = strain / body.n_cells
            relative = np.sqrt(error / share) if share > 0.0 else np.zeros(body.n_cells)
            self.measures[ERROR] = relative / self._bounds[ERROR]

    def blame(self, cells: Floats) -> None:
        """Take over what PBD does to the goal in each cell, relative to it (C,) [1]."""
        self.measures[GOAL] = cells * (len(cells) / self._bounds[GOAL])

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What evolves, for a snapshot."""
        return {_key(name): measure.copy() for name, measure in self.measures.items()}

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and has changed nothing, where these are others."""
        found = {name: arrays[_key(name)].astype(np.float64) for name in self._bounds}
        if any(measure.shape != (self._body.n_cells,) for measure in found.values()):
            raise ValueError(f"it is not of {self._body.n_cells} cells")
        self.measures = found


def _key(name: str) -> str:
    return f"urgency_{name.replace(' ', '_')}"
