"""How far a tool reaches."""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.tools.kernels import rotate_back
from softseam_services.tools.tool_set import ToolSet


def extent_along(tools: ToolSet, tool: int, direction: Floats, orientation: Floats) -> float:
    """How far a tool reaches from its position along a unit direction [m]; 0 for a plane.

    orientation (4,)  of the tool
    """
    return tools.geometry[tool].reach_along(np.array(rotate_back(orientation, *direction)))
