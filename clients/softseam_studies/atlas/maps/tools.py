"""Shape and size of a tool against the cells that it presses, and whether claims of the error hold there."""

from functools import cache
from typing import Any

from softseam_studies.atlas.maps.by_cells import BOUND, CLAIM_HOLDS, MATERIAL, ByCells
from softseam_studies.atlas.maps.grid import Map
from softseam_studies.atlas.scenes import Model
from softseam_studies.atlas.trace import Trace, follow

TOOLS: dict[str, dict[str, Any]] = {
    "ball 3": {"kind": "sphere", "radius": 3e-3},
    "ball 10": {"kind": "sphere", "radius": 10e-3},
    "rod 3": {"kind": "capsule", "radius": 3e-3, "length": 0.02, "axis": [1, 0, 0]},
    "end 5": {"kind": "cylinder", "radius": 5e-3, "length": 0.02, "axis": [0, 0, 1]},
    "box 12": {"kind": "box", "size": [0.012, 0.012, 0.02]},
}
"""by name, with radius or edge [mm]"""
ABOVE = {"ball 3": 3e-3, "ball 10": 10e-3, "rod 3": 3e-3, "end 5": 10e-3, "box 12": 10e-3}
"""height of each one's middle over its lowest point [m]"""
FINEST = 20.0 / 6
DEPTH, SPEED = 2e-3, 0.02
PLACE = 3.1e-3, 2.7e-3
"""of the tool's axis, between nodes [m]"""


def build(tools: tuple[str, ...] = tuple(TOOLS), edges: tuple[float, ...] = (20.0, 10.0, 20.0 / 3, 5.0)) -> Map:
    """The map; a smaller one for tests."""
    text = (
        f"Tools, by radius or edge, are pressed {1e3 * DEPTH:g} mm into a bonded block of 40 x 40 x 20 mm (E 20 kPa), "
        f"between its nodes. Accurate: the force is within {100 * BOUND:g} % of FEM's on cells of {FINEST:.2g} mm. "
        f"{CLAIM_HOLDS}"
    )
    return ByCells(pressed, "tool.force", edges, FINEST).map(
        "tools", "Tools against cells", text, tools, ("tool [mm]", "cell [mm]"), 1.0
    )


@cache
def pressed(model: Model, tool: str, edge: float) -> Trace:
    """Press, and hold until it rests."""
    return follow(scene(model, tool, 1e-3 * edge), lambda seen: float(seen.wrench["tool"][2]))


def scene(model: Model, tool: str, edge: float) -> dict[str, Any]:
    """Edge in m."""
    side, height, gap = 0.04, 0.02, 0.5e-3
    cells = [side / max(1, round(side / edge))] * 2 + [height / max(1, round(height / edge))]
    return {
        "softseam": 1,
        "name": "tools",
        "step": 0.01,
        "gravity": [0, 0, 0],
        "body": {
            "shape": {"kind": "block", "size": [side, side, height]},
            "cell": cells,
            "material": MATERIAL,
            "fixed": [{"min": [-1, -1, -1e-3], "max": [1, 1, 1e-4]}],
        },
        "tools": {"tool": TOOLS[tool] | {"position": [*PLACE, height + gap + ABOVE[tool]], "friction": 0.3}},
        "motion": [{"tools": ["tool"], "move": [0, 0, -DEPTH - gap], "speed": SPEED}, {"hold": 0.1}],
        "regions": {"default": model},
    }
