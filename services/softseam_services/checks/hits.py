"""Body and tools that meet so fast that the material is crushed where they do: thrown, pressed, or fallen."""

import math
from collections.abc import Iterator

import numpy as np

from softseam_protocol.scene.motion import ClosePhase, MovePhase, OpenPhase
from softseam_protocol.scene.tools import PlaneTool
from softseam_services.to_check import Cells

_HARD = 0.5
"""of the speed of waves: what is hit faster is squeezed to half, and more, before the rest of it knows"""
_SPEEDS = {ClosePhase: "close", OpenPhase: "open", MovePhase: "speed"}


def look(seen: Cells) -> Iterator[str]:
    scene, body = seen.scene, seen.body
    waves = min(material.wave_speed for material in body.materials)
    gravity, fall = np.array(scene.gravity), 0.0
    for tool in scene.tools.values():
        if isinstance(tool, PlaneTool):
            normal = np.array(tool.normal) / np.linalg.norm(tool.normal)
            fall = max(fall, float(-gravity @ normal) * float(((body.x_rest - tool.point) @ normal).min()))
    speeds = []
    if scene.tools:
        thrown = math.hypot(*scene.body.said("velocity", ()), math.sqrt(2.0 * fall))
        speeds.append((f"body.velocity: it meets tools at up to {thrown:.3g} m/s, ", thrown))
    for number, phase in enumerate(scene.motion):
        for kind, key in _SPEEDS.items():
            if isinstance(phase, kind):
                speed = getattr(phase, key)
                speeds.append((f"motion.{number}.{key}: {speed:.3g} m/s is ", speed))
    for what, speed in speeds:
        if speed > _HARD * waves:
            yield (
                f"{what}{speed / waves:.2g} times the {waves:.3g} m/s of waves in the body: what is hit so fast is "
                "crushed before the rest of it gives way, and the run may fail; slow it down, or is it in m/s, not in "
                "mm/s?"
            )
