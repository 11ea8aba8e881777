"""Every task is trained and judged by the same commands; what one of them has not is refused with the remedy.

Needs stable-baselines3, which continuous integration installs; elsewhere: pip install 'softseam[learn]'.
"""

from __future__ import annotations

import os
from dataclasses import replace
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rich.console import Console

from softseam.errors import BadInput
from softseam.gym.task_env import TaskEnv
from softseam.scenes import scene_path
from softseam_studies.cli_learning import Evaluate as Judgement
from softseam_studies.cli_learning import Train as Wishes
from softseam_studies.learn import train as training
from softseam_studies.learn.evaluate import THE_POLICY, episode, evaluate, learned
from softseam_studies.learn.policy import POLICY, TRAINING, Training, read_training
from softseam_studies.learn.tasks import TASKS, Rule
from softseam_studies.learn.train import one_of, train

learns = pytest.mark.skipif(
    find_spec("stable_baselines3") is None and not os.environ.get("CI"), reason="pip install 'softseam[learn]'"
)
COARSE = {"SliceLift": {"step": 0.04, "settings": ["body.cell=0.016"]}}
"""what makes a task cheaper, where its goal bears that"""


@learns
@pytest.mark.slow
def test_a_task_of_sessions_is_trained_and_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the files, the curve and the table of TofuLift, in the words of its own."""
    monkeypatch.setattr(training, "cores", lambda: 1)
    said, folder = Console(file=StringIO(), width=160), tmp_path / "policy"
    train(Wishes("PushGentle", "sac", 420, environments=4, out=folder), said)
    found = read_training(folder)
    assert (found.done, found.model, found.environments, found.stages) == (420, "fem", 4, ())
    assert {path.name for path in folder.iterdir()} == {POLICY, TRAINING, "curve.png"} and found.curve
    judged = evaluate(Judgement(folder, pieces=2, step=0.02), said)
    assert list(judged) == [THE_POLICY, *TASKS["PushGentle"].rules]
    assert isinstance(said.file, StringIO)
    told = said.file.getvalue()
    for word in ("reached", "bruised", "passed", "failed", "time", "largest stress", "2 of 6 episodes"):
        assert word in told


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("SliceLift", "close to 0.5 N"),
        ("PushGentle", "ahead at 12 % of full speed"),
        ("TowelFold", "half of a circle"),
    ],
)
def test_a_rule_of_each_task_reaches_its_goal(name: str, rule: str) -> None:
    """Of a piece that nothing was learned from, as `softseam evaluate` tells it."""
    task = TASKS[name]
    env = task.environment(**COARSE.get(name, {}))
    info = episode(env, task.rules[rule], seed=1_000_000)
    env.close()
    assert info["ending"] == task.make.GOAL and 0.0 < info[task.hardship.name] < np.inf


def test_a_shape_goes_with_the_training() -> None:
    """And so does how far it is, from which the weight of stress follows."""
    mesh = scene_path("dumpling").with_suffix(".obj")
    settings = ("body.shape.scale=0.001", "body.cell=0.016")
    known = Training("SliceLift", "ppo", 0, 4, 100, done=40, shape=str(mesh), settings=settings)
    env: TaskEnv[Any] = one_of(known)
    env.close()
    assert env.scene.name == "slice_lift" and env.trained == 40


@pytest.mark.parametrize(
    ("wishes", "why"),
    [
        (Wishes("PushGentle", model="xpbd"), r"--model xpbd: PushGentle is learned by fem: leave it out"),
        (Wishes("TofuLift", shape="bread.stl"), r"--shape bread\.stl: TofuLift has a body of its own.*SliceLift"),
        (Wishes("SliceLift", stages=True), r"--stages goes with batches of XPBD, and SliceLift is learned in single"),
        (Wishes("TowelFold", check=True), r"--check goes with batches of XPBD"),
        (Wishes("TofuLift", model="fem", check=True), r"--check goes with batches of XPBD"),
    ],
)
def test_what_a_task_has_not_is_refused(wishes: Wishes, why: str) -> None:
    with pytest.raises(BadInput, match=why):
        train(wishes, Console(quiet=True))


@learns
@pytest.mark.slow
def test_a_little_training_pushes_better_than_chance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one piece that bears much, at long steps: its policy is worth more than doing nothing and than noise."""
    given = {"step": 0.04, "randomise": None, "stress_limit": 2e3}
    task = TASKS["PushGentle"]
    monkeypatch.setitem(TASKS, "PushGentle", replace(task, learning={"reward": task.learning["reward"], **given}))
    monkeypatch.setattr(training, "Sessions", in_this_process)
    train(Wishes("PushGentle", steps=4096, out=tmp_path), Console(quiet=True))
    env = TASKS["PushGentle"].environment(**TASKS["PushGentle"].learning)
    policy, random = learned((tmp_path / POLICY).read_bytes(), "ppo", env), np.random.default_rng(0)
    worth = [
        np.mean([returned(env, rule, seed) for seed in range(8)])
        for rule in (policy, lambda seen, info: [0.0, 0.0], lambda seen, info: random.normal(0.0, 0.5, 2).tolist())
    ]
    env.close()
    assert worth[0] > max(worth[1:]) + 0.3


def in_this_process(make: Any, count: int, processes: int) -> Any:
    """What `Sessions` is for, by Gymnasium."""
    return SyncVectorEnv([make] * count, autoreset_mode=AutoresetMode.SAME_STEP)


def returned(env: TaskEnv[Any], rule: Rule, seed: int) -> float:
    """The sum of an episode's rewards."""
    (seen, info), total, over = env.reset(seed=seed), 0.0, False
    while not over:
        seen, reward, terminated, truncated, info = env.step(rule(seen, info))
        total, over = total + reward, terminated or truncated
    return total
