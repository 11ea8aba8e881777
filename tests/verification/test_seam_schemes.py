"""The seam's scheme in the real loop, FEM beside XPBD: energy, gap and momentum; and the control that fails."""

from __future__ import annotations

import numpy as np
import pytest
from seam_runs import CLAMPED, FREE, bar, fall, largest_energy

from softseam_protocol.scene.kinds import IntegratorKind
from softseam_services.orchestrator.part_client import StepFailed


@pytest.mark.parametrize("integrator", ["implicit_euler", "midpoint"])
def test_a_beam_falls_with_its_gap_closed_and_no_work_at_the_seam(integrator: IntegratorKind) -> None:
    """Tips of both agree to 0.8 %: implicit Euler lags."""
    run, other = fall(f"models.fem.integrator={integrator}"), fall("models.fem.integrator=midpoint")
    assert max(report.seam.gap for report in run) < 3e-4 * 0.025
    assert abs(sum(report.energy["seam_work"] for report in run)) < 3e-5 * largest_energy(run)
    assert run[-1].quantities["tip_deflection"] == pytest.approx(other[-1].quantities["tip_deflection"], rel=0.01)
    # a step of midpoint is not corrected but taken again
    most = 2.2 if integrator == "midpoint" else 2.0
    assert np.mean([report.seam.exchanges for report in run]) < most


def test_the_seam_does_no_work() -> None:
    """The same fall, gap closed to 3e-6 of a cell: seam work below 1e-6 of the energy (1.4e-7; 1.9e-6 at 3e-5)."""
    run = fall("seam.tolerance=3e-6")[:60]
    work = sum(report.energy["seam_work"] for report in run)
    largest = max(report.energy["kinetic"] + report.energy["strain"] for report in run)
    assert abs(work) < 1e-6 * largest


def test_position_keeps_the_momentum() -> None:
    simulation = bar("position", "implicit_euler", FREE, density=3000.0)
    momenta = [simulation.step().momentum for _ in range(50)]
    assert np.ptp(momenta, axis=0).max() < 1e-9  # of impulses of 1e-4: what the linear answers that settle steps leave


@pytest.mark.parametrize(
    ("speed", "tolerance", "words"), [(0.05, 3e-4, "cannot be put where"), (1e-3, 1e-6, "alternates and has grown")]
)
def test_staggered_diverges_and_says_so(speed: float, tolerance: float, words: str) -> None:
    """Equal densities: the multiplier grows four times a step. It ends in StepFailed before anything is NaN, by what
    FEM cannot follow where the motion is large, and by the growth itself where it is small."""
    body = {**CLAMPED, "velocity": [0.0, 0.0, speed]}
    simulation = bar("staggered", "implicit_euler", body, tolerance=tolerance)
    reports = []
    with pytest.raises(StepFailed, match=rf"staggered: .*{words}.*added mass.*seam: \{{scheme: position\}}"):
        for _ in range(100):
            reports.append(simulation.step())
    assert 2 < len(reports) < 30
    assert largest_energy(reports) > 10.0 * largest_energy(reports[:1])
    assert np.isfinite(simulation.frame().x).all()


def test_staggered_agrees_with_position_where_the_near_side_is_light_and_soft() -> None:
    """So that it fails for its reason: the far half, which carries the near one, moves alike but for the lag."""
    runs = {}
    for scheme in ("position", "staggered"):
        simulation = bar(scheme, "implicit_euler", CLAMPED, density=20.0, young=1e3)
        reports = [simulation.step() for _ in range(60)]
        far = simulation.body.x_rest[:, 0] >= 0.04
        runs[scheme] = (simulation.frame().x - simulation.body.x_rest)[far]
        assert max(report.seam.gap for report in reports) <= 3e-4 * 0.02
        assert largest_energy(reports) <= 1.01 * largest_energy(reports[:1])
    off = np.abs(runs["staggered"] - runs["position"]).max() / np.abs(runs["position"]).max()
    assert off < 0.13, off
