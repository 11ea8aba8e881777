"""Points of the body's surface beside what is seen, as a depth camera and a mask would show them."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import NDArray

from softseam.errors import BadInput, NotReset
from softseam.given import whole
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.gym.sight import BOUND


class PointCloud(gymnasium.ObservationWrapper[dict[str, Numbers], Any, Numbers]):
    """An environment whose agent also sees so many points of the body's surface.

    What is seen becomes {"seen": what it was, "points": (points, 3)}: the way from the middle of the body at the
    start of the episode, in parts of its longest edge then, so of order 1. Which points of the surface they are is
    drawn at each reset, by the seed and the number of the episode, and stays the same through the episode; the
    environment's own draws are what they are without. A surface with fewer points shows some twice.

    Raises BadInput for what is no environment of a scene, and no number of points.
    """

    def __init__(self, env: gymnasium.Env[Numbers, Any], points: int = 128) -> None:
        number = whole(points)
        if number is None or number < 1:
            raise BadInput(f"points={points!r}: give a whole number of points, 1 or more")
        super().__init__(env)
        if not isinstance(env.unwrapped, SceneEnv):
            raise BadInput(f"{type(env.unwrapped).__name__} is no environment of a scene: it has no surface to show")
        self._inner, self._scene_env, self._number = env, env.unwrapped, number
        self._random = np.random.default_rng()
        cloud = Box(-BOUND, BOUND, (number, 3), np.float32)
        self.observation_space: Space[Any] = Dict({"seen": env.observation_space, "points": cloud})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Numbers], dict[str, Any]]:
        seen, info = self._inner.reset(seed=seed, options=options)
        if seed is not None:
            self._random = np.random.default_rng(seed)
        surface = self._scene_env.session.last.surface
        _, places = np.unique(surface, axis=0, return_index=True)  # faces of a block share those of its edges
        few = len(places) < self._number
        self._chosen: NDArray[np.int64] = self._random.choice(places, self._number, replace=few)
        low, high = surface.min(axis=0), surface.max(axis=0)
        self._middle, self._longest = 0.5 * (low + high), float((high - low).max())
        self._surface = surface
        return self.observation(seen), info

    def observation(self, observation: Numbers) -> dict[str, Numbers]:
        try:
            self._surface = self._scene_env.session.last.surface
        except NotReset:  # the simulation failed: the surface as it was last seen
            pass
        points = (self._surface[self._chosen] - self._middle) / self._longest
        return {"seen": observation, "points": np.clip(points, -BOUND, BOUND).astype(np.float32)}
