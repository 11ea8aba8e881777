"""Tools that are unlike ones for this body, or stand as if in another unit."""

import math
from collections.abc import Iterator

from softseam.to_check import Written
from softseam_protocol.scene.tools import BoxTool, MeshTool, PlaneTool


def look(seen: Written) -> Iterator[str]:
    scene, size = seen.scene, seen.size
    for name, tool in scene.tools.items():
        if tool.friction > 5.0:  # rubber on rubber has 1 to 4
            yield (
                f"tools.{name}.friction: {tool.friction:.4g} is more than any materials have, so that nothing slides; "
                "is it a coefficient, not in percent?"
            )
        if isinstance(tool, PlaneTool):
            continue
        turn = math.hypot(*tool.rotation) if isinstance(tool, BoxTool | MeshTool) else 0.0
        if (turns := turn / (2.0 * math.pi)) > 1.0 + 1e-9:
            text = f"{turn:.4g} rad are {turns:.3g} full turns"
            yield f"tools.{name}.rotation: {text}; is it axis times angle in rad, not in degrees?"
        if tool.mass > 50.0:
            yield f"tools.{name}.mass: {tool.mass:.4g} kg is more than a gripper has; is it in kg, not in g?"
        reaches = [tool.extent(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        length = 2.0 * max((reach for reach in reaches if reach is not None), default=0.0)
        away = math.dist(tool.position, seen.body.said("position", (0.0, 0.0, 0.0)))
        least = max(5.0, 100.0 * size)
        if length > least:
            key, far, what = "", length, "from end to end"
        elif away > least + length:
            key, far, what = ".position", away, "from the body"
        else:
            continue
        times = f"{far / size:.3g} times the body's {size:.3g} m"
        yield f"tools.{name}{key}: {far:.4g} m {what}, {times}; is it in m, not in mm?"
