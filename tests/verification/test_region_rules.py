"""Regions that follow stress and model error in a run; switches that are too dear are taken back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.session import Event
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator import regions
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation


def bar(near: dict[str, Any] | None, **more: Any) -> Scene:
    """A bar of 8 x 2 x 2 cells, clamped at one end, under its own weight."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "bar",
            "step": 0.01,
            "duration": 0.25,
            "body": {
                "shape": {"kind": "block", "size": [0.08, 0.02, 0.02]},
                "position": [0.04, 0.0, 0.0],
                "cell": 0.01,
                "material": {"young": 60e3, "poisson": 0.4, "density": 1000.0},
                "fixed": [{"min": [-0.001, -1, -1], "max": [1e-4, 1, 1]}],
            },
            "regions": {"default": "pbd", **({"near": {"split": "always", **near}} if near else {})},
            **more,
        }
    )


def run(scene: Scene) -> tuple[Simulation, list[Event]]:
    events: list[Event] = []
    simulation = Simulation(
        bundle_scene(scene), EmbeddedTransport(), emit=lambda m: events.append(m) if isinstance(m, Event) else None
    )
    while not simulation.done:
        simulation.step()
    return simulation, events


def test_fem_goes_where_the_stress_is() -> None:
    """Bent, the bar is stressed at the clamp: those cells become near, a few a switch, and the events say why."""
    simulation, events = run(bar({"stress": 2e3}))
    switches = [event.message for event in events if event.kind == "regions"]
    body = simulation.body
    assert isinstance(body, Body)
    assert switches and all("by stress" in text and "energy" in text for text in switches)
    places = body.cell_grid[simulation.regions.rule.mask, 0]
    assert 0 < len(places) < body.n_cells
    assert places.max() < 6, "the free end bears nothing"
    assert np.isin(places.max() - 1, places)
    simulation.close()


def test_a_bound_for_the_model_error_is_kept() -> None:
    """PBD alone is a tenth off; with the bound, near cells are added at the clamp until it is within a thirtieth."""
    quantities = ("model_error",)
    errors = []
    for near in (None, {"error": 0.03}):
        scene = bar(near, quantities=quantities)
        simulation, _ = run(scene)
        report = simulation.report
        assert report is not None
        errors.append(report.quantities["model_error"])
        mask = simulation.regions.rule.mask
        simulation.close()
    assert errors[0] > 0.08
    assert errors[1] < 0.03
    assert 0 < mask.sum() < len(mask)


def test_the_rules_go_on_from_a_snapshot_bit_for_bit() -> None:
    scene = bar({"stress": 2e3, "error": 0.05})
    one, other = (Simulation(bundle_scene(scene), EmbeddedTransport()) for _ in range(2))
    for _ in range(13):
        one.step()
    other.load(one.save())
    for _ in range(12):
        one.step()
        other.step()
    np.testing.assert_array_equal(one.frame().x, other.frame().x)
    np.testing.assert_array_equal(one.regions.rule.mask, other.regions.rule.mask)
    for simulation in (one, other):
        simulation.close()


def test_a_switch_that_is_too_dear_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no share of the energy to spend, the run is the same, bit for bit, as one without a rule that is saved when
    the other tries; and it is tried again every tenth step."""
    monkeypatch.setattr(regions, "SWITCH_LIMIT", 1e-15)
    simulation, events = run(bar({"stress": 2e3}))
    refused = [event.header.step for event in events if event.kind == "refused"]
    assert not [event for event in events if event.kind == "regions"]
    assert len(refused) >= 2 and set(np.diff(refused)) == {10}
    assert "tried again in 10 steps" in next(event.message for event in events if event.kind == "refused")
    plain = Simulation(bundle_scene(bar(None)), EmbeddedTransport())
    while not plain.done:
        plain.step()
        if plain.report is not None and plain.report.header.step + 1 in refused:
            plain.save()
    np.testing.assert_array_equal(simulation.frame().x, plain.frame().x)
    assert not simulation.regions.rule.mask.any()
    unmet = simulation.regions.rule.unmet
    assert unmet.n_refused == len(refused) and 0 < unmet.n_never == unmet.n_asked
    (told,) = [event.message for event in events if event.kind == "not_done"]
    assert told.startswith(f"{unmet.n_never} of the {unmet.n_never} cells that regions.near asked for never became fem")
    assert "regions.near.boxes" in told and f"{len(refused)} switches were refused" in told
    for each in (simulation, plain):
        each.close()
