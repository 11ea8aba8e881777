"""A body cut in two and stitched again behaves as if it had never been cut."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import softseam
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.solver import PbdSolver

CUT = {"min": [0.0, -1.0, -1.0], "max": [0.04, 1.0, 1.0]}


def beam(
    *, near: str | None, far: str, kind: str = "neo_hookean", tolerance: float = 1e-12, newton: float = 1e-12
) -> Scene:
    """A cantilever of 4 x 1 x 1 cells, 8 x 2 x 2 cm, cut in the middle where `near` is a model."""
    scene: dict[str, Any] = {
        "softseam": 1,
        "name": "beam",
        "step": 0.005,
        "duration": 0.25,
        "body": {
            "shape": {"kind": "block", "size": [0.08, 0.02, 0.02]},
            "position": [0.04, 0.0, 0.0],
            "cell": 0.02,
            "material": {"kind": kind, "young": 50e3, "poisson": 0.4, "density": 1000.0},
            "fixed": [{"min": [0.0, -1.0, -1.0], "max": [0.0, 1.0, 1.0]}],
        },
        "regions": {"default": far},
        "models": {"fem": {"tolerance": newton}},
        "seam": {"tolerance": tolerance, "exchanges": 12},
    }
    if near is not None:
        scene["regions"]["near"] = {"model": near, "boxes": [CUT]}
    return Scene.model_validate(scene)


def run(scene: Scene) -> tuple[np.ndarray, list[int], float]:
    """Trajectory of all nodes (steps, N, 3), exchanges of each step, largest gap [m]."""
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    path, exchanges, gap = [], [], 0.0
    while not simulation.done:
        report = simulation.step()
        path.append(simulation.frame().x)
        exchanges.append(report.seam.exchanges)
        gap = max(gap, report.seam.gap)
    simulation.close()
    return np.array(path), exchanges, gap


def difference(path: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference over the largest displacement of the reference."""
    return float(np.abs(path - reference).max() / np.abs(reference - reference[0]).max())


def test_linear_fem_split_equals_unsplit() -> None:
    """Equal linear elements and steps on both sides: the dual solution is the unsplit one, to rounding."""
    whole, _, _ = run(beam(near=None, far="fem", kind="linear"))
    split, exchanges, gap = run(beam(near="fem", far="fem", kind="linear"))
    assert difference(split, whole) < 1e-8
    assert gap < 1e-12
    assert np.mean(exchanges[2:]) <= 2.0  # an exact compliance closes the gap in one correction


def test_neo_hookean_fem_split_equals_unsplit() -> None:
    """As above, to the tolerances of Newton and of the seam."""
    whole, _, _ = run(beam(near=None, far="fem"))
    split, exchanges, gap = run(beam(near="fem", far="fem", tolerance=1e-9))
    assert difference(split, whole) < 1e-6
    assert gap < 1e-9 * 0.02
    assert max(exchanges) <= 8  # down to a gap of 1e-9 of a cell


def test_pbd_split_agrees_with_unsplit() -> None:
    """One sweep is no exact solve, so the order of sweeps shows: the cut costs about the error of the sweep itself."""
    whole, _, _ = run(beam(near=None, far="pbd"))
    split, exchanges, gap = run(beam(near="pbd", far="pbd", tolerance=1e-6))
    assert difference(split, whole) < 0.02
    assert gap < 1e-6 * 0.02
    assert np.mean(exchanges) <= 8.0  # down to a gap of 1e-6 of a cell


@pytest.mark.parametrize("near, far", [("fem", "pbd"), ("pbd", "fem")])
def test_mixed_split_is_close_to_fem(near: str, far: str) -> None:
    whole, _, _ = run(beam(near=None, far="fem"))
    split, exchanges, _ = run(beam(near=near, far=far, tolerance=1e-4))
    assert difference(split, whole) < 0.15  # one cell thick: the discretisations differ by several per cent
    assert np.mean(exchanges) <= 4.0


def test_a_part_that_tells_no_compliance_is_refused_at_start(monkeypatch: pytest.MonkeyPatch) -> None:
    able = vars(PbdSolver)["capabilities"].fget
    monkeypatch.setattr(PbdSolver, "capabilities", property(lambda solver: replace(able(solver), compliance=False)))
    with pytest.raises(
        softseam.BadInput, match=r"part 'body\.far' reports no compliance.*its participant must report it"
    ):
        softseam.open(beam(near="fem", far="pbd")).reset()


def test_a_gap_that_is_kept_is_told() -> None:
    """Two exchanges do not agree to rounding: the step goes on, and an event says which gap was kept."""
    scene = beam(near="pbd", far="pbd", tolerance=1e-16)
    scene = scene.model_copy(update={"seam": scene.seam.model_copy(update={"exchanges": 2})})
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    report = simulation.step()
    assert report.seam.gap > 1e-16 * 0.02
    assert [event.kind for event in simulation.events] == ["seam"]
    simulation.close()
