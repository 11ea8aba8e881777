"""A scene's tools -> flat arrays."""

from __future__ import annotations

import numpy as np

from softseam_protocol.scene import BoxTool, HoldPhase, PlaneTool, Scene
from softseam_services.body.body import Body
from softseam_services.tools.clear import check_clear
from softseam_services.tools.tool_set import BOX, PLANE, SPHERE, ToolSet


def build_tools(scene: Scene, body: Body | None = None) -> ToolSet:
    """All tools in the scene's order; with a body, raises ToolError where one starts inside it.

    Near tools are those that `regions.near` names, else those that the motion moves.
    """
    names = tuple(scene.tools)
    kinds, shapes, positions = [], [], []
    for tool in scene.tools.values():
        if isinstance(tool, PlaneTool):
            normal = np.array(tool.normal)
            kinds.append(PLANE)
            shapes.append(normal / np.linalg.norm(normal))
            positions.append(tool.point)
        elif isinstance(tool, BoxTool):
            kinds.append(BOX)
            shapes.append(0.5 * np.array(tool.size))
            positions.append(tool.position)
        else:
            kinds.append(SPHERE)
            shapes.append(np.array([tool.radius, 0.0, 0.0]))
            positions.append(tool.position)
    near = near_tools(scene)
    tools = ToolSet(
        names=names,
        kind=np.array(kinds, dtype=np.int32),
        shape=np.array(shapes, dtype=np.float64).reshape(-1, 3),
        friction=np.array([tool.friction for tool in scene.tools.values()], dtype=np.float64),
        near=np.array([name in near for name in names], dtype=np.bool_),
        position=np.array(positions, dtype=np.float64).reshape(-1, 3),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (len(names), 1)),
    )
    if body is not None:
        check_clear(tools, body)
    return tools


def near_tools(scene: Scene) -> frozenset[str]:
    """Names of the tools whose distance makes cells near."""
    near = scene.regions.near
    if near is not None and near.tools is not None:
        return frozenset(near.tools)
    return frozenset(name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools)
