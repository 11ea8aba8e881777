"""PushGentle: a scripted finger reaches the target; who does nothing, goes too fast or goes past it scores less."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from episodes import bits
from numpy.typing import NDArray

import softseam
from softseam.gym import PushGentle
from softseam.gym.push_gentle import BEYOND, NEAR, SEEN, STRESS_LIMIT
from softseam.gym.reward import Lift, Nearness, StressConcentration, Touch, Way

Rule = Callable[[NDArray[np.float32]], list[float]]
FULL = (Nearness(), Way(), Touch(), StressConcentration(0.5))


@pytest.fixture(scope="module")
def env() -> Iterator[PushGentle]:
    env = PushGentle(reward=FULL)
    yield env
    env.close()


def towards(speed: float) -> Rule:
    """Ahead until something is touched, then along the line to the target, by what is seen alone."""

    def rule(seen: NDArray[np.float32]) -> list[float]:
        now = dict(zip(SEEN, seen.tolist(), strict=True))
        if now["finger in contact"] == 0.0 and now["force ahead"] == 0.0:
            return [speed, 0.0]
        ahead, aside = 0.05 * now["target ahead of the marker"], 0.01 * now["target aside of it"]
        return [speed, 6.0 * speed * float(np.clip(aside / max(ahead, NEAR), -0.5, 0.5))]

    return rule


def push(env: PushGentle, rule: Rule, seed: int) -> tuple[float, dict[str, Any]]:
    seen, _ = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        seen, reward, terminated, truncated, info = env.step(rule(seen))
        assert seen in env.observation_space and np.abs(seen).max() < 4.0
        total, over = total + reward, terminated or truncated
    return total, info


@pytest.mark.kernels
def test_a_gentle_push_reaches_targets_and_scores_most(env: PushGentle) -> None:
    gentle = [push(env, towards(0.12), seed) for seed in range(5)]
    hard = [push(env, towards(1.0), seed) for seed in range(4)]
    nothing, idle = push(env, lambda seen: [0.0, 0.0], 0)
    assert all(info["ending"] == "reached" and info["distance"] <= NEAR for _, info in gentle)
    assert all(info["stress"] <= STRESS_LIMIT for _, info in gentle)
    assert sum(info["ending"] == "bruised" for _, info in hard) >= 2
    assert idle["ending"] == "time" and nothing < 0.0
    returns = [float(np.mean([total for total, _ in each])) for each in (gentle, hard)]
    assert returns[0] > 2.0 > returns[1] + 0.5


@pytest.mark.kernels
def test_each_part_of_a_push_pays(env: PushGentle) -> None:
    """No valley between the air and the target, in which an agent would stay."""
    seen, _ = env.reset(seed=1)
    rewards = {"air": 0.0, "way": 0.0}
    over = False
    while not over:
        phase = "air" if seen[SEEN.index("finger in contact")] == 0.0 else "way"
        seen, reward, terminated, truncated, info = env.step(towards(0.12)(seen))
        rewards[phase] += 0.0 if info["ending"] else reward
        over = terminated or truncated
    assert info["is_success"] and min(rewards.values()) > 0.1


@pytest.mark.kernels
def test_who_goes_past_the_target_has_failed() -> None:
    """Straight ahead, where the target is 6 mm aside."""
    env = PushGentle(reward=FULL, randomise=None, stress_limit=1e5)
    total, info = push(env, lambda seen: [0.2, 0.0], 0)
    env.close()
    assert info["ending"] == "passed" and not info["is_success"] and info["distance"] >= BEYOND
    assert total < 1.0


@pytest.mark.kernels
def test_targets_are_drawn_by_the_seed_whatever_else_varies(env: PushGentle) -> None:
    alike = PushGentle(reward=FULL, randomise=None)
    found = []
    for each in (env, alike, env):
        rows = [each.reset(seed=3)[0], each.reset()[0], each.reset()[0]]
        found.append([(row[6], row[7]) for row in rows])
    alike.close()
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-5)  # of a seed's first episode
    assert found[0] == found[2]
    ahead, aside = np.array(found[0]).T
    assert np.ptp(ahead) > 0.05 and (0.6 <= ahead).all() and (ahead <= 1.2).all()
    assert np.ptp(aside) > 0.05 and (np.abs(aside) <= 0.8).all()


@pytest.mark.kernels
def test_the_finger_goes_no_farther_back_than_it_began_nor_far_aside(env: PushGentle) -> None:
    env.reset(seed=0)
    start = env.session.last.tools["finger"].position
    for _ in range(6):
        env.step([-1.0, 1.0])
    at = env.session.last.tools["finger"].position
    np.testing.assert_allclose(at - start, [0.0, 0.02, 0.0], atol=1e-9)


@pytest.mark.kernels
def test_an_episode_knows_nothing_of_those_before_it(env: PushGentle) -> None:
    fresh = PushGentle(reward=FULL)
    assert bits(env, 5, 40) == bits(fresh, 5, 40)
    fresh.close()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"stress_limit": 0.0}, "stress_limit=0.0"),
        ({"stress_limit": float("nan")}, "stress_limit=nan"),
        ({"step": 0.03}, "step=0.03"),
        ({"reward": [Lift()]}, "Lift looks at 'lift', and this task has distance, aside, air, force, stress, energy"),
    ],
)
def test_what_cannot_be_an_environment_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(softseam.BadInput, match=told):
        PushGentle(**given)
