"""`softseam check`: is the scene good, is its mesh good, and what will simulating it take? Simulates nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.doubts import doubts_of, of_body
from softseam.duration import expected_duration, too_many_steps
from softseam.embedded import translated
from softseam.errors import SceneRefused, missing_extra
from softseam.outputs import check_ending, check_outputs
from softseam.previewing import draw_preview
from softseam.scenes import bundle_of, bundle_with, inputs_of, located
from softseam.symmetric import symmetric
from softseam.uneven_friction import in_words
from softseam.variants import with_settings
from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.material_borders import material_borders
from softseam_protocol.models import some_read
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.parts import SpherePart
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Vector

if TYPE_CHECKING:
    from softseam_services.body.body import Body
    from softseam_services.body.check import Part
    from softseam_services.body.particles import ParticleBody
    from softseam_services.server import Setup


_QUICK = 125
"""cells up to which a check computes the condition number of their blocks: .5 s"""


def check_scene(name: str, settings: Sequence[str], console: Console, picture: Path | None = None) -> None:
    """Build the bodies and the tools as a run would, print what they are, and draw them to a .png where one is named.
    Raises SceneRefused and BadInput."""
    if picture is not None:
        check_ending("--picture", picture, ".png", "a picture")
        check_outputs([("--picture", picture)], inputs=inputs_of(name))
    loaded, bundle = bundle_of(name)
    scene = with_settings(loaded, settings)
    if scene is not loaded:
        bundle = bundle_with(scene, bundle, name, settings)
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
        told = doubts if scene.one is not None else [of_body(body, doubt) for doubt in doubts]
        print_doubts(told, name, settings, console)
        for note in notes:
            console.print(Text(f"note: {note}", style="dim"))
    if picture is not None:
        console.print(Text(f"picture: {draw_preview(bundle, picture)}"), soft_wrap=True)
    console.print(Text("the scene can be simulated", style="green"))


def _check_body(
    setup: Setup, probes: Mapping[str, Vector], name: str, settings: Sequence[str]
) -> tuple[Table, list[str], list[str]]:
    """What a body is, what is doubtful about it, and notes. Raises SceneRefused."""
    from softseam_services.body.check import check_body
    from softseam_services.body.errors import SettingError
    from softseam_services.orchestrator.goal import Goal
    from softseam_services.orchestrator.grip_sides import grip_sides
    from softseam_services.orchestrator.probes import Probes
    from softseam_services.pbd.levels import coarse_cells

    scene, built = setup.scene, setup.body
    try:
        with translated():
            if built.has_cells:
                Probes(built, probes)
                if scene.regions.goal is not None:
                    Goal(scene, built, setup.tools)
    except SceneRefused as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    if not built.has_cells:
        facts = {**built.facts(), **_friction(setup), **_added(setup, built), **_condition(setup)}
        for fact, value in facts.items():
            table.add_row(fact, value)
        table.add_row("models", _models(setup))
        table.add_row("steps", _steps(scene))
        return table, doubts_of(setup), []
    body = check_body(built)
    assert isinstance(scene.body, BodySpec)  # it has cells
    table.add_row("size", " x ".join(f"{1e3 * side:.4g}" for side in body.size) + " mm")
    table.add_row("volume, mass", f"{1e6 * body.volume:.4g} cm^3, {1e3 * body.mass:.4g} g")
    edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.edges)
    whose = "in the block" if isinstance(scene.body.shape, BlockShape) else "of the file"
    kind = f"tetrahedra ({scene.models.fem.element})" if scene.body.tetrahedral else "hexahedra"
    own = f"{body.n_cells} {kind} {whose}, shortest edge {1e3 * body.edges[0]:.3g} mm"
    along = f", along the mesh's own axes, turned by {body.turned:.3g} degrees" if body.turned else ""
    table.add_row("cells", f"{body.n_cells} of {edges} mm{along}" if body.boxes else own)
    if not scene.body.tetrahedral:
        slivers = f", {body.slivers} by less than 2 %" if body.slivers else ""
        emptiest = f"the emptiest to {100.0 * body.smallest_fill:.3g} %"
        table.add_row("filled", f"{body.full_cells} cells wholly{slivers}; {emptiest}")
    table.add_row(
        "unknowns", f"{3 * (body.n_nodes - body.n_fixed)} ({body.n_nodes} nodes, {body.n_fixed} of them clamped)"
    )
    table.add_row("surface", f"{body.n_triangles} triangles, {body.n_contact_points} contact points")
    table.add_row(
        "wave speed", f"{body.wave_speed:.3g} m/s: crosses a cell in {_crossing(body.edges, body.wave_speed)}"
    )
    for fact, value in _friction(setup).items():
        table.add_row(fact, value)
    if scene.symmetry:
        table.add_row("symmetry", symmetric(scene))
    for number, (inclusion, part) in enumerate(zip(scene.body.inclusions, body.parts, strict=True)):
        table.add_row(f"inclusion {number}", _inclusion(inclusion.shape.kind, part))
    if sides := grip_sides(setup):
        table.add_row("grip", sides)
    table.add_row("models", _models(setup))
    try:
        doubts = doubts_of(setup, body)
    except SettingError as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    if scene.models.pbd.coarse is not None:
        coarse = coarse_cells(built, scene.models.pbd.coarse, setup.tools)
        blocks = f"{int(coarse.sum())} of {body.n_cells} cells are one block where pbd has them, not eight"
        table.add_row("coarse", blocks)
    for fact, value in _condition(setup).items():
        table.add_row(fact, value)
    table.add_row("steps", _steps(scene))
    return table, doubts, [*_hidden_viscosity(scene), *_cut_by_borders(scene, scene.body, built)]


def _friction(setup: Setup) -> dict[str, str]:
    """How friction varies over the body; nothing where it does not."""
    from softseam_services.body.interpolate import rest_points

    spec, body = setup.scene.body.uneven_friction, setup.body
    if spec is None:
        return {}
    factor = body.friction_field.factor(rest_points(body) if body.has_cells else body.x_rest)
    return {"friction": f"{in_words(spec)}: {factor.min():.3g} to {factor.max():.3g} times the tools' own"}


def _added(setup: Setup, body: ParticleBody) -> dict[str, str]:
    """Constraints that the scene adds to the body's own; nothing where it adds none."""
    from softseam_services.pbd.particles.constraints import build_constraints, constraints_of
    from softseam_services.pbd.particles.kernels.constraint import FIRST, LAST

    specs = constraints_of(setup.scene)
    families = build_constraints(body, specs).families
    counts = (families[:, LAST] - families[:, FIRST]).tolist()
    told = ", ".join(f"{count} of kind {spec.kind}" for spec, count in zip(specs, counts, strict=True))
    return {"added": told} if specs else {}


def _condition(setup: Setup) -> dict[str, str]:
    """How hard XPBD is to sweep, at rest; nothing where it moves nothing, or so much that a check would wait for it."""
    from softseam_services.pbd.condition import condition_of
    from softseam_services.pbd.particles.condition import spring_spectrum

    scene, body = setup.scene, setup.body
    if scene.regions.cut or body.n_cells > _QUICK:
        return {}
    found = condition_of(scene, body, setup.tools, body.x_rest)
    if found is None:
        return {}
    told = f"number {found.spectrum.condition:.3g} of XPBD's system, in {found.substeps} substeps a step"
    if body.has_cells or not len(body.springs.rest):
        return {"condition": told}
    springs = spring_spectrum(body, scene.step / found.substeps)
    if springs.omega is None:
        meaning = "diverges"
    else:  # Young's formula is right for a chain of springs, not for a lattice
        meaning = f"suggests omega = {springs.omega:.3g}" if body.kind == "rope" else "converges"
    return {
        "condition": told,
        "sweeps": f"Gauss-Seidel's; Jacobi's radius of the springs {springs.jacobi:.4g} {meaning}",
    }


def print_doubts(doubts: Sequence[str], name: str, settings: Sequence[str], console: Console) -> None:
    """Warn of what is doubtful (see `doubts`) in a scene of this name or path, with file, line and column."""
    for doubt in doubts:
        console.print(Text(f"warning: {located(doubt, name, settings)}", style="yellow"), soft_wrap=True)


def _inclusion(kind: str, part: Part) -> str:
    """What the cells make of an inclusion."""
    size = f"{part.octants} octants of cells, {1e6 * part.volume:.4g} cm^3, {1e3 * part.density * part.volume:.4g} g"
    return f"{kind}: {size}; E {1e-3 * part.young:.4g} kPa, nu {part.poisson:.3g}"


def _hidden_viscosity(scene: Scene) -> list[str]:
    """That implicit Euler damps more than the material's viscosity, where fem has cells of it."""
    if not scene.body.has_cells or not some_read(scene.regions.models, "fem.integrator"):
        return []
    time = scene.body.cell_materials[0].retardation_time
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
        alone = "" if not scene.regions.cut else ", which takes one model: leave out regions.near"
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


def _models(setup: Setup) -> str:
    """Which model has which cells, and why where the scene leaves that open."""
    told = _regions(setup.scene.regions)
    return f"{told}, for {setup.why}" if setup.why else told


def _regions(regions: RegionsSpec) -> str:
    default, near = regions.models
    if not regions.cut:
        return f"{default} everywhere"
    reasons = [f"within {1e3 * regions.within:.3g} mm of a tool"] if regions.within is not None else []
    if regions.boxes:
        reasons.append(f"in {len(regions.boxes)} boxes")
    return f"{near} {' and '.join(reasons) or 'nowhere'}, {default} elsewhere"


def _steps(scene: Scene) -> str:
    duration = expected_duration(scene)
    if duration is None:
        return f"of {1e3 * scene.step:g} ms, until the motion ends"
    return f"{math.ceil(duration / scene.step - 1e-9)} of {1e3 * scene.step:g} ms: {duration:.3g} s"
