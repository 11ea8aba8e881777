"""Velocities of tools that are moved by hand, checked once a process: in the client's, and where they come off the bus.

Nothing between there and the participants looks at them again. These refuse poses that are not finite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.scene.motion import LARGEST_TURN
from softseam_protocol.scene.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Command = Mapping[str, Vector3 | Sequence[float]]
"""velocities of tools by name, checked"""
_NUMBERS = (
    "three numbers [m/s], e.g. [0.02, 0, 0], three more [rad/s] where it also turns, and a seventh to make it "
    "hold a sheet or rope (1) or let go (0)"
)
_FARTHEST = 100.0
"""way of a tool in a step beyond which nobody meant it [m]"""


class BadCommand(ValueError):
    """No velocities of tools that a step can be taken with; the text says what to give."""


class NoSuchTool(BadCommand):
    """The scene does not have it."""


def checked_command(velocities: Mapping[str, ArrayLike], scene: Scene) -> dict[str, Vector3]:
    """Velocities of tools of a scene [m/s], (3,), with angular ones about their positions [rad/s] (6,), or also with 1
    for what is to hold the particles within reach and 0 for what is to let go (7,). Raises BadCommand."""
    if not isinstance(velocities, Mapping):
        raise BadCommand(
            f"tool velocities are a mapping from tool names to velocities, not {type(velocities).__name__}"
        )
    checked = {}
    for name, value in velocities.items():
        if name not in scene.tools:
            have = ", ".join(scene.tools) or "none"
            raise NoSuchTool(f"the scene {scene.name!r} has no tool {name!r}; it has: {have}")
        try:
            velocity = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise BadCommand(f"the velocity of {name!r} is {value!r}: give {_NUMBERS}") from None
        if velocity.shape not in ((3,), (6,), (7,)):
            raise BadCommand(f"the velocity of {name!r} has shape {velocity.shape}: give {_NUMBERS}")
        if not np.isfinite(velocity).all():
            raise BadCommand(f"the velocity of {name!r} is {velocity.tolist()}: it must be finite")
        if float(np.abs(velocity[:3]).max()) * scene.step > _FARTHEST:
            raise BadCommand(
                f"the velocity of {name!r} is {velocity.tolist()}, more than {_FARTHEST:g} m in a step: give m/s"
            )
        turn = float(np.linalg.norm(velocity[3:6])) * scene.step
        if turn > LARGEST_TURN:
            raise BadCommand(
                f"{name!r} would turn by {turn:.3g} rad in a step of {scene.step:g} s, more than "
                f"{LARGEST_TURN:g}: turn it more slowly, or shorten the step"
            )
        if velocity[6:].any() and all(body.has_cells for body in scene.bodies.values()):
            raise BadCommand(
                f"the velocity of {name!r} has a grip, its seventh number: tools grip particles only, and bodies here "
                "are of cells, which friction holds: give six"
            )
        checked[name] = velocity
    return checked
