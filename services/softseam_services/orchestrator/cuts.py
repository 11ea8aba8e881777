"""The cut of a body: which cells are near, by the scene's rule, applied to what the participants report.

Distances to tools come with every step; stresses and model errors are looked at every few steps, where the scene has a
bound for them. Where the near model on the whole body costs no more than the cut that the rule asks for, the body is
not cut: all of it is near as long as any cell is. That is as accurate as the near model, and has no seam. Where it also
costs no more than the far model while no tool is near, and than any cut, there is nothing to choose: all cells are near
from the start, and the rule does not look.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.regions import CellGrid, RegionRule, RegionState
from softseam_protocol.messages.names import ONLY_BODY, within
from softseam_protocol.messages.participant import Advanced, Fields
from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT, PARTICLES_DEFAULT
from softseam_protocol.scene.regions import NearSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.body.errors import SettingError
from softseam_services.body.region import shared_nodes
from softseam_services.orchestrator.cost import one_is_enough, step_cost
from softseam_services.orchestrator.parts import Parts
from softseam_services.orchestrator.refinement import RefinementIndicators
from softseam_services.solvers import SOLVERS
from softseam_services.tools.kernels import cell_distances
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR, FAR = "near", "far"
"""what parts of a body that is cut are called, in ids"""
LOOK_EVERY = 5
"""steps between looks at stresses and model errors"""
RETRY = 10
"""steps after which a switch that was refused is tried again"""
_STEPS_AHEAD = 2
"""a tool that would be within reach after so many steps is: a switch takes effect in the next"""


def cut(name: str, body: AnyBody, near: Mask, near_model: str, far_model: str) -> Parts:
    """Cut the body of that name into the near cells (C,) and the rest; one of particles is one part, without cells."""
    none = np.zeros(0, dtype=np.int32)
    part, other = within(name, NEAR), within(name, FAR)
    if not body.has_cells:
        return Parts(name, {other: far_model}, {other: none}, {other: body.n_nodes}, none)
    cells = {part: np.flatnonzero(near).astype(np.int32), other: np.flatnonzero(~near).astype(np.int32)}
    models = {part: near_model, other: far_model}
    kept = [name for name in (part, other) if len(cells[name])]
    seam = none
    if len(kept) == 2:
        seam = shared_nodes(body, cells[part], cells[other])
    return Parts(
        name,
        {name: models[name] for name in kept},
        {name: cells[name] for name in kept},
        {name: len(np.unique(body.cell_nodes[cells[name]])) for name in kept},
        seam,
    )


@dataclass(frozen=True, slots=True)
class Unmet:
    """What became of the switches that were refused."""

    n_refused: int
    """of the switches"""
    n_never: int
    """cells that were to become near, and never were"""
    n_asked: int
    """cells that are near, were, or were to become so"""

    def said(self, model: str, limit: float) -> str:
        """In words, of cells that were to be this model's; limit: share of the energy that a switch may change [1]."""
        return (
            f"{self.n_never} of the {self.n_asked} cells that regions.near asked for never became {model}: "
            f"{self.n_refused} switches were refused, since each would have changed the energy by more than "
            f"{100.0 * limit:g} %; put these cells into regions.near.boxes, which makes them {model} from "
            f"the start, or say regions.default: {model}"
        )


class NearCells:
    """The near cells of a body while tools come and go. Raises SettingError for a bound of an error that nothing
    estimates."""

    def __init__(self, scene: Scene, body: Body, tools: ToolSet) -> None:
        self._body, self._tools = body, tools
        near = scene.regions.near
        boxes = [] if near is None else [(box.min, box.max) for box in near.boxes]
        self._none = near is None
        self._fixed = near is None or (near.within is None and near.stress is None and near.error is None)
        self._grid = CellGrid.build(
            body.cell_grid, body.x_rest[body.cell_nodes[:, 13]], np.asarray(boxes, dtype=np.float64).reshape(-1, 2, 3)
        )
        self._rule = _rule(near, self._fixed)
        self._horizon = _STEPS_AHEAD if near is None or near.ahead is None else near.ahead / scene.step
        if near is not None and near.error is not None and body.material.n_state:
            raise SettingError(
                f"regions.near.error: what pbd errs by is not known of {body.material.kind}: say within or stress"
            )
        self._refinement = RefinementIndicators(body, near, scene.regions.goal)
        self.model = NEAR_DEFAULT if near is None else near.model
        """model of the near cells"""
        self._far_model, self._models, self._dt = scene.regions.far, scene.models, scene.step
        self._spares = near is not None and near.split == "when_cheaper" and not self._fixed
        self._spares = self._spares and (self.model, self._far_model) == (NEAR_DEFAULT, FAR_DEFAULT)
        self._coarse = SOLVERS[FAR_DEFAULT].coarse_cells(body, scene.models, tools)
        self._alone = self.cost(np.ones(body.n_cells, dtype=np.bool_)) if self._spares else 0.0
        self._why = self._enough(near) if self._spares else ""
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
        self._take_cut(self._state.near)

    def _take_cut(self, cut: Mask) -> None:
        self._cut = cut
        self.enough = self._why if self._why and cut.all() else ""
        """why all cells are near whatever tools do, so that the rule does not look; '' where it does"""

    @property
    def looks_for(self) -> tuple[bool, bool]:
        """Whether the rule wants to look at the fields every `LOOK_EVERY` steps, and at their indicators."""
        return (False, False) if self.enough else (self._refinement.wanted, self._refinement.wants_errors)

    @property
    def looks_for_goal(self) -> bool:
        """Whether the rule wants to know which cells the goal blames, every `LOOK_EVERY` steps."""
        return self._refinement.wants_goal and not self.enough

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
            tools.followed,
            node_gap,
            distance,
        )
        self._distance = distance
        self._refinement.reset()
        self._wait = 0
        self._forget_refused()
        self._state: RegionState = self._rule.init(self._grid, distance)
        if self._none:
            self._state.near[:] = False
        self._take_cut(self._spare(self._state.near)[0])

    def follow(
        self,
        parts: Parts,
        replies: Mapping[str, Advanced],
        seen: Mapping[str, Fields] | None = None,
        blame: Floats | None = None,
    ) -> str:
        """Take over what the rule asks for after a step; why cells switched, or '' where none did.

        seen   what a look at the fields found, see `looks_for`; None where nobody looked
        blame  what the goal blames each cell for (C,), see `looks_for_goal`; None where nobody looked
        """
        if self._fixed:
            return ""
        self._had |= self._cut
        if self.enough:
            (whole,) = parts.names
            self._distance = replies[whole].cell_distance.copy()
            return ""
        distance = np.empty(self._body.n_cells)
        for name, cells in parts.cells.items():
            distance[cells] = replies[name].cell_distance
        with np.errstate(invalid="ignore"):
            approach = self._horizon * (self._distance - distance)
        if not np.isfinite(approach).all():
            approach = np.nan_to_num(approach)  # no tool, no distance: inf - inf
        self._distance = distance
        if blame is not None:
            self._refinement.blame(blame)
        if seen is not None:
            self._refinement.look(parts, seen, self._cut)
        measures = self._refinement.measures
        if seen is None and blame is None:
            # an old look keeps cells near, and raises none: they would come before what it brought is seen
            measures = {name: np.minimum(measure, 1.0) for name, measure in measures.items()}
        choice = self._rule.choose(self._state, self._grid, distance, approach, measures)
        self._wait = max(0, self._wait - 1)
        if not choice.switches or self._wait:
            return ""
        self._before = self._state.to_arrays(), self._cut
        self._rule.accept(self._state, choice)
        cut, why = self._spare(choice.near)
        self._take_cut(cut)
        if np.array_equal(self._before[1], self._cut):
            return ""
        return f"{choice.reason}; {why or f'{int(choice.near.sum())} of {self._body.n_cells} cells are near'}"

    def refused(self) -> None:
        """The switch that the last step asked for was taken back: ask again in `RETRY` steps."""
        self._n_refused += 1
        self._wanted |= self._cut
        state, cut = self._before
        self._take_cut(cut)
        self._state = RegionState.from_arrays(state)
        self._wait = RETRY

    @property
    def unmet(self) -> Unmet:
        """What was refused since the start, or since a state was taken."""
        had = self._had | self._cut
        never, asked = self._wanted & ~had, self._wanted | had
        return Unmet(self._n_refused, int(never.sum()), int(asked.sum()))

    def _forget_refused(self) -> None:
        """Nothing was refused yet."""
        self._n_refused = 0
        self._had, self._wanted = np.zeros((2, self._body.n_cells), dtype=np.bool_)

    def _spare(self, near: Mask) -> tuple[Mask, str]:
        """The cut to make where the rule asks for `near` (C,), and why it is another."""
        if not self._spares or near.all():
            return near, ""
        if not near.any():
            return (np.ones_like(near), self._why) if self._why else (near, "")
        split = self.cost(near)
        if self._alone > split:
            return near, ""
        cells = f"{self.model} on all {len(near)} cells"
        why = f"one model is enough: {cells} costs {self._alone / split:.2g} of a cut at {int(near.sum())}"
        return np.ones_like(near), why

    def _enough(self, near: NearSpec | None) -> str:
        """Why all cells may as well be near always; '' where that may cost more than to follow the tools."""
        if near is None or near.within is None or not self._tools.followed.any() or self._coarse.any():
            return ""  # no tool ever asks for near cells; or the scene wants coarse blocks where no tool is
        share = one_is_enough(self._body, self._models, self._dt, True)
        if share > 1.0:
            return ""
        cells = f"{self.model} on all {self._body.n_cells} cells"
        return f"one model is enough: {cells} costs {share:.2g} of {self._far_model} at rest, and less than a cut"

    def parts(self, name: str, body: AnyBody) -> Parts:
        """Of the body, which has this name, as it is cut."""
        return cut(name, body, self._cut, self.model, self._far_model)

    @property
    def models(self) -> tuple[str, str]:
        """Of the cells that are not near, and of those that are."""
        return self._far_model, self.model

    def cost(self, near: Mask) -> float:
        """Expected cost of a step cut like this (C,) [us]."""
        parts = cut(ONLY_BODY, self._body, near, self.model, self._far_model)
        return step_cost(self._body, parts, self._models, self._dt, len(self._tools.names) > 0, self._coarse)

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What evolves, for a snapshot."""
        return {
            **self._state.to_arrays(),
            **self._refinement.to_arrays(),
            "cut": self._cut.astype(np.int32),
            "distance": self._distance.copy(),
            "wait": np.array([self._wait], dtype=np.int32),
        }

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and has changed nothing, where these are others."""
        state = RegionState.from_arrays(arrays)
        cut, distance = arrays["cut"].astype(np.bool_), arrays["distance"].astype(np.float64)
        wait = int(arrays["wait"].astype(np.int32)[0])
        if not len(state.near) == len(state.idle) == len(cut) == len(distance) == self._body.n_cells:
            raise ValueError(f"it is not of {self._body.n_cells} cells")
        self._refinement.take(arrays)
        self._forget_refused()
        self._take_cut(cut)
        self._state, self._distance, self._wait = state, distance, wait


def _rule(near: NearSpec | None, fixed: bool) -> RegionRule:
    if near is None or fixed:
        return RegionRule(0.0, min_patch=1)  # boxes are taken at their word
    return RegionRule(-np.inf if near.within is None else near.within, near.release, near.patience)


class NoCells:
    """Stands for `NearCells` where a body has no cells: one region, which no tool divides."""

    model = PARTICLES_DEFAULT
    looks_for = (False, False)
    looks_for_goal = False
    enough = ""
    unmet = Unmet(0, 0, 0)
    models = (PARTICLES_DEFAULT, PARTICLES_DEFAULT)
    neighbours: NDArray[np.int32] = np.zeros((0, 6), dtype=np.int32)

    def __init__(self, scene: Scene) -> None:
        self._far_model = scene.regions.far
        self.mask: Mask = np.zeros(0, dtype=np.bool_)

    def parts(self, name: str, body: AnyBody) -> Parts:
        """Of the body, which has this name: one."""
        return cut(name, body, self.mask, self.model, self._far_model)

    def reset(self) -> None:
        """Nothing evolves."""

    def follow(
        self,
        parts: Parts,
        replies: Mapping[str, Advanced],
        seen: Mapping[str, Fields] | None = None,
        blame: Floats | None = None,
    ) -> str:
        """Never a reason to switch."""
        return ""

    def refused(self) -> None:
        """Nothing switches."""

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        return {"cut": np.zeros(0, dtype=np.int32)}

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Nothing evolves."""
