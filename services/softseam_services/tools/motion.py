"""Tool poses over one step."""

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import ToolMotion
from softseam_protocol.scene.motion import LARGEST_TURN
from softseam_services.shapes.turns import turned
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]


def tool_motion(tools: ToolSet, position: Floats, orientation: Floats, velocities: Floats, dt: float) -> ToolMotion:
    """Poses at the start and the end of a step in which tools move and turn about their positions at constant rates.

    position (t, 3) [m], orientation (t, 4), velocities (t, 6) [m/s, rad/s], dt [s]; the poses are kept, not copied.
    Raises ValueError where one turns
    too far in the step for its way to be clear
    """
    n_tools = len(tools.names)
    if position.shape != (n_tools, 3) or orientation.shape != (n_tools, 4) or velocities.shape != (n_tools, 6):
        raise ValueError(
            f"{n_tools} tools need positions ({n_tools}, 3), orientations ({n_tools}, 4) and velocities "
            f"({n_tools}, 6); got {position.shape}, {orientation.shape}, {velocities.shape}"
        )
    orientation_next = orientation
    for tool, (_, _, _, x, y, z) in enumerate(velocities.tolist()):
        if x or y or z:
            if orientation_next is orientation:
                orientation_next = orientation.copy()
            turn = dt * np.array([x, y, z])
            if float(np.linalg.norm(turn)) > LARGEST_TURN:
                raise ValueError(
                    f"the tool {tools.names[tool]!r} turns by {np.linalg.norm(turn):.3g} rad in a step of {dt:g} s, "
                    f"more than {LARGEST_TURN:g}: turn it more slowly, or shorten the step"
                )
            orientation_next[tool] = turned(turn, orientation[tool])
    return ToolMotion(
        position=position,
        orientation=orientation,
        position_next=position + dt * velocities[:, :3],
        orientation_next=orientation_next,
    )
