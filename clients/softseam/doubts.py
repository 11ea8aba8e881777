"""What is doubtful about a scene and its bodies before anything moves: sentences that begin with their key."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softseam.duration import expected_duration
from softseam.odd_motion import odd_motion
from softseam.odd_units import odd_units
from softseam_protocol.models import some_read
from softseam_protocol.scene.kinds import element_warning
from softseam_protocol.scene.motion import ClosePhase, HoldPhase, MovePhase, OpenPhase, TurnPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import BoxRegion
from softseam_protocol.scene.tools import CapsuleTool, CylinderTool, PlaneTool, SphereTool, ToolSpec

if TYPE_CHECKING:
    from softseam_services.body.body import Body
    from softseam_services.body.check import BodyCheck
    from softseam_services.server import Setup
    from softseam_services.tools.tool_set import ToolSet

_MANY = 100_000
"""unknowns whose factor takes 1.5 GB, and seconds"""
_SWIFT = 4.0
"""waves so many times as fast are worth a warning"""
_HARD = 0.5
"""of the speed of waves: what is hit faster is squeezed to half, and more, before the rest of it knows"""
_END_ON = 0.9
"""cosine of a cylinder's axis and its way to the body, from which on it comes with a flat end"""
_PARTS = 2.4
"""spacings of the points inside a face: what is narrower parts them, and cuts in"""


def doubts(scene: Scene, setups: Mapping[str, Setup]) -> list[str]:
    """What is doubtful about a scene, which costs little to find out: thousands of cells take some hundredths of a
    second, and half a second where PBD's substeps are fixed.

    setups  bodies that are built, by name; of others the scene alone is looked at
    """
    found = []
    for name in scene.bodies:
        one, setup = scene.of(name), setups.get(name)
        told = _doubts_of_scene(one, _size(one)) if setup is None else doubts_of(setup)
        found += told if scene.one is not None else [of_body(name, doubt) for doubt in told]
    return list(dict.fromkeys(found))


def doubts_of(setup: Setup, found: BodyCheck | None = None) -> list[str]:
    """The same of one body.

    setup  the scene with that body alone, the body, and the tools
    found  what it looks like, where that is known already
    Raises SettingError where the run would be refused.
    """
    from softseam_services.body.check import check_body
    from softseam_services.body.contact_points import is_embedded
    from softseam_services.pbd.levels import coarse_cells

    scene, body, tools = setup.scene, setup.body, setup.tools
    if not body.has_cells:
        size = float(np.ptp(body.x_rest, axis=0).max())
        return [*_doubts_of_scene(scene, size), *_fine_friction(scene, body.spacing, "more divisions")]
    found = check_body(body) if found is None else found
    told = [*found.warnings, *_stiff_for_pbd(scene, body), *_leaps(scene, body, tools)]
    apart = float(body.edges.max()) * (0.25 if is_embedded(body) else 0.5)
    told += [
        *_fine_friction(scene, apart, "shorter cells"),
        *_large(scene, 3 * (found.n_nodes - found.n_fixed)),
        *_thin_tools(scene, body, tools),
        *_biting_tools(scene, body, tools),
        *_repaired_tools(tools),
        *_in_vain(scene, body),
        *_hard_hits(scene, body),
        *_doubts_of_scene(scene, max(found.size)),
        *_few_substeps(scene, body, tools),
    ]
    if scene.models.pbd.coarse is not None:
        told += _pokes_between(scene, body, coarse_cells(body, scene.models.pbd.coarse, tools), tools)
    return told


def _doubts_of_scene(scene: Scene, size: float) -> list[str]:
    """What the scene of one body of this extent [m] alone tells."""
    return [*_locks(scene), *_stiffened_by_time(scene), *odd_motion(scene, size), *odd_units(scene, size)]


def _size(scene: Scene) -> float:
    """Largest extent of the only body [m]; infinite where only who reads its file knows: nothing is too large then."""
    return max(scene.body.own_lengths, default=math.inf)


def of_body(name: str, doubt: str) -> str:
    """A sentence about `body`, about one of several."""
    return f"bodies.{name}.{doubt.removeprefix('body.')}" if doubt.startswith("body.") else doubt


def _left_to_pbd(scene: Scene, body: Body) -> NDArray[np.bool_]:
    """Cells that PBD has, or may have (C,)."""
    default, near = scene.regions.models
    left = np.full(body.n_cells, some_read((default, near), "pbd.substeps"))
    if some_read([default], "pbd.substeps") and not some_read([near], "pbd.substeps"):
        middle = body.x_rest[body.cell_nodes[:, 13]]
        for box in scene.regions.boxes:
            left &= ~((middle >= box.min) & (middle <= box.max)).all(axis=1)
    return left


def _stiff_for_pbd(scene: Scene, body: Body) -> list[str]:
    """That substeps follow an inclusion, where PBD has cells of one in which waves are much faster than around it."""
    fast = np.array([material.wave_speed for material in body.materials]) / body.material.wave_speed
    swift = (fast > _SWIFT)[body.octant_material].any(axis=1)
    if not (swift & _left_to_pbd(scene, body)).any():
        return []
    return [
        f"waves in an inclusion are {fast.max():.0f} times as fast as around it: where PBD has it, a step takes about "
        "as many times more substeps; give it to fem by regions.near.boxes, or all cells by regions.default"
    ]


def _large(scene: Scene, n_unknowns: int) -> list[str]:
    """That FEM's factor takes much memory, which grows with the power 1.35 of the unknowns."""
    n = n_unknowns / 2 ** len(scene.symmetry)
    if not some_read([scene.regions.default], "fem.element") or n <= _MANY:
        return []
    return [
        f"body.cell: fem factors a matrix of {n:,.0f} unknowns, which takes about {1.5 * (n / _MANY) ** 1.35:.2g} GB, "
        "and a step many seconds: give a longer edge, or `symmetry` where the scene has one"
    ]


def _fine_friction(scene: Scene, apart: float, finer: str) -> list[str]:
    """That friction varies between points that touch, which are so far apart [m]; finer: what brings them nearer."""
    field = scene.body.uneven_friction
    if field is None or field.length >= apart:
        return []
    return [
        f"body.friction_field.length: friction varies over {1e3 * field.length:.3g} mm, and points that touch tools "
        f"are {1e3 * apart:.3g} mm apart, each of which stands for what is around it: give a longer length, or {finer}"
    ]


def _thin_tools(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """Tools so narrow that they fit between the points inside faces of a block, or part them and pass when pressed."""
    from softseam_services.body.contact_points import is_embedded
    from softseam_services.tools.edged import PATCHES

    if is_embedded(body):
        return []
    spacing = float(max(body.edges)) / PATCHES
    least = _PARTS * spacing
    widths = {name: width for name, width in _felt_at_points(scene, body, tools) if width < least * (1.0 - 1e-9)}
    if not widths:
        return []
    named = ", ".join(f"{name} ({1e3 * width:.3g} mm)" for name, width in widths.items())
    return [
        f"body.cell: tools are felt at points {1e3 * spacing:.3g} mm apart, between which these pass when "
        f"pressed in by about their width: {named}. Make cells {PATCHES * min(widths.values()) / _PARTS:.2g} m long"
    ]


def _biting_tools(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """Round tools that press a block in one phase and move on in another, of a radius shorter than a cell's edge: rows
    of points to either side of them lie on slopes, so that they hold like pinions, with less friction than it takes.
    """
    from softseam_services.body.contact_points import is_embedded

    if is_embedded(body):
        return []
    edge, middle = float(max(body.edges)), body.x_rest.mean(axis=0)
    driven = Counter(name for phase in scene.motion if not isinstance(phase, HoldPhase) for name in phase.tools)
    radii = {
        name: 0.5 * width
        for name, width in _felt_at_points(scene, body, tools)
        if scene.tools[name].friction > 0.0 and driven[name] > 1 and _is_round(scene.tools[name], middle)
    }
    small = {name: radius for name, radius in radii.items() if radius < edge * (1.0 - 1e-9)}
    if not small:
        return []
    named = ", ".join(f"{name} ({1e3 * radius:.3g} mm)" for name, radius in small.items())
    return [
        f"body.cell: round tools of a radius below the {1e3 * edge:.3g} mm of a cell hold with up to a third less "
        f"friction than it takes, where they slide across their rounding: {named}. Where a grip is near what friction "
        f"holds, make cells {min(small.values()):.2g} m long"
    ]


def _is_round(tool: ToolSpec, middle: NDArray[np.float64]) -> bool:
    """Whether a tool meets a body about this point (3,) [m] with a side that is round."""
    if isinstance(tool, CylinderTool):
        way = middle - tool.position
        return bool(abs(way @ tool.axis) < _END_ON * np.linalg.norm(way) * np.linalg.norm(tool.axis))
    return isinstance(tool, SphereTool | CapsuleTool)


def _felt_at_points(scene: Scene, body: Body, tools: ToolSet) -> Iterator[tuple[str, float]]:
    """Tools that press inside faces of cells, and how wide each is: the middle one of its three extents [m].

    Planes are not narrow, and nodes feel boxes that cover the body; of others the narrower side of the face counts.
    """
    from softseam_services.body.outer_faces import is_covered_by_faces
    from softseam_services.tools.edged import edged_tools, face_width

    edged = edged_tools(tools, body)
    for number, (name, half_width) in enumerate(zip(tools.names, tools.half_width, strict=True)):
        if edged[number]:
            yield name, face_width(tools, number, body)
        elif np.isfinite(half_width) and not (is_covered_by_faces(body) and scene.tools[name].kind == "box"):
            yield name, 2.0 * float(half_width)


def _repaired_tools(tools: ToolSet) -> list[str]:
    """What was done to the meshes of tools, each by its key."""
    return [
        f"tools.{name}.path: {note}"
        for name, geometry in zip(tools.names, tools.geometry, strict=True)
        for note in geometry.notes
    ]


def _locks(scene: Scene) -> list[str]:
    """That FEM's element is too stiff for the scene's material."""
    body = scene.body
    if not body.has_cells or not some_read(scene.regions.models, "fem.element"):
        return []
    found = element_warning(
        scene.models.fem.element, max(material.poisson for material in body.cell_materials), body.tetrahedral
    )
    return [f"models.fem.element: {found}"] if found else []


def _few_substeps(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """That a fixed number of PBD's substeps is fewer than is stable.

    Raises SettingError where leapfrog, which has all cells or none, would be unstable: the run would be refused.
    """
    from softseam_services.body.region import build_region
    from softseam_services.pbd.model import build_model
    from softseam_services.pbd.parameters import build_parameters

    left = _left_to_pbd(scene, body)
    if scene.models.pbd.substeps == "auto" or not left.any():
        return []
    region = build_region(body, np.flatnonzero(left).astype(np.int32), np.zeros(0, dtype=np.int32))
    spec = scene.models.pbd
    parameters = build_parameters(build_model(body, region, tools, spec), body, region, tools, spec)
    given, stable = parameters.substeps(scene.step), parameters.stable_substeps(scene.step)
    if given >= stable:
        return []
    return [
        f"models.pbd.substeps: {given} in a step of {1e3 * scene.step:g} ms are fewer than the {stable} that are "
        f"stable: blocks may gain energy, and points chatter on tools; leave it out, and {stable} are taken, or "
        "shorten `step`"
    ]


def _in_vain(scene: Scene, body: Body) -> list[str]:
    """Boxes in which nothing is that they are to choose."""
    clamped: tuple[BoxRegion, ...] = ()
    clamped, boxes = scene.body.said("fixed", clamped), scene.regions.boxes
    middle = body.x_rest[body.cell_nodes[:, 13]]

    def holds(box: BoxRegion, points: NDArray[np.float64]) -> bool:
        slack = 1e-6 * min(body.edges)
        return bool(((points >= np.array(box.min) - slack) & (points <= np.array(box.max) + slack)).all(axis=1).any())

    empty = [f"body.fixed.{i}: no node" for i, box in enumerate(clamped) if not holds(box, body.x_rest)]
    empty += [f"regions.near.boxes.{i}: no cell's middle" for i, box in enumerate(boxes) if not holds(box, middle)]
    spans = " .. ".join(str(end(body.x_rest, axis=0).round(6).tolist()) for end in (np.min, np.max))
    return [f"{said} is in this box: the body spans {spans} m at rest; move the box, or leave it out" for said in empty]


def _stiffened_by_time(scene: Scene) -> list[str]:
    """A viscosity that lets nothing move while the scene lasts."""
    length = expected_duration(scene)
    time = scene.body.cell_materials[0].retardation_time if scene.body.has_cells else 0.0
    if length is None or time <= length:
        return []
    return [
        f"body.material.retardation_time: {time:g} s, but the motion lasts {length:.3g} s: next to nothing would move; "
        "is it in s?"
    ]


def _leaps(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """Tools that a phase of the motion takes half through themselves in a step, as it begins or is fastest."""
    from softseam_services.orchestrator.grips import Grips
    from softseam_services.orchestrator.program import Program, Progress
    from softseam_services.tools.motion import tool_motion
    from softseam_services.tools.travel import beyond_middle

    program = Program(scene.motion, scene.step, tools, Grips(scene, tools, [body]))
    found = []
    for phase, spec in enumerate(scene.motion):
        fastest = 0.0
        if isinstance(spec, MovePhase | TurnPhase) and spec.acceleration is not None:
            fastest = max(0.0, 0.5 * (spec.ramp.time - scene.step))
        command, _ = program.step(Progress(phase, fastest), tools.position, tools.orientation)
        motion = tool_motion(tools, tools.position, tools.orientation, command, scene.step)
        found += [
            f"motion.{phase}: {name} moves half its thickness in a step of {1e3 * scene.step:g} ms: the body may come "
            "out behind it; shorten `step`, or move it more slowly"
            for name in beyond_middle(tools, motion)
        ]
    return found


def _hard_hits(scene: Scene, body: Body) -> list[str]:
    """That body and tools meet so fast that the material is crushed where they do: by what the scene says of both, and
    by a fall onto a plane."""
    slowest = min(material.wave_speed for material in body.materials)
    gravity, heights = np.array(scene.gravity), [0.0]
    for tool in scene.tools.values():
        if isinstance(tool, PlaneTool):
            normal = np.array(tool.normal) / np.linalg.norm(tool.normal)
            heights.append(max(0.0, float(-gravity @ normal) * float(((body.x_rest - tool.point) @ normal).min())))
    thrown = (
        math.hypot(math.hypot(*scene.body.said("velocity", ())), math.sqrt(2.0 * max(heights))) if scene.tools else 0.0
    )
    found = []
    if thrown > _HARD * slowest:
        found.append(f"body.velocity: it meets tools at up to {thrown:.3g} m/s, {_blow(thrown, slowest)}")
    for number, phase in enumerate(scene.motion):
        key, speed = "", 0.0
        if isinstance(phase, ClosePhase):
            key, speed = "close", phase.close
        elif isinstance(phase, OpenPhase):
            key, speed = "open", phase.open
        elif isinstance(phase, MovePhase):
            key, speed = "speed", phase.speed
        if speed > _HARD * slowest:
            found.append(f"motion.{number}.{key}: {speed:.3g} m/s is {_blow(speed, slowest)}")
    return found


def _blow(speed: float, waves: float) -> str:
    return (
        f"{speed / waves:.2g} times the {waves:.3g} m/s of waves in the body: what is hit so fast is crushed before "
        "the rest of it gives way, and the run may fail; slow it down, or is it in m/s, not in mm/s?"
    )


def _pokes_between(scene: Scene, body: Body, coarse: NDArray[np.bool_], tools: ToolSet) -> list[str]:
    """That cells of one block are too firm between their corners, where a tool is narrower than they are.

    Tools beside which cells are FEM's meet none of PBD's.
    """
    models, within = scene.regions.models, scene.regions.within
    if not coarse.any() or not some_read(models, "pbd.coarse"):
        return []
    corners = body.x_rest[body.cell_nodes[coarse]].reshape(-1, 3, 3, 3, 3)[:, ::2, ::2, ::2]
    edge = max(float(np.linalg.norm(np.diff(corners, axis=axis), axis=-1).max()) for axis in (1, 2, 3))
    kept_away = within is not None and not some_read(models[1:], "pbd.coarse")
    followed = {name for name, near_it in zip(tools.names, tools.followed, strict=True) if near_it and kept_away}
    narrow = [
        f"{name} ({1e3 * width:.3g} mm)"
        for name, width in _felt_at_points(scene, body, tools)
        if width < edge * (1.0 - 1e-9) and name not in followed
    ]
    if not narrow:
        return []
    return [
        f"narrower than the coarse cells' edge of {1e3 * edge:.3g} mm: {', '.join(narrow)}. Coarse cells have nodes at "
        "their corners alone, and between these such a tool meets them up to twice too firmly; give a larger "
        "models.pbd.coarse.beyond, or boxes away from it"
    ]
