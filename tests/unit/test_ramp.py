"""Moves and turns that speed up and slow down within an acceleration: how far after which time, and exact ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_program import played

from softseam_protocol.scene.motion import MovePhase, TurnPhase
from softseam_protocol.scene.ramp import Ramp

CASES = [(0.05, 0.05, 0.2), (0.05, 0.05, 0.02), (0.3, 2.0, 11.0), (1e-4, 0.5, 3.0)]
"""length [m], speed [m/s], acceleration [m/s^2]: with and without a stretch at full speed"""


@pytest.mark.parametrize(("length", "speed", "acceleration"), CASES)
def test_speed_and_acceleration_stay_within_their_limits_and_are_used(
    length: float, speed: float, acceleration: float
) -> None:
    ramp = Ramp(length, speed, acceleration)
    time = np.linspace(0.0, ramp.time, 4001)
    way = np.array([ramp.gone(float(t)) for t in time])
    velocity = np.gradient(way, time, edge_order=2)
    change = np.gradient(velocity, time, edge_order=2)
    assert way[0] == 0.0 and way[-1] == pytest.approx(length, rel=1e-12)
    assert np.all(np.diff(way) >= 0.0) and velocity.max() <= speed * (1.0 + 1e-6)
    assert np.abs(change).max() == pytest.approx(acceleration, rel=2e-3)
    assert velocity[0] == pytest.approx(0.0, abs=2e-3 * speed)
    assert change[0] == pytest.approx(0.0, abs=0.02 * acceleration)
    np.testing.assert_allclose(way, length - way[::-1], atol=1e-9 * length)  # slows down as it sped up


def test_without_an_acceleration_the_speed_is_even() -> None:
    ramp = Ramp(0.3, 0.1, None)
    assert ramp.time == pytest.approx(3.0) and ramp.gone(0.5) == pytest.approx(0.05)


MOVE: dict[str, Any] = {"tools": ["left", "right"], "move": [0.0, 0.01, 0.03], "speed": 0.07, "acceleration": 0.3}
TURN: dict[str, Any] = {"tools": ["left", "right"], "turn": [0.0, 0.0, 0.3], "speed": 1.1, "acceleration": 5.0}


@pytest.mark.kernels
@pytest.mark.parametrize("step", [0.004, 0.03, 0.2])
def test_poses_at_the_end_of_a_step_are_those_of_the_exact_motion(step: float) -> None:
    motion: list[dict[str, Any]] = [{"hold": 0.0123}, MOVE, {"hold": 0.02}]
    places, _, _ = played(step, motion)
    phase = MovePhase.model_validate(MOVE)
    for number, place in enumerate(places):
        share = phase.ramp.gone(min(max(0.0, number * step - 0.0123), phase.ramp.time)) / phase.length
        np.testing.assert_allclose(place[0] - places[0, 0], share * np.array(MOVE["move"]), atol=1e-12)
    np.testing.assert_allclose(places[-1] - places[0], np.tile(MOVE["move"], (2, 1)), atol=1e-12)


@pytest.mark.kernels
def test_a_turn_ends_where_it_is_to() -> None:
    _, turns, _ = played(0.01, [TURN])
    np.testing.assert_allclose(turns[-1, 0], [np.cos(0.15), 0, 0, np.sin(0.15)], atol=1e-12)
    phase = TurnPhase.model_validate(TURN)
    angle = 2.0 * np.arctan2(turns[3, 0, 3], turns[3, 0, 0])
    assert angle == pytest.approx(phase.ramp.gone(0.03), abs=1e-12)
