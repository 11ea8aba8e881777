"""The lift of any shape: a mesh of your own, or the body of a scene."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

import numpy as np

from softseam.errors import BadInput
from softseam.gym.lift_scene import BELOW, PADS, STEPS, THICKNESS, times_of
from softseam.gym.pad_lift import Floats, PadLift
from softseam.gym.randomise import Randomise
from softseam.gym.reward import GENTLE, Grip, Term
from softseam.gym.task_env import ACT, Given
from softseam.opening import open as open_session
from softseam.scenes import load_scene, scene_path
from softseam_protocol.models import REFERENCE
from softseam_protocol.scene.bodies import BodySpec, MeshShape
from softseam_protocol.scene.scene import Scene

OPENING = 0.12
"""between the pads at most [m]"""
CLEAR = 2e-3
"""between a pad and the largest piece that is drawn, at least [m]"""
_SCENES = (".yaml", ".yml", ".json", "")
_AWAY = 10.0
"""where pads wait while a piece is measured [m]"""


class SliceLift(PadLift):
    """Two pads grip a piece of any shape across its shorter side and lift it by 3 cm: see `TofuLift`.

    Actions, what is seen, rewards and endings are those of `TofuLift`. Pads are larger than the piece, and begin clear
    of the largest that is drawn.

    shape         a mesh file, in metres or with settings=["body.shape.scale=0.001"]; or a scene with one body in cells,
                  whose material and cells are taken, too: a file, or the name of one that comes along. A mesh is of
                  tofu, and has cells as thick as its walls, where settings say nothing else
    reward, randomise, step, environments  as for `TofuLift`; sizes of a mesh vary as a whole

    Raises SceneRefused for a shape that cannot be read or simulated, BadInput for one that is too wide for the pads.
    """

    def __init__(
        self,
        shape: str | Path = "dumpling",
        *,
        reward: Sequence[Term[Grip]] = GENTLE,
        randomise: Randomise | None = Randomise(),  # noqa: B008 - it is frozen
        step: float = ACT,
        settings: Sequence[str] = (),
        **given: Unpack[Given],
    ) -> None:
        """Other arguments as of `Given`, and for `SceneEnv`."""
        scene = scene_path(shape) if Path(shape).suffix in _SCENES else _scene_of(Path(shape))
        if not isinstance(load_scene(scene).one, BodySpec):
            raise BadInput(f"shape={str(shape)!r} has no body in cells, or several: give a scene with one, or a mesh")
        alone = [*_of_any_lift(step), _pads(np.zeros(3), 0, _AWAY), *settings]
        with open_session(scene, given.get("connect"), model=REFERENCE, settings=alone) as measured:
            surface = measured.reset(seed=0).surface
        extent = np.ptp(surface, axis=0)
        axis = int(np.argmin(extent[:2]))
        reach, largest = _reach(extent, axis, randomise)
        if reach > 0.5 * OPENING:
            raise BadInput(
                f"shape={str(shape)!r} is {1e3 * extent[axis]:.3g} mm wide at its shorter side, {1e3 * largest:.3g} mm "
                f"as the largest that is drawn, and pads that open by {1e3 * OPENING:g} mm do not fit round it: give "
                "another body.shape.scale or body.shape.up in `settings`, or less of size, yaw and offset in "
                "`randomise`"
            )
        more = 1.0 if randomise is None else 1.0 + randomise.size
        super().__init__(
            scene,
            step=step,
            model=REFERENCE,
            settings=(*_of_any_lift(step), _pads(more * extent, axis, reach), *settings),
            reward=reward,
            randomise=randomise,
            **given,
        )
        self._axis = axis

    def points_of_face(self, surface: Floats) -> int:
        """Those of the outer tenth of its width."""
        across = surface[:, self._axis]
        return int((across < across.min() + 0.1 * np.ptp(across)).sum())


def _scene_of(mesh: Path) -> Scene:
    """A scene of a mesh file alone, of tofu."""
    tofu = load_scene("tofu_grasp").body
    assert isinstance(tofu, BodySpec)
    shape = MeshShape(path=str(mesh))
    return Scene(
        softseam=1, name="slice_lift", duration=STEPS * ACT, body=BodySpec(shape=shape, material=tofu.material)
    )


def _of_any_lift(step: float) -> list[str]:
    """Settings that make a lift of any scene with a body; step [s]."""
    closing = "motion=[{tools: [left, right], close: 0.02, until: {time: 1}}]"  # what grips, which quantities ask
    found = [*times_of(step), "regions={default: fem}", "body.position=[0, 0, 0]", closing]
    return [*found, "probes={}", "symmetry=[]", "tolerance=null"]


def _pads(extent: Floats, axis: int, reach: float) -> str:
    """The setting of ground and pads for a piece that large (3,), at a distance from its middle along an axis [m]."""
    size = [float(each) + 0.02 for each in extent]
    size[axis] = THICKNESS
    tools = ["ground: {kind: plane, friction: 0.6}"]
    for name, side in zip(PADS, (-1.0, 1.0), strict=True):
        place = [0.0, 0.0, 0.5 * size[2] - BELOW]
        place[axis] = side * (reach + 0.5 * THICKNESS)
        tools.append(f"{name}: {{kind: box, size: {size}, position: {place}, friction: 0.6}}")
    return f"tools={{{', '.join(tools)}}}"


def _reach(extent: Floats, axis: int, randomise: Randomise | None) -> tuple[float, float]:
    """From the middle of a piece to pads that are clear of the largest that is drawn, and how wide that is [m]."""
    if randomise is None:
        return 0.5 * float(extent[axis]) + 0.01, float(extent[axis])
    turn = math.radians(randomise.yaw)
    wide = math.cos(turn) * float(extent[axis]) + math.sin(turn) * float(extent[1 - axis])
    largest = (1.0 + randomise.size) * wide
    return 0.5 * largest + math.hypot(randomise.offset, randomise.offset) + CLEAR, largest
