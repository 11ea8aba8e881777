"""Which sides of boxes and meshes a scene's first grip closes on the body with, before anything runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase, HoldPhase
from softseam_protocol.scene.tools import BoxTool, MeshTool
from softseam_services.body.interpolate import rest_points
from softseam_services.orchestrator.grips import Grips
from softseam_services.server import Setup
from softseam_services.tools.approach import way_to_touch
from softseam_services.tools.kernels import rotate_back

_ALONG, _IN = 0.9, 0.2
"""of the way in the tool's frame: more than that along an axis, and a side comes first; less, and none does there"""


def grip_sides(setup: Setup) -> str:
    """In words, in the tools' own axes; '' where tools move before they close, or none of them has sides."""
    scene, body, tools = setup.scene, setup.body, setup.tools
    first = next((phase for phase in scene.motion if not isinstance(phase, HoldPhase)), None)
    grip = Grips(scene, tools, [body]).first
    if grip is None or not isinstance(first, ClosePhase) or not body.has_cells:
        return ""
    corners, said = rest_points(body)[body.surface.triangles], []
    for tool, way in zip(grip.tools, grip.inward, strict=True):
        name, (position, orientation) = tools.names[tool], (tools.position[tool], tools.orientation[tool])
        if not isinstance(scene.tools[name], BoxTool | MeshTool):
            continue
        found = way_to_touch(tools, tool, position, orientation, way, corners)
        if found is None:
            said.append(f"{name} passes the body")
            continue
        side = _side(np.array(rotate_back(orientation, *way)))
        said.append(f"{name}, {side}, after {1e3 * found[0]:.3g} mm")
    return "; ".join(said)


def _side(way: NDArray[np.float64]) -> str:
    """What of a tool looks along a unit vector (3,) in its frame."""
    axes = [("-" if part < 0.0 else "+") + axis for part, axis in zip(way.tolist(), "xyz", strict=True)]
    along = int(np.abs(way).argmax())
    if abs(way[along]) > _ALONG:
        return f"its {axes[along]} side"
    return f"its edge or corner between {' and '.join(a for a, part in zip(axes, way, strict=True) if abs(part) > _IN)}"
