"""Many environments of Gymnasium as stable-baselines3 takes them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv

Watch = Callable[[Any, Mapping[str, Any], Any], None]
"""what sees each step: actions (k, 2), what the batch reported, and which episodes ended with it (k,)"""


class BatchVec(VecEnv):  # type: ignore[misc]
    """Episodes that end are followed at once; `infos` are empty but where one ended."""

    def __init__(self, batch: VectorEnv[Any, Any, Any], hardship: str = "stress", deadline: bool = False) -> None:
        """hardship  what is reported of an episode that ended, beside its success: a name in `info`
        deadline  whether one that runs out of time has ended, and nothing that would have come counts
        """
        if batch.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise ValueError("stable-baselines3 wants episodes to follow at once: autoreset_mode SAME_STEP")
        self.batch, self._hardship, self._deadline = batch, hardship, deadline
        self.watch: Watch | None = None
        super().__init__(batch.num_envs, batch.single_observation_space, batch.single_action_space)
        self._taken: Any = None
        self._returned, self._length = np.zeros(batch.num_envs), np.zeros(batch.num_envs, dtype=np.int64)

    def reset(self) -> Any:
        seeds = self._seeds
        seen, _ = self.batch.reset(seed=None if all(seed is None for seed in seeds) else seeds)
        self._returned[:], self._length[:] = 0.0, 0
        self._reset_seeds()
        return seen

    def step_async(self, actions: Any) -> None:
        self._taken = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        seen, reward, terminated, truncated, info = self.batch.step(self._taken)
        self._returned += reward
        self._length += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        done = terminated | truncated
        if self.watch is not None:
            self.watch(self._taken, info, done)
        for i in np.flatnonzero(done):
            last = info["final_info"]
            infos[i] = {
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i]) and not self._deadline,
                "is_success": bool(last["is_success"][i]),
                "hardship": float(last[self._hardship][i]),
                "episode": {"r": float(self._returned[i]), "l": int(self._length[i])},
            }
        self._returned[done], self._length[done] = 0.0, 0
        return seen, reward.astype(np.float32), done, infos

    def close(self) -> None:
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.batch, attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self.batch, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        return [getattr(self.batch, method_name)(*args, **kwargs)] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        return [False] * self._count(indices)

    def _count(self, indices: int | Sequence[int] | None) -> int:
        return len(list(self._get_indices(indices)))
