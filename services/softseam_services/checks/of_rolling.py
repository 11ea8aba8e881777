"""Round bodies that a slope lets roll: cells give way more at their corners than between these."""

from collections.abc import Iterator

import numpy as np

from softseam_protocol.scene.tools import PlaneTool
from softseam_services.body.bulges import curvatures
from softseam_services.body.interpolate import rest_points
from softseam_services.checks.seen import Cells

_LATE = 0.08
"""of the time in which a body rolls as far as corners of octants are apart, by which it starts late or early at most
(docs/decisions/45)"""


def rolls(seen: Cells) -> Iterator[str]:
    """Meshes on a plane down which they roll: the lattice of their cells shows in their way."""
    body, gravity = seen.body, np.array(seen.scene.gravity)
    if not body.cut or body.fixed.any():
        return
    x, h = rest_points(body), 0.5 * body.resolution
    for name, tool in seen.scene.tools.items():
        if not isinstance(tool, PlaneTool):
            continue
        normal = np.array(tool.normal) / np.linalg.norm(tool.normal)
        down = gravity - (gravity @ normal) * normal
        pull = float(np.linalg.norm(down))
        height = np.where(body.surface.area > 0.0, (x - tool.point) @ normal, np.inf)
        lowest = int(height.argmin())
        if 0.0 < pull < -tool.friction * float(gravity @ normal) and height[lowest] < h:
            late = _LATE * float(np.sqrt(1.5 * h / pull)) * float(down @ curvatures(body)[lowest] @ down > 0.0)
            if late > 0.0:
                yield (
                    "body.cell: cells give way more at corners of their octants than between these, so down "
                    f"{name} the body may start to roll {1e3 * late:.2g} ms late, or early, {400.0 * late:.2g} % of "
                    f"its way in the first half second; cells of {0.25 * body.resolution:.2g} m halve that"
                )
