"""A lattice of springs cut in two, and its macro steps by a fixed-point iteration, as loops take steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.accelerations.memory import Acceleration
from analysis.linear_study.constant_multiplier import answer, march
from analysis.linear_study.integrators import LinearSide, propagate
from analysis.linear_study.split import Split, SplitState
from analysis.loops.fixed_point import FixedPoint
from softseam_coupling.loops.coupled_part import CoupledPart
from softseam_coupling.loops.loop import largest

Floats = NDArray[np.float64]


def compliance(split: Split, integrate_far_as: int | None = None) -> Floats:
    """H_near + H_far of a macro step [m/N]; optionally with another number of substeps on the far side."""
    m = split.substeps if integrate_far_as is None else integrate_far_as
    far = split.far_propagator if m == split.substeps else propagate(split.far, split.far_integrator, split.step / m)
    near_x = answer(split.near_propagator, split.substeps_near)[: split.near.n]
    return split.near.link @ near_x + split.far.link @ answer(far, m)[: split.far.n]


def fixed_point(split: Split, acceleration: Acceleration | None = None, first: Floats | None = None) -> FixedPoint:
    """Of the split's unknowns. What guesses by mass is given the mean diagonal of the true compliance."""
    n = split.near.link.shape[0] // 3
    mobility = np.full(n, np.diagonal(compliance(split)).mean() / split.step**2)
    return FixedPoint({"both": CoupledPart(np.eye(n), 1.0)}, {"both": mobility}, first, acceleration)


def couple(
    found: FixedPoint, split: Split, now: SplitState, tolerance: float, told: Floats | None = None, most: int = 20
) -> tuple[SplitState, int]:
    """One macro step; the new state and the exchanges it took. told: compliance, where it is asked for first."""
    lambda_ = found.begin(split.step)
    if found.asks:
        found.set_compliance(compliance(split) if told is None else told)
    for n in range(1, most + 1):
        flat = lambda_.ravel()
        near, work_near = march(split.near, split.near_propagator, now.near, split.substeps_near, now.lambda_, flat)
        far, work_far = march(split.far, split.far_propagator, now.far, split.substeps, now.lambda_, flat)
        after = SplitState(near, far, flat, now.work + work_near + work_far)
        gap = split.gap(after).reshape(-1, 3)
        proposed = found.next(lambda_, gap)
        found.asks = False  # nothing new could be told
        if largest(gap) <= tolerance:
            found.commit(lambda_)
            return after, n
        lambda_ = proposed
    raise AssertionError("the seam did not close")


def grid_bar(
    n_cells: int, cut: int, mass_ratio: float, substeps: int, step: float, stiffness_ratio: float = 1.0
) -> tuple[Split, SplitState]:
    """A lattice of 2 x 2 chains of springs in three directions, clamped at one end, cut at a layer: 4 seam nodes.

    mass_ratio: density of the near part over that of the far part; stiffness_ratio likewise.
    It starts with a uniform velocity.
    """

    def part(layers: int, density: float) -> tuple[Floats, Floats]:
        n = 4 * (layers + 1)
        mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
        for layer in range(layers):
            for c in range(4):
                nodes = [4 * layer + c, 4 * layer + 4 + c]
                mass[nodes, nodes] += 0.5 * density
                stiffness[np.ix_(nodes, nodes)] += 400.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
                across = [4 * layer + 4 + c, 4 * layer + 4 + (c + 1) % 4]
                stiffness[np.ix_(across, across)] += 150.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        eye = np.eye(3)
        return np.asarray(np.kron(mass, eye)), np.asarray(np.kron(stiffness, np.diag([1.0, 0.4, 0.3])))

    near_mass, near_stiffness = part(cut, mass_ratio)
    far_mass, far_stiffness = part(n_cells - cut, 1.0)
    near_mass, near_stiffness = (
        near_mass[12:, 12:],
        stiffness_ratio * near_stiffness[12:, 12:],
    )  # the first layer is clamped
    n_near, n_far = len(near_mass), len(far_mass)
    near = LinearSide(near_mass, near_stiffness, np.eye(12, n_near, n_near - 12))
    far = LinearSide(far_mass, far_stiffness, -np.eye(12, n_far))
    split = Split(near, far, step, "implicit_euler", "implicit_euler", substeps)
    rng = np.random.default_rng(3)
    kick = rng.normal(size=12)
    v_near, v_far = np.tile(kick, n_near // 12), np.tile(kick, n_far // 12)
    return split, split.init(np.zeros(n_near), v_near, np.zeros(n_far), v_far, np.zeros(12))
