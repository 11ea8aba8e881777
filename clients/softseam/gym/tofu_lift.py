"""The reference job: lift a block of tofu, however soft it may be, and press it no more than that needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput
from softseam.gym.lift_scene import ACT, CRUSHED, HEIGHT, PADS, STEPS, LiftModel, settings_of
from softseam.gym.randomise import Randomise
from softseam.gym.reward import GENTLE, Grip, Term
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.gym.sight import BOUND, SEEN, Sight
from softseam.observation import Observation
from softseam.session import Session
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool

Floats = NDArray[np.float64]


class _Felt(NamedTuple):
    """What the pads feel."""

    wrench: Floats
    """force on the left pad and on the right one (2, 3) [N]"""
    touching: Floats
    """surface points that touch each (2,)"""

    @classmethod
    def of(cls, observation: Observation) -> _Felt:
        wrench = np.array([observation.wrench[pad][:3] for pad in PADS])
        tools = [observation.tool_names.index(pad) for pad in PADS]
        return cls(wrench, np.array([float((observation.contact_tool == tool).sum()) for tool in tools]))


def _mean(felt: Sequence[_Felt]) -> _Felt:
    """Over time, of what was felt at the ends of steps, by the trapezoidal rule."""
    return _Felt(*(np.trapezoid(np.array(each), axis=0) / (len(felt) - 1) for each in zip(*felt, strict=True)))


@dataclass(frozen=True, eq=False)
class _Piece:
    """A piece as it stands at rest between the pads."""

    along: Floats
    """from the left pad to the right one (2,)"""
    marker: int
    """the surface point in the middle of its top"""
    marker_start: Floats
    """(3,) [m]"""
    points_of_face: int
    """surface points of a face that a pad presses"""
    air: float
    """between pads and piece, both sides together [m]"""

    @classmethod
    def of(cls, scene: Scene, model: LiftModel, observation: Observation) -> _Piece:
        surface, pad = observation.surface, scene.tools["left"]
        assert isinstance(pad, BoxTool)
        turn = pad.rotation[2]
        along = np.array([math.cos(turn), math.sin(turn)])
        low, high = surface.min(axis=0), surface.max(axis=0)
        top = np.array([*(0.5 * (low + high))[:2], high[2]])
        marker = int(np.argmin(np.linalg.norm(surface - top, axis=1)))
        on_face = int((surface[:, 0] < low[0] + 1e-3 * (high[0] - low[0])).sum())
        if model == "xpbd":  # of whole cells only the corners touch
            on_face = ((math.isqrt(on_face) + 1) // 2) ** 2
        apart = observation.tools["right"].position - observation.tools["left"].position
        return cls(
            along,
            marker,
            surface[marker].copy(),
            on_face,
            float(apart[:2] @ along) - pad.size[0] - float(np.ptp(surface[:, :2] @ along)),
        )


class TofuLift(SceneEnv):
    """Two pads grip a block of tofu and lift it by 3 cm, within 3.2 s.

    An action has two numbers from -1 to 1: how fast each pad closes and both rise, in parts of 5 cm/s, for 0.04 s. Pads
    open no wider than they began and sink no lower. Seen is what a robot could measure, `SEEN`: the pads' ways, their
    forces, how much of them touches, and a marker in the middle of the tofu's top. `info` has what it could not: the
    piece's constants, stress, compression, lift.

    An episode ends with 1 where the tofu is lifted, and with -1 where it is squeezed by half, or where a step finds no
    solution; each step costs 0.002.

    reward        terms that are rewarded beside; see `softseam.gym.reward`
    randomise     how pieces differ; None: not at all
    model         FEM, or XPBD as `BatchEnv` has it
    step          of the simulation: a whole part of 0.04 s. Learn at 0.04, judge at 0.01 [s]
    environments  that learn together: weights that grow with training count the steps of all of them
    """

    def __init__(
        self,
        *,
        reward: Sequence[Term] = GENTLE,
        randomise: Randomise | None = Randomise(),  # noqa: B008 - it is frozen
        model: LiftModel = "fem",
        step: float = ACT,
        environments: int = 1,
        settings: Sequence[str] = (),
        connect: str | None = None,
        record: str | Path | None = None,
    ) -> None:
        """Other arguments as for `SceneEnv`."""
        repeat = round(ACT / step) if step > 0.0 else 0
        if repeat < 1 or not math.isclose(repeat * step, ACT):
            raise BadInput(f"step={step!r}: give a whole part of {ACT} s, such as 0.01")
        if environments < 1:
            raise BadInput(f"environments={environments!r}: give 1 or more")
        if model not in ("fem", "xpbd") or (model == "xpbd" and repeat > 1):
            raise BadInput(f"model={model!r}, step={step!r}: there are fem, and xpbd with steps of {ACT} s")
        super().__init__(
            "tofu_grasp",
            model="pbd" if model == "xpbd" else model,
            settings=(*settings_of(model, step), *settings),
            connect=connect,
            repeat=repeat,
            record=record,
        )
        self._terms, self._environments, self._lift_model = tuple(reward), environments, model
        self._randomise = Randomise.nothing(self.scene) if randomise is None else randomise
        self.steps = 0
        """of training, in this environment; set it to go on where another one stopped"""
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = Box(-BOUND, BOUND, (len(SEEN),), np.float32)

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        return self._randomise.settings(self.scene, PADS, random)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        self._closed = self._risen = 0.0
        self._sight: Sight | None = None
        self._last, self._count = np.zeros(2), 0
        self._grip: Grip | None = None
        self._piece: _Piece | None = None
        self._felt = self._felt_last = _Felt(np.zeros((2, 3)), np.zeros(2))
        found = super().reset(seed=seed, options=options)
        self._grip = self._grip_of(self.session.last)
        return found

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        close, rise = self.speed * action.astype(np.float64)
        close, rise = max(close, -self._closed / ACT), max(rise, -self._risen / ACT)
        self._closed, self._risen = self._closed + close * ACT, self._risen + rise * ACT
        self._last = action.astype(np.float64)
        assert self._piece is not None
        inwards = close * self._piece.along
        return {"left": [*inwards, rise], "right": [*-inwards, rise]}

    def see(self, observation: Observation) -> Numbers:
        if self._piece is None:
            self._piece = _Piece.of(self.session.scene, self._lift_model, observation)
        piece, (force, pull) = self._piece, self._forces()
        marker = observation.surface[piece.marker] - piece.marker_start
        touching = self._felt.touching / piece.points_of_face
        along = float(marker[:2] @ piece.along)
        sight = Sight(
            *(self._closed, self._risen, *force, pull, float(marker[2]), along, *touching),
            *(*self._last, self._count / STEPS),
        )
        before, self._sight = self._sight, sight
        return sight.numbers(before, ACT, self.speed, HEIGHT)

    def reward(self, before: Observation, after: Observation) -> float:
        grip, then = self._grip_of(after), self._grip
        assert then is not None
        self._grip = grip
        self.steps += 1
        steps = self.steps * self._environments
        return float(sum(term.of(then, grip, steps) for term in self._terms)) - 2e-3 + self._ending(after)

    def ended(self, observation: Observation) -> bool:
        return self._ending(observation) != 0.0

    def step(self, action: Any) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        self._count += 1
        seen, reward, terminated, truncated, info = super().step(action)
        if "failed" in info:  # a squeeze beyond what the body bears
            reward, terminated, truncated = -1.0, True, False
        info["is_success"] = terminated and "failed" not in info and info["lift_height"] >= HEIGHT
        info["stress"] = 0.0 if self._grip is None else self._grip.stress
        return seen, reward, terminated, truncated, info

    # ----

    def _advance(self, session: Session, velocities: Mapping[str, ArrayLike]) -> Observation:
        """And feel the pads: means over the action, whatever the step."""
        taken = [session.step(velocities) for _ in range(self._repeat)]
        felt = [_Felt.of(observation) for observation in taken]
        if self._lift_model == "xpbd":  # a step has the mean over its substeps already
            self._felt = felt[-1]
        else:
            self._felt, self._felt_last = _mean([self._felt_last, *felt]), felt[-1]
        return replace(taken[-1], events=tuple(event for each in taken for event in each.events))

    def _forces(self) -> tuple[Floats, float]:
        """With which the left and the right pad press (2,), and the body's weight on both [N]."""
        assert self._piece is not None
        left, right = self._felt.wrench
        along = np.array([-(left[:2] @ self._piece.along), right[:2] @ self._piece.along])
        return np.maximum(along, 0.0), float(-left[2] - right[2])

    def _grip_of(self, observation: Observation) -> Grip:
        quantities, last = observation.quantities, self._grip
        assert self._piece is not None
        squeezed = quantities.get("compression", 0.0)
        return Grip(
            lift=quantities.get("lift_height", 0.0),
            air=max(self._piece.air - 2.0 * self._closed, 0.0),
            force=float(self._forces()[0].min()),
            slip=quantities.get("slip", 0.0),
            compression=max(squeezed, 0.0 if last is None else last.compression),
            stress=max(quantities.get("peak_von_mises", 0.0), 0.0 if last is None else last.stress),
            energy=float(observation.energies.get("strain", 0.0)),
        )

    def _ending(self, observation: Observation) -> float:
        """1 where the tofu is lifted, -1 where it is crushed, 0 before."""
        if observation.quantities.get("compression", 0.0) >= CRUSHED:
            return -1.0
        return float(observation.lift_height >= HEIGHT)
