"""Models that overlap and share their energy in a layer: what they reflect and lose; a study of bars, not the loop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.arlequin import Cells, shares
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.split import Split, amplification, run, spectral_radius
from analysis.overlap_bar import Share, linear, reflected, sharp_seam, sides, stepped

Floats = NDArray[np.float64]


@pytest.mark.parametrize("ratio", [2, 4])
@pytest.mark.parametrize("nodes", [6, 10, 20])
def test_a_sharp_seam_reflects_what_its_impedances_say(nodes: int, ratio: int) -> None:
    assert reflected(nodes, ratio, 0) == pytest.approx(sharp_seam(nodes, ratio), rel=1e-9)


@pytest.mark.parametrize(
    ("nodes", "layer", "share"),
    [(20, 5, 0.40), (20, 8, 0.06), (10, 2, 0.44), (10, 4, 0.05), (6, 1, 0.28), (6, 2, 0.08)],
)
def test_at_one_to_four_an_overlap_of_a_quarter_wave_reflects_less_than_half(
    nodes: int, layer: int, share: float
) -> None:
    """Energy that comes back, over the sharp seam's; `share` is what was found, rounded up."""
    assert reflected(nodes, 4, layer) < share * sharp_seam(nodes, 4)


@pytest.mark.parametrize("nodes", [6, 10, 20, 40])
@pytest.mark.parametrize("layer", [1, 2, 4, 8])
def test_no_overlap_reflects_more_than_the_sharp_seam(nodes: int, layer: int) -> None:
    assert reflected(nodes, 4, layer) < sharp_seam(nodes, 4)


@pytest.mark.parametrize(("nodes", "layer", "at_least"), [(20, 1, 50.0), (20, 4, 15.0), (10, 2, 10.0)])
def test_a_share_that_varies_within_a_coarse_cell_reflects_more(nodes: int, layer: int, at_least: float) -> None:
    """The failing control."""
    assert reflected(nodes, 4, layer, linear) > at_least * sharp_seam(nodes, 4)


def strain_error(ratio: int, layer: int, share: Share) -> float:
    """Largest error of the displacements, over their largest, of a bar that is pulled: its strain is constant."""
    near, far, x_near, x_far = sides(4, 4, ratio, layer, share)
    n, m, s = near.n, far.n, len(near.link)
    whole = np.zeros((n + m + s, n + m + s))
    whole[:n, :n], whole[n : n + m, n : n + m] = near.stiffness, far.stiffness
    whole[n + m :, :n], whole[n + m :, n : n + m] = near.link, far.link
    whole[: n + m, n + m :] = whole[n + m :, : n + m].T
    load = np.zeros(n + m + s)
    whole[0, 0] += 1e6  # held by a spring
    load[0], load[n + m - 1] = 1e6 * x_near[0] - 1.0, 1.0
    found = np.linalg.solve(whole, load)[: n + m]
    expected = np.concatenate([x_near, x_far])
    return float(np.abs(found - expected - (found[0] - expected[0])).max() / np.abs(expected).max())


@pytest.mark.parametrize("layer", [0, 1, 2, 5])
@pytest.mark.parametrize("ratio", [1, 2, 4])
def test_constant_strain_passes(ratio: int, layer: int) -> None:
    assert strain_error(ratio, layer, stepped) < 1e-9
    if layer and ratio > 1:
        assert strain_error(ratio, layer, linear) > 1e-3  # the failing control


def split(layer: int, substeps: int = 4, step: float = 0.05, n: int = 70) -> tuple[Split, Floats]:
    near, far, x_near, _ = sides(n, n // 2, 4, layer)
    return Split(near, far, step, "midpoint", "implicit_euler", substeps), x_near


def came_back(layer: int, nodes: float = 6.0) -> float:
    """Share of a pulse's energy that is back in the near part after it met the seam, in time, by the scheme."""
    divided, x = split(layer)
    q = 2.0 * np.pi / nodes
    omega, group = 2.0 * np.sin(0.5 * q), np.cos(0.5 * q)
    shape = np.exp(-(((x + 32.0) / 10.0) ** 2))
    slope = -2.0 * (x + 32.0) / 100.0 * shape
    u = shape * np.cos(q * x)
    v = omega * shape * np.sin(q * x) - group * slope * np.cos(q * x)  # to the right, envelope and all
    none = np.zeros(divided.far.n)
    state = divided.init(u, v, none, none, np.zeros(layer + 1))
    matrix = amplification(PositionConstant(), divided)
    y = np.concatenate([state.near, state.far, state.lambda_])
    for _ in range(round(56.0 / group / 0.05)):
        y = matrix @ y
    return divided.near.energy(y[: 4 * divided.near.n]) / divided.energy(state)


def test_a_pulse_in_time_reflects_less_by_an_overlap() -> None:
    """1:4, six coarse nodes a wave: the sharp seam's share of energy, and a tenth of it by two cells of overlap."""
    sharp, blended = came_back(0), came_back(2)
    assert sharp == pytest.approx(sharp_seam(6, 4), rel=0.2)  # a pulse holds shorter waves, too
    assert blended < 0.15 * sharp


@pytest.mark.parametrize("layer", [0, 1, 3])
@pytest.mark.parametrize("substeps", [1, 20])
def test_the_scheme_stays_stable_and_does_no_work_in_the_layer(layer: int, substeps: int) -> None:
    near, far, _, _ = sides(4, 3, 4, layer)
    for step in (0.02, 0.5, 5.0):
        divided = Split(near, far, step, "implicit_euler", "implicit_euler", substeps)
        assert spectral_radius(PositionConstant(), divided) < 1.0 + 1e-7  # a double root at 1: it moves freely
        u = np.cos(np.arange(far.n))
        u[far.link.T.any(axis=1)] = 0.0
        state = divided.init(np.zeros(near.n), np.zeros(near.n), u, np.zeros(far.n), np.zeros(len(near.link)))
        states = run(PositionConstant(), divided, state, 50)
        assert max(float(np.abs(divided.gap(one)).max()) for one in states) < 1e-12
        assert abs(float(states[-1].work)) < 1e-12 * divided.energy(state)


def test_shares_add_up_and_none_is_nothing() -> None:
    assert shares(4).tolist() == [0.875, 0.625, 0.375, 0.125]
    near, far, _, _ = sides(3, 3, 4, 2)
    assert np.trace(near.mass) + np.trace(far.mass) == pytest.approx(3 + 2 + 3)
    with pytest.raises(ValueError, match="nothing holds"):
        Cells(np.array([[0, 1]]), np.ones((1, 2)), np.ones((1, 2, 2)), np.zeros(1)).assembled()
