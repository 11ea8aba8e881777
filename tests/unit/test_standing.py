"""What tools carry of bodies that sleep."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_services.orchestrator.standing import passed_down, with_more


def test_a_tower_passes_on_what_is_lacking() -> None:
    """Three, of which the upper two lack something: the ground carries it; one beside them, that nothing carries, and
    one on that, are left as they are."""
    lacks = np.array([0.0, 0.02, -0.01, 0.3, 0.1])
    pairs, carried = np.array([[0, 1], [2, 1], [4, 3]]), np.array([2.0, 1.0, 1.0])
    by_tools = np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    more = passed_down(lacks, pairs, carried, by_tools)
    assert by_tools[0] * more[0] == pytest.approx(0.01, rel=1e-12)
    assert carried[0] * (more[1] - more[0]) == pytest.approx(0.01, rel=1e-12)
    assert carried[1] * (more[2] - more[1]) == pytest.approx(-0.01, rel=1e-12)
    np.testing.assert_array_equal(more[3:], 0.0)


def test_two_ways_down_share_by_what_they_carry() -> None:
    """One on two others, of which one carries three times as much; what it lacks goes the same ways."""
    more = passed_down(
        np.array([0.04, 0.0, 0.0]), np.array([[0, 1], [0, 2]]), np.array([3.0, 1.0]), np.array([0.0, 3.0, 1.0])
    )
    np.testing.assert_allclose(np.array([3.0, 1.0]) * more[1:], [0.03, 0.01], rtol=1e-12)


def test_more_force_acts_on_the_same_line() -> None:
    at, force, more = np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.0, -2.0]), np.array([0.0, 0.0, -0.1])
    wrench = np.concatenate([force, np.cross(at, force)])
    np.testing.assert_allclose(with_more(wrench, more), np.concatenate([force + more, np.cross(at, force + more)]))
    np.testing.assert_array_equal(with_more(np.zeros((2, 6)), np.zeros((2, 3))), 0.0)
