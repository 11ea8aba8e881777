"""The rungs of one body: what it is simulated as at present, and how it goes from one to another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ladder import RUNGS, Discretised, Rung, Standing
from softseam_protocol.messages.participant import BodyState, Bundle
from softseam_protocol.scene.bodies import AnyBody as AnyBodySpec
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.ladder import RungSpec
from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.body.errors import SettingError
from softseam_services.orchestrator.parts import side_mass
from softseam_services.orchestrator.simulated_body import SimulatedBody

Floats = NDArray[np.float64]


class Ladder:
    """Of a body that has rungs. It is built on a rung when it first comes there.

    make  builds the body of a bundle, which has it as it is on a rung
    """

    def __init__(
        self,
        scene: Scene,
        name: str,
        spec: AnyBodySpec,
        files: Mapping[str, bytes],
        make: Callable[[Bundle], SimulatedBody],
    ) -> None:
        if any(isinstance(phase, ClosePhase) for phase in scene.motion):
            raise SettingError(
                "motion: tools that close measure bodies whose cells stay: leave out the ladder, or move"
            )
        if scene.of(name).regions.cut:
            raise SettingError(f"regions: cells that have a model of their own stay: give {name!r} one, or no ladder")
        if any(name in interface.between for interface in scene.interfaces.values()):
            raise SettingError(f"interfaces: they act on nodes that stay: leave out the ladder of {name!r}")
        self._scene, self._name, self._spec, self._files, self._make = scene, name, spec, dict(files), make
        none: tuple[RungSpec, ...] = ()
        self._rungs: list[Rung] = [RUNGS[rung.kind](rung) for rung in spec.said("ladder", none)]
        self._bodies: dict[int, SimulatedBody] = {}
        self.at = 0
        """which it is on, from 0"""

    def due(self, body: Standing) -> int:
        """The rung that it is to be on. Raises SettingError where none holds."""
        held = [place for place, rung in enumerate(self._rungs) if rung.holds(body)]
        if not held:
            raise SettingError(
                f"the ladder of {self._name!r} has no rung for it at {body.time:.4g} s: begin it with one that always "
                "holds"
            )
        return held[-1]

    def body(self, rung: int) -> SimulatedBody:
        """The body on a rung, which is not configured yet."""
        found = self._bodies.get(rung)
        if found is None:
            spec = self._rungs[rung].body(self._spec.model_copy(update={"ladder": ()}))
            bundle = bundle_scene(self._scene.with_body(spec, self._name), self._files)
            found = self._bodies[rung] = self._make(bundle)
        return found

    def begin(self) -> SimulatedBody:
        """The body as it stands at the start of the scene."""
        self.at = self.due(Standing(0.0, 0.0, 0.0))
        return self.body(self.at)

    def carried(self, rung: int, old: SimulatedBody) -> BodyState:
        """The state in which the body goes on, on a rung."""
        now, new = old.regions.state(), self.body(rung).body
        before = Discretised(old.body.x_rest, _mass(old.body), now.x, now.v)
        after = Discretised(new.x_rest, _mass(new), new.x_rest, np.zeros_like(new.x_rest))
        x, v = self._rungs[rung].carry(before, after)
        return BodyState(x, v, np.zeros((new.n_points, 3)), np.full(new.n_points, -1, dtype=np.int32))


def _mass(body: AnyBody) -> Floats:
    """Of each node (N,) [kg]."""
    return side_mass(cast(Body, body), np.arange(body.n_cells, dtype=np.int32))
