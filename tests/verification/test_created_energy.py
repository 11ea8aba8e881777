"""Energy from nowhere rings where a run creates it, step after step, and in no sound run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import Advance
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_services.fem import parameters as fem_parameters
from softseam_services.fem.solver import FemSolver
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.solver import PbdSolver
from softseam_services.tools.build import build_tools
from softseam_services.tools.tool_set import ToolSet

SOLVERS: dict[str, Any] = {"fem": FemSolver, "pbd": PbdSolver}
GROUND = {"ground": {"kind": "plane", "friction": 0.5}}
PAD = {"kind": "box", "size": [0.01, 0.08, 0.05], "friction": 0.5}
PADS = {"left": {**PAD, "position": [-0.031, 0, 0.026]}, "right": {**PAD, "position": [0.031, 0, 0.026]}}
CLOSE = {"tools": ["left", "right"], "close": 0.03, "until": {"compression": 0.15}}
RAISE = {"tools": ["left", "right"], "move": [0, 0, 0.01], "speed": 0.05}


def block(**keys: Any) -> dict[str, Any]:
    shape = {"kind": "block", "size": [0.05, 0.05, 0.05]}
    return {"shape": shape, "cell": 0.025, "material": {"young": 2e4, "poisson": 0.4, "density": 1050}, **keys}


def swinging(model: str, **keys: Any) -> dict[str, Any]:
    """A cantilever that falls and swings."""
    bar = {"kind": "block", "size": [0.15, 0.04, 0.04]}
    fixed = [{"min": [-1, -1, -1], "max": [-0.0749, 1, 1]}]
    body = block(shape=bar, cell=0.0375, fixed=fixed)
    return {"body": body, "step": 0.002, "duration": 0.4, "regions": {"default": model}, **keys}


def told(scene: dict[str, Any]) -> set[Detail]:
    """What alarms of the energy say in a run."""
    parsed = parse_scene(json.dumps({"softseam": 1, "name": "case", **scene}))
    simulation = Simulation(bundle_scene(parsed), EmbeddedTransport())
    while not simulation.done:
        simulation.step()
    simulation.close()
    return {detail for event in simulation.events if event.kind == "energy" for detail in event.details}


@contextmanager
def pushed_along(model: str, share: float, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Each step begins with velocities that are larger by this share."""
    solver, seen = SOLVERS[model], {-1}
    advance = solver.advance

    def pushing(self: Any, request: Advance) -> Any:
        if request.header.step not in seen:
            seen.add(request.header.step)
            self.commit()
            self.committed.v[:] *= 1.0 + share
        return advance(self, request)

    with monkeypatch.context() as patch:
        patch.setattr(solver, "advance", pushing)
        yield


@pytest.mark.parametrize("model", SOLVERS)
def test_a_force_along_the_velocity_rings(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that make velocities 1 % larger, of a bar that swings."""
    assert told(swinging(model)) == set()
    with pushed_along(model, 0.01, monkeypatch):
        assert Detail.CREATED in told(swinging(model))


@pytest.mark.parametrize("model", SOLVERS)
def test_friction_that_pushes_rings(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A block that slides to rest, and one that friction drives on: contact works on it, and the ground stands."""
    slides = {"body": block(velocity=[0.3, 0, 0]), "tools": GROUND, "duration": 0.3, "regions": {"default": model}}
    assert told(slides) == set()

    def pushing(*of: Any) -> ToolSet:
        tools = build_tools(*of)
        tools.friction[:] *= -0.2
        return tools

    monkeypatch.setattr("softseam_services.server.build_tools", pushing)
    assert Detail.CONTACT in told(slides)


def test_a_multiplier_that_lags_rings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the penalty of short steps contact gains energy where r dt^2 < m (docs/decisions/20)."""
    drop = {"body": block(position=[0, 0, 0.005]), "tools": GROUND, "step": 1e-4, "duration": 0.06}
    drop["regions"] = {"default": "fem"}
    assert told(drop) == set()
    monkeypatch.setattr(fem_parameters, "FIRM", 0.0)
    assert told(drop) & {Detail.CONTACT, Detail.CREATED}


@pytest.mark.parametrize("model", SOLVERS)
@pytest.mark.parametrize("step", [0.005, 0.02])
def test_what_settles_drops_and_is_gripped_is_silent(model: str, step: float) -> None:
    """In short steps and long ones; of XPBD with more substeps than it takes itself of long ones.

    With its own it puts .5 % of what the grip stores on top of that, where points inside faces stick to pads that end
    on these: one sweep a substep leaves them apart. That rings as the pads close; with 20 substeps it is .1 %.
    """
    motion = [{"hold": 0.1}, CLOSE, {"hold": 0.1}, RAISE, {"hold": 0.1}]
    grip = {"body": block(), "tools": {**GROUND, **PADS}, "motion": motion}
    drop = {"body": block(position=[0, 0, 0.05]), "tools": GROUND, "duration": 0.4}
    keys = {"step": step, "regions": {"default": model}, "models": {"pbd": {"substeps": 20}} if step > 0.01 else {}}
    for scene in (grip, drop):
        assert told({**scene, **keys}) == set()


def test_cells_that_pass_to_full_quadrature_create_nothing() -> None:
    """A block squeezed to half: what the stiffer cells have more is a switch, and no energy from nowhere."""
    plates = {name: {**pad, "friction": 20.0, "size": [0.01, 0.12, 0.12]} for name, pad in PADS.items()}
    scene = {
        "body": block(),
        "gravity": [0, 0, 0],
        "tools": plates,
        "motion": [{**CLOSE, "close": 0.05, "until": {"compression": 0.52}}, {"hold": 0.1}],
        "regions": {"default": "fem"},
    }
    parsed = parse_scene(json.dumps({"softseam": 1, "name": "crushed", **scene}))
    simulation = Simulation(bundle_scene(parsed), EmbeddedTransport())
    energies = []
    while not simulation.done:
        energies.append(simulation.step().energy)
    simulation.close()
    passed = np.array([energy["switch"] for energy in energies])
    assert passed.max() > 1e-3 * energies[-1]["strain"] > 0.0 and not passed[:20].any()
    assert min(energy["dissipation"] for energy in energies[1:]) > -1e-3 * energies[-1]["strain"]
    assert not any(event.kind == "energy" for event in simulation.events)
