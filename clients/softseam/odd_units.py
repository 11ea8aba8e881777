"""What in a scene is likely in another unit than meant: gravity, speeds, friction, turns, masses, tools far larger or
farther than the body; and gravity along another axis than planes stand against."""

import math

from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool, MeshTool, PlaneTool, SolidTool

_EARTH = 9.81
"""[m/s^2]"""
_HEAVY = 100.0
"""gravity beyond this is no planet's [m/s^2]"""
_FAST = 100.0
"""bodies that begin faster are unlike what a hand throws [m/s]"""
_STICKY = 5.0
"""friction beyond this is no pair of materials': rubber on rubber has 1 to 4 [1]"""
_FULL_TURN = 2.0 * math.pi
"""tools that are turned by more at the start are unlike what anybody writes [rad]"""
_HEAVY_TOOL = 50.0
"""[kg]"""
_STEEP = 0.02
"""cosine of gravity and a plane, up to which the plane holds nothing: a wall"""
_FAR, _TIMES = 5.0, 100.0
"""tools that reach, or stand, farther than both this [m] and so many times the body's extent are unlike a hand's"""


def odd_units(scene: Scene, size: float) -> list[str]:
    """Sentences, each beginning with its key.

    scene  with one body
    size   largest extent of the body [m]
    """
    found = []
    gravity = math.hypot(*scene.gravity)
    if gravity > _HEAVY:
        times = f"{gravity / _EARTH:.3g} times the earth's"
        found.append(f"gravity: {gravity:.4g} m/s^2 is {times}; is it in m/s^2, not in mm/s^2?")
    elif gravity > 0.0 and not _stands(scene):
        found.append(
            "gravity: it pulls the body along every plane of the scene, or away from it, so that nothing holds the "
            "body up; is its sign right, and its axis? Planes look along z where they name no normal"
        )
    speed = math.hypot(*scene.body.said("velocity", ()))
    if speed > _FAST:
        found.append(f"body.velocity: {speed:.4g} m/s is faster than a hand throws; is it in m/s, not in mm/s?")
    for name, tool in scene.tools.items():
        if tool.friction > _STICKY:
            found.append(
                f"tools.{name}.friction: {tool.friction:.4g} is more than any materials have, so that nothing slides; "
                "is it a coefficient, not in percent?"
            )
        if not isinstance(tool, PlaneTool):
            found += _odd_tool(scene, name, tool, size)
    return found


def _stands(scene: Scene) -> bool:
    """Whether a plane can hold the body against gravity, or anything else may: clamps, tools that stand still, tools
    moved by hand. True without planes: then the scene has the body fall, or swing."""
    planes = [tool for tool in scene.tools.values() if isinstance(tool, PlaneTool)]
    moved = {name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools}
    others = {name for name, tool in scene.tools.items() if not isinstance(tool, PlaneTool)}
    if not planes or scene.body.said("fixed", ()) or any(scene.body.said("velocity", ())) or others - moved:
        return True
    down = scene.gravity
    return any(
        -sum(g * n for g, n in zip(down, plane.normal, strict=True))
        > _STEEP * math.hypot(*down) * math.hypot(*plane.normal)
        for plane in planes
    )


def _odd_tool(scene: Scene, name: str, tool: SolidTool, size: float) -> list[str]:
    """A tool that is unlike one for this body, or stands as if in another unit."""
    found = []
    turn = math.hypot(*tool.rotation) if isinstance(tool, BoxTool | MeshTool) else 0.0
    if turn > _FULL_TURN * (1.0 + 1e-9):
        turns = f"{turn:.4g} rad are {turn / _FULL_TURN:.3g} full turns"
        found.append(f"tools.{name}.rotation: {turns}; is it axis times angle in rad, not in degrees?")
    if tool.mass > _HEAVY_TOOL:
        found.append(f"tools.{name}.mass: {tool.mass:.4g} kg is more than a gripper has; is it in kg, not in g?")
    reaches = [tool.extent(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    length = 2.0 * max((reach for reach in reaches if reach is not None), default=0.0)
    least = max(_FAR, _TIMES * size)
    away = math.dist(tool.position, scene.body.said("position", (0.0, 0.0, 0.0)))
    if length > least:
        found.append(_unlike(f"tools.{name}", f"{length:.4g} m from end to end", length, size))
    elif away > least + length:
        found.append(_unlike(f"tools.{name}.position", f"{away:.4g} m from the body", away, size))
    return found


def _unlike(key: str, what: str, length: float, size: float) -> str:
    return f"{key}: {what}, {length / size:.3g} times the body's {size:.3g} m; is it in m, not in mm?"
