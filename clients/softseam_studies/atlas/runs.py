"""How the maps run their cells: each function takes a cell's column, its row, and what the map's file gives."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from softseam.claims.claim import Scale
from softseam.embedded import faulty, simulate, translated
from softseam.errors import SimulationFailed
from softseam.observation import Observation
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.models import CLASSIC_PBD
from softseam_protocol.scene.scene import Scene
from softseam_studies.atlas.lumps import Floats, obj, surface
from softseam_studies.atlas.scenes import (
    EDGE,
    FEM,
    XPBD,
    YOUNG,
    confined,
    data_of,
    force_share,
    press,
    pressed,
    scene_of,
)
from softseam_studies.atlas.trace import Trace, follow
from softseam_studies.atlas.verdicts import Verdict, judge, percent


def step(step: float, young: float, model: str, squeeze: float, bound: float) -> Verdict:
    trace = follow(press(young, step, model, squeeze=squeeze), force_share(young))
    return judge(trace, pressed(squeeze), bound, "force")


def squeeze(squeeze: float, speed: float, model: str, step: float, hold: float, bound: float) -> Verdict:
    scene = press(YOUNG, step, model, squeeze=squeeze, speed=speed, hold=hold, walls=True)
    return judge(follow(scene, force_share(YOUNG)), confined(squeeze), bound, "force")


def iterations(column: Any, row: float, what: str, bound: float, per_substep: bool = False) -> Verdict:
    if what == "block":
        trace = follow(press(row, 0.01, XPBD, pbd={"substeps": column}), force_share(row))
        return judge(trace, pressed(0.1), bound, "force")
    if what == "rope":
        return judge(hang({"sweeps": column}, row), weight_stretch(row), bound, "stretch")
    calibrated = _classic(4, row, per_substep).value
    return judge(_classic(column, row, per_substep), calibrated, bound, "stretch", "its own at 4 sweeps")


@cache
def _classic(sweeps: int, share: float, per_substep: bool) -> Trace:
    keys = {"stretch": share, "bending": 0.0, "per_substep": per_substep}
    return hang({"method": CLASSIC_PBD, "classic": keys, "sweeps": sweeps, "substeps": 4}, 500.0)


def hang(pbd: dict[str, Any], stretch: float) -> Trace:
    """A rope that hangs by its upper end from rest, until it is calm: its strain."""
    scene = scene_of("iterations", {"body.stretch": stretch, f"models.{XPBD}": pbd})
    unmet = 0.0

    def longer(observation: Observation) -> float:
        nonlocal unmet
        quantities = observation.quantities
        unmet = quantities["stretch_violation"] / max(abs(quantities["worst_stretch"]), 1e-12)
        return -quantities["sag"] / float(scene["body"]["length"])

    trace = follow(scene, longer)
    if unmet > data_of("iterations")["given"]["bound"]:
        trace.warned = (*trace.warned, "quantity: stretch violation")
    return trace


def weight_stretch(stretch: float) -> float:
    """Strain of a rope of n springs under its own weight: sum over springs of what hangs below, g rho L/(2 E A) [1]."""
    scene = scene_of("iterations", {})
    return float(-scene["gravity"][2] * scene["body"]["density"] * scene["body"]["length"] / (2.0 * stretch))


def poisson(ratio: float, element: str, bends: bool, bound: float) -> Verdict:
    what, source = ("deflection", "a third") if bends else ("force", "half")
    trace = settled(element, ratio, bends)
    return judge(trace, _true(ratio, bends), bound, what, f"hex27 on cells {source} as long")


@cache
def _true(ratio: float, bends: bool) -> float:
    """Deflection [m] or force [N] of hex27 on fine cells."""
    return settled("hex27", ratio, bends, 3 if bends else 2).value


def settled(element: str, ratio: float, bends: bool, refine: int = 1) -> Trace:
    """Settle one of the two bodies, on cells divided by `refine`."""
    return follow(still("cantilever" if bends else "bonded", element, ratio, refine), _tip if bends else _push)


def still(body: str, element: str, ratio: float, refine: int = 1) -> dict[str, Any]:
    """The scene of a cantilever or of a bonded cube at rest."""
    changes = data_of("poisson")[body] | {"body.cell": [0.02 / refine] * 3, "body.material.poisson": ratio}
    return scene_of("poisson", changes | {f"models.{FEM}": {"element": element, "integrator": "static"}})


def _tip(observation: Observation) -> float:
    return observation.quantities.get("tip_deflection", float("nan"))


def _push(observation: Observation) -> float:
    return float(observation.wrench["plate"][2])


def slope(slope: float, friction: float, model: str, ground: str, bound: float, creep: float) -> Verdict:
    angle, g = math.radians(slope), 9.81
    tool = data_of("slope")["grounds"][ground] | {"friction": friction}
    gravity = [g * math.sin(angle), 0.0, -g * math.cos(angle)]
    scene = scene_of("slope", {"gravity": gravity, "tools.ground": tool, "regions.default": model})
    mass = scene["body"]["material"]["density"] * math.prod(scene["body"]["shape"]["size"])
    trace = follow(scene, lambda seen: float(seen.momentum[0]) / mass)
    if not trace.times:
        return judge(trace, 1.0, bound, "speed")
    time = float(np.mean(trace.times[-max(1, len(trace.times) // 4) :]))
    free, held = gravity[0] * time, friction > math.tan(angle)
    truth = 0.0 if held else free + friction * gravity[2] * time
    found = judge(trace, free, math.inf, "speed")
    if found.error is None or found.kind == "unstable":
        return found
    off = abs(trace.value - truth) / free
    why = f"it goes at {1e3 * trace.value:.3g} mm/s, {percent(off)} of a slide without friction off Coulomb's law"
    right = abs(trace.value) <= creep if held else off <= bound
    return Verdict(found.kind if right else "inaccurate", why, off, found.safeguards, found.warned)


def impact(thickness: float, speed: float, model: str, hit: str) -> Verdict:
    """Whether the body was above in every step; its base begins 10 mm above the top of what is at the origin."""
    plate = {"kind": "box", "size": [0.2, 0.2, thickness]}
    rod = {"kind": "capsule", "radius": 0.5 * thickness, "length": 0.2, "axis": [0, 1, 0]}
    gap, above = 0.01, list[bool]()
    changes = {
        "duration": max((gap + EDGE) / speed, 0.1) + 0.1,
        "body.position": [0, 0, 0.5 * thickness + gap],
        "body.velocity": [0, 0, -speed],
        f"tools.{hit}": (plate if hit == "plate" else rod) | {"position": [0, 0, 0], "friction": 0.3},
        "regions.default": model,
    }

    def share(seen: Observation) -> float:
        above.append(float(seen.surface[:, 2].mean()) > 0.0)
        return float(all(above))

    trace = follow(scene_of("impact", changes), share, fields=True)
    found = judge(trace, 1.0, 0.5, "side on which it is", "that from which it came")
    if found.error is None:
        return found
    why = f"it passed the {hit}" if found.error > 0.5 else f"the {hit} stopped it"
    return Verdict(found.kind, why, found.error, found.safeguards, found.warned)


def _by_cells(name: str, force: Callable[[str, str, float], Trace]) -> Callable[..., Verdict]:
    """Runs of maps of forces by model, what is varied and edge of the cells [mm], and of what FEM claims there."""

    def run(column: str, edge: float, model: str, bound: float, claims: bool = False) -> Verdict:
        data = data_of(name)
        right, here = force(FEM, column, data["finest"]).value, force(model, column, edge)
        if not claims:
            return judge(here, right, bound, "force", "FEM on small cells")
        rows = data["rows"]
        longest = max(rows.values() if isinstance(rows, dict) else rows)
        sibling = 2.0 * edge if edge < longest else 0.5 * edge  # the longest cells have no longer ones
        scale = Scale(alike=True, taken=0.0, finer=sibling < edge).at(data["quantity"])
        claimed = scale.claim(abs(here.value - force(FEM, column, sibling).value), right, 0.0) / right
        error = abs(here.value - right) / right
        why = f"the force is off by {percent(error)}, and {percent(claimed)} is claimed"
        return Verdict("accurate" if claimed >= error else "inaccurate", why, error, warned=here.warned)

    return run


@cache
def _pressed(model: str, tool: str, edge: float) -> Trace:
    """Press a tool into a block, and hold until it rests; edge [mm]."""
    data = data_of("tools")
    form: dict[str, Any] = data["tools"][tool]
    x, y, z = data["place"]
    cells = [size / max(1, round(1e3 * size / edge)) for size in data["scene"]["body"]["shape"]["size"]]
    placed = form | {"position": [x, y, z + form["position"]], "friction": 0.3}
    scene = scene_of("tools", {"body.cell": cells, "tools.tool": placed, "regions.default": model})
    return follow(scene, lambda seen: float(seen.wrench["tool"][2]))


@cache
def _squeezed(model: str, shape: str, edge: float) -> Trace:
    """Squeeze a mesh between plates, and hold until it rests; edge [mm]."""
    points, triangles = surface(shape)
    with TemporaryDirectory() as folder:
        (Path(folder) / "shape.obj").write_text(obj(points, triangles))
        path = Path(folder) / "shapes.yaml"
        path.write_text(json.dumps(between(model, points, edge)))
        return follow(path, lambda seen: seen.grip_force)


def between(model: str, points: Floats, edge: float) -> dict[str, Any]:
    """The scene of a mesh with these points (n, 3) between plates; all in mm."""
    data = data_of("shapes")
    half, gap, time = 0.5e-3 * float(np.ptp(points[:, 0])), data["gap"], data["time"]
    away = half + gap + 0.5 * data["scene"]["tools"]["left"]["size"][0]
    close = (gap + data["squeeze"] * half) / time
    changes = {
        "body.cell": 1e-3 * edge,
        "tools.left.position": [-away, 0, 0.01],
        "tools.right.position": [away, 0, 0.01],
        "motion": [{"tools": ["left", "right"], "close": close, "until": {"time": time}}, {"hold": 0.1}],
        "regions.default": model,
    }
    return scene_of("shapes", changes)


@dataclass(frozen=True)
class Told:
    """What a run reported: digest of all its reports and of the body's end, and its events by kind."""

    digest: str
    events: tuple[str, ...]
    failed: str = ""


def messages(every: int, fault: str, model: str) -> Verdict:
    """Beside the undisturbed run."""
    found, true = _disturbed(model, fault, every), _undisturbed(model)
    restored = found.events.count(EventKind.PARTICIPANT_RESTORED)
    guards = ("participant restored from its checkpoint",) if restored else ()
    if found.failed:
        return Verdict("unstable", found.failed, None, guards, ("the run failed by name",))
    if found.digest != true.digest:
        why = "not the same bits as undisturbed"
        return Verdict("inaccurate", why, None, guards, guards and ("participant_lost",))
    if restored:
        why = f"restored {restored} times from the last checkpoint; bit for bit as undisturbed"
        return Verdict("recovered", why, 0.0, guards)
    return Verdict("accurate", "answered from what the participant had kept; bit for bit as undisturbed", 0.0)


@cache
def _undisturbed(model: str) -> Told:
    """What the run reports when all messages arrive."""
    return _disturbed(model, None, 1)


def _disturbed(model: str, fault: str | None, every: int) -> Told:
    """Squeeze while of every so many requests for a step one fares badly, at most once; `None`: none does."""
    scene = Scene.model_validate(press(YOUNG, 0.005, model, hold=0.3))
    transport = None if fault is None else faulty(fault, every)
    digest = hashlib.sha256()
    failed = ""
    simulation = simulate(bundle_scene(scene, {}), lambda message: None, transport)
    try:
        with translated():
            while not simulation.done:
                report = simulation.step()
                digest.update(report.wrench.tobytes() + report.momentum.tobytes() + report.tool_position.tobytes())
            frame = simulation.frame()
        digest.update(frame.x.tobytes() + frame.cauchy.tobytes())
    except SimulationFailed as error:
        failed = str(error)
    kinds = tuple(event.kind for event in simulation.events)
    simulation.close()
    if transport is not None and not transport.harmed:
        failed = failed or "nothing was harmed: the run is too short"
    return Told(digest.hexdigest(), kinds, failed)


RUNS: dict[str, Callable[..., Verdict]] = {
    "step": step,
    "poisson": poisson,
    "iterations": iterations,
    "squeeze": squeeze,
    "tools": _by_cells("tools", _pressed),
    "shapes": _by_cells("shapes", _squeezed),
    "slope": slope,
    "impact": impact,
    "messages": messages,
}
"""by map, in the order of the atlas"""
