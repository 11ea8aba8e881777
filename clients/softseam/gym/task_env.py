"""A scene with a task: terms are rewarded, and an episode ends with a word."""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike

from softseam.errors import BadInput
from softseam.gym.felt import Felt, mean_of_ends, mean_of_means
from softseam.gym.reward import Term
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.gym.sight import BOUND
from softseam.observation import Observation
from softseam.session import Session
from softseam.variants import Model
from softseam_protocol.models import some_read
from softseam_protocol.scene.scene import Scene

ACT = 0.04
"""time between two actions [s]"""
COST = 2e-3
"""of an action"""

Standing = TypeVar("Standing")


@dataclass(frozen=True)
class Frame:
    """How a task is simulated: what the constructor of each hands on; for what is not said here see `SceneEnv`."""

    step: float
    """of the simulation: a whole part of 0.04 s [s]"""
    environments: int
    """that learn together: weights that grow with training count the steps of all of them"""
    model: Model
    settings: Sequence[str]
    connect: str | None
    record: str | Path | None
    render_mode: str | None


class TaskEnv(SceneEnv, Generic[Standing]):
    """A task with a scene: what is rewarded are changes of how the body stands, `Standing`, and how an episode ends.

    The last action of an episode adds 1 where it ends well, with the word `GOAL`, and -1 where it ends badly; each
    costs 0.002. A step that finds no solution ends it badly. `info["ending"]` has the word with which an episode ended:
    `GOAL`, one of the task's own, "failed" or "time". Before, it is "".
    """

    GOAL: str
    """word of an episode that ended well"""
    BAD: tuple[str, ...]
    """the task's own words of those that ended badly"""

    def __init__(
        self,
        scene: str | Path | Scene,
        frame: Frame,
        *,
        seen: Sequence[str],
        actions: int,
        felt: Sequence[str],
        reward: Sequence[Term[Standing]],
    ) -> None:
        """
        seen     names of the numbers that `look` returns
        actions  numbers of an action
        felt     tools whose forces are felt: means over an action, whatever the step
        reward   terms

        Raises BadInput.
        """
        if frame.environments < 1:
            raise BadInput(f"environments={frame.environments!r}: give 1 or more")
        super().__init__(
            scene,
            settings=frame.settings,
            model=frame.model,
            connect=frame.connect,
            repeat=parts_of_an_action(frame.step),
            record=frame.record,
            render_mode=frame.render_mode,
        )
        self._terms, self._environments = tuple(reward), frame.environments
        self._felt_tools, self._means = tuple(felt), some_read([frame.model], "pbd.substeps")
        self.steps = 0
        """of training, in this environment; set it to go on where another one stopped"""
        self.action_space = Box(-1.0, 1.0, (actions,), np.float32)
        self.observation_space = Box(-BOUND, BOUND, (len(seen),), np.float32)
        self._begun = False

    # ---- what a task says

    @abstractmethod
    def begin(self, observation: Observation) -> None:
        """Take measure of what an episode begins with."""

    @abstractmethod
    def look(self, observation: Observation) -> Numbers:
        """What the agent sees after an action, and at the start."""

    @abstractmethod
    def stands(self, observation: Observation, before: Standing | None) -> Standing:
        """How the body stands; before: how it stood an action ago, at the start None."""

    @abstractmethod
    def ending(self, observation: Observation, standing: Standing) -> str:
        """The word with which the episode ends, "" where it goes on."""

    def shown(self, standing: Standing) -> Mapping[str, Any]:
        """What `info` has beside the scene's quantities."""
        return {}

    @property
    def trained(self) -> int:
        """Steps of training in all environments that learn together."""
        return self.steps * self._environments

    # ---- what SceneEnv and Gymnasium call

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        self._begun, self._count, self._word = False, 0, ""
        self._last_action = np.zeros(self.action_space.shape or ())
        self._felt = self._felt_last = Felt.nothing(self._felt_tools)
        seen, info = super().reset(seed=seed, options=options)
        self._standing = self.stands(self.session.last, None)
        return seen, info | {"ending": ""} | dict(self.shown(self._standing))

    def see(self, observation: Observation) -> Numbers:
        if not self._begun:
            self.begin(observation)
            self._begun = True
        return self.look(observation)

    def reward(self, before: Observation, after: Observation) -> float:
        then, self._standing = self._standing, self.stands(after, self._standing)
        self.steps += 1
        steps = self.trained
        self._word = self.ending(after, self._standing)
        ended = 0.0 if not self._word else 1.0 if self._word == self.GOAL else -1.0
        return float(sum(term.of(then, self._standing, steps) for term in self._terms)) - COST + ended

    def ended(self, observation: Observation) -> bool:
        return bool(self._word)

    def step(self, action: Any) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        self._count += 1
        seen, reward, terminated, truncated, info = super().step(action)
        word = self._word or ("time" if truncated else "")
        if "failed" in info:  # more than the body bears
            reward, terminated, truncated, word = -1.0, True, False, "failed"
        info |= {"ending": word, "is_success": word == self.GOAL, **self.shown(self._standing)}
        return seen, reward, terminated, truncated, info

    def _advance(self, session: Session, velocities: Mapping[str, ArrayLike]) -> Observation:
        """And feel the tools: means over the action, whatever the step."""
        taken = [session.step(velocities) for _ in range(self._repeat)]
        felt = [Felt.of(observation, self._felt_tools) for observation in taken]
        if self._means:  # of substeps
            self._felt = mean_of_means(felt)
        else:
            self._felt, self._felt_last = mean_of_ends([self._felt_last, *felt]), felt[-1]
        return replace(taken[-1], events=tuple(event for each in taken for event in each.events))


def parts_of_an_action(step: float) -> int:
    """How many steps [s] an action takes. Raises BadInput where they are no whole number."""
    repeat = round(ACT / step) if step > 0.0 else 0
    if repeat < 1 or not math.isclose(repeat * step, ACT):
        raise BadInput(f"step={step!r}: give a whole part of {ACT} s, such as 0.01")
    return repeat
