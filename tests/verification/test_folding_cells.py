"""Cells that fold pass to full quadrature and stay there: between pads that hold a star its force does not jitter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softseam.observation import Observation
from softseam.session import open_as_given
from softseam_protocol.messages.session import Event

STAR = """\
softseam: 1
name: star
body:
  shape: {kind: mesh, path: star.obj, scale: 0.001}
  material: {young: 20.0e3, poisson: 0.45, density: 1050}
tools:
  ground: {kind: plane, friction: 0.6}
  left: {kind: box, size: [0.09, 0.01, 0.03], position: [0, -0.052, 0.016], friction: 0.6}
  right: {kind: box, size: [0.09, 0.01, 0.03], position: [0, 0.052, 0.016], friction: 0.6}
motion:
  - {tools: [left, right], close: 0.03, force: 0.33, until: {force: 0.32, time: 1.0}}
  - {hold: 0.1}
  - {tools: [left, right], move: [0, 0, 0.03], speed: 0.06}
regions: {default: fem}
models: {fem: {element: hex27_reduced}}
"""


def test_the_force_on_an_arm_that_folds_does_not_jitter(tmp_path: Path) -> None:
    """Second differences of the grip from step to step: they are large only as the pads meet the arms and as they stop.
    With shares that follow at once thirteen were, of up to a fifth of the force, and energy came from nowhere."""
    (tmp_path / "star.obj").write_bytes((Path(__file__).parents[1] / "meshes" / "star.obj").read_bytes())
    path = tmp_path / "star.yaml"
    path.write_text(STAR)
    force: list[float] = []
    phase: list[int] = []
    told: list[Event] = []

    def see(seen: Observation) -> None:
        force.append(seen.grip_force)
        phase.append(seen.report.phase)
        told.extend(seen.events)

    with open_as_given(path) as session:
        session.reset()
        session.run(see)
    jumps = np.abs(np.diff(force, 2)) / 0.33
    assert any(event.kind == "cells" for event in told)
    meet, stop = int(np.argmax(np.array(force) > 0.0)), int(np.argmax(np.array(phase) > 0))
    step = np.arange(len(jumps)) + 1  # in the middle of each difference
    elsewhere = (np.abs(step - meet) > 2) & (np.abs(step - stop) > 2)
    assert jumps[elsewhere].max() < 0.03 and jumps.max() < 0.1
    assert not any(event.kind == "energy" for event in told)
