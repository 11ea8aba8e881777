"""Episodes that a rule plays in an environment, and random ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

import softseam
from softseam.gym import BatchEnv
from softseam.gym.task_env import TaskEnv

REFUSED = 0.02
"""how often a soak tries an action that is none"""
Rule = Callable[[dict[str, Any]], list[float]]


def episode(env: TaskEnv[Any], rule: Rule, seed: int) -> tuple[float, dict[str, Any]]:
    """The return of an episode, and what `info` says at its end."""
    _, info = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        _, reward, terminated, truncated, info = env.step(rule(info))
        total, over = total + reward, terminated or truncated
    return total, info


def bits(env: TaskEnv[Any], seed: int, actions: int) -> bytes:
    """All that is seen and rewarded in an episode of random actions, which the seed draws."""
    random, (seen, _) = np.random.default_rng(seed), env.reset(seed=seed)
    found = [seen.tobytes()]
    for _ in range(actions):
        seen, reward, terminated, truncated, _ = env.step(random.uniform(-1.0, 1.0, env.action_space.shape))
        found.append(seen.tobytes() + np.float64(reward).tobytes())
        if terminated or truncated:
            break
    return b"".join(found)


def soak(env: TaskEnv[Any], actions: int, seed: int) -> Counter[str]:
    """How many episodes of random actions ended with which word; each episode drifts its own way, so that some crush.

    Raises AssertionError for a number that is none, and whatever is not refused by name.
    """
    random, shape = np.random.default_rng(seed), env.action_space.shape or ()
    words: Counter[str] = Counter()
    env.reset(seed=seed)
    drift = random.uniform(-1.0, 1.0, shape)
    for _ in range(actions):
        if random.random() < REFUSED:
            refused(env, np.full(shape, np.nan))
        seen, reward, terminated, truncated, info = env.step(drift + random.uniform(-0.7, 0.7, shape))
        assert env.observation_space.contains(seen) and np.isfinite(seen).all() and np.isfinite(reward)
        assert all(np.isfinite(value) for value in info.values() if not isinstance(value, str)), info
        if terminated or truncated:
            words[info["ending"]] += 1
            env.reset()
            drift = random.uniform(-1.0, 1.0, shape)
    return words


def soak_many(envs: BatchEnv, actions: int, seed: int) -> Counter[str]:
    """The same of many pieces, as many actions in all of them together."""
    random, shape = np.random.default_rng(seed), (envs.num_envs, 2)
    words: Counter[str] = Counter()
    envs.reset(seed=seed)
    drift = random.uniform(-1.0, 1.0, shape)
    for _ in range(actions // envs.num_envs):
        if random.random() < REFUSED:
            refused(envs, np.full(shape, np.inf))
        seen, reward, terminated, truncated, info = envs.step(drift + random.uniform(-0.7, 0.7, shape))
        assert np.isfinite(seen).all() and np.isfinite(reward).all() and envs.observation_space.contains(seen)
        assert all(np.isfinite(value).all() for value in info.values())
        success, over = info["is_success"], terminated | truncated
        words.update(lifted=int(success.sum()), crushed=int((terminated & ~success).sum()), time=int(truncated.sum()))
        drift[over] = random.uniform(-1.0, 1.0, (int(over.sum()), 2))
    return words


def refused(env: Any, action: Any) -> None:
    """Raises AssertionError where an action that is no number is taken."""
    try:
        env.step(action)
    except softseam.BadInput:
        return
    raise AssertionError(f"{action} was taken")
