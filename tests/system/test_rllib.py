"""RLlib takes `BatchEnv` as the example hands it over: what it samples are whole episodes of lifts.

Needs what `ray[rllib]` brings but for Gymnasium, of which it wants one release and these tests use a later one;
continuous integration installs it, by .ci/ahead. A training starts a Ray of its own, for half a minute of processor
time, and is run by hand: `python -m softseam.examples.rllib_lift`.
"""

from __future__ import annotations

import os
from importlib.util import find_spec

import numpy as np
import pytest


@pytest.mark.slow
@pytest.mark.skipif(find_spec("tree") is None and not os.environ.get("CI"), reason="pip install 'ray[rllib]'")
def test_what_rllib_samples_are_episodes_of_the_batch() -> None:
    from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner

    from softseam.examples.rllib_lift import settings
    from softseam.gym import BatchEnv

    runner = SingleAgentEnvRunner(config=settings(pieces=8))
    batch = runner.env.unwrapped
    assert isinstance(batch, BatchEnv) and batch.num_envs == 8
    episodes = runner.sample(num_episodes=8, random_actions=True)
    runner.stop()
    assert len(episodes) == 8 and all(each.is_done for each in episodes)
    for each in episodes:
        seen, rewards = np.array(each.get_observations()), np.array(each.get_rewards())
        assert seen.shape == (len(each) + 1, 16) and len(rewards) == len(each) <= 80
        assert (seen[1:] != seen[:-1]).any(axis=1).all()  # none is of the piece that follows
        assert seen[0, -1] == 0.0 and -3.0 < rewards.sum() < 3.0
