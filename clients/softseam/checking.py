"""`softseam check`: is the scene good, is its mesh good, and what will simulating it take? Simulates nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.duration import expected_duration
from softseam.embedded import translated
from softseam.errors import missing_extra
from softseam.scenes import bundle_of
from softseam.variants import with_settings
from softseam_protocol.scene import Scene
from softseam_protocol.scene_file import bundle_scene, scene_hash


def check_scene(name: str, settings: Sequence[str], console: Console) -> None:
    """Build the body and the tools as a run would, and print what they are. Raises SceneRefused."""
    loaded, bundle = bundle_of(name)
    scene = with_settings(loaded, settings)
    if scene is not loaded:
        bundle = bundle_scene(scene, bundle.files)
    try:
        from softseam_services.body.check import check_body
        from softseam_services.body.particles import ParticleBody
        from softseam_services.server import build_setup
    except ImportError as error:
        raise missing_extra(error, "checking a mesh") from error
    with translated():
        built = build_setup(bundle).body
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_row("scene", f"{scene.name}  (hash {scene_hash(bundle)[:12]})")
    if isinstance(built, ParticleBody):
        for name, value in built.facts().items():
            table.add_row(name, value)
        table.add_row("models", _models(scene))
        table.add_row("steps", _steps(scene))
        console.print(table)
        console.print(Text("the scene can be simulated", style="green"))
        return
    body = check_body(built)
    table.add_row("size", " x ".join(f"{1e3 * side:.4g}" for side in body.size) + " mm")
    table.add_row("volume, mass", f"{1e6 * body.volume:.4g} cm^3, {1e3 * body.mass:.4g} g")
    edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.edges)
    own = f"{body.n_cells} hexahedra of the file, shortest edge {1e3 * body.edges[0]:.3g} mm"
    table.add_row("cells", f"{body.n_cells} of {edges} mm" if body.boxes else own)
    table.add_row("filled", f"{body.full_cells} cells wholly; the emptiest to {100.0 * body.smallest_fill:.3g} %")
    table.add_row(
        "unknowns", f"{3 * (body.n_nodes - body.n_fixed)} ({body.n_nodes} nodes, {body.n_fixed} of them clamped)"
    )
    table.add_row("surface", f"{body.n_triangles} triangles, {body.n_contact_points} contact points")
    table.add_row(
        "wave speed", f"{body.wave_speed:.3g} m/s: crosses a cell in {_crossing(body.edges, body.wave_speed)}"
    )
    table.add_row("models", _models(scene))
    table.add_row("steps", _steps(scene))
    console.print(table)
    for warning in body.warnings:
        console.print(Text(f"warning: {warning}", style="yellow"))
    console.print(Text("the scene can be simulated", style="green"))


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
