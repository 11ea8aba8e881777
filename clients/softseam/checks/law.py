"""A body that turns, by itself or between tools, whose law knows no turns."""

import math
from collections.abc import Iterator

from softseam.duration import expected_duration
from softseam.to_check import Written
from softseam_protocol.scene.motion import TurnPhase

_TURNED = 0.3
"""turn of a linear body beyond which it swells by a twentieth [rad]"""


def look(seen: Written) -> Iterator[str]:
    scene = seen.scene
    if all(material.kind != "linear" for material in seen.body.cell_materials):
        return
    turns = [math.hypot(*p.turn) for p in scene.motion if isinstance(p, TurnPhase) and len(p.tools) > 1]
    angle = max([math.hypot(*seen.body.said("spin", ())) * (expected_duration(scene) or 0.0), *turns])
    if angle > _TURNED:
        yield (
            f"body.material.kind: linear knows no turns: a body that turns by {angle:.2g} rad swells, and goes on "
            "turning too slowly; take neo_hookean"
        )
