"""Exchanges of seams that know no compliance, on lattices and in a real hybrid run, beside the exact compliance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from seam_runs import cantilever

from analysis.accelerations.aitken import Aitken
from analysis.accelerations.constant import Constant
from analysis.accelerations.iqn_ils import IqnIls
from analysis.accelerations.memory import Acceleration
from analysis.lattice import compliance, couple, fixed_point, grid_bar
from analysis.loops.fixed_point import FixedPoint
from softseam_coupling.loops.coupled_part import CoupledPart
from softseam_protocol.messages.session import StepReport

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]


def corrections(acceleration: Acceleration | None, mass_ratio: float, error: float = 0.0) -> int:
    """Corrections of the multiplier until the first step's gap, of a lattice cut at a layer (12 unknowns), is 1e-6 of
    what it was. error: of the compliance that is told (symmetric, in the spectral norm relative to it)."""
    split, start = grid_bar(6, 2, mass_ratio, 10, 0.02)
    after, n = couple(fixed_point(split), split, start, 1e9)
    assert n == 1
    tolerance = 1e-6 * float(np.abs(split.gap(after)).max())
    h = compliance(split)
    noise = np.random.default_rng(2).normal(size=h.shape)
    noise, root = noise + noise.T, np.linalg.cholesky(h)
    told = h + error * root @ (noise / np.linalg.norm(noise, 2)) @ root.T
    return couple(fixed_point(split, acceleration), split, start, tolerance, told, most=60)[1] - 1


@pytest.mark.parametrize("mass_ratio", [0.1, 1.0, 10.0])
def test_corrections_to_a_millionth(mass_ratio: float) -> None:
    """1 with the exact compliance, 3 to 5 with one that is 10 % wrong, then IQN-ILS, Aitken and constant relaxation."""
    counts = [corrections(None, mass_ratio), corrections(None, mass_ratio, 0.1)]
    counts += [corrections(acceleration, mass_ratio) for acceleration in (IqnIls(), Aitken(), Constant())]
    expected = {0.1: [1, 4, 8, 13, 33], 1.0: [1, 4, 5, 7, 16], 10.0: [1, 4, 3, 4, 12]}[mass_ratio]
    assert all(abs(count - wanted) <= 1 for count, wanted in zip(counts, expected, strict=True)), counts


def test_columns_of_earlier_steps_serve_the_next() -> None:
    """IQN-ILS: fewer exchanges a step with the columns of 8 steps than without."""
    means = []
    for windows in (0, 8):
        split, now = grid_bar(6, 2, 1.0, 10, 0.02)
        found = fixed_point(split, IqnIls(windows=windows))
        counts = []
        for _ in range(60):
            now, n = couple(found, split, now, 1e-6, most=60)
            counts.append(n)
        means.append(np.mean(counts[20:]))
    assert means[1] < 0.7 * means[0], means


@pytest.mark.parametrize("acceleration", [IqnIls(), IqnIls(columns=0), Aitken(), Constant()], ids=str)
def test_an_answer_that_does_not_change_breaks_nothing(acceleration: Acceleration) -> None:
    """A column of zeros: the same gap whatever the multiplier."""
    found = FixedPoint({"a": CoupledPart(np.eye(2), 1.0)}, {"a": np.full(2, 1e-3)}, None, acceleration)
    lambda_ = found.begin(1.0)
    for _ in range(5):
        lambda_ = found.next(lambda_, np.full((2, 3), 1e-4))
        assert np.isfinite(lambda_).all()


@pytest.mark.parametrize("acceleration", [None, IqnIls(), Aitken()], ids=str)
def test_it_goes_on_from_a_snapshot_bit_for_bit(acceleration: Acceleration | None) -> None:
    split, now = grid_bar(6, 2, 1.0, 10, 0.02)
    found, other = fixed_point(split, acceleration), fixed_point(split, acceleration)
    for _ in range(5):
        now, _ = couple(found, split, now, 1e-6, most=60)
    other.take(found.to_arrays())
    one = two = now
    for _ in range(5):
        one, n_one = couple(found, split, one, 1e-6, most=60)
        two, n_two = couple(other, split, two, 1e-6, most=60)
        assert n_one == n_two
        assert (one.lambda_ == two.lambda_).all()


def hybrid(*settings: str) -> list[StepReport]:
    """The cantilever's first 0.12 s."""
    simulation = cantilever(*settings)
    return [simulation.step() for _ in range(60)]


def test_a_real_beam_falls_alike_with_every_acceleration() -> None:
    """The cantilever's first 0.12 s, FEM and XPBD: as many exchanges a step as `expected`."""
    runs = {name: hybrid(f"seam.scheme={name}") for name in ("position", "iqn_ils", "aitken", "constant")}
    tips = {name: run[-1].quantities["tip_deflection"] for name, run in runs.items()}
    means = {name: float(np.mean([report.seam.exchanges for report in run])) for name, run in runs.items()}
    for run in runs.values():
        assert max(report.seam.gap for report in run) <= 3e-4 * 0.025
    assert np.ptp(list(tips.values())) < 1e-3 * abs(tips["position"])
    expected = {"position": 1.02, "iqn_ils": 2.12, "aitken": 2.55, "constant": 4.67}
    assert means == pytest.approx(expected, abs=0.2)


def test_a_simulation_goes_on_from_a_snapshot_bit_for_bit() -> None:
    """The columns of IQN-ILS are in the snapshot of the whole simulation."""
    simulation, other = cantilever("seam.scheme=iqn_ils"), cantilever("seam.scheme=iqn_ils")
    for _ in range(10):
        simulation.step()
    other.load(simulation.save())
    for _ in range(5):
        one, two = simulation.step(), other.step()
        assert one.seam == two.seam
        assert (one.momentum == two.momentum).all()
