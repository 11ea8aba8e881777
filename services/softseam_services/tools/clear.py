"""Do the tools start outside the body?"""

import numpy as np

from softseam_services.body.body import SAME, Body, Floats, Ints
from softseam_services.body.errors import ToolError
from softseam_services.body.interpolate import rest_points
from softseam_services.body.particles import ParticleBody
from softseam_services.body.units import LOOKS_LIKE
from softseam_services.tools.kernels import least_gaps, rotate
from softseam_services.tools.tool_set import ToolSet

_LARGER = 5.0
"""times the body's extent: a mesh that is larger, and starts inside it, may be in another unit"""
SHRINK = 1e-6
"""how much smaller than the tool its outline is for this check [1]"""


def check_clear(tools: ToolSet, body: Body) -> None:
    """Raise ToolError, naming each tool, where a tool and the body overlap at time 0; touching is allowed.

    Overlap means a surface point of the body inside the tool, or a point of the tool's outline inside the body (its
    middle; a box's corners and the middles of its edges and faces; rings around a cylinder; points all over a mesh).
    """
    points = rest_points(body)
    size = float(np.ptp(points, axis=0).max())
    gap = np.empty(len(tools.names))
    least_gaps(points, tools.kind, tools.shape, tools.position, tools.orientation, gap)
    problems = []
    for tool, name in enumerate(tools.names):
        if gap[tool] < -_slack(tools, tool, size):
            problems.append(f"tools.{name}: it starts {-1e3 * gap[tool]:.3g} mm inside the body")
        elif any_inside(points, body.surface.triangles, _probes(tools, tool, points)):
            problems.append(f"tools.{name}: it starts inside the body")
    if problems:
        _check_sizes(tools, gap, size)
        unit = "".join(f"; {note}" for note in body.notes if LOOKS_LIKE in note)
        what = f"move it clear of the body, whose bounding box is {_bounds(points)}{unit}"
        raise ToolError(f"{'; '.join(problems)}: {what}")


def _check_sizes(tools: ToolSet, gap: Floats, size: float) -> None:
    """Raise ToolError, naming each mesh that starts inside a body of this extent [m] as it is in another unit."""
    odd = []
    for name, geometry, depth in zip(tools.names, tools.geometry, -gap, strict=True):
        if geometry.surface is None or depth <= 0.0:
            continue
        guesses = [note for note in geometry.notes if LOOKS_LIKE in note]
        extent = float(np.ptp(geometry.surface.vertices, axis=0).max())
        if guesses or extent > _LARGER * size:
            text = f"it is {extent:.3g} m long, {extent / size:.2g} times the body, and starts inside it"
            odd.append(f"tools.{name}.scale: {text}; {guesses[0] if guesses else 'is that the unit of its file?'}")
    if odd:
        raise ToolError("; ".join(odd))


def check_clear_of_particles(tools: ToolSet, body: ParticleBody) -> None:
    """Raise ToolError, naming each tool, where a tool is closer to a particle than the body is thick."""
    size = float(np.ptp(body.x_rest, axis=0).max())
    gap = np.empty(len(tools.names))
    least_gaps(body.x_rest, tools.kind, tools.shape, tools.position, tools.orientation, gap)
    deep = [(name, body.radius - gap[tool]) for tool, name in enumerate(tools.names)]
    problems = [
        f"tools.{name}: it starts {1e3 * depth:.3g} mm inside the {body.kind}"
        for tool, (name, depth) in enumerate(deep)
        if depth > _slack(tools, tool, size)
    ]
    if problems:
        _check_sizes(tools, gap, size)
        raise ToolError(
            f"{'; '.join(problems)}: move it clear of the particles, which keep {1e3 * body.radius:.3g} mm from tools "
            f"and whose bounding box is {_bounds(body.x_rest)}"
        )


def _slack(tools: ToolSet, tool: int, size: float) -> float:
    """Depth that counts as touching [m]; with what the tool's distance may be wrong by."""
    return SAME * size + tools.geometry[tool].slack


def _probes(tools: ToolSet, tool: int, points: Floats) -> Floats:
    """Outline of a tool where it is within the bounds of the body's points (n, 3) [m]."""
    # Slightly smaller than the tool, so that a touching face is outside whatever the rounding.
    own = (1.0 - SHRINK) * tools.geometry[tool].outline
    probes = tools.position[tool] + np.array([rotate(tools.orientation[tool], *p) for p in own]).reshape(-1, 3)
    within = np.all((probes > points.min(axis=0)) & (probes < points.max(axis=0)), axis=1)
    return np.asarray(probes[within])


def any_inside(points: Floats, triangles: Ints, probes: Floats) -> bool:
    """Whether a probe (p, 3) lies inside the closed surface of points (n, 3) and triangles (t, 3)."""
    if not len(probes):
        return False
    import igl  # a third of a second, where a tool is close by

    return bool(igl.winding_number(points, triangles.astype(np.int64), probes).max() > 0.5)


def _bounds(points: Floats) -> str:
    low, high = points.min(axis=0), points.max(axis=0)
    rounding = SAME * float((high - low).max())
    low, high = (np.where(np.abs(end) < rounding, 0.0, end) for end in (low, high))
    return "; ".join(f"{axis} {low[c]:.4g} .. {high[c]:.4g} m" for c, axis in enumerate("xyz"))
