"""A scene with a task: terms are rewarded, tools feel, and an episode ends with a word."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypedDict, TypeVar

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput
from softseam.gym.reward import Term
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.gym.sight import BOUND
from softseam.observation import Observation
from softseam.session import Session
from softseam.variants import Model
from softseam_protocol.models import some_read
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]


class Felt(NamedTuple):
    """What k tools feel."""

    wrench: Floats
    """force on each (k, 3) [N]"""
    touching: Floats
    """surface points that touch each (k,)"""

    @classmethod
    def of(cls, observation: Observation, tools: Sequence[str]) -> Felt:
        """At the end of a step."""
        wrench = np.array([observation.wrench[tool][:3] for tool in tools])
        numbers = [observation.tool_names.index(tool) for tool in tools]
        return cls(wrench, np.array([float((observation.contact_tool == number).sum()) for number in numbers]))

    @classmethod
    def nothing(cls, tools: Sequence[str]) -> Felt:
        """Before the first step."""
        return cls(np.zeros((len(tools), 3)), np.zeros(len(tools)))


def mean_of_ends(felt: Sequence[Felt]) -> Felt:
    """Over time, of what was felt at the start and at the ends of steps, by the trapezoidal rule."""
    return Felt(*(np.trapezoid(np.array(each), axis=0) / (len(felt) - 1) for each in zip(*felt, strict=True)))


def mean_of_means(felt: Sequence[Felt]) -> Felt:
    """Over time, of what was felt in each step on the mean."""
    return Felt(*(np.mean(np.array(each), axis=0) for each in zip(*felt, strict=True)))


ACT = 0.04
"""time between two actions [s]"""
COST = 2e-3
"""of an action"""

Standing = TypeVar("Standing")


class Given(TypedDict, total=False):
    """What the constructor of each task hands on; for what is not said here see `SceneEnv`."""

    environments: int
    """that learn together: weights that grow with training count the steps of all of them"""
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
        *,
        step: float,
        model: Model,
        settings: Sequence[str],
        seen: Sequence[str],
        actions: int,
        felt: Sequence[str],
        reward: Sequence[Term[Standing]],
        environments: int = 1,
        connect: str | None = None,
        record: str | Path | None = None,
        render_mode: str | None = None,
    ) -> None:
        """
        step     of the simulation: a whole part of 0.04 s [s]
        seen     names of the numbers that `look` returns
        actions  numbers of an action
        felt     tools whose forces are felt: means over an action, whatever the step
        reward   terms

        Other arguments as of `Given`.
        Raises BadInput.
        """
        if environments < 1:
            raise BadInput(f"environments={environments!r}: give 1 or more")
        super().__init__(
            scene,
            settings=settings,
            model=model,
            connect=connect,
            repeat=parts_of_an_action(step),
            record=record,
            render_mode=render_mode,
        )
        self._terms, self._environments = tuple(reward), environments
        self._felt_tools, self._means = tuple(felt), some_read([model], "pbd.substeps")
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
