"""Hand-over at a region switch: mass, momentum, centre of mass and angular momentum of the whole body are kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from softseam_coupling.handover import HandOver, Side, angular_momentum, merge_sides

Floats = NDArray[np.float64]


def two_sides(seed: int, n_nodes: int, n_shared: int, gap: float, jump: float) -> tuple[Side, Side]:
    """A random body whose sides disagree by `gap` [m] and `jump` [m/s] at the shared nodes, moving and spinning."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(n_nodes).astype(np.int32)
    n_near = rng.integers(n_shared, n_nodes + 1)
    nodes_near = np.sort(order[:n_near])
    nodes_far = np.sort(np.concatenate((order[:n_shared], order[n_near:])))
    x = rng.normal(size=(n_nodes, 3)) + 10.0 * rng.normal(size=3)
    v = np.cross(rng.normal(size=3), x) + rng.normal(size=3)

    def side(nodes: NDArray[np.int32]) -> Side:
        shape = (len(nodes), 3)
        off = np.isin(nodes, order[:n_shared])[:, None]
        return Side(
            nodes,
            10.0 ** rng.uniform(-6.0, -3.0, len(nodes)),
            x[nodes] + gap * off * rng.normal(size=shape),
            v[nodes] + jump * off * rng.normal(size=shape),
        )

    return side(nodes_near), side(nodes_far)


def totals(*parts: tuple[Floats, Floats, Floats]) -> tuple[float, Floats, Floats, Floats, float]:
    """Mass, first moment, momentum, angular momentum and kinetic energy."""
    mass = sum(float(m.sum()) for m, _, _ in parts)
    moment = sum((m @ x for m, x, _ in parts), np.zeros(3))
    momentum = sum((m @ v for m, _, v in parts), np.zeros(3))
    spin = sum((angular_momentum(*part) for part in parts), np.zeros(3))
    kinetic = sum(0.5 * float(m @ (v * v).sum(axis=1)) for m, _, v in parts)
    return mass, moment, momentum, spin, kinetic


def check(near: Side, far: Side, merged: HandOver) -> None:
    before = totals((near.mass, near.x, near.v), (far.mass, far.x, far.v))
    after = totals((merged.mass, merged.x, merged.v))
    speed = np.abs(merged.v).max()
    size = np.abs(merged.x).max()
    assert_allclose(after[0], before[0], rtol=1e-14)
    assert_allclose(after[1], before[1], atol=1e-12 * before[0] * size)
    assert_allclose(after[2], before[2], atol=1e-12 * before[0] * speed)
    assert_allclose(after[3], before[3], atol=1e-10 * before[0] * speed * size)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 40),
    st.floats(0.0, 1.0),
    st.floats(-8.0, -1.0),
    st.floats(-8.0, 0.0),
)
@settings(deadline=None, max_examples=150)
def test_invariants(seed: int, n_nodes: int, share: float, gap: float, jump: float) -> None:
    near, far = two_sides(seed, n_nodes, 1 + int(share * (n_nodes - 1)), 10.0**gap, 10.0**jump)
    merged = merge_sides(near, far, n_nodes)
    check(near, far, merged)


def test_the_repair_is_what_keeps_angular_momentum() -> None:
    """Without it the means alone lose D = sum mu gap x jump: the check above has teeth."""
    near, far = two_sides(4, 20, 8, 0.3, 3.0)
    merged = merge_sides(near, far, 20)
    v = np.empty((20, 3))
    v[near.nodes], v[far.nodes] = near.v, far.v
    shared, a, b = np.intersect1d(near.nodes, far.nodes, return_indices=True)
    m_a, m_b = near.mass[a][:, None], far.mass[b][:, None]
    v[shared] = (m_a * near.v[a] + m_b * far.v[b]) / (m_a + m_b)
    before = totals((near.mass, near.x, near.v), (far.mass, far.x, far.v))
    plain = totals((merged.mass, merged.x, v))
    assert np.linalg.norm(plain[3] - before[3]) > 1e-9
    # least kinetic norm: any other change with the same P and L differs by one with sum m dv = 0, sum m x cross dv = 0,
    # to which the repair is orthogonal
    change = (merged.v - v)[shared]
    mass, x = merged.mass[shared], merged.x[shared]
    rows = np.zeros((6, 3 * len(shared)))
    for i in range(len(shared)):
        for c in range(3):
            unit = np.eye(3)[c]
            rows[:3, 3 * i + c] = mass[i] * unit
            rows[3:, 3 * i + c] = mass[i] * np.cross(x[i], unit)
    free = np.linalg.svd(rows)[2][6:]
    weighted = (mass[:, None] * change).ravel()
    assert_allclose(free @ weighted, 0.0, atol=1e-10 * float(np.linalg.norm(weighted)))


@pytest.mark.parametrize("n_shared", [1, 2])
def test_one_or_two_merged_nodes_borrow_the_rest_of_the_body(n_shared: int) -> None:
    near, far = two_sides(7, 12, n_shared, 1e-3, 1e-1)
    merged = merge_sides(near, far, 12)
    check(near, far, merged)


def test_sides_that_agree_are_copied_bit_for_bit() -> None:
    near, far = two_sides(1, 30, 9, 0.0, 0.0)
    merged = merge_sides(near, far, 30)
    assert_array_equal(merged.x[near.nodes], near.x)
    assert_array_equal(merged.v[far.nodes], far.v)
    assert merged.gap == 0.0


def test_merging_takes_the_energy_of_the_jump() -> None:
    """Two copies of one node of 1 kg and 3 kg at speeds 1 and -1: mu = 3/4, the jump 2 costs mu 2^2/2 = 1.5 J."""
    x = np.zeros((1, 3))
    node = np.zeros(1, dtype=np.int32)
    near = Side(node, np.array([1.0]), x, np.array([[1.0, 0.0, 0.0]]))
    far = Side(node, np.array([3.0]), x, np.array([[-1.0, 0.0, 0.0]]))
    merged = merge_sides(near, far, 1)
    assert_allclose(merged.v, [[-0.5, 0.0, 0.0]])
    assert_allclose(0.5 * 4.0 * (merged.v**2).sum() - 0.5 * (1.0 + 3.0), -1.5)


def test_clamped_nodes_stay() -> None:
    near, far = two_sides(3, 15, 6, 1e-3, 1e-2)
    fixed = np.zeros(15, dtype=np.bool_)
    fixed[np.intersect1d(near.nodes, far.nodes)[:2]] = True
    free = merge_sides(near, far, 15)
    held = merge_sides(near, far, 15, fixed)
    check(near, far, held)
    plain = merge_sides(near, far, 15, np.ones(15, dtype=np.bool_))
    assert_array_equal(held.v[fixed], plain.v[fixed])
    assert not np.array_equal(free.v[fixed], plain.v[fixed])


def test_one_side_may_be_empty_and_the_body_must_be_covered() -> None:
    near, _ = two_sides(5, 6, 6, 0.0, 0.0)
    none = Side(np.zeros(0, dtype=np.int32), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    whole = Side(np.arange(6, dtype=np.int32), np.ones(6), near.x[:6], near.v[:6])
    assert_array_equal(merge_sides(whole, none, 6).x, whole.x)
    assert_array_equal(merge_sides(none, whole, 6).v, whole.v)
    with pytest.raises(ValueError, match="1 nodes have no mass"):
        merge_sides(whole, none, 7)
