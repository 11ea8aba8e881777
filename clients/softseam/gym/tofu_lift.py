"""The reference job: lift a block of tofu, however soft it may be, and press it no more than that needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput
from softseam.gym.randomise import Randomise
from softseam.gym.reward import GENTLE, Grip, Term
from softseam.gym.scene_env import Numbers, SceneEnv
from softseam.observation import Observation
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool

Floats = NDArray[np.float64]

HEIGHT = 0.03
"""to lift the tofu by, which ends an episode [m]"""
CRUSHED = 0.5
"""compression that ends it, too; FEM in a rigid box is right up to 0.6"""
STEPS = 80
"""of an episode at most"""
ACT = 0.04
"""time between two actions [s]"""
_CLOSING = 0.02
_FORCE = 0.3
"""from which on a force is seen by its logarithm [N]"""
_PADS = ("left", "right")
_BOUND = 10.0
"""largest number seen"""

SEEN = (
    "closed",
    "risen",
    "force of the left pad",
    "force of the right pad",
    "pull",
    "pull over force",
    "height of the marker",
    "its speed upwards",
    "its way sideways",
    "slip of the marker",
    "left pad in contact",
    "right pad in contact",
    "change of force",
    "last closing",
    "last rising",
    "time",
)
"""what an agent sees, in this order, all of order 1"""


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
    def of(cls, scene: Scene, observation: Observation) -> _Piece:
        surface, pad = observation.surface, scene.tools["left"]
        assert isinstance(pad, BoxTool)
        turn = pad.rotation[2]
        along = np.array([math.cos(turn), math.sin(turn)])
        low, high = surface.min(axis=0), surface.max(axis=0)
        top = np.array([*(0.5 * (low + high))[:2], high[2]])
        marker = int(np.argmin(np.linalg.norm(surface - top, axis=1)))
        apart = observation.tools["right"].position - observation.tools["left"].position
        return cls(
            along,
            marker,
            surface[marker].copy(),
            int((surface[:, 0] < low[0] + 1e-3 * (high[0] - low[0])).sum()),
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
    step          of the simulation: a whole part of 0.04 s. Learn at 0.04, judge at 0.01 [s]
    environments  that learn together: weights that grow with training count the steps of all of them
    """

    def __init__(
        self,
        *,
        reward: Sequence[Term] = GENTLE,
        randomise: Randomise | None = Randomise(),  # noqa: B008 - it is frozen
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
        # FEM on 2x2x2 cells of 27 nodes: within 5 % of the truth (docs/results/chart.md), the fastest that is
        own = [f"step={step!r}", "body.cell=[0.025, 0.025, 0.025]", f"duration={STEPS * ACT!r}"]
        own += ["quantities=[grip_force, lift_height, slip, peak_von_mises, compression]"]
        for name, side in zip(_PADS, (-1.0, 1.0), strict=True):
            # larger than any piece, so that no point slips off an edge, and clear of the largest
            own += [f"tools.{name}.size=[0.01, 0.09, 0.09]", f"tools.{name}.position=[{0.048 * side}, 0, 0.046]"]
        super().__init__(
            "tofu_grasp", model="fem", settings=(*own, *settings), connect=connect, repeat=repeat, record=record
        )
        self._terms, self._environments = tuple(reward), environments
        self._randomise = Randomise.nothing(self.scene) if randomise is None else randomise
        self.steps = 0
        """of training, in this environment; set it to go on where another one stopped"""
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = Box(-_BOUND, _BOUND, (len(SEEN),), np.float32)

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        return self._randomise.settings(self.scene, _PADS, random)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        self._closed = self._risen = self._force = self._height = 0.0
        self._last, self._count = np.zeros(2), 0
        self._grip: Grip | None = None
        self._piece: _Piece | None = None
        return super().reset(seed=seed, options=options)

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
            self._piece = _Piece.of(self.session.scene, observation)
        piece, (force, pull) = self._piece, self._forces(observation)
        marker = observation.surface[piece.marker] - piece.marker_start
        touching = [
            float((observation.contact_tool == observation.tool_names.index(pad)).sum()) / piece.points_of_face
            for pad in _PADS
        ]
        weaker = float(force.min())
        rate = (marker[2] - self._height) / ACT if self._count else 0.0
        seen = [
            self._closed / _CLOSING,
            self._risen / HEIGHT,
            *_logarithm(force),
            float(_logarithm(pull)),
            pull / (force.sum() + _FORCE),
            marker[2] / HEIGHT,
            rate / self.speed,
            float(marker[:2] @ piece.along) / 5e-3,
            (self._risen - marker[2]) / 5e-3,
            *touching,
            float(_logarithm(weaker) - _logarithm(self._force)),
            *self._last,
            self._count / STEPS,
        ]
        self._force, self._height = weaker, float(marker[2])
        return np.asarray(np.clip(seen, -_BOUND, _BOUND), np.float32)

    def reward(self, before: Observation, after: Observation) -> float:
        grip = self._grip_of(after)
        then, self._grip = self._grip or self._grip_of(before), grip
        self.steps += 1
        steps = self.steps * self._environments
        return sum(term.of(then, grip, steps) for term in self._terms) - 2e-3 + self._ending(after)

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

    def _forces(self, observation: Observation) -> tuple[Floats, float]:
        """With which the left and the right pad press (2,), and the body's weight on both [N]."""
        assert self._piece is not None
        left, right = (observation.wrench[pad] for pad in _PADS)
        along = np.array([-(left[:2] @ self._piece.along), right[:2] @ self._piece.along])
        return np.maximum(along, 0.0), float(-left[2] - right[2])

    def _grip_of(self, observation: Observation) -> Grip:
        quantities, last = observation.quantities, self._grip
        assert self._piece is not None
        squeezed = quantities.get("compression", 0.0)
        return Grip(
            lift=quantities.get("lift_height", 0.0),
            air=max(self._piece.air - 2.0 * self._closed, 0.0),
            force=float(self._forces(observation)[0].min()),
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


def _logarithm(force: Any) -> Any:
    """Of a force [N], with its sign: linear below 0.3 N."""
    return np.sign(force) * np.log1p(np.abs(force) / _FORCE)
