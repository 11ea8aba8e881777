"""`softseam check`: is the scene good, is its mesh good, and what will simulating it take? Simulates nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.duration import expected_duration, too_many_steps
from softseam.embedded import translated
from softseam.errors import SceneRefused, missing_extra
from softseam.odd_motion import odd_motion
from softseam.scenes import bundle_of, located
from softseam.symmetric import symmetric
from softseam.variants import with_settings
from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.material_borders import material_borders
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.file import bundle_scene, scene_hash
from softseam_protocol.scene.parts import SpherePart
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import BoxRegion, Vector

_MANY = 100_000
"""unknowns whose factor takes 1.5 GB, and seconds"""
_SWIFT = 4.0
"""waves so many times as fast are worth a warning"""

if TYPE_CHECKING:
    from softseam_services.body.body import Body
    from softseam_services.body.check import Part
    from softseam_services.server import Setup
    from softseam_services.tools.tool_set import ToolSet


def check_scene(name: str, settings: Sequence[str], console: Console) -> None:
    """Build the bodies and the tools as a run would, and print what they are. Raises SceneRefused."""
    loaded, bundle = bundle_of(name)
    scene = with_settings(loaded, settings)
    if scene is not loaded:
        bundle = bundle_scene(scene, bundle.files)
    if endless := too_many_steps(scene):
        raise SceneRefused(located(endless, name, settings))
    try:
        from softseam_services.orchestrator.probes import share_probes
        from softseam_services.server import build_setup
    except ImportError as error:
        raise missing_extra(error, "checking a mesh") from error
    try:
        with translated():
            setups = {body: build_setup(bundle, body) for body in scene.bodies}
            probes = share_probes({body: setup.body for body, setup in setups.items()}, scene.probes)
    except SceneRefused as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_row("scene", f"{scene.name}  (hash {scene_hash(bundle)[:12]})")
    found = {body: _check_body(setup, probes[body], name, settings) for body, setup in setups.items()}
    console.print(table)
    for body, (facts, doubts, notes) in found.items():
        if len(found) > 1:
            console.print(Text(f"\n{body}", style="bold"))
        console.print(facts)
        _warn(doubts, name, settings, console)
        for note in notes:
            console.print(Text(f"note: {note}", style="dim"))
    console.print(Text("the scene can be simulated", style="green"))


def _check_body(
    setup: Setup, probes: Mapping[str, Vector], name: str, settings: Sequence[str]
) -> tuple[Table, list[str], list[str]]:
    """What a body is, what is doubtful about it, and notes. Raises SceneRefused."""
    from softseam_services.body.body import Body
    from softseam_services.body.check import check_body
    from softseam_services.body.errors import SettingError
    from softseam_services.body.particles import ParticleBody
    from softseam_services.orchestrator.goal import Goal
    from softseam_services.orchestrator.probes import Probes
    from softseam_services.pbd.levels import coarse_cells

    scene, built = setup.scene, setup.body
    try:
        with translated():
            if isinstance(built, Body):
                Probes(built, probes)
                if scene.regions.goal is not None:
                    Goal(scene, built, setup.tools)
    except SceneRefused as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    if isinstance(built, ParticleBody):
        for fact, value in built.facts().items():
            table.add_row(fact, value)
        table.add_row("models", _models(scene))
        table.add_row("steps", _steps(scene))
        return table, odd_motion(scene, float(np.ptp(built.x_rest, axis=0).max())), []
    body = check_body(built)
    assert isinstance(scene.body, BodySpec)  # it has cells
    table.add_row("size", " x ".join(f"{1e3 * side:.4g}" for side in body.size) + " mm")
    table.add_row("volume, mass", f"{1e6 * body.volume:.4g} cm^3, {1e3 * body.mass:.4g} g")
    edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.edges)
    whose = "in the block" if isinstance(scene.body.shape, BlockShape) else "of the file"
    own = f"{body.n_cells} hexahedra {whose}, shortest edge {1e3 * body.edges[0]:.3g} mm"
    table.add_row("cells", f"{body.n_cells} of {edges} mm" if body.boxes else own)
    table.add_row("filled", f"{body.full_cells} cells wholly; the emptiest to {100.0 * body.smallest_fill:.3g} %")
    table.add_row(
        "unknowns", f"{3 * (body.n_nodes - body.n_fixed)} ({body.n_nodes} nodes, {body.n_fixed} of them clamped)"
    )
    table.add_row("surface", f"{body.n_triangles} triangles, {body.n_contact_points} contact points")
    table.add_row(
        "wave speed", f"{body.wave_speed:.3g} m/s: crosses a cell in {_crossing(body.edges, body.wave_speed)}"
    )
    if scene.symmetry:
        table.add_row("symmetry", symmetric(scene))
    for number, (inclusion, part) in enumerate(zip(scene.body.inclusions, body.parts, strict=True)):
        table.add_row(f"inclusion {number}", _inclusion(inclusion.shape.kind, part))
    table.add_row("models", _models(scene))
    doubts = [*body.warnings, *_locks(scene), *_stiff_for_pbd(scene, built), *_leaps(scene, built, setup.tools)]
    doubts += [*_large(scene, 3 * (body.n_nodes - body.n_fixed)), *_thin_tools(scene, built, setup.tools)]
    doubts += [*_in_vain(scene, built), *_stiffened_by_time(scene), *odd_motion(scene, max(body.size))]
    try:
        doubts += _few_substeps(scene, built, setup.tools)
    except SettingError as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    if scene.models.pbd.coarse is not None:
        coarse = coarse_cells(built, scene.models.pbd.coarse, setup.tools)
        blocks = f"{int(coarse.sum())} of {body.n_cells} cells are one block where pbd has them, not eight"
        table.add_row("coarse", blocks)
        doubts += _pokes_between(scene, built, coarse, setup.tools)
    table.add_row("steps", _steps(scene))
    return table, doubts, [*_hidden_viscosity(scene), *_cut_by_borders(scene, scene.body, built)]


def _warn(doubts: Sequence[str], name: str, settings: Sequence[str], console: Console) -> None:
    for doubt in doubts:
        console.print(Text(f"warning: {located(doubt, name, settings)}", style="yellow"))


def _inclusion(kind: str, part: Part) -> str:
    """What the cells make of an inclusion."""
    size = f"{part.octants} octants of cells, {1e6 * part.volume:.4g} cm^3, {1e3 * part.density * part.volume:.4g} g"
    return f"{kind}: {size}; E {1e-3 * part.young:.4g} kPa, nu {part.poisson:.3g}"


def _left_to_pbd(scene: Scene, body: Body) -> NDArray[np.bool_]:
    """Cells that PBD has, or may have (C,)."""
    near, default = scene.regions.near, scene.regions.default
    left = np.full(body.n_cells, "pbd" in (default, near.model if near else default))
    if near is not None and near.model == "fem" and default == "pbd":
        middle = body.x_rest[body.cell_nodes[:, 13]]
        for box in near.boxes:
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
    if scene.regions.default != "fem" or n <= _MANY:
        return []
    return [
        f"body.cell: fem factors a matrix of {n:,.0f} unknowns, which takes about {1.5 * (n / _MANY) ** 1.35:.2g} GB, "
        "and a step many seconds: give a longer edge, or `symmetry` where the scene has one"
    ]


def _thin_tools(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """Tools narrower than two of the cells that they touch, where PBD has these."""
    near, edge = scene.regions.near, float(max(body.edges))
    if "fem" in (scene.regions.default, near.model if near else ""):
        return []
    widths = {name: width for name, width in _felt_at_points(scene, body, tools) if width < 2.0 * edge * (1.0 - 1e-9)}
    if not widths:
        return []
    named = ", ".join(f"{name} ({1e3 * width:.3g} mm)" for name, width in widths.items())
    return [
        f"body.cell: pbd feels tools at points {0.5e3 * edge:.3g} mm apart, between which these may pass, or sink in "
        f"beside one: {named}. Make cells {0.5 * min(widths.values()):.3g} m long, or give all to fem by "
        "regions.default"
    ]


def _felt_at_points(scene: Scene, body: Body, tools: ToolSet) -> Iterator[tuple[str, float]]:
    """Tools that PBD feels at points, and how wide each is: the middle one of its three extents [m].

    Planes are not narrow, and boxes press by the share of a face that they cover.
    """
    from softseam_services.body.outer_faces import is_covered_by_faces

    shares = is_covered_by_faces(body)
    for name, geometry in zip(tools.names, tools.geometry, strict=True):
        if len(geometry.outline) and not (shares and scene.tools[name].kind == "box"):
            yield name, float(np.sort(np.ptp(geometry.outline, axis=0))[1])


def _locks(scene: Scene) -> list[str]:
    """That FEM's element is too stiff for the scene's material."""
    from softseam_services.orchestrator.step_warnings import locking

    found = locking(scene)
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
    assert isinstance(scene.body, BodySpec)
    near = scene.regions.near
    middle = body.x_rest[body.cell_nodes[:, 13]]

    def holds(box: BoxRegion, points: NDArray[np.float64]) -> bool:
        slack = 1e-6 * min(body.edges)
        return bool(((points >= np.array(box.min) - slack) & (points <= np.array(box.max) + slack)).all(axis=1).any())

    empty = [f"body.fixed.{i}: no node" for i, box in enumerate(scene.body.fixed) if not holds(box, body.x_rest)]
    boxes = near.boxes if near is not None else ()
    empty += [f"regions.near.boxes.{i}: no cell's middle" for i, box in enumerate(boxes) if not holds(box, middle)]
    spans = " .. ".join(str(end(body.x_rest, axis=0).round(6).tolist()) for end in (np.min, np.max))
    return [f"{said} is in this box: the body spans {spans} m at rest; move the box, or leave it out" for said in empty]


def _stiffened_by_time(scene: Scene) -> list[str]:
    """A viscosity that lets nothing move while the scene lasts."""
    length = expected_duration(scene)
    time = scene.body.material.retardation_time if isinstance(scene.body, BodySpec) else 0.0
    if length is None or time <= length:
        return []
    return [
        f"body.material.retardation_time: {time:g} s, but the motion lasts {length:.3g} s: next to nothing would move; "
        "is it in s?"
    ]


def _leaps(scene: Scene, body: Body, tools: ToolSet) -> list[str]:
    """Tools that a phase of the motion takes half through themselves in a step, as it begins."""
    from softseam_services.orchestrator.grip import grips_by_phase
    from softseam_services.orchestrator.program import Program, Progress
    from softseam_services.tools.motion import tool_motion
    from softseam_services.tools.travel import beyond_middle

    program = Program(scene.motion, scene.step, tools, grips_by_phase(scene, tools, [body]))
    found = []
    for phase in range(len(scene.motion)):
        command, _ = program.step(Progress(phase, 0.0), tools.position, tools.orientation)
        motion = tool_motion(tools, tools.position, tools.orientation, command, scene.step)
        found += [
            f"motion.{phase}: {name} moves half its thickness in a step of {1e3 * scene.step:g} ms: the body may come "
            "out behind it; shorten `step`, or move it more slowly"
            for name in beyond_middle(tools, motion)
        ]
    return found


def _pokes_between(scene: Scene, body: Body, coarse: NDArray[np.bool_], tools: ToolSet) -> list[str]:
    """That cells of one block meet tools at their corners, where a tool is narrower than they are: it fits between.

    Tools beside which cells are FEM's meet none of PBD's.
    """
    near = scene.regions.near
    if not coarse.any() or "pbd" not in (scene.regions.default, near.model if near else scene.regions.default):
        return []
    corners = body.x_rest[body.cell_nodes[coarse]].reshape(-1, 3, 3, 3, 3)[:, ::2, ::2, ::2]
    edge = max(float(np.linalg.norm(np.diff(corners, axis=axis), axis=-1).max()) for axis in (1, 2, 3))
    kept_away = near is not None and near.model == "fem" and near.within is not None
    followed = {name for name, near_it in zip(tools.names, tools.near, strict=True) if near_it and kept_away}
    narrow = [
        f"{name} ({1e3 * width:.3g} mm)"
        for name, width in _felt_at_points(scene, body, tools)
        if width < edge * (1.0 - 1e-9) and name not in followed
    ]
    if not narrow:
        return []
    return [
        f"narrower than the coarse cells' edge of {1e3 * edge:.3g} mm: {', '.join(narrow)}. Coarse cells meet tools at "
        "their corners alone, and do not feel one between them; give a larger models.pbd.coarse.beyond, or boxes away "
        "from it"
    ]


def _hidden_viscosity(scene: Scene) -> list[str]:
    """That implicit Euler damps more than the material's viscosity, where fem has cells of it."""
    near, default = scene.regions.near, scene.regions.default
    if not isinstance(scene.body, BodySpec) or "fem" not in (default, near.model if near else default):
        return []
    time = scene.body.material.retardation_time
    if time == 0.0 or scene.step < time or scene.models.fem.integrator != "implicit_euler":
        return []
    return [
        f"in fem the step itself damps more than the material: take step < {1e3 * time:.3g} ms, its retardation_time"
    ]


def _cut_by_borders(scene: Scene, spec: BodySpec, body: Body) -> list[str]:
    """That materials meet inside cells, where a block's cells could end there."""
    if not isinstance(spec.shape, BlockShape):
        return []
    if spec.shape.borders == "even" and inner_ball(spec.shape.size, spec.position, spec.inclusions):
        what = "say body.shape.borders: materials, and they follow it"
        alone = "" if scene.regions.near is None else ", which takes one model: leave out regions.near"
        return [f"a sphere inside the block is made up of octants of cells, as a staircase: {what}{alone}"]
    ball = inner_ball(spec.shape.size, spec.position, spec.inclusions)
    spheres = [part for part in spec.inclusions if isinstance(part.shape, SpherePart)]
    if spec.shape.borders == "materials" and ball is None and spheres:
        return [
            "no cells follow the spheres in spite of body.shape.borders: materials; what is seen of them is made up of "
            "octants, as a staircase: cells follow one sphere alone, a tenth of its radius or more from the block's "
            "faces, with nothing but boxes along the axes beside it, and no later one over it"
        ]
    lower = np.array(spec.position) - np.array([0.5, 0.5, 0.0]) * spec.shape.size
    ends = body.x_rest[body.cell_nodes[:, [0, 26]]].reshape(-1, 3) - lower
    inside = [
        f"{axis} {1e3 * (plane + start):.4g}"
        for axis, planes, start, at in zip(
            "xyz", material_borders(spec.shape.size, spec.position, spec.inclusions), lower, ends.T, strict=True
        )
        for plane in planes
        if np.abs(at - plane).min() > 1e-6 * np.ptp(at)
    ]
    if not inside:
        return []
    remedy = "choose `cell` so that cells end there, or say body.shape.borders: materials"
    if spec.shape.borders == "materials":
        remedy = "shorten `cell`, for within a tenth of it from a face or another border no cell ends"
    return [
        f"materials meet inside cells, at {', '.join(inside)} mm, where stress is smeared and the border moves by up "
        f"to a quarter of a cell: {remedy}"
    ]


def _crossing(edges: Sequence[float], wave_speed: float) -> str:
    return f"{1e3 * min(edges) / wave_speed:.3g} ms"


def _models(scene: Scene) -> str:
    near = scene.regions.near
    if near is None:
        return f"{scene.regions.default} everywhere"
    reasons = [f"within {1e3 * near.within:.3g} mm of a tool"] if near.within is not None else []
    if near.boxes:
        reasons.append(f"in {len(near.boxes)} boxes")
    return f"{near.model} {' and '.join(reasons) or 'nowhere'}, {scene.regions.default} elsewhere"


def _steps(scene: Scene) -> str:
    duration = expected_duration(scene)
    if duration is None:
        return f"of {1e3 * scene.step:g} ms, until the motion ends"
    return f"{math.ceil(duration / scene.step - 1e-9)} of {1e3 * scene.step:g} ms: {duration:.3g} s"
