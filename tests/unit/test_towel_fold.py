"""TowelFold: scripted grippers fold the towel, and it stays folded; what is torn or left alone scores less."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from episodes import bits
from numpy.typing import NDArray

import softseam
from softseam.gym import TowelFold
from softseam.gym.reward import Corners, FoldedArea, Nearness
from softseam.gym.towel_fold import CORNERS, GRIPPERS, TORN

Seen = NDArray[np.float32]
Rule = Callable[[Seen], NDArray[np.float64]]
EDGE, ACT, SPEED = 0.5, 0.04, 0.5


@pytest.fixture(scope="module")
def env() -> Iterator[TowelFold]:
    env = TowelFold(divisions=16)
    yield env
    env.close()


def over_an_arc(speed: float = 0.3) -> Rule:
    """Both grippers along a flat half of a circle to the other edge, then straight to where the corners belong."""
    actions, taken = int(0.5 * math.pi * EDGE / speed / ACT), iter(range(1, 1000))

    def rule(seen: Seen) -> NDArray[np.float64]:
        way, to_go = EDGE * seen[:6].reshape(2, 3).astype(np.float64), EDGE * seen[12:18].reshape(2, 3)
        part, half = next(taken) / actions, 0.5 * EDGE
        angle = math.pi * part
        goal = np.tile([half * (math.cos(angle) - 1.0), 0.0, 0.85 * half * math.sin(angle)], (2, 1))
        return np.clip(((goal if part <= 1.0 else way + to_go) - way) / ACT / SPEED, -1.0, 1.0).ravel()

    return rule


def fold(env: TowelFold, rule: Rule, seed: int) -> tuple[float, dict[str, Any]]:
    seen, _ = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        seen, reward, terminated, truncated, info = env.step(rule(seen))
        assert seen in env.observation_space
        total, over = total + reward, terminated or truncated
    return total, info


@pytest.mark.kernels
def test_a_scripted_fold_is_one_and_stays_one(env: TowelFold) -> None:
    """Towels of other weight, stiffness and friction, too; let go, the corners stay where they are."""
    for seed in range(2):
        total, info = fold(env, over_an_arc(), seed)
        assert info["ending"] == "folded" and info["is_success"] and total > 3.0
        assert info["corners"] <= CORNERS and info["area"] == 1.0 and info["stretch"] < 0.15
    last = env.session.step({name: [0.0] * 7 for name in GRIPPERS}, count=20)
    x = last.positions
    half_as_long = np.ptp(x[:, 0]) < 0.6 * EDGE
    assert half_as_long and last.quantities["held"] == 0.0
    assert x[:, 2].max() < 0.1 * EDGE


@pytest.mark.kernels
def test_nothing_and_half_a_fold_score_less(env: TowelFold) -> None:
    nothing, idle = fold(env, lambda seen: np.zeros(6), 0)
    half_way = over_an_arc()
    half, lifted = fold(env, lambda seen: half_way(seen) if seen[-1] < 0.25 else np.zeros(6), 0)
    whole, _ = fold(env, over_an_arc(), 0)
    assert idle["ending"] == lifted["ending"] == "time" and idle["corners"] == pytest.approx(1.0, abs=0.01)
    assert nothing < 0.0 and nothing + 0.2 < half < whole - 1.0


@pytest.mark.kernels
def test_a_towel_that_is_pulled_apart_is_torn(env: TowelFold) -> None:
    total, info = fold(env, lambda seen: np.array([0.0, -1.0, 0.0, 0.0, 1.0, 0.0]), 0)
    assert info["ending"] == "torn" and info["stretch"] > TORN and total < -1.0


@pytest.mark.kernels
def test_one_gripper_alone_folds_a_corner_and_not_the_towel(env: TowelFold) -> None:
    arc = over_an_arc()
    _, info = fold(env, lambda seen: arc(seen) * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], 0)
    assert not info["is_success"] and info["corners"] > 0.3 and info["area"] < 0.9


@pytest.mark.kernels
def test_grippers_sink_no_lower_than_they_began_and_hold_two_corners(env: TowelFold) -> None:
    env.reset(seed=0)
    start = [env.session.last.tools[name].position for name in GRIPPERS]
    seen, *_, info = env.step([0.0, 0.0, -1.0] * 2)
    for name, before in zip(GRIPPERS, start, strict=True):
        np.testing.assert_allclose(env.session.last.tools[name].position, before, atol=1e-9)
    assert info["held"] >= 4.0 and not seen[:6].any()


@pytest.mark.kernels
def test_an_episode_knows_nothing_of_those_before_it(env: TowelFold) -> None:
    fresh = TowelFold(divisions=16)
    assert bits(env, 5, 40) == bits(fresh, 5, 40)
    assert bits(env, 6, 5) != bits(env, 5, 5)
    fresh.close()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"divisions": 4}, "divisions=4"),
        ({"divisions": 20.5}, "divisions=20.5"),
        ({"spread": 1.0}, "spread=1.0"),
        ({"step": 0.03}, "step=0.03"),
        ({"reward": [Corners(), FoldedArea(), Nearness()]}, "Nearness looks at 'distance', and this task has corners"),
    ],
)
def test_what_cannot_be_an_environment_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(softseam.BadInput, match=told):
        TowelFold(**given)
