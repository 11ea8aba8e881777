"""Which model has which cells as a run begins, and why, in a line."""

from __future__ import annotations

from softseam.observation import Observation
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene

_PBD = {"xpbd": "XPBD", "pbd": "classic PBD", "leapfrog": "leapfrog"}


def choice(scene: Scene, first: Observation) -> str:
    """Of every body, from the observation after the first step."""
    return "; ".join(_of_body(scene, name, first) for name in scene.bodies)


def _of_body(scene: Scene, name: str, first: Observation) -> str:
    parts = [part for part in first.parts.values() if part.body == name]
    models = {"fem": "FEM", "pbd": _PBD[scene.models.pbd.method]}
    named = f"{name}: " if len(scene.bodies) > 1 else ""
    if not isinstance(scene.bodies[name], BodySpec):
        return f"{named}{models['pbd']}, which moves particles"
    total = sum(part.n_cells for part in parts)
    if len(parts) == 1:
        has = f"{models.get(parts[0].model, parts[0].model)} on all {total} cells"
    else:
        has = ", ".join(f"{models.get(part.model, part.model)} on {part.n_cells}" for part in parts)
        has += f" of {total} cells"
    return f"{named}{has}{_why(scene, name, first)}"


def _why(scene: Scene, name: str, first: Observation) -> str:
    regions = scene.of(name).regions
    told = [event.message for event in first.events if event.kind is EventKind.REGIONS]
    if len(scene.bodies) > 1:
        told = [message.removeprefix(f"{name}: ") for message in told if message.startswith(f"{name}: ")]
    if told:
        return f", for {told[0]}"
    if regions == RegionsSpec():
        return ", for the scene names no regions (--model fem for FEM)"
    return ", as the scene's regions say"
