"""Gravity and speeds in another unit than meant; gravity along another axis than planes stand against."""

import math
from collections.abc import Iterator

from softseam.to_check import Written
from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.scene import EARTH
from softseam_protocol.scene.tools import PlaneTool

_STEEP = 0.02
"""cosine of gravity and a plane, up to which the plane holds nothing: a wall"""


def look(seen: Written) -> Iterator[str]:
    gravity = math.hypot(*seen.scene.gravity)
    if gravity > 100.0:  # no planet's
        times = f"{gravity / EARTH:.3g} times the earth's"
        yield f"gravity: {gravity:.4g} m/s^2 is {times}; is it in m/s^2, not in mm/s^2?"
    elif gravity > 0.0 and not _stands(seen):
        yield (
            "gravity: it pulls the body along every plane of the scene, or away from it, so that nothing holds the "
            "body up; is its sign right, and its axis? Planes look along z where they name no normal"
        )
    if (speed := math.hypot(*seen.body.said("velocity", ()))) > 100.0:
        yield f"body.velocity: {speed:.4g} m/s is faster than a hand throws; is it in m/s, not in mm/s?"


def _stands(seen: Written) -> bool:
    """Whether a plane can hold the body against gravity, or anything else may: clamps, tools that stand still, tools
    moved by hand. True without planes: then the scene has the body fall, or swing."""
    scene = seen.scene
    planes = [tool for tool in scene.tools.values() if isinstance(tool, PlaneTool)]
    moved = {name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools}
    others = {name for name, tool in scene.tools.items() if not isinstance(tool, PlaneTool)}
    if not planes or seen.body.said("fixed", ()) or any(seen.body.said("velocity", ())) or others - moved:
        return True
    down = scene.gravity
    return any(
        -sum(g * n for g, n in zip(down, plane.normal, strict=True))
        > _STEEP * math.hypot(*down) * math.hypot(*plane.normal)
        for plane in planes
    )
