"""Environments under random actions, and under the checkers of Gymnasium and stable-baselines3.

A million random actions: `PYTHONPATH=tests python tests/benchmarks/soak.py`.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import pytest
from episodes import soak, soak_many
from gymnasium.utils.env_checker import check_env

from softseam.gym import BatchEnv, PushGentle, SliceLift, TofuLift, TowelFold
from softseam.gym.task_env import TaskEnv

pytestmark = pytest.mark.kernels

Make = Callable[[], TaskEnv[Any]]
EACH = pytest.mark.parametrize(
    ("make", "actions"),
    [
        (TofuLift, 100),
        (lambda: SliceLift(settings=["body.cell=0.016"]), 100),
        (PushGentle, 200),
        (lambda: TowelFold(divisions=12), 200),
    ],
    ids=["TofuLift", "SliceLift", "PushGentle", "TowelFold"],
)


@EACH
def test_random_actions_give_numbers_and_refusals_have_names(make: Make, actions: int) -> None:
    env = make()
    words = soak(env, actions, seed=5)
    env.close()
    assert sum(words.values()) >= 2 and "" not in words


def test_so_they_do_for_many_pieces() -> None:
    envs = BatchEnv(32)
    words = soak_many(envs, 4000, seed=1)
    envs.close()
    assert words["crushed"] >= 5 and words["time"] >= 5


@EACH
def test_gymnasium_finds_nothing_to_object(make: Make, actions: int) -> None:
    env = make()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(env, skip_close_check=True)
    env.close()
    assert not [str(each.message) for each in warned if "render modes" not in str(each.message)]


@pytest.mark.skipif(
    find_spec("stable_baselines3") is None and not os.environ.get("CI"), reason="pip install 'softseam[learn]'"
)
@EACH
def test_stable_baselines3_finds_nothing_to_object(make: Make, actions: int) -> None:
    from stable_baselines3.common.env_checker import check_env as check

    env = make()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env)
    env.close()
