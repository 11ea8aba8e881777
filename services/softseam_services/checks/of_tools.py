"""Tools and a body: what is narrow, round, repaired, fast, or goes half through itself in a step."""

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from softseam_protocol.models import some_read
from softseam_protocol.scene.motion import ClosePhase, HoldPhase, MovePhase, OpenPhase, TurnPhase
from softseam_protocol.scene.tools import CapsuleTool, CylinderTool, PlaneTool, SphereTool, ToolSpec
from softseam_services.body.body import Floats
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.checks.seen import Cells
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.pbd.levels import coarse_cells
from softseam_services.tools.edged import PATCHES, edged_tools, face_width
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.travel import beyond_middle

_PARTS = 2.4
"""spacings of the points inside a face: what is narrower parts them, and cuts in"""
_END_ON = 0.9
"""cosine of a cylinder's axis and its way to the body, from which on it comes with a flat end"""
_HARD = 0.5
"""of the speed of waves: what is hit faster is squeezed to half, and more, before the rest of it knows"""
_SPEEDS = {ClosePhase: "close", OpenPhase: "open", MovePhase: "speed"}


def narrow_tools(seen: Cells) -> Iterator[str]:
    """Tools narrower than what feels them: the points inside faces of cells, or the corners of coarse cells."""
    spacing = float(max(seen.body.edges)) / PATCHES
    found = {} if is_embedded(seen.body) else narrower(seen, _PARTS * spacing)
    if found:
        yield (
            f"body.cell: tools are felt at points {1e3 * spacing:.3g} mm apart, between which these pass when pressed "
            f"in by about their width: {listed(found)}. Make cells {PATCHES * min(found.values()) / _PARTS:.2g} m long"
        )
    yield from _between_corners(seen)


def narrower(seen: Cells, least: float) -> dict[str, float]:
    """Tools that press inside faces of cells and are not so wide [m]: the middle one of the three extents of each [m].

    Planes are not narrow, and nodes feel boxes that cover the body; of others the narrower side of the face counts.
    """
    tools, body, widths = seen.tools, seen.body, {}
    for number, edged in enumerate(edged_tools(tools, body)):
        name, half_width = tools.names[number], float(tools.half_width[number])
        if edged:
            widths[name] = face_width(tools, number, body)
        elif np.isfinite(half_width) and not (is_covered_by_faces(body) and seen.scene.tools[name].kind == "box"):
            widths[name] = 2.0 * half_width
    return {name: width for name, width in widths.items() if width < least * (1.0 - 1e-9)}


def listed(lengths: dict[str, float]) -> str:
    """Names, each with its length [m] in millimetres."""
    return ", ".join(f"{name} ({1e3 * length:.3g} mm)" for name, length in lengths.items())


def _between_corners(seen: Cells) -> Iterator[str]:
    """Cells of one block are too firm between their corners; tools beside which cells are FEM's meet none of PBD's."""
    regions, body, tools = seen.scene.regions, seen.body, seen.tools
    asked = seen.scene.models.pbd.coarse
    if asked is None or not some_read(regions.models, "pbd.coarse"):
        return
    coarse = coarse_cells(body, asked, tools)
    if not coarse.any():
        return
    corners = body.x_rest[body.cell_nodes[coarse]].reshape(-1, 3, 3, 3, 3)[:, ::2, ::2, ::2]
    edge = max(float(np.linalg.norm(np.diff(corners, axis=axis), axis=-1).max()) for axis in (1, 2, 3))
    kept_away = regions.within is not None and not some_read(regions.models[1:], "pbd.coarse")
    followed = {name for name, it_is in zip(tools.names, tools.followed, strict=True) if it_is and kept_away}
    found = {name: width for name, width in narrower(seen, edge).items() if name not in followed}
    if found:
        yield (
            f"narrower than the coarse cells' edge of {1e3 * edge:.3g} mm: {listed(found)}. Coarse cells have nodes at "
            "their corners alone, and between these such a tool meets them up to twice too firmly; give a larger "
            "models.pbd.coarse.beyond, or boxes away from it"
        )


def round_tools(seen: Cells) -> Iterator[str]:
    """Round tools of a radius shorter than a cell's edge that press a block in one phase and move on in another.

    Rows of points to either side of them lie on slopes, so that they hold like pinions, with less friction than it
    takes.
    """
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


def repaired_tools(seen: Cells) -> Iterator[str]:
    """What was done to the meshes of tools."""
    for name, geometry in zip(seen.tools.names, seen.tools.geometry, strict=True):
        yield from (f"tools.{name}.path: {note}" for note in geometry.notes)


def hits(seen: Cells) -> Iterator[str]:
    """Body and tools that meet so fast that the material is crushed where they do: thrown, pressed, or fallen."""
    scene, body = seen.scene, seen.body
    waves = min(material.wave_speed for material in body.materials)
    gravity, fall = np.array(scene.gravity), 0.0
    for tool in scene.tools.values():
        if isinstance(tool, PlaneTool):
            normal = np.array(tool.normal) / np.linalg.norm(tool.normal)
            fall = max(fall, float(-gravity @ normal) * float(((body.x_rest - tool.point) @ normal).min()))
    speeds = []
    if scene.tools:
        thrown = math.hypot(*seen.spec.said("velocity", ()), math.sqrt(2.0 * fall))
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


def leaps(seen: Cells) -> Iterator[str]:
    """Tools that a phase of the motion takes half through themselves in a step, as it begins or is fastest."""
    scene, tools = seen.scene, seen.tools
    program = Program(scene.motion, scene.step, tools, Grips(scene, tools, [seen.body]))
    for phase, spec in enumerate(scene.motion):
        fastest = 0.0
        if isinstance(spec, MovePhase | TurnPhase) and spec.acceleration is not None:
            fastest = max(0.0, 0.5 * (spec.ramp.time - scene.step))
        command, _ = program.step(Progress(phase, fastest), tools.position, tools.orientation)
        for name in beyond_middle(tools, tool_motion(tools.position, tools.orientation, command, scene.step)):
            yield (
                f"motion.{phase}: {name} moves half its thickness in a step of {1e3 * scene.step:g} ms: the body may "
                "come out behind it; shorten `step`, or move it more slowly"
            )
