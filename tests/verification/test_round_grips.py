"""Round fingers that are small beside a block's cells hold with too little friction, and are warned of."""

from __future__ import annotations

import pytest

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.checks import doubts
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.server import build_setup

EDGE, RADIUS, FORCE, FRICTION = 0.04, 0.008, 1.0, 0.3
"""of a cube and of the fingers' rounding [m]; what each presses with [N]; Coulomb's coefficient"""
WORDS = "body.cell: round tools of a radius below"


def grip(cell: float, share: float, model: str = "fem", kind: str = "capsule") -> Scene:
    """Two fingers lift a cube with so much of the friction that its weight takes: 2 mu F = share m g."""
    density = 2.0 * FRICTION * FORCE / (share * EDGE**3 * 9.81)
    shape: dict[str, object] = {"kind": kind, "radius": RADIUS, "friction": FRICTION}
    if kind != "sphere":
        shape |= {"length": 0.03, "axis": [1, 0, 0] if kind == "cylinder" else [0, 1, 0]}
    away = 0.5 * EDGE + (0.015 if kind == "cylinder" else RADIUS) + 5e-4
    ends = {"left": -away, "right": away}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "round_grip",
            "step": 0.01,
            "body": {
                "shape": {"kind": "block", "size": [EDGE, EDGE, EDGE]},
                "cell": cell,
                "material": {"young": 6e4, "poisson": 0.4, "density": density, "retardation_time": 0.005},
            },
            "tools": {
                "table": {"kind": "plane", "friction": 0.5},
                **{name: {**shape, "position": [x, 0, 0.5 * EDGE]} for name, x in ends.items()},
            },
            "motion": [
                {"tools": ["left", "right"], "close": 0.02, "force": FORCE, "until": {"force": 0.98, "time": 1.0}},
                {"hold": 0.2},
                {"tools": ["left", "right"], "move": [0, 0, 0.012], "speed": 0.05},
                {"hold": 0.2},
            ],
            "regions": {"default": model},
            "quantities": ["lift_height"],
        }
    )


def bundle(scene: Scene) -> Bundle:
    return Bundle(scene.model_dump_json(), {})


def told(scene: Scene) -> list[str]:
    """What is said of round tools before the run."""
    found = doubts(build_setup(bundle(scene), "body"))
    return [text for text in found if text.startswith(WORDS)]


def lift(scene: Scene) -> float:
    """How high the cube hangs in the end [m]."""
    simulation = Simulation(bundle(scene), EmbeddedTransport())
    report = simulation.step()
    while not report.done:
        report = simulation.step()
    simulation.close()
    return float(report.quantities["lift_height"])


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_what_is_warned_of_holds_too_well_and_what_is_not_does_not(model: str) -> None:
    """Fingers of 8 mm with .82 of the friction that the weight takes: on cells of 13.3 mm they hold from .7 on."""
    coarse, fine = grip(EDGE / 3, 0.82, model), grip(0.2 * EDGE, 0.82, model)
    assert told(coarse) and not told(fine)
    assert lift(coarse) > 0.01 and lift(fine) < 1e-3
    assert lift(grip(0.2 * EDGE, 1.1, model)) > 0.01


@pytest.mark.parametrize(("kind", "warned"), [("capsule", True), ("sphere", True), ("cylinder", False)])
def test_only_what_meets_the_block_with_a_round_side_is_warned_of(kind: str, warned: bool) -> None:
    """The cylinders come with their flat ends."""
    (text,) = told(grip(EDGE / 3, 1.0, kind=kind)) or [""]
    assert ("left (8 mm), right (8 mm)" in text and "make cells 0.008 m long" in text) == warned
