"""Tool poses over one step."""

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import ToolMotion
from softseam_services.shapes.turns import turned

Floats = NDArray[np.float64]


def tool_motion(position: Floats, orientation: Floats, velocities: Floats, dt: float) -> ToolMotion:
    """Poses at the start and the end of a step in which tools move and turn about their positions at constant rates.

    position (t, 3) [m], orientation (t, 4), velocities (t, 6) [m/s, rad/s], dt [s]; the poses are kept, not copied.
    """
    orientation_next = orientation
    for tool, (_, _, _, x, y, z) in enumerate(velocities.tolist()):
        if x or y or z:
            if orientation_next is orientation:
                orientation_next = orientation.copy()
            orientation_next[tool] = turned(dt * np.array([x, y, z]), orientation[tool])
    return ToolMotion(
        position=position,
        orientation=orientation,
        position_next=position + dt * velocities[:, :3],
        orientation_next=orientation_next,
    )
