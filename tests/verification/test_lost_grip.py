"""What a body had slipped by when its tools lost it stays what `slip` says, until they touch it again."""

from __future__ import annotations

import json
from typing import Any

import pytest

from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

PAD = {"kind": "box", "size": [0.01, 0.06, 0.03], "friction": 0.1}
BOTH = ["left", "right"]


def simulation(model: str) -> Simulation:
    """A clamped cube is squeezed, the pads slide along it by 4 mm, go away, and come back."""
    away = [{"tools": [name], "move": [way, 0, 0], "speed": 0.2} for name, way in (("left", -0.006), ("right", 0.006))]
    scene: dict[str, Any] = {
        "softseam": 1,
        "name": "lost",
        "step": 0.005,
        "body": {
            "shape": {"kind": "block", "size": [0.02, 0.02, 0.02]},
            "cell": 0.01,
            "material": {"young": 5e4, "poisson": 0.3, "density": 1000},
            "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0]}],
        },
        "tools": {"left": {**PAD, "position": [-0.016, 0, 0.02]}, "right": {**PAD, "position": [0.016, 0, 0.02]}},
        "motion": [
            {"tools": BOTH, "close": 0.05, "until": {"compression": 0.1}},
            {"tools": BOTH, "move": [0, 0.004, 0], "speed": 0.1},
            *away,
            {"hold": 0.05},
            {"tools": BOTH, "close": 0.1, "until": {"compression": 0.1}},
        ],
        "regions": {"default": model},
    }
    return Simulation(bundle_scene(parse_scene(json.dumps(scene))), EmbeddedTransport())


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_slip_stays_once_tools_have_lost_the_body(model: str) -> None:
    run = simulation(model)
    slips, lost, saved = [], [], b""
    while not run.done:
        report = run.step()
        slips.append(report.quantities["slip"])
        if report.phase == 4:
            assert not report.wrench.any()
            lost.append(slips[-1])
            saved = saved or run.save()
    last = lost[0]
    assert 2e-3 < last < 4.5e-3 and lost == [last] * 10
    assert slips[0] == 0.0 and report.wrench.any() and slips[-1] < 0.5 * last
    run.load(saved)
    assert run.step().quantities["slip"] == last
    run.reset()
    assert run.step().quantities["slip"] == 0.0
    run.close()
