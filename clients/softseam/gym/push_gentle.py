"""A finger pushes a soft piece over a table to a target, and presses it no more than that needs."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput
from softseam.gym.pad_lift import top_middle
from softseam.gym.randomise import Randomise
from softseam.gym.reward import GENTLE_PUSH, Push, Ramp, Term, fitting
from softseam.gym.scene_env import Numbers
from softseam.gym.sight import BOUND, logarithm
from softseam.gym.task_env import ACT, Given, TaskEnv
from softseam.observation import Observation
from softseam_protocol.models import REFERENCE

FINGER = "finger"
STEPS = 100
"""of an episode at most"""
NEAR = 4e-3
"""from the target, which ends an episode well [m]"""
BEYOND = 0.015
"""past the target ahead, which ends it badly, as a finger cannot pull [m]"""
AHEAD, ASIDE = (0.03, 0.06), (-0.008, 0.008)
"""least and greatest distance of the target from where the piece's marker begins, along x and y [m]"""
SIDEWAYS = 0.02
"""way of the finger aside at most [m]"""
SPEED_ASIDE = 0.1
"""of the finger aside at an action of 1: where it is as fast as ahead, who explores does not learn to steer [m/s]"""
STRESS_LIMIT = 900.0
"""largest von Mises stress that a piece bears without a bruise; assumed, a little above what sliding takes [Pa]"""
STRAIGHT = Randomise(yaw=0.0)
"""pieces as of TofuLift, met by a finger that is square to them"""

SEEN = (
    "way of the finger ahead",
    "way of the finger aside",
    "force ahead",
    "force aside",
    "change of force",
    "finger in contact",
    "target ahead of the marker",
    "target aside of it",
    "marker's way ahead",
    "marker's way aside",
    "its speed ahead",
    "turn of the piece",
    "last action ahead",
    "last action aside",
    "time",
)
"""what an agent sees, in this order, all of order 1"""

Floats = NDArray[np.float64]


class PushGentle(TaskEnv[Push]):
    """A finger pushes a block of tofu over a table to a target 3 to 6 cm ahead and up to 8 mm aside, within 4 s.

    An action has two numbers from -1 to 1: how fast the finger goes ahead, in parts of 40 cm/s, and aside, in parts of
    10 cm/s, for 0.04 s. It goes no farther back than it began, and up to 2 cm aside. Seen is what a robot could
    measure, `SEEN`: the finger's way, force and contact, where the target is from the marker in the middle of the
    piece's top, as a camera shows it, and how the piece is turned. `info` has what it could not: stress, the distance.

    An episode ends "reached" with 1, where the marker is within 4 mm of the target; with -1 "bruised", where von Mises
    stress exceeds `stress_limit`, or "passed", where the marker is 15 mm past the target; or with the "time". A piece
    that slides is stressed by 0.25 to 0.8 kPa, whatever the speed; one that is met at full speed by 0.9 to 1.7 kPa.

    reward        terms that are rewarded beside; see `softseam.gym.reward`
    randomise     how pieces differ; None: not at all. The target is drawn in any case
    stress_limit  that a piece bears; a `Ramp` where it falls while an agent learns [Pa]
    step          of the simulation: a whole part of 0.04 s; longer ones do not show how hard a piece is met [s]
    environments  that learn together: weights that grow with training count the steps of all of them
    """

    GOAL, BAD = "reached", ("bruised", "passed")
    speed = 0.4

    def __init__(
        self,
        *,
        reward: Sequence[Term[Push]] = GENTLE_PUSH,
        randomise: Randomise | None = STRAIGHT,
        stress_limit: float | Ramp = STRESS_LIMIT,
        step: float = 0.01,
        settings: Sequence[str] = (),
        **given: Unpack[Given],
    ) -> None:
        """Other arguments as of `Given`, and for `SceneEnv`."""
        limit = Ramp.of(stress_limit)
        if not min(limit.start, limit.end) > 0.0:
            raise BadInput(f"stress_limit={stress_limit!r}: give more than 0 Pa")
        super().__init__(
            "tofu_push",
            step=step,
            model=REFERENCE,
            settings=(*_settings(step), *settings),
            seen=SEEN,
            actions=2,
            felt=(FINGER,),
            reward=fitting(reward, Push),
            **given,
        )
        self._randomise = Randomise.nothing(self.scene) if randomise is None else randomise
        self._stress_limit = limit

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        drawn = self._randomise.settings(self.scene, (FINGER,), random)
        self._way_to_go = np.array([random.uniform(*AHEAD), random.uniform(*ASIDE)])
        return drawn

    def begin(self, observation: Observation) -> None:
        surface = observation.surface
        self._marker, self._front = top_middle(surface), _front_of_top(surface)
        self._marker_start = surface[self._marker, :2].copy()
        self._target = self._marker_start + self._way_to_go
        self._finger = np.zeros(2)
        face = surface[:, 0] < surface[:, 0].min() + 1e-3 * np.ptp(surface[:, 0])
        self._points_of_face = int(face.sum())
        self._marker_last, self._force_last = self._marker_start, 0.0

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        ahead, aside = (self.speed, SPEED_ASIDE) * action.astype(np.float64) * ACT
        way = np.array(
            [max(self._finger[0] + ahead, 0.0), float(np.clip(self._finger[1] + aside, -SIDEWAYS, SIDEWAYS))]
        )
        velocity, self._finger = (way - self._finger) / ACT, way
        self._last_action = action.astype(np.float64)
        return {FINGER: [*velocity, 0.0]}

    def look(self, observation: Observation) -> Numbers:
        surface = observation.surface
        marker = surface[self._marker, :2]
        front = surface[self._front, :2] - marker
        to_go, went = self._target - marker, marker - self._marker_start
        ahead, aside = (-self._felt.wrench[0, :2]).tolist()
        seen = [
            *(self._finger / 0.05),
            logarithm(ahead),
            logarithm(aside),
            logarithm(ahead) - logarithm(self._force_last),
            float(self._felt.touching[0]) / self._points_of_face,
            *(to_go / (0.05, 0.01)),
            *(went / (0.05, 0.01)),
            float(marker[0] - self._marker_last[0]) / ACT / self.speed,
            math.atan2(front[1], front[0]) / 0.2,
            *self._last_action,
            self._count / STEPS,
        ]
        self._marker_last, self._force_last = marker, ahead
        return np.clip(np.array(seen, np.float32), -BOUND, BOUND)

    def stands(self, observation: Observation, before: Push | None) -> Push:
        to_go = self._target - observation.surface[self._marker, :2]
        stress = observation.quantities.get("peak_von_mises", 0.0)
        reached = observation.tools[FINGER].position[0] + 0.5 * _THICKNESS
        return Push(
            distance=float(np.linalg.norm(to_go)),
            aside=abs(float(to_go[1])),
            air=max(float(observation.surface[:, 0].min()) - float(reached), 0.0),
            force=max(float(-self._felt.wrench[0, 0]), 0.0),
            stress=max(stress, 0.0 if before is None else before.stress),
            energy=float(observation.energies.get("strain", 0.0)),
        )

    def ending(self, observation: Observation, standing: Push) -> str:
        if standing.stress > self._stress_limit.at(self.trained):
            return "bruised"
        if standing.distance <= NEAR:
            return self.GOAL
        past = observation.surface[self._marker, 0] - self._target[0]
        return "passed" if past > BEYOND else ""

    def marks(self) -> Floats:
        """A pole at the target, on a cross."""
        x, y = self._target
        arm = 0.3 * AHEAD[0]
        ends = [
            [[x, y, 0.0], [x, y, _POLE]],
            [[x - arm, y, 0.0], [x + arm, y, 0.0]],
            [[x, y - arm, 0.0], [x, y + arm, 0.0]],
        ]
        return np.array(ends)

    def shown(self, standing: Push) -> Mapping[str, Any]:
        return {"stress": standing.stress, "distance": standing.distance, "force": standing.force}


_POLE = 0.06
"""height of what marks the target in pictures, above the table and the piece [m]"""
_THICKNESS = 0.01
"""of the finger [m]"""


def _settings(step: float) -> list[str]:
    """What the scene tofu_push is changed by: a finger in place of its plate, clear of the largest piece."""
    finger = f"{{kind: box, size: [{_THICKNESS}, 0.04, 0.05], position: [-0.055, 0, 0.0265], friction: 0.6}}"
    return [
        f"step={step!r}",
        f"duration={STEPS * ACT!r}",
        f"tools={{table: {{kind: plane, friction: 0.3}}, {FINGER}: {finger}}}",
        f"motion=[{{tools: [{FINGER}], move: [0.06, 0, 0], speed: 0.06}}]",
        "regions={default: fem}",
        "probes={}",
        "quantities=[slip, peak_von_mises]",
        "body.cell=[0.03, 0.03, 0.02]",
    ]


def _front_of_top(surface: Floats) -> int:
    """The point of a surface (n, 3) [m] in the middle of its top's edge ahead."""
    low, high = surface.min(axis=0), surface.max(axis=0)
    place = np.array([high[0], 0.5 * (low[1] + high[1]), high[2]])
    return int(np.argmin(np.linalg.norm(surface - place, axis=1)))
