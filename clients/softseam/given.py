"""What a user gives by hand, checked: whole numbers, and velocities of tools."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softseam.errors import BadVelocity, UnknownTool
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.scene.motion import LARGEST_TURN
from softseam_protocol.scene.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_NUMBERS = (
    "three numbers [m/s], e.g. [0.02, 0, 0], three more [rad/s] where it also turns, and a seventh to make it "
    "hold a sheet or rope (1) or let go (0)"
)


def whole(value: object) -> int | None:
    """A whole number, numpy's too; None of what is none. True and False are none, though Python counts with them."""
    if isinstance(value, bool | np.bool_):
        return None
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None


def checked_velocities(
    tool_velocities: Mapping[str, ArrayLike], scene: Scene, tools: Sequence[str]
) -> dict[str, Vector3]:
    """Of the tools of a scene, (3,), (6,) or (7,). Raises UnknownTool and BadVelocity."""
    if not isinstance(tool_velocities, Mapping):
        raise BadVelocity(
            f"tool velocities are a mapping from tool names to velocities, not {type(tool_velocities).__name__}"
        )
    checked = {}
    for name, value in tool_velocities.items():
        if name not in tools:
            raise UnknownTool(f"the scene {scene.name!r} has no tool {name!r}; it has: {', '.join(tools) or 'none'}")
        try:
            velocity = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise BadVelocity(f"the velocity of {name!r} is {value!r}: give {_NUMBERS}") from None
        if velocity.shape not in ((3,), (6,), (7,)):
            raise BadVelocity(f"the velocity of {name!r} has shape {velocity.shape}: give {_NUMBERS}")
        if not np.isfinite(velocity).all():
            raise BadVelocity(f"the velocity of {name!r} is {velocity.tolist()}: it must be finite")
        turn = float(np.linalg.norm(velocity[3:6])) * scene.step
        if turn > LARGEST_TURN:
            raise BadVelocity(
                f"{name!r} would turn by {turn:.3g} rad in a step of {scene.step:g} s, more than "
                f"{LARGEST_TURN:g}: turn it more slowly, or shorten the step"
            )
        checked[name] = velocity
    return checked
