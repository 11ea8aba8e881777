"""Which tool is which one's image in a plane of symmetry, as tools begin and as the scene's motion has them move."""

import math

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase, MovePhase, OpenPhase, TurnPhase
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import SAME, Body
from softseam_services.body.symmetry import SymmetryPlane, asymmetric, symmetry_plane
from softseam_services.tools.kernels.symmetry import tool_astray
from softseam_services.tools.tool_set import ToolSet


def symmetry_axes(scene: Scene) -> tuple[int, ...]:
    """The axes that the scene says it is symmetric across, as numbers."""
    return tuple("xyz".index(axis) for axis in scene.symmetry)


def check_symmetry(scene: Scene, body: Body, tools: ToolSet) -> None:
    """Raise SettingError where a scene is not symmetric across an axis that it names, with what breaks it."""
    for axis in symmetry_axes(scene):
        plane = symmetry_plane(body, axis)
        image = images_of_tools(plane, tools, SAME * body.resolution)
        _check_motion(scene, plane, image)
        for t in np.flatnonzero(tools.followed & ~tools.followed[image]):
            raise asymmetric(axis, f"regions.near.tools names {tools.names[t]!r} without its image: name both")


def images_of_tools(plane: SymmetryPlane, tools: ToolSet, near: float) -> NDArray[np.int32]:
    """Each tool's image in a plane as tools begin (t,). Raises SettingError, naming a tool that has none.

    near: as close as places must be [m]
    """
    axis, place = np.array([plane.axis], dtype=np.int32), np.array([plane.place])
    swapped = np.array([[1, 0]], dtype=np.int32)
    found = []
    for t, name in enumerate(tools.names):
        for other in range(len(tools.names)):
            pair = np.array([t, other])
            alike = (
                tools.kind[t] == tools.kind[other]
                and tools.friction[t] == tools.friction[other]
                and np.array_equal(tools.shape[t], tools.shape[other])
            )
            of_both = tools.kind[pair], tools.shape[pair], tools.sameness[pair], axis, place, swapped, near
            poses = tools.position[pair], tools.orientation[pair]
            if alike and tool_astray(*of_both, *poses, *poses)[1] < 0:
                found.append(other)
                break
        else:
            raise asymmetric(plane.axis, f"tool {name!r} has no image: move it into the plane, or add its image")
    return np.array(found, dtype=np.int32)


def _check_motion(scene: Scene, plane: SymmetryPlane, image: NDArray[np.int32]) -> None:
    """Raise SettingError, naming the phase, where the motion does not move images (t,) as images."""
    names, e = tuple(scene.tools), plane.axis
    for i, phase in enumerate(scene.motion):
        if not isinstance(phase, ClosePhase | OpenPhase | MovePhase | TurnPhase):
            continue
        moved = {names.index(name) for name in phase.tools}
        if lone := sorted(names[t] for t in moved if int(image[t]) not in moved):
            raise asymmetric(e, f"motion.{i} moves {lone[0]!r} without its image: move both")
        if isinstance(phase, MovePhase):
            ways = {names.index(name): np.array(way) for name, way in phase.ways.items()}
            mirror = np.where(np.arange(3) == e, -1.0, 1.0)
            if any(np.abs(ways[int(image[t])] - mirror * way).max() > SAME for t, way in ways.items()):
                raise asymmetric(e, f"motion.{i} moves tools across the plane: move each as its image")
        if isinstance(phase, TurnPhase):
            across = math.hypot(*(part for axis, part in enumerate(phase.turn) if axis != e))
            aside = phase.about is not None and abs(phase.about[e] - plane.place) > SAME
            if across > SAME or aside:
                raise asymmetric(e, f"motion.{i} turns tools out of the plane: turn about its normal, at its place")
