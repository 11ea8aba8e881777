"""Steps that failed, which report where the body stands, and commands that are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softseam
from softseam.variants import Model

pytestmark = pytest.mark.kernels

SPIN = 1e5
"""[rad/s]: 50 turns of the block in a step"""
TEXT = f"""
softseam: 1
name: whirl
step: 0.01
gravity: [0, 0, 0]
duration: 0.02
body:
  shape: {{kind: block, size: [0.05, 0.05, 0.05]}}
  cell: 0.025
  spin: [0, 0, {SPIN}]
  material: {{kind: neo_hookean, young: 20.0e3, poisson: 0.45, density: 1050}}
regions: {{default: fem}}
quantities: [sag]
"""


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_body_whose_step_failed_is_reported_where_it_stands(tmp_path: Path, model: Model) -> None:
    """It read a sag of its whole height, no energy and no momentum."""
    path = tmp_path / "whirl.yaml"
    path.write_text(TEXT)
    with softseam.open(path, model=model) as session:
        session.reset()
        first = session.step()
        assert session.step().done
    report = first.report
    assert any(event.kind == "solver" for event in first.events)
    assert report.quantities["sag"] == pytest.approx(0.0, abs=1e-12)
    spin = float(report.angular_momentum[2])
    assert spin == pytest.approx(1050 * 0.05**5 / 6.0 * SPIN, rel=1e-9)
    assert report.energy["kinetic"] == pytest.approx(0.5 * spin * SPIN)
    assert np.linalg.norm(report.momentum) < 1e-9 * report.energy["kinetic"] / (0.05 * SPIN)


def test_a_grip_is_refused_where_nothing_can_be_gripped() -> None:
    """A seventh number did nothing, without a word, to a body of cells."""
    with softseam.open("tofu_grasp", model="fem") as session:
        session.reset()
        with pytest.raises(ValueError, match=r"'left' has a grip.*particles only"):
            session.step({"left": [0, 0, 0, 0, 0, 0, 1]})
        session.step({"left": [0, 0, 0, 0, 0, 0, 0]})  # to let go of nothing is no mistake


def test_a_velocity_that_nobody_can_mean_is_refused() -> None:
    """1e300 m/s gave a grip force of 3e302 N, without a word."""
    with softseam.open("tofu_grasp", model="fem") as session:
        session.reset()
        with pytest.raises(ValueError, match=r"'left' is \[1e\+300.* more than 100 m in a step"):
            session.step({"left": [1e300, 0, 0]})
        assert session.step({"left": [0.02, 0, 0]}).step == 1


def test_a_command_that_is_refused_grips_nothing() -> None:
    with softseam.open("rope") as session:
        session.reset()
        with pytest.raises(ValueError, match="turn"):
            session.step({"left": [0.0, 0.0, 0.0, 1e6, 0.0, 0.0, 1.0]})
        assert not session.step({}).report.gripping.any()
