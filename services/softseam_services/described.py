"""What a scene's bodies are before anything is simulated: sizes, cells, masses, models, and what is doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.scene.motion import ClosePhase, HoldPhase
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool, MeshTool
from softseam_services.body.body import Body
from softseam_services.body.check import BodyCheck, check_body
from softseam_services.body.interpolate import rest_points
from softseam_services.body.particles import ParticleBody
from softseam_services.checks import When, doubts, size_of
from softseam_services.meshes_apart import check_meshes_apart
from softseam_services.orchestrator.goal import Goal
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.probes import Probes, share_probes
from softseam_services.pbd.condition import condition_of
from softseam_services.pbd.levels import coarse_cells
from softseam_services.pbd.particles.condition import spring_spectrum
from softseam_services.pbd.particles.constraints import build_constraints, constraints_of
from softseam_services.pbd.particles.kernels.constraint import FIRST, LAST
from softseam_services.server import Setup, build_setup
from softseam_services.tools.approach import way_to_touch
from softseam_services.tools.kernels import rotate_back

_QUICK = 125
"""cells up to which a check computes the condition number of their blocks: .5 s"""


@dataclass(frozen=True)
class Described:
    """A body, for people."""

    facts: Mapping[str, str]
    """by what they are of, in the order in which they are read"""
    size: float
    """its largest extent [m]"""
    doubts: list[str]
    notes: list[str]


def describe(bundle: Bundle) -> dict[str, Described]:
    """Every body of a scene, by name. Raises what a run of it would raise at its start."""
    scene = scene_from_bundle(bundle)
    setups = {name: build_setup(bundle, name) for name in scene.bodies}
    check_meshes_apart(scene, {name: setup.body for name, setup in setups.items()})
    probes = share_probes({name: setup.body for name, setup in setups.items()}, scene.probes)
    found = {}
    for name, setup in setups.items():
        if setup.body.has_cells:
            Probes(setup.body, probes[name])
            if setup.scene.regions.goal is not None:
                Goal(setup.scene, setup.body, setup.tools)
            facts = _of_cells(setup, check_body(setup.body), setup.body)
        else:
            facts = {**setup.body.facts(), "friction": _friction(setup), "added": _added(setup.scene, setup.body)}
            facts |= _condition(setup) | _models(setup)
        facts = {fact: text for fact, text in facts.items() if text}
        found[name] = Described(facts, size_of(setup), doubts(setup), doubts(setup, When.NOTE))
    return found


def _of_cells(setup: Setup, body: BodyCheck, built: Body) -> dict[str, str]:
    """Facts, '' where there is nothing to say."""
    scene, spec = setup.scene, setup.spec
    assert isinstance(spec, BodySpec)  # it has cells
    whose = "in the block" if isinstance(spec.shape, BlockShape) else "of the file"
    kind = f"tetrahedra ({scene.models.fem.element})" if spec.tetrahedral else "hexahedra"
    edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.edges)
    along = f", along the mesh's own axes, turned by {body.turned:.3g} degrees" if body.turned else ""
    cells = f"{kind} {whose}, shortest edge {1e3 * body.edges[0]:.3g} mm"
    slivers = f", {body.slivers} by less than 2 %" if body.slivers else ""
    filled = f"{body.full_cells} cells wholly{slivers}; the emptiest to {100.0 * body.smallest_fill:.3g} %"
    coarse = ""
    if scene.models.pbd.coarse is not None:
        n_coarse = int(coarse_cells(built, scene.models.pbd.coarse, setup.tools).sum())
        coarse = f"{n_coarse} of {body.n_cells} cells are one block where pbd has them, not eight"
    inclusions = {
        f"inclusion {number}": f"{inclusion.shape.kind}: {part.octants} octants of cells, "
        f"{1e6 * part.volume:.4g} cm^3, {1e3 * part.density * part.volume:.4g} g; "
        f"E {1e-3 * part.young:.4g} kPa, nu {part.poisson:.3g}"
        for number, (inclusion, part) in enumerate(zip(spec.inclusions, body.parts, strict=True))
    }
    facts = {
        "size": " x ".join(f"{1e3 * side:.4g}" for side in body.size) + " mm",
        "volume, mass": f"{1e6 * body.volume:.4g} cm^3, {1e3 * body.mass:.4g} g",
        "cells": f"{body.n_cells} " + (f"of {edges} mm{along}" if body.boxes else cells),
        "filled": "" if spec.tetrahedral else filled,
        "unknowns": f"{3 * (body.n_nodes - body.n_fixed)} ({body.n_nodes} nodes, {body.n_fixed} of them clamped)",
        "surface": f"{body.n_triangles} triangles, {body.n_contact_points} contact points",
        "wave speed": f"{body.wave_speed:.3g} m/s: crosses a cell in {1e3 * min(body.edges) / body.wave_speed:.3g} ms",
        "friction": _friction(setup),
        **inclusions,
        "grip": grip_sides(setup),
        **_models(setup),
        "coarse": coarse,
        **_condition(setup),
    }
    return facts


def _friction(setup: Setup) -> str:
    """How friction varies over the body; '' where it does not."""
    spec, body = setup.spec.uneven_friction, setup.body
    if spec is None:
        return ""
    factor = body.friction_field.factor(rest_points(body) if body.has_cells else body.x_rest)
    return f"{spec.in_words}: {factor.min():.3g} to {factor.max():.3g} times the tools' own"


def _added(scene: Scene, body: ParticleBody) -> str:
    """Constraints that the scene adds to those of a body of particles; '' where it adds none."""
    specs = constraints_of(scene)
    families = build_constraints(body, specs).families
    counts = (families[:, LAST] - families[:, FIRST]).tolist()
    return ", ".join(f"{count} of kind {spec.kind}" for spec, count in zip(specs, counts, strict=True))


def _condition(setup: Setup) -> dict[str, str]:
    """How hard XPBD is to sweep, at rest; nothing where it moves nothing, or so much that a check would wait for it."""
    scene, body = setup.scene, setup.body
    if scene.regions.cut or body.n_cells > _QUICK:
        return {}
    found = condition_of(scene, body, setup.tools, body.x_rest)
    if found is None:
        return {}
    number = f"number {found.spectrum.condition:.3g} of XPBD's system, in {found.substeps} substeps a step"
    if body.has_cells or not len(body.springs.rest):
        return {"condition": number}
    springs = spring_spectrum(body, scene.step / found.substeps)
    if springs.omega is None:
        meaning = "diverges"
    else:  # Young's formula is right for a chain of springs, not for a lattice
        meaning = f"suggests omega = {springs.omega:.3g}" if body.kind == "rope" else "converges"
    sweeps = f"Gauss-Seidel's; Jacobi's radius of the springs {springs.jacobi:.4g} {meaning}"
    return {"condition": number, "sweeps": sweeps}


def _models(setup: Setup) -> dict[str, str]:
    """Which model has which cells, and why where the scene leaves that open."""
    has = _regions(setup.scene.regions)
    return {"models": f"{has}, for {setup.why}" if setup.why else has}


def _regions(regions: RegionsSpec) -> str:
    default, near = regions.models
    if not regions.cut:
        return f"{regions.default} everywhere"
    reasons = [f"within {1e3 * regions.within:.3g} mm of a tool"] if regions.within is not None else []
    if regions.boxes:
        reasons.append(f"in {len(regions.boxes)} boxes")
    return f"{near} {' and '.join(reasons) or 'nowhere'}, {default} elsewhere"


_ALONG, _IN = 0.9, 0.2
"""of the way in the tool's frame: more than that along an axis, and a side comes first; less, and none does there"""


def grip_sides(setup: Setup) -> str:
    """In words, in the tools' own axes; '' where tools move before they close, or none of them has sides."""
    scene, body, tools = setup.scene, setup.body, setup.tools
    first = next((phase for phase in scene.motion if not isinstance(phase, HoldPhase)), None)
    grip = Grips(scene, tools, [body]).first
    if grip is None or not isinstance(first, ClosePhase) or not body.has_cells:
        return ""
    corners, said = rest_points(body)[body.surface.triangles], []
    for tool, way in zip(grip.tools, grip.inward, strict=True):
        name, (position, orientation) = tools.names[tool], (tools.position[tool], tools.orientation[tool])
        if not isinstance(scene.tools[name], BoxTool | MeshTool):
            continue
        found = way_to_touch(tools, tool, position, orientation, way, corners)
        if found is None:
            said.append(f"{name} passes the body")
            continue
        side = _side(np.array(rotate_back(orientation, *way)))
        said.append(f"{name}, {side}, after {1e3 * found[0]:.3g} mm")
    return "; ".join(said)


def _side(way: NDArray[np.float64]) -> str:
    """What of a tool looks along a unit vector (3,) in its frame."""
    axes = [("-" if part < 0.0 else "+") + axis for part, axis in zip(way.tolist(), "xyz", strict=True)]
    along = int(np.abs(way).argmax())
    if abs(way[along]) > _ALONG:
        return f"its {axes[along]} side"
    return f"its edge or corner between {' and '.join(a for a, part in zip(axes, way, strict=True) if abs(part) > _IN)}"
