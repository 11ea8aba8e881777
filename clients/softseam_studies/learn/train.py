"""`softseam train`: learn a task with stable-baselines3, and leave the policy, how it was learned, and the curve."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from rich.console import Console

from softseam.bar import Bar
from softseam.errors import BadInput, SoftseamError, missing_extra
from softseam.gym.task_env import TaskEnv
from softseam.outputs import check_outputs, whole
from softseam_protocol.facts import cores
from softseam_studies.cli_learning import Train
from softseam_studies.learn.check import Beside, show_checks
from softseam_studies.learn.policy import POLICY, Algorithm, Training, read_training
from softseam_studies.learn.sessions import Sessions
from softseam_studies.learn.tasks import TASKS, Stage, Task, task_of
from softseam_studies.learn.weights import NETWORK, go_on

_KEPT = 100
"""episodes that the curve is a mean of"""
ROW = 2_000
"""steps between rows of the curve"""
SAVE = 20_000
"""steps between checkpoints"""
WAIT = 20.0
"""for the last check [s]"""


def train(wishes: Train, console: Console) -> Path:
    """Learn, and return the folder; interrupted, what was learned is kept. Raises BadInput and MissingExtra."""
    task = task_of(wishes.task)
    folder = wishes.out or Path("out") / f"{wishes.task}-{wishes.algorithm}-{wishes.seed}"
    steps = task.steps if wishes.steps is None else wishes.steps
    environments = task.environments if wishes.environments is None else wishes.environments
    if steps < 1 or environments < 1:
        raise BadInput("--steps and --environments: give 1 or more")
    if wishes.resume:
        known = read_training(folder)
        training = replace(known, steps=known.steps if wishes.steps is None else steps)
        if training.done >= training.steps:
            raise BadInput(f"{folder} has its {training.done} steps already: give more with --steps")
    else:
        if (folder / POLICY).exists():
            raise BadInput(f"{folder} holds a policy already: go on with --resume, or choose another folder with --out")
        _check(wishes, task)
        training = Training(
            *(wishes.task, wishes.algorithm, wishes.seed, environments, steps),
            model=wishes.model or task.models[0],
            shape=wishes.shape,
            settings=wishes.settings,
            stages=stages_of(wishes),
        )
    check_outputs([("--out", folder / POLICY)], inputs={})
    _learn(training, folder, console, wishes)
    return folder


def _check(wishes: Train, task: Task) -> None:
    """Raises BadInput where the task has not what is asked for."""
    if wishes.model is not None and wishes.model not in task.models:
        raise BadInput(f"--model {wishes.model}: {wishes.task} is learned by {' or '.join(task.models)}: leave it out")
    if wishes.shape is not None and not task.shaped:
        shaped = ", ".join(name for name, each in TASKS.items() if each.shaped)
        raise BadInput(f"--shape {wishes.shape}: {wishes.task} has a body of its own: leave it out, or learn {shaped}")
    batched = task.batch is not None and (wishes.model or task.models[0]) == "xpbd"
    for option, asked in (("--stages", wishes.stages), ("--check", wishes.check)):
        if asked and not batched:
            raise BadInput(
                f"{option} goes with batches of XPBD, and {wishes.task} is learned in single sessions: leave it out"
            )


def stages_of(wishes: Train) -> tuple[Stage, ...]:
    """The task's; none without batches of XPBD, or on cells that were asked for."""
    task = TASKS[wishes.task]
    said = any(setting.startswith("body.cell") for setting in wishes.settings)
    xpbd = (wishes.model or task.models[0]) == "xpbd"
    return task.stages if wishes.stages is not False and xpbd and not said else ()


def _learn(training: Training, folder: Path, console: Console, wishes: Train) -> None:
    """To the end, or until it is interrupted."""
    try:
        import torch
        from stable_baselines3.common.callbacks import BaseCallback

        # before there is anything to keep: a module that an interrupt cuts short cannot be imported again
        import softseam_studies.learn.curve  # noqa: F401
    except ImportError as error:
        raise missing_extra(error, "training") from error
    torch.set_num_threads(1)  # networks this small are slower on two
    task = TASKS[training.task]
    vector = vectorised(training)
    if wishes.resume:
        try:
            learner = load_learner(training, folder / POLICY, vector)
        except BadInput:
            vector.close()
            raise
    else:
        learner = new_learner(training, vector)
    beside = None
    if wishes.check is not False and batched(training):
        beside = Beside(vector.batch, training.settings)
        vector.watch = beside.see
    keeper = _Keeper(training, folder, learner, beside)
    bar = Bar(console, f"{training.task}, {training.algorithm}", float(training.steps))

    class Watch(BaseCallback):  # type: ignore[misc]
        def _on_rollout_start(self) -> None:
            if training.algorithm == "ppo":
                part = min(self.num_timesteps / training.steps, 1.0)
                learner.policy.log_std.data.fill_(float(np.interp(part, (0.0, 1.0), task.spread)))

        def _on_step(self) -> bool:
            keeper.see(self.num_timesteps, self.locals["infos"], self.locals["dones"])
            done = keeper.training.done
            bar.show(float(done), f"{done:,} of {training.steps:,} steps; {keeper.state}")
            return True

    try:
        while (now := keeper.training).done < training.steps:
            if keeper.go_on():
                console.print(f"{keeper.training.stage} from {now.done:,} steps on", highlight=False)
                vector.close()
                vector = vectorised(keeper.training)
                learner.set_env(vector)
                if beside is not None:
                    beside.follow(vector.batch)
                    vector.watch = beside.see
            learner.learn(keeper.until - now.done, callback=Watch(), reset_num_timesteps=False)
        keeper.wait()
    except (KeyboardInterrupt, SoftseamError):
        bar.stop()
        keeper.save()
        console.print(f"stopped after {keeper.training.done:,} steps; go on with: softseam train --resume "
                      f"--out {folder}", soft_wrap=True, highlight=False)  # fmt: skip
        raise
    finally:
        bar.stop()
        vector.close()
        silence, lost = "", False
        if beside is not None:
            silence, lost = beside.silence(), not beside.alive
            beside.close()
    keeper.save()
    done = f"{folder}: {keeper.training.done:,} steps in {keeper.training.seconds:.0f} s"
    console.print(f"{done}; of the last {_KEPT} episodes {keeper.state}", soft_wrap=True, highlight=False)
    if keeper.training.checks:
        show_checks(console, keeper.training.checks)
    checked = len(keeper.training.checks) - len(training.checks)
    if beside is not None and (lost or not checked):
        console.print(f"episodes checked by FEM: {checked or 'none'}, as {silence}; evaluate judges the policy by FEM",
                      style="yellow", soft_wrap=True, highlight=False)  # fmt: skip
    console.print(f"judge it: softseam evaluate {folder}", soft_wrap=True, highlight=False)


def vectorised(training: Training) -> Any:
    """The environments: a batch of XPBD in this process, where the task has that, or sessions in others."""
    from softseam_studies.learn.vector import BatchVec

    task, several = TASKS[training.task], training.environments
    many: VectorEnv[Any, Any, Any]
    if batched(training):
        assert task.batch is not None
        settings = (*(training.stage.settings if training.stage else ()), *training.settings)
        many = task.batch(several, autoreset_mode="SAME_STEP", threads=cores(), settings=settings)
        many.steps = training.done
    else:
        many = Sessions(partial(one_of, training), several, cores())
    vector = BatchVec(many, task.hardship.name, task.deadline)
    vector.seed(training.seed + training.done)
    return vector


def batched(training: Training) -> bool:
    """Whether it learns from batches of XPBD."""
    return TASKS[training.task].batch is not None and training.model == "xpbd"


def one_of(training: Training) -> TaskEnv[Any]:
    """One of its environments, which goes on where the training is."""
    task = TASKS[training.task]
    env = task.environment(environments=training.environments, **task.learning, **training.options)
    env.steps = training.done // training.environments
    return env


def algorithm(name: Algorithm) -> Any:
    """The class that learns by it."""
    import stable_baselines3

    return {"ppo": stable_baselines3.PPO, "sac": stable_baselines3.SAC}[name]


def load_learner(training: Training, saved: Path, vector: Any) -> Any:
    """What learned so far, to go on in the environments `vector`. Raises BadInput where the file is none of it."""
    learner = new_learner(training, vector)
    go_on(learner, training.algorithm, saved, training.done)
    return learner


def new_learner(training: Training, vector: Any) -> Any:
    """With constants that learn the tasks (docs/decisions/40, 59)."""
    task = TASKS[training.task]
    shared: dict[str, Any] = {"seed": training.seed, "device": "cpu", "learning_rate": 5e-4}
    if training.algorithm == "sac":
        # rewards are small beside the entropy that it begins with by default, and change with the weight of stress
        return algorithm("sac")(
            "MlpPolicy",
            vector,
            gamma=0.98,
            ent_coef="auto_0.02",
            train_freq=1,
            gradient_steps=max(training.environments // 4, 1),
            buffer_size=60_000,
            policy_kwargs=dict(NETWORK),
            **shared,
        )
    return algorithm("ppo")(
        "MlpPolicy",
        vector,
        gamma=task.gamma,
        n_steps=max(task.rollout // training.environments, 8),
        batch_size=task.rollout // 4,
        n_epochs=10,
        policy_kwargs=NETWORK | {"log_std_init": task.spread[0]},
        **shared,
    )


class _Keeper:
    """What is known of the training so far, and how it is kept."""

    def __init__(self, training: Training, folder: Path, learner: Any, beside: Beside | None) -> None:
        self.training, self._folder, self._learner, self._beside = training, folder, learner, beside
        self._hardship = TASKS[training.task].hardship
        self._began, self._spent = perf_counter(), training.seconds
        self._episodes: deque[tuple[float, float, float]] = deque(maxlen=_KEPT)
        self._rows, self._checks = list(training.curve), list(training.checks)
        self._saved = training.done

    def see(self, steps: int, infos: Sequence[dict[str, Any]], dones: Sequence[bool]) -> None:
        """One step of all environments."""
        for info, done in zip(infos, dones, strict=True):
            if done:
                self._episodes.append((info["episode"]["r"], info["is_success"], info["hardship"]))
        self.training = replace(self.training, done=steps)
        if self._episodes and steps >= (self._rows[-1][0] if self._rows else 0) + ROW:
            self._add(steps)
        self._take_check()
        if steps >= self._saved + SAVE:
            self.save()

    @property
    def until(self) -> int:
        """How many steps it may take until it is looked at whether the next stage begins."""
        now = self.training
        if len(now.begun) + 1 >= len(now.stages):
            return now.steps
        assert now.stage is not None
        return min(max(math.ceil(now.stage.part * now.steps), now.done + ROW), now.steps)

    def go_on(self) -> bool:
        """Begin the next stage, if it is time."""
        now = self.training
        if len(now.begun) + 1 >= len(now.stages) or not self._rows:
            return False
        assert now.stage is not None
        if not now.stage.over(now.done / now.steps, self._rows[-1][2]):
            return False
        self.training = replace(now, begun=(*now.begun, now.done))
        return True

    def wait(self) -> None:
        """For the last check, if that does not take long."""
        self._take_check(WAIT)

    @property
    def state(self) -> str:
        if not self._rows:
            return "none is over yet"
        _, reward, success, hardship = self._rows[-1]
        return f"{success:.0%} succeed, return {reward:.2f}, {self._hardship.title} {self._hardship.text(hardship)}"

    def _take_check(self, seconds: float = 0.0) -> None:
        if self._beside is not None and (check := self._beside.ended(seconds)) is not None:
            self._checks.append(check)

    def _add(self, steps: int) -> None:
        reward, success, hardship = (float(value) for value in np.mean(self._episodes, axis=0))
        self._rows.append((steps, reward, success, hardship))

    def save(self) -> None:
        """The policy first, all or nothing, then how it was learned, then the curve."""
        if self._episodes and (not self._rows or self._rows[-1][0] < self.training.done):
            self._add(self.training.done)
        seconds = self._spent + perf_counter() - self._began
        self.training = replace(self.training, curve=tuple(self._rows), seconds=seconds, checks=tuple(self._checks))
        self._saved = self.training.done
        with whole(self._folder / POLICY) as fresh:
            self._learner.save(fresh)
        self.training.write(self._folder)
        if self._rows:
            from softseam_studies.learn.curve import draw_curve

            draw_curve(self.training, self._folder / "curve.png")
