"""A scene's tools -> flat arrays."""

from collections.abc import Mapping

import numpy as np

from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import PlaneTool, SolidTool
from softseam_services.body.body import Body, Floats
from softseam_services.body.particles import ParticleBody
from softseam_services.shapes import SHAPES
from softseam_services.shapes.geometry import Geometry
from softseam_services.tools.clear import check_clear, check_clear_of_particles
from softseam_services.tools.kernels import rotate
from softseam_services.tools.tool_set import ToolSet


def build_tools(
    scene: Scene, body: Body | ParticleBody | None = None, files: Mapping[str, bytes] | None = None
) -> ToolSet:
    """All tools in the scene's order; with a body, raises ToolError where one starts inside it.

    files: contents of tools' meshes by the path that the scene gives them; raises MeshError where one is no solid.
    Raises MissingRow where a kind of tool has no shape, ShapeError where it has one that does not fit.
    Followed are those that `regions.near` names, else those that the motion moves.
    """
    names = tuple(scene.tools)
    specs = tuple(scene.tools.values())
    shapes = tuple(SHAPES[spec.kind] for spec in specs)
    geometry = tuple(shape.build(spec, files or {}) for shape, spec in zip(shapes, specs, strict=True))
    rows = np.zeros((len(names), max((len(each.numbers) for each in geometry), default=3)))
    for row, each in zip(rows, geometry, strict=True):
        row[: len(each.numbers)] = each.numbers
    followed = followed_tools(scene)
    tools = ToolSet(
        names=names,
        kind=np.array([shape.number for shape in shapes], dtype=np.int64),
        shape=rows,
        reach=np.array([each.reach for each in geometry], dtype=np.float64),
        friction=np.array([tool.friction for tool in specs], dtype=np.float64),
        followed=np.array([name in followed for name in names], dtype=np.bool_),
        position=np.array([_place(spec, each) for spec, each in zip(specs, geometry, strict=True)]).reshape(-1, 3),
        orientation=np.array([each.orientation for each in geometry], dtype=np.float64).reshape(-1, 4),
        geometry=geometry,
    )
    if body is None:
        return tools
    if body.has_cells:
        check_clear(tools, body)
    else:
        check_clear_of_particles(tools, body)
    return tools


def _place(spec: PlaneTool | SolidTool, geometry: Geometry) -> Floats:
    """Where a tool's centre is at time 0, or a point of a plane (3,) [m]."""
    if isinstance(spec, PlaneTool):
        return np.array(spec.point, dtype=np.float64)
    return np.asarray(np.array(spec.position) - rotate(geometry.orientation, *geometry.placed_by))


def followed_tools(scene: Scene) -> frozenset[str]:
    """Names of the tools whose distance makes cells near."""
    if scene.regions.tools is not None:
        return frozenset(scene.regions.tools)
    return frozenset(name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools)
