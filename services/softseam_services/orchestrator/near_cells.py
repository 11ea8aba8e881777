"""Which cells are near: the scene's rule, applied to the distances that the participants report.

Where the near model on the whole body costs no more than the cut that the rule asks for, the body is not cut: all of it
is near as long as any cell is. That is as accurate as the near model, and has no seam.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.regions import CellGrid, RegionRule, RegionState
from softseam_protocol.messages import Advanced
from softseam_protocol.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.cost import step_cost
from softseam_services.orchestrator.sides import Sides, cut
from softseam_services.tools.kernels import cell_distances
from softseam_services.tools.tool_set import ToolSet

Mask = NDArray[np.bool_]


class NearCells:
    """The near cells of a body while tools come and go."""

    def __init__(self, scene: Scene, body: Body, tools: ToolSet) -> None:
        self._body, self._tools = body, tools
        near = scene.regions.near
        boxes = [] if near is None else [(box.min, box.max) for box in near.boxes]
        self._none = near is None
        self._fixed = near is None or near.within is None
        self._distance = np.empty(body.n_cells)
        self._grid = CellGrid.build(
            body.cell_grid, body.x_rest[body.cell_nodes[:, 13]], np.asarray(boxes, dtype=np.float64).reshape(-1, 2, 3)
        )
        if near is None or near.within is None:
            self._rule = RegionRule(0.0, min_patch=1)  # boxes are taken at their word
        else:
            self._rule = RegionRule(near.within, near.release, near.patience)
        self.model = "fem" if near is None else near.model
        """model of the near cells"""
        self._far_model, self._models, self._dt = scene.regions.default, scene.models, scene.step
        self._spares = near is not None and near.split == "when_cheaper" and not self._fixed
        self._spares = self._spares and (self.model, self._far_model) == ("fem", "pbd")
        self._alone = self._cost(np.ones(body.n_cells, dtype=np.bool_)) if self._spares else 0.0
        self.reset()

    @property
    def neighbours(self) -> NDArray[np.int32]:
        """Face neighbours -x +x -y +y -z +z of each cell, -1 for none (C, 6)."""
        return self._grid.neighbours

    @property
    def mask(self) -> Mask:
        """(C,)"""
        return self._cut

    @mask.setter
    def mask(self, near: Mask) -> None:
        self._state.near = np.array(near, dtype=np.bool_)
        self._state.whole = False
        self._cut = self._state.near

    def reset(self) -> None:
        """The cells that are near at the start."""
        body, tools = self._body, self._tools
        distance, node_gap = np.empty(body.n_cells), np.empty(body.n_nodes)
        cell_distances(
            body.x_rest,
            body.cell_nodes,
            tools.kind,
            tools.shape,
            tools.position,
            tools.orientation,
            tools.near,
            node_gap,
            distance,
        )
        self._state: RegionState = self._rule.init(self._grid, distance)
        if self._none:
            self._state.near[:] = False
        self._cut, _ = self._spare(self._state.near)

    def follow(self, sides: Sides, replies: Mapping[str, Advanced]) -> str:
        """Take over what the rule asks for after a step; why cells switched, or '' where none did."""
        if self._fixed:
            return ""
        distance = self._distance
        if len(sides.names) == 1:
            distance = replies[sides.names[0]].cell_distance
        else:
            for name, cells in sides.cells.items():
                distance.put(cells, replies[name].cell_distance)
        choice = self._rule.choose(self._state, self._grid, distance)
        if not choice.switches:
            return ""
        self._rule.accept(self._state, choice)
        before = self._cut
        self._cut, why = self._spare(choice.near)
        if np.array_equal(before, self._cut):
            return ""
        return f"{choice.reason}; {why or f'{int(choice.near.sum())} of {self._body.n_cells} cells are near'}"

    def _spare(self, near: Mask) -> tuple[Mask, str]:
        """The cut to make where the rule asks for `near` (C,), and why it is another."""
        if not self._spares or near.all() or not near.any():
            return near, ""
        split = self._cost(near)
        if self._alone > split:
            return near, ""
        cells = f"{self.model} on all {len(near)} cells"
        why = f"one model is enough: {cells} costs {self._alone / split:.2g} of a cut at {int(near.sum())}"
        return np.ones_like(near), why

    def _cost(self, near: Mask) -> float:
        """Expected cost of a step cut like this (C,) [us]."""
        sides = cut(self._body, near, self.model, self._far_model)
        return step_cost(self._body, sides, self._models, self._dt)

    def to_arrays(self) -> dict[str, NDArray[np.int32]]:
        """What evolves, for a snapshot."""
        return self._state.to_arrays() | {"cut": self._cut.astype(np.int32)}

    def take(self, arrays: Mapping[str, NDArray[np.int32]]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and has changed nothing, where these are others."""
        state, cut = RegionState.from_arrays(arrays), arrays["cut"].astype(np.bool_)
        if not len(state.near) == len(state.idle) == len(cut) == self._body.n_cells:
            raise ValueError(f"it is not of {self._body.n_cells} cells")
        self._state, self._cut = state, cut
