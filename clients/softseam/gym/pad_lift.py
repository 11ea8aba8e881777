"""The lift that TofuLift and SliceLift share: two pads grip a piece that is not known, and raise it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softseam.gym.lift_scene import CRUSHED, HEIGHT, PADS, STEPS, THICKNESS
from softseam.gym.randomise import Randomise
from softseam.gym.reward import Grip, Term, fitting
from softseam.gym.scene_env import Numbers
from softseam.gym.sight import SEEN, Sight
from softseam.gym.task_env import ACT, Given, TaskEnv
from softseam.observation import Observation
from softseam.variants import Model
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]


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
    """surface points that a pad presses once it holds the piece"""
    air: float
    """between pads and piece, both sides together [m]"""

    @classmethod
    def of(cls, observation: Observation, points_of_face: int) -> _Piece:
        surface = observation.surface
        apart = (observation.tools["right"].position - observation.tools["left"].position)[:2]
        along = apart / np.linalg.norm(apart)
        marker = top_middle(surface)
        air = float(apart @ along) - THICKNESS - float(np.ptp(surface[:, :2] @ along))
        return cls(along, marker, surface[marker].copy(), points_of_face, air)


def top_middle(surface: Floats) -> int:
    """The point of a surface (n, 3) [m] that is nearest to the middle of its bounding box's top."""
    low, high = surface.min(axis=0), surface.max(axis=0)
    top = np.array([*(0.5 * (low + high))[:2], high[2]])
    return int(np.argmin(np.linalg.norm(surface - top, axis=1)))


class PadLift(TaskEnv[Grip]):
    """Actions, what is seen and endings of `TofuLift`, which says them, and of `SliceLift`."""

    GOAL, BAD = "lifted", ("crushed",)

    def __init__(
        self,
        scene: str | Path | Scene,
        *,
        step: float,
        model: Model,
        settings: Sequence[str],
        reward: Sequence[Term[Grip]],
        randomise: Randomise | None,
        **given: Unpack[Given],
    ) -> None:
        """reward: terms; randomise: how pieces differ; None: not at all"""
        simulated: dict[str, Any] = {"step": step, "model": model, "settings": settings}
        super().__init__(scene, seen=SEEN, actions=2, felt=PADS, reward=fitting(reward, Grip), **simulated, **given)
        self._randomise = Randomise.nothing(self.scene) if randomise is None else randomise

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        return self._randomise.settings(self.scene, PADS, random)

    @abstractmethod
    def points_of_face(self, surface: Floats) -> int:
        """How many points (n, 3) [m] of a piece's surface a pad presses once it holds it, about."""

    def begin(self, observation: Observation) -> None:
        self._closed = self._risen = 0.0
        self._sight: Sight | None = None
        self._piece = _Piece.of(observation, self.points_of_face(observation.surface))

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        close, rise = self.speed * action.astype(np.float64)
        close, rise = max(close, -self._closed / ACT), max(rise, -self._risen / ACT)
        self._closed, self._risen = self._closed + close * ACT, self._risen + rise * ACT
        self._last_action = action.astype(np.float64)
        inwards = close * self._piece.along
        return {"left": [*inwards, rise], "right": [*-inwards, rise]}

    def look(self, observation: Observation) -> Numbers:
        piece, (force, pull) = self._piece, self._forces()
        marker = observation.surface[piece.marker] - piece.marker_start
        touching = self._felt.touching / piece.points_of_face
        along = float(marker[:2] @ piece.along)
        sight = Sight(
            *(self._closed, self._risen, *force, pull, float(marker[2]), along, *touching),
            *(*self._last_action, self._count / STEPS),
        )
        before, self._sight = self._sight, sight
        return sight.numbers(before, ACT, self.speed, HEIGHT)

    def stands(self, observation: Observation, before: Grip | None) -> Grip:
        quantities = observation.quantities
        squeezed = self._squeezed(observation)
        return Grip(
            lift=quantities.get("lift_height", 0.0),
            air=max(self._piece.air - 2.0 * self._closed, 0.0),
            force=float(self._forces()[0].min()),
            slip=quantities.get("slip", 0.0),
            compression=max(squeezed, 0.0 if before is None else before.compression),
            stress=max(quantities.get("peak_von_mises", 0.0), 0.0 if before is None else before.stress),
            energy=float(observation.energies.get("strain", 0.0)),
        )

    def ending(self, observation: Observation, standing: Grip) -> str:
        if self._squeezed(observation) >= CRUSHED:
            return "crushed"
        return self.GOAL if observation.lift_height >= HEIGHT else ""

    def shown(self, standing: Grip) -> Mapping[str, Any]:
        return {"stress": standing.stress}

    # ----

    def _squeezed(self, observation: Observation) -> float:
        """By how much of its width the piece is squeezed; 0 where it is not between the pads, however near they are."""
        return observation.quantities.get("compression", 0.0) if (self._felt.touching > 0.0).all() else 0.0

    def _forces(self) -> tuple[Floats, float]:
        """With which the left and the right pad press (2,), and the body's weight on both [N]."""
        left, right = self._felt.wrench
        along = np.array([-(left[:2] @ self._piece.along), right[:2] @ self._piece.along])
        return np.maximum(along, 0.0), float(-left[2] - right[2])
