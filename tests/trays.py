"""Scenes of trays: cubes that touch one another, between walls, what sleep by body is measured and checked with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from cubes import EDGE, cube, scene_of

from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene

MATERIAL: dict[str, float] = {"young": 1e5, "poisson": 0.3, "density": 1000.0, "retardation_time": 0.02}
MASS = 1000.0 * EDGE**3
"""of a cube [kg]"""
GAP = 2e-4
"""between cubes, and to the walls, at the start [m]"""


def tray(
    counts: tuple[int, int, int],
    tools: Mapping[str, Any] | None = None,
    gaps: tuple[float, float, float] = (GAP,) * 3,
    material: Mapping[str, Any] | None = None,
    cells: int = 2,
    own: Mapping[str, Mapping[str, Any]] | None = None,
    **keys: Any,
) -> Scene:
    """Cubes beside and above one another, named by their places, with what else there is as tools; own: keys of some of
    the bodies."""
    places = {f"cube{x}{y}{z}": (x, y, z) for z in range(counts[2]) for y in range(counts[1]) for x in range(counts[0])}
    pitch = EDGE + np.array(gaps)
    bodies = {
        name: cube(0, 1, cells, position=(pitch * at).tolist(), material=dict(material or MATERIAL))
        | dict((own or {}).get(name, {}))
        for name, at in places.items()
    }
    touch = {
        f"{one}_{other}": {"kind": "contact", "between": [one, other], "friction": 0.4}
        for one, at in places.items()
        for other, beside in places.items()
        if sorted(np.subtract(beside, at)) == [0, 0, 1]
    }
    walls: dict[str, Any] = {"ground": {"kind": "plane", "friction": 0.5}}
    for axis, (count, gap) in enumerate(zip(counts[:2], gaps[:2], strict=True)):
        for side, at in ((1.0, -0.5 * EDGE - gap), (-1.0, pitch[axis] * (count - 1) + 0.5 * EDGE + gap)):
            point, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            point[axis], normal[axis] = float(at), side
            walls[f"wall{axis}{'ab'[side < 0.0]}"] = {"kind": "plane", "point": point, "normal": normal}
    return scene_of(bodies, interfaces=touch, tools={**walls, **(tools or {})}, **keys)


def pressed(**keys: Any) -> Scene:
    """Nine cubes between walls, of which a plate presses one corner's by 2 mm, once they sleep."""
    plate = {"kind": "box", "size": [0.03, 0.03, 0.01], "position": [0, 0, EDGE + 0.065], "friction": 0.3}
    moves = ({"tools": ["plate"], "move": [0, 0, -way], "speed": speed} for way, speed in ((0.056, 0.1), (0.006, 0.02)))
    motion = [{"hold": 0.5}, *moves, {"hold": 0.3}]
    return tray((3, 3, 1), {"plate": plate}, motion=motion, duration=None, **keys)


def gripped(counts: tuple[int, int, int], rest: float = 0.5, young: float = 1e5, **keys: Any) -> Scene:
    """Cubes with room beside them along x, of which plates grip the middle one of the upper layer, and lift it past its
    neighbours, once all had so long to rest [s]."""
    room, material = 6e-3, MATERIAL | {"young": young}
    middle = [(EDGE + gap) * (count // 2) for count, gap in zip(counts, (room, GAP), strict=False)]
    sunk = 9.81 * material["density"] * (counts[2] * EDGE) ** 2 / (2.0 * young)
    height = (counts[2] - 1) * (EDGE + GAP) + 0.5 * EDGE - sunk + 0.012
    plate = {"kind": "box", "size": [0.004, 0.04, 0.06], "friction": 0.8}
    plates = {
        name: plate | {"position": [middle[0] + side * (0.5 * EDGE + 0.5 * room), middle[1], height]}
        for name, side in (("left", -1.0), ("right", 1.0))
    }
    both = {"tools": list(plates)}
    lift = [both | {"close": 0.05, "until": {"compression": 0.05}}, both | {"move": [0, 0, 0.03], "speed": 0.1}]
    motion = [{"hold": rest}, *lift, {"hold": 0.3}]
    return tray(counts, plates, (room, GAP, GAP), material, motion=motion, duration=None, **keys)


def awake(report: StepReport) -> set[str]:
    """Names of the bodies that took the step."""
    return {part.body for part in report.parts.values() if part.iterations}
