"""Two grippers fold a cloth edge to edge."""

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput
from softseam.given import whole
from softseam.gym.reward import FOLD, Fold, Term, fitting
from softseam.gym.scene_env import Numbers
from softseam.gym.sight import BOUND, logarithm
from softseam.gym.task_env import ACT, Given, TaskEnv
from softseam.observation import Observation
from softseam.scenes import load_scene
from softseam_protocol.models import PARTICLES_DEFAULT
from softseam_protocol.scene.particles import SheetBody

GRIPPERS = ("left", "right")
STEPS = 120
"""of an episode at most"""
CORNERS = 0.05
"""mean distance of the corners from where they belong that is folded, in parts of the cloth's edge"""
PLACE = 0.08
"""distance, seen from above, within which a particle lies on its place, in parts of the cloth's edge"""
AREA = 0.9
"""part of the free half that lies on its place where the cloth is folded"""
TORN = 0.5
"""largest relative change of a spring's length that the cloth bears"""
HIGHEST = 0.4
"""of a gripper above where it began [m]"""

SEEN = (
    *(f"way of the {side} gripper along {axis}" for side in GRIPPERS for axis in "xyz"),
    *(f"pull on the {side} gripper along {axis}" for side in GRIPPERS for axis in "xyz"),
    *(f"way to go of the {side} corner along {axis}" for side in GRIPPERS for axis in "xyz"),
    "height of the cloth's middle",
    "folded area",
    *(f"last action of the {side} gripper along {axis}" for side in GRIPPERS for axis in "xyz"),
    "time",
)
"""what an agent sees, in this order, all of order 1"""

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class TowelFold(TaskEnv[Fold]):
    """Two grippers fold the textbook chapter's towel edge to edge, within 4.8 s.

    They hold two corners from the first action on. An action has six numbers from -1 to 1: velocities along x, y and z
    of the left gripper and of the right one, in parts of 50 cm/s, for 0.04 s. Grippers sink no lower than they began,
    and rise by 40 cm at most. Seen is what a robot with a camera could measure, `SEEN`: the grippers' ways and pulls,
    where the corners belong, the middle of the cloth, the part that is folded. `info` has more: stretch and energies.

    An episode ends "folded" with 1, where the corners that are held lie on the opposite ones (within 5 % of the edge,
    one layer above) and nine tenths of the free half on the other; with -1 "torn", where a spring is stretched by half;
    or with the "time".

    reward        terms that are rewarded beside; see `softseam.gym.reward`
    divisions     spacings along each edge, 24 in place of the chapter's 50: an action takes 10 ms, not 40
    spread        how far density, bending and friction on the table differ, evenly to either side; 0: not at all
    step          of the simulation: a whole part of 0.04 s [s]
    environments  that learn together: weights that grow with training count the steps of all of them
    """

    GOAL, BAD = "folded", ("torn",)
    speed = 0.5

    def __init__(
        self,
        *,
        reward: Sequence[Term[Fold]] = FOLD,
        divisions: int = 24,
        spread: float = 0.3,
        step: float = 0.01,
        settings: Sequence[str] = (),
        **given: Unpack[Given],
    ) -> None:
        """Other arguments as of `Given`, and for `SceneEnv`."""
        number = whole(divisions)
        if number is None or number < 8:
            raise BadInput(f"divisions={divisions!r}: give a whole number of spacings along an edge, 8 or more")
        if not 0.0 <= spread < 1.0:
            raise BadInput(f"spread={spread!r}: give a part of what the scene says, from 0 to below 1")
        super().__init__(
            "cloth_fold",
            step=step,
            model=PARTICLES_DEFAULT,
            settings=(*_settings(number, step), *settings),
            seen=SEEN,
            actions=6,
            felt=GRIPPERS,
            reward=fitting(reward, Fold),
            **given,
        )
        cloth = self.scene.body
        assert isinstance(cloth, SheetBody)
        self._cloth, self._spread = cloth, spread

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        density, bending, friction = 1.0 + self._spread * random.uniform(-1.0, 1.0, 3)
        return (
            f"body.density={self._cloth.density * density:.6g}",
            f"body.bending={self._cloth.bending * bending:.6g}",
            f"tools.ground.friction={self.scene.tools['ground'].friction * friction:.6g}",
        )

    def begin(self, observation: Observation) -> None:
        x = observation.positions
        rows = _rows(x)
        self._layer = 2.0 * float(x[:, 2].mean())  # it lies on the table, half of its thickness above
        self._size = float(np.ptp(x[:, 0]))
        half = (len(rows) - 1) // 2
        self._free, self._partner = rows[: -half - 1 : -1].ravel(), rows[:half].ravel()
        self._held, self._opposite = rows[-1, [0, -1]], rows[0, [0, -1]]
        self._middle = int(rows[len(rows) // 2, rows.shape[1] // 2])
        self._ways = np.zeros((2, 3))

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        way = self._ways + self.speed * ACT * action.astype(np.float64).reshape(2, 3)
        way[:, 2] = np.clip(way[:, 2], 0.0, HIGHEST)
        velocity, self._ways = (way - self._ways) / ACT, way
        self._last_action = action.astype(np.float64)
        return {name: [*each, 0.0, 0.0, 0.0, 1.0] for name, each in zip(GRIPPERS, velocity, strict=True)}

    def look(self, observation: Observation) -> Numbers:
        x = observation.positions
        seen = [
            *(self._ways / self._size).ravel(),
            *logarithm(self._felt.wrench).ravel(),
            *(self._to_go(x) / self._size).ravel(),
            float(x[self._middle, 2]) / self._size,
            self._area(x),
            *self._last_action,
            self._count / STEPS,
        ]
        return np.clip(np.array(seen, np.float32), -BOUND, BOUND)

    def stands(self, observation: Observation, before: Fold | None) -> Fold:
        x = observation.positions
        stretch = observation.quantities.get("worst_stretch", 0.0)
        return Fold(
            corners=float(np.linalg.norm(self._to_go(x), axis=1).mean()) / self._size,
            area=self._area(x),
            stretch=max(stretch, 0.0 if before is None else before.stretch),
        )

    def ending(self, observation: Observation, standing: Fold) -> str:
        if standing.stretch > TORN:
            return "torn"
        return self.GOAL if standing.corners <= CORNERS and standing.area >= AREA else ""

    def shown(self, standing: Fold) -> Mapping[str, Any]:
        return {"corners": standing.corners, "area": standing.area, "stretch": standing.stretch}

    # ----

    def _to_go(self, x: Floats) -> Floats:
        """From the corners that are held to where they belong, a layer above the opposite ones (2, 3) [m]."""
        return np.asarray(x[self._opposite] + [0.0, 0.0, self._layer] - x[self._held])

    def _area(self, x: Floats) -> float:
        """Part of the free half that lies on its place, seen from above."""
        aside = np.linalg.norm(x[self._free, :2] - x[self._partner, :2], axis=1)
        return float((aside <= PLACE * self._size).mean())


def _settings(divisions: int, step: float) -> list[str]:
    """What the scene cloth_fold is changed by: a cloth of so many spacings, grippers at its corners."""
    cloth = load_scene("cloth_fold").body
    assert isinstance(cloth, SheetBody)
    spacing = cloth.size[0] / divisions
    height = 0.375 * spacing  # half of the thickness, which is three quarters of a spacing
    found = [
        f"step={step!r}",
        f"duration={STEPS * ACT!r}",
        f"body.divisions=[{divisions}, {divisions}]",
        f"body.position=[0, 0, {height!r}]",
        "quantities=[worst_stretch, stretch_energy, bending_energy, held]",
    ]
    for name, side in zip(GRIPPERS, (-1.0, 1.0), strict=True):
        # near enough for the edge alone, as tools hold what is within one spacing
        place = [0.5 * cloth.size[0] + 0.005 + 0.45 * spacing, 0.4 * cloth.size[1] * side, max(height, 0.0045)]
        found.append(f"tools.{name}.position={place}")
    return found


def _rows(x: Floats) -> Ints:
    """Particles of a cloth that lies flat (n, 3) by place: (along x, along y)."""
    columns = np.round(x[:, 0] - x[:, 0].min(), 6)
    order = np.lexsort((x[:, 1], columns))
    return order.reshape(len(np.unique(columns)), -1)
