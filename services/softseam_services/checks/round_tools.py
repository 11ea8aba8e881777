"""Round tools of a radius shorter than a cell's edge that press a block in one phase and move on in another.

Rows of points to either side of them lie on slopes, so that they hold like pinions, with less friction than it takes.
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.tools import CapsuleTool, CylinderTool, SphereTool, ToolSpec
from softseam_services.body.body import Floats
from softseam_services.checks.narrow import listed, narrower
from softseam_services.to_check import Cells

_END_ON = 0.9
"""cosine of a cylinder's axis and its way to the body, from which on it comes with a flat end"""


def look(seen: Cells) -> Iterator[str]:
    scene, edge, middle = seen.scene, float(max(seen.body.edges)), seen.body.x_rest.mean(axis=0)
    driven = Counter(name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools)
    small = {
        name: 0.5 * width
        for name, width in narrower(seen, 2.0 * edge).items()
        if scene.tools[name].friction > 0.0 and driven[name] > 1 and _is_round(scene.tools[name], middle)
    }
    if small:
        yield (
            f"body.cell: round tools of a radius below the {1e3 * edge:.3g} mm of a cell hold with up to a third less "
            f"friction than it takes, where they slide across their rounding: {listed(small)}. Where a grip is near "
            f"what friction holds, make cells {min(small.values()):.2g} m long"
        )


def _is_round(tool: ToolSpec, middle: Floats) -> bool:
    """Whether a tool meets a body about this point (3,) [m] with a side that is round."""
    if isinstance(tool, CylinderTool):
        way = middle - tool.position
        return bool(abs(way @ tool.axis) < _END_ON * np.linalg.norm(way) * np.linalg.norm(tool.axis))
    return isinstance(tool, SphereTool | CapsuleTool)
