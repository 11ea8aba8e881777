"""Tool poses over one step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages import ToolMotion
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]


def tool_motion(tools: ToolSet, position: Floats, orientation: Floats, velocities: Floats, dt: float) -> ToolMotion:
    """Poses at the start and the end of a step in which tools translate at constant velocities.

    position (t, 3) [m], orientation (t, 4), velocities (t, 3) [m/s], dt [s]
    """
    n_tools = len(tools.names)
    if position.shape != (n_tools, 3) or orientation.shape != (n_tools, 4) or velocities.shape != (n_tools, 3):
        raise ValueError(
            f"{n_tools} tools need positions ({n_tools}, 3), orientations ({n_tools}, 4) and velocities "
            f"({n_tools}, 3); got {position.shape}, {orientation.shape}, {velocities.shape}"
        )
    return ToolMotion(
        position=position.copy(),
        orientation=orientation.copy(),
        position_next=position + dt * velocities,
        orientation_next=orientation.copy(),
    )
