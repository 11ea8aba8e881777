"""What in a scene is likely in another unit than meant: gravity, speeds, friction, tools far larger or farther than the
body."""

from __future__ import annotations

import math

from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import PlaneTool, SolidTool

_EARTH = 9.81
"""[m/s^2]"""
_HEAVY = 100.0
"""gravity beyond this is no planet's [m/s^2]"""
_FAST = 100.0
"""bodies that begin faster are unlike what a hand throws [m/s]"""
_STICKY = 5.0
"""friction beyond this is no pair of materials': rubber on rubber has 1 to 4 [1]"""
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
    speed = math.hypot(*scene.body.velocity)
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


def _odd_tool(scene: Scene, name: str, tool: SolidTool, size: float) -> list[str]:
    """A tool that is unlike one for this body, or stands as if in another unit."""
    reaches = [tool.extent(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    length = 2.0 * max((reach for reach in reaches if reach is not None), default=0.0)
    least = max(_FAR, _TIMES * size)
    if length > least:
        return [_unlike(f"tools.{name}", f"{length:.4g} m from end to end", length, size)]
    away = math.dist(tool.position, scene.body.position)
    if away > least + length:
        return [_unlike(f"tools.{name}.position", f"{away:.4g} m from the body", away, size)]
    return []


def _unlike(key: str, what: str, length: float, size: float) -> str:
    return f"{key}: {what}, {length / size:.3g} times the body's {size:.3g} m; is it in m, not in mm?"
