"""Learn to lift tofu with RLlib's PPO, from many pieces at once: RLlib's environments are those of one `BatchEnv`.

RLlib wants one release of Gymnasium and brings much else, so it goes into an environment of its own:

    pip install 'softseam[solve,gym]' 'ray[rllib]>=2.60,<3' torch
    python -m softseam.examples.rllib_lift [ITERATIONS [PIECES]]
"""

import sys
from typing import Any

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

from softseam.gym import BatchEnv
from softseam.gym.task_env import ACT

ROLLOUT = 64
"""actions of each piece in an iteration"""


def many(wanted: dict[str, Any]) -> BatchEnv:
    """What RLlib runs."""
    return BatchEnv(wanted["num_envs"])


def settings(pieces: int) -> PPOConfig:
    """The numbers of `softseam train`, but for the spread of first actions, which RLlib does not take."""
    register_env("TofuLift", many)
    return (
        PPOConfig()
        .environment("TofuLift")
        .env_runners(
            num_env_runners=0,  # in this process: pieces are stepped together anyway
            num_envs_per_env_runner=pieces,
            gym_env_vectorize_mode="vector_entry_point",
            rollout_fragment_length=ROLLOUT,
        )
        .training(
            train_batch_size=pieces * ROLLOUT,
            minibatch_size=min(1024, pieces * ROLLOUT),
            num_epochs=10,
            lr=5e-4,
            gamma=0.98,
            entropy_coeff=0.0,
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64], fcnet_activation="tanh"))
        .debugging(seed=0)
    )


def _told(found: dict[str, Any]) -> dict[str, float]:
    """Actions taken, mean return and length [s] of the latest episodes."""
    return {
        "actions": float(found["num_env_steps_sampled_lifetime"]),
        "return": float(found.get("episode_return_mean", float("nan"))),
        "seconds": ACT * float(found.get("episode_len_mean", float("nan"))),
    }


def main(iterations: int = 4, pieces: int = 64) -> None:
    algorithm = settings(pieces).build_algo()
    print("  actions    return   episodes last")
    try:
        for _ in range(iterations):
            each = _told(algorithm.train()["env_runners"])
            print(f"{each['actions']:9,.0f} {each['return']:9.3f} {each['seconds']:10.2f} s")
    finally:
        algorithm.stop()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
