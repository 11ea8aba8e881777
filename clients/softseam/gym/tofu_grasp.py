"""The reference job: lift a block of tofu, and press it no more than that needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike

from softseam.errors import BadInput
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.observation import Observation
from softseam_protocol.scene.bodies import BodySpec

HEIGHT = 0.05
"""to lift the tofu by [m]"""
LIFTED = 0.9
"""of that height, from which on it counts as lifted [1]"""
CRUSHED = 0.5
"""compression at which an episode ends; FEM in a rigid box is right up to 0.6"""
STRESS = 20.0e3
"""that costs as much as the whole height is worth, where it lasts for all of an episode [Pa]"""


class TofuGrasp(SceneEnv):
    """Two plates grip a cube of tofu of 5 cm and lift it by 5 cm, within 3 s.

    An action has two numbers from -1 to 1: how fast each plate closes and both rise, in parts of 5 cm/s, for 0.04 s.
    Seen is what `SceneEnv` sees. The rewards of an episode add up to the part of the height that was reached, less the
    mean over its time of the largest von Mises stress in parts of 20 kPa; less 1 where the tofu was squeezed by half,
    which ends the episode. `info["is_success"]`: it is lifted by 90 % of the height.

    spread  how much Young's modulus and the plates' friction differ from one episode to the next, to either side [1];
            0 for none, which saves 0.1 s an episode
    """

    def __init__(
        self,
        *,
        spread: float = 0.25,
        settings: Sequence[str] = (),
        connect: str | None = None,
        record: str | Path | None = None,
    ) -> None:
        """Other arguments as for `SceneEnv`."""
        if not 0.0 <= spread < 1.0:
            raise BadInput(f"spread is {spread!r}: give a number from 0 to below 1")
        # FEM on 2x2x2 cells of 27 nodes: within 5 % of the truth (docs/results/chart.md), the fastest that is
        own = ("step=0.04", "body.cell=0.025", "duration=3")
        super().__init__("tofu_grasp", model="fem", settings=(*own, *settings), connect=connect, record=record)
        self._spread = spread
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        if self._spread == 0.0:
            return ()
        stiffer, rougher = random.uniform(1.0 - self._spread, 1.0 + self._spread, 2)
        assert isinstance(self.scene.body, BodySpec)
        tools = [f"tools.{name}.friction={rougher * self.scene.tools[name].friction:.4g}" for name in self.tools]
        return (f"body.material.young={stiffer * self.scene.body.material.young:.5g}", *tools)

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        close, rise = self.speed * action.astype(np.float64)
        return {"left": [close, 0.0, rise], "right": [-close, 0.0, rise]}

    def reward(self, before: Observation, after: Observation) -> float:
        time = (after.time - before.time) / (self.scene.duration or 1.0)
        stress = after.quantities.get("peak_von_mises", 0.0) / STRESS
        risen = _part(after.lift_height) - _part(before.lift_height)
        return risen - stress * time - float(self.ended(after))

    def ended(self, observation: Observation) -> bool:
        return observation.quantities.get("compression", 0.0) >= CRUSHED

    def step(self, action: Any) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        seen, reward, terminated, truncated, info = super().step(action)
        info["is_success"] = not terminated and _part(info["lift_height"]) >= LIFTED
        return seen, reward, terminated, truncated, info


def _part(height: float) -> float:
    """Of what is to be lifted by, from 0 to 1, of a height [m]."""
    return min(max(height / HEIGHT, 0.0), 1.0)
