"""A scene's tools -> flat arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softseam_protocol.messages.recording import ToolSurface
from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool, CapsuleTool, CylinderTool, MeshTool, PlaneTool, ToolSpec
from softseam_services.body.body import Body, Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.particles import ParticleBody
from softseam_services.tools.clear import check_clear, check_clear_of_particles
from softseam_services.tools.distance_grid import ToolMesh, tool_mesh
from softseam_services.tools.outline import outline
from softseam_services.tools.pose import quaternion_onto, quaternion_turning
from softseam_services.tools.tool_set import BOX, CAPSULE, CYLINDER, MESH, PLANE, SPHERE, ToolSet


def build_tools(
    scene: Scene, body: Body | ParticleBody | None = None, files: Mapping[str, bytes] | None = None
) -> ToolSet:
    """All tools in the scene's order; with a body, raises ToolError where one starts inside it.

    files: contents of tools' meshes by the path that the scene gives them; raises MeshError where one is no solid.
    Near tools are those that `regions.near` names, else those that the motion moves.
    """
    names = tuple(scene.tools)
    specs = tuple(scene.tools.values())
    meshes = tool_meshes(scene, files or {})
    kinds, shapes, outlines = [], [], []
    for name, tool in scene.tools.items():
        kind, shape = _shape(tool) if name not in meshes else (MESH, meshes[name].row)
        kinds.append(kind)
        shapes.append(shape)
        outlines.append(outline(kind, shape) if name not in meshes else meshes[name].outline)
    width = max((len(shape) for shape in shapes), default=3)
    rows = np.zeros((len(names), width))
    for row, shape in zip(rows, shapes, strict=True):
        row[: len(shape)] = shape
    near = near_tools(scene)
    tools = ToolSet(
        names=names,
        kind=np.array(kinds, dtype=np.int32),
        shape=rows,
        friction=np.array([tool.friction for tool in specs], dtype=np.float64),
        near=np.array([name in near for name in names], dtype=np.bool_),
        position=np.array(
            [tool.point if isinstance(tool, PlaneTool) else tool.position for tool in specs], dtype=np.float64
        ).reshape(-1, 3),
        orientation=np.array([_orientation(tool) for tool in specs], dtype=np.float64).reshape(-1, 4),
        outline=tuple(outlines),
        surfaces={name: ToolSurface(mesh.vertices, mesh.triangles) for name, mesh in meshes.items()},
    )
    if isinstance(body, ParticleBody):
        check_clear_of_particles(tools, body)
    elif body is not None:
        check_clear(tools, body)
    return tools


def tool_meshes(scene: Scene, files: Mapping[str, bytes]) -> dict[str, ToolMesh]:
    """The meshes among the tools by the tools' names, built once for the same content; raises MeshError."""
    found = {}
    for name, tool in scene.tools.items():
        if isinstance(tool, MeshTool):
            if tool.path not in files:
                raise MeshError(f"{tool.path}: the file is missing; give its path relative to the scene file")
            found[name] = tool_mesh(tool.path, files[tool.path], tool.scale, tool.up)
    return found


def near_tools(scene: Scene) -> frozenset[str]:
    """Names of the tools whose distance makes cells near."""
    near = scene.regions.near
    if near is not None and near.tools is not None:
        return frozenset(near.tools)
    return frozenset(name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools)


def _shape(tool: ToolSpec) -> tuple[int, Floats]:
    """Kind and shape of a tool that is no mesh."""
    if isinstance(tool, PlaneTool):
        normal = np.array(tool.normal)
        return PLANE, normal / np.linalg.norm(normal)
    if isinstance(tool, BoxTool):
        return BOX, 0.5 * np.array(tool.size)
    if isinstance(tool, CapsuleTool):
        return CAPSULE, np.array([tool.radius, 0.5 * tool.length, 0.0])
    if isinstance(tool, CylinderTool):
        return CYLINDER, np.array([tool.radius, 0.5 * tool.length, 0.0])
    assert not isinstance(tool, MeshTool)
    return SPHERE, np.array([tool.radius, 0.0, 0.0])


def _orientation(tool: ToolSpec) -> Floats:
    """Unit quaternion w, x, y, z at time 0 (4,)."""
    if isinstance(tool, CapsuleTool | CylinderTool):
        return quaternion_onto(np.array(tool.axis))
    if isinstance(tool, BoxTool | MeshTool):
        return quaternion_turning(np.array(tool.rotation))
    return np.array([1.0, 0.0, 0.0, 0.0])
