"""The region rule: hysteresis, patience, whole patches, determinism."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from softseam_coupling.regions import CellGrid, RegionRule, RegionState

Mask = NDArray[np.bool_]


def block(nx: int, ny: int, nz: int) -> tuple[NDArray[np.int32], CellGrid]:
    """A full block of cells, x fastest."""
    cells = [(i, j, k) for k in range(nz) for j in range(ny) for i in range(nx)]
    grid = np.array(cells, dtype=np.int32)
    return grid, CellGrid.build(grid)


def as_lattice(near: Mask, nx: int, ny: int, nz: int) -> Mask:
    return near.reshape(nz, ny, nx)


def test_neighbours_and_blocks_of_a_small_block() -> None:
    _, grid = block(3, 2, 1)
    assert_array_equal(grid.neighbours[0], [-1, 1, -1, 3, -1, -1])
    assert_array_equal(grid.neighbours[4], [3, 5, 1, -1, -1, -1])
    assert ((grid.blocks >= 0).sum(axis=1) >= 2).all()
    hollow = CellGrid.build(np.array([[0, 0, 0], [2, 0, 0]], dtype=np.int32))
    assert_array_equal(hollow.neighbours, np.full((2, 6), -1))


@pytest.mark.kernels
def test_static_boxes_are_always_near() -> None:
    cells = np.array([[i, 0, 0] for i in range(6)], dtype=np.int32)
    grid = CellGrid.build(cells, cells.astype(np.float64) + 0.5, np.array([[[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]]]))
    rule = RegionRule(within=0.0, patience=2)
    far_away = np.full(6, 1e3)
    state = rule.init(grid, far_away)
    assert_array_equal(state.near, [True, True, False, False, False, False])
    for _ in range(10):
        assert not rule.choose(state, grid, far_away).switches
    with pytest.raises(ValueError, match="centres"):
        CellGrid.build(cells, None, np.zeros((1, 2, 3)))


@pytest.mark.kernels
def test_approach_hold_and_leave() -> None:
    """Near at `within`, kept to `release * within`, let go `patience` steps after the last reason and not before."""
    _, grid = block(8, 1, 1)
    rule = RegionRule(within=1.0, release=1.5, patience=5, min_patch=1)
    base = np.arange(8.0)

    def go(offset: float) -> int:
        choice = rule.choose(state, grid, base + offset)
        if choice.switches:
            rule.accept(state, choice)
        return int(state.near.sum())

    state = rule.init(grid, base + 5.0)
    assert state.near.sum() == 0
    assert [go(offset) for offset in (3.0, 1.2, 0.9, 0.4)] == [0, 0, 1, 1]
    assert go(-0.5) == 2
    assert [go(0.45) for _ in range(50)] == [2] * 50  # inside the release distance: 1.45 < 1.5
    assert [go(0.6) for _ in range(8)] == [2, 2, 2, 2, 1, 1, 1, 1]  # cell 1 lost its reason
    assert go(0.0) == 1  # at `within` exactly is not closer
    choice = rule.choose(state, grid, base - 3.5)
    assert choice.n_raised == 4
    assert "4 cells raised (4 by a tool" in choice.reason


@pytest.mark.kernels
def test_a_choice_that_is_not_accepted_is_asked_for_again() -> None:
    _, grid = block(4, 1, 1)
    rule = RegionRule(within=1.0)
    state = rule.init(grid, np.full(4, 9.0))
    distance = np.array([0.5, 2.0, 3.0, 4.0])
    assert rule.choose(state, grid, distance).switches
    assert rule.choose(state, grid, distance).switches
    assert not state.near.any()


@pytest.mark.kernels
def test_approach_speed_raises_cells_early_and_never_keeps_them() -> None:
    _, grid = block(4, 1, 1)
    rule = RegionRule(within=1.0, patience=2)
    state = rule.init(grid, np.full(4, 9.0))
    distance = np.array([1.4, 2.4, 3.4, 4.4])
    assert not rule.choose(state, grid, distance, np.full(4, 0.3)).switches
    assert rule.choose(state, grid, distance, np.full(4, 0.5)).n_raised == 1
    assert not rule.choose(state, grid, distance, np.full(4, -2.0)).switches


@pytest.mark.kernels
def test_cells_are_raised_in_batches() -> None:
    """A tool that comes 0.05 closer a step to cells 0.1 apart raises four at a time; far ones alone are no reason."""
    _, grid = block(12, 1, 1)
    rule = RegionRule(within=1.0, release=1.5, patience=20, min_patch=1)
    state = rule.init(grid, np.full(12, 9.0))
    raised = []
    for step in range(40):
        choice = rule.choose(state, grid, 1.29 + 0.1 * np.arange(12.0) - 0.05 * step)
        if choice.switches:
            raised.append((step, choice.n_raised))
            rule.accept(state, choice)
    assert raised == [(6, 4), (14, 4), (22, 4)]
    kept = RegionRule(within=1.0, release=1.1, min_patch=1)
    state = kept.init(grid, np.full(12, 9.0))
    assert kept.choose(state, grid, 0.95 + 0.1 * np.arange(12.0)).n_raised == 2  # never what the rule would let go


@pytest.mark.kernels
def test_cells_are_lowered_in_batches() -> None:
    """Cells that lose their reason one a step leave together, at most once in `patience` steps."""
    _, grid = block(12, 1, 1)
    rule = RegionRule(within=1.0, release=1.0, patience=4, min_patch=1)
    state = rule.init(grid, np.full(12, 0.5))
    lowered = []
    for step in range(16):
        choice = rule.choose(state, grid, np.where(np.arange(12) < 11 - step, 0.5, 2.0))
        if choice.switches:
            rule.accept(state, choice)
            lowered.append((step, choice.n_lowered))
    steps = [step for step, _ in lowered]
    assert min(np.diff(steps)) >= 4
    assert sum(n for _, n in lowered) == 12
    assert len(lowered) <= 5


@pytest.mark.kernels
def test_a_single_far_cell_inside_is_no_island() -> None:
    _, grid = block(3, 3, 3)
    distance = np.zeros(27)
    distance[13] = 9.0
    near = RegionRule(within=1.0).init(grid, distance).near
    assert near.all()
    # a hole of a face: one far cell at the surface, all of whose neighbours are near
    distance[13], distance[10] = 0.0, 9.0
    assert RegionRule(within=1.0).init(grid, distance).near.all()


@pytest.mark.kernels
def test_edge_and_corner_contacts_are_mended() -> None:
    _, grid = block(2, 2, 1)
    near = RegionRule(within=1.0, min_patch=1).init(grid, np.array([0.0, 3.0, 2.0, 0.0])).near
    assert_array_equal(near, [True, False, True, True])  # the closer of the two candidates
    _, grid = block(2, 2, 2)
    corners = np.full(8, 5.0)
    corners[[0, 7]] = 0.0
    near = RegionRule(within=1.0, min_patch=1).init(grid, corners).near
    assert near[[0, 7]].all()
    assert islands(near, (2, 2, 2)) == 1  # a path of face contacts from corner to corner


@pytest.mark.kernels
def test_cap_raises_the_closest_first() -> None:
    _, grid = block(10, 1, 1)
    rule = RegionRule(within=20.0, max_cells=3, min_patch=1)
    state = rule.init(grid, np.full(10, 99.0))
    distance = np.arange(10.0)[::-1].copy()
    counts = []
    for _ in range(5):
        choice = rule.choose(state, grid, distance)
        rule.accept(state, choice)
        counts.append(int(state.near.sum()))
    assert counts == [3, 6, 9, 10, 10]
    state = rule.init(grid, np.full(10, 99.0))
    assert_array_equal(np.flatnonzero(rule.choose(state, grid, distance).near), [7, 8, 9])


def islands(inside: Mask, n: tuple[int, int, int]) -> int:
    """Face-connected components by flood fill, written anew."""
    todo = {tuple(int(i) for i in cell) for cell in np.argwhere(as_lattice(inside, *n))}
    count = 0
    while todo:
        count += 1
        front = [todo.pop()]
        while front:
            k, j, i = front.pop()
            for step in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)):
                other = (k + step[0], j + step[1], i + step[2])
                if other in todo:
                    todo.remove(other)
                    front.append(other)
    return count


@pytest.mark.kernels
@given(
    st.tuples(st.integers(1, 5), st.integers(1, 5), st.integers(1, 4)),
    st.integers(0, 2**32 - 1),
    st.floats(0.05, 0.95),
)
@settings(deadline=None, max_examples=80)
def test_any_cells_become_clean_patches(n: tuple[int, int, int], seed: int, share: float) -> None:
    """Near cells only grow; no small far islands; no diagonal contact of near cells across an edge; deterministic."""
    _, grid = block(*n)
    rng = np.random.default_rng(seed)
    distance = rng.random(grid.n_cells)
    rule = RegionRule(within=share)
    state = rule.init(grid, distance)
    assert (state.near >= (distance < share)).all()
    assert_array_equal(state.near, rule.init(grid, distance.copy()).near)
    far = ~state.near
    if state.near.any() and far.any():
        assert islands(far, n) <= far.sum() / min(rule.min_patch, max(1, grid.n_cells // 6))
    lattice = as_lattice(state.near, *n).astype(int)
    for axes in ((0, 1), (0, 2), (1, 2)):
        a = np.moveaxis(lattice, axes, (0, 1))
        if a.shape[0] > 1 and a.shape[1] > 1:
            checker = (a[:-1, :-1] == a[1:, 1:]) & (a[1:, :-1] == a[:-1, 1:]) & (a[:-1, :-1] != a[1:, :-1])
            if min(n) == 1:  # in a full block two such cells may also meet through the layers beside them
                assert not checker.any()
    # the same distances, forever: cells that only mended patches may leave, then nothing changes any more
    last = 0
    for step in range(1, 6 * rule.patience):
        choice = rule.choose(state, grid, distance)
        assert choice.n_raised == 0
        if choice.switches:
            rule.accept(state, choice)
            last = step
    assert last < 5 * rule.patience


@pytest.mark.kernels
def test_state_survives_a_checkpoint() -> None:
    _, grid = block(6, 2, 1)
    rule = RegionRule(within=1.0, patience=3)
    state = rule.init(grid, np.linspace(0.0, 3.0, 12))
    rule.choose(state, grid, np.linspace(2.0, 3.0, 12))
    copy = RegionState.from_arrays(state.to_arrays())
    for _ in range(6):
        ours, theirs = (rule.choose(each, grid, np.linspace(2.0, 3.0, 12)) for each in (state, copy))
        assert_array_equal(ours.near, theirs.near)
        assert ours.reason == theirs.reason
        rule.accept(state, ours)
        rule.accept(copy, theirs)


@pytest.mark.kernels
def test_urgency_raises_a_few_cells_at_a_time_and_lets_go_late() -> None:
    """The most urgent 5 % first; kept above 0.3, let go `patience` steps after."""
    _, grid = block(8, 5, 2)
    rule = RegionRule(within=-np.inf, patience=5, min_patch=1)
    nowhere = np.full(80, np.inf)
    state = rule.init(grid, nowhere)
    measure = np.zeros(80)
    measure[:8] = [1.1, 1.8, 1.7, 1.6, 1.5, 1.2, 0.9, 0.5]

    def go() -> tuple[int, str]:
        choice = rule.choose(state, grid, nowhere, None, {"stress": measure, "other": 0.1 * measure})
        if choice.switches:
            rule.accept(state, choice)
        return int(state.near.sum()), choice.reason

    n_near, reason = go()
    assert n_near == 4 and reason == "4 cells raised (4 by stress, up to 1.8 of its bound, 0 to mend patches)"
    assert_array_equal(np.flatnonzero(state.near), [1, 2, 3, 4])
    assert go()[0] == 6
    assert go() == (6, ""), "0.9 and 0.5 of the bound are no reason"
    measure[:8] = 0.31
    assert [go()[0] for _ in range(30)] == [6] * 30
    measure[:8] = 0.29
    assert [go()[0] for _ in range(6)] == [6, 6, 6, 6, 0, 0]


@pytest.mark.kernels
def test_tools_come_before_urgency_and_are_not_capped() -> None:
    _, grid = block(40, 1, 1)
    rule = RegionRule(within=1.0, min_patch=1)
    state = rule.init(grid, np.full(40, 9.0))
    distance = np.where(np.arange(40) < 6, 0.5, 9.0)
    choice = rule.choose(state, grid, distance, None, {"model error": np.where(np.arange(40) > 10, 2.0, 0.0)})
    assert choice.n_raised == 8
    assert choice.reason.startswith("8 cells raised (6 by a tool, closest 500.0 mm, 2 by model error, up to 2")
