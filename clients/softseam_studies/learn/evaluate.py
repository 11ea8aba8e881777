"""`softseam evaluate`: a policy on pieces that it has not seen, beside rules, and the best and the worst to replay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from softseam.bar import Bar
from softseam.errors import BadInput, missing_extra
from softseam.gym.task_env import TaskEnv
from softseam_studies.cli_learning import Evaluate
from softseam_studies.cluster import share
from softseam_studies.learn.policy import POLICY, Algorithm, Training, read_training
from softseam_studies.learn.tasks import TASKS, Rule

UNSEEN = 1_000_000
"""the first seed of pieces that no training begins with"""
THE_POLICY = "the policy"
"""its row beside those of the rules"""
ANY_TASK = ("failed", "time")
"""words with which an episode of any task may end: without a solution, out of time"""
Ending = tuple[str, float]
"""of an episode: its word, and the hardship of its task"""


@dataclass(frozen=True)
class Judged:
    """What became of each of n pieces."""

    ending: NDArray[np.str_]
    """word of each (n,)"""
    hardship: NDArray[np.float64]
    """largest of each, see `Task` (n,)"""

    @classmethod
    def of(cls, endings: Sequence[Ending]) -> Judged:
        words, hardship = zip(*endings, strict=True)
        return cls(np.array(words), np.array(hardship, dtype=np.float64))

    def part(self, word: str) -> float:
        """Of the pieces that ended so."""
        return float((self.ending == word).mean())


class Judge:
    """Plays unseen pieces by a policy, or by a rule of its task; what becomes of one does not depend on those before.

    policy    what stable-baselines3 saved
    training  that made it
    step      of the simulation [s]
    record    folder for a recording of each episode
    """

    def __init__(self, policy: bytes, training: Training, step: float, record: Path | None = None) -> None:
        """Raises BadInput and MissingExtra."""
        task = TASKS[training.task]
        self._env, self._hardship = task.environment(step=step, record=record, **training.options), task.hardship.name
        try:
            self._rules = {**task.rules, THE_POLICY: learned(policy, training.algorithm, self._env)}
        except BaseException:
            self._env.close()
            raise

    def __call__(self, work: tuple[str, int]) -> Ending:
        """By whom, and the number of the piece."""
        name, number = work
        info = episode(self._env, self._rules[name], UNSEEN + number)
        return info["ending"], float(info[self._hardship])

    def close(self) -> None:
        self._env.close()


def learned(policy: bytes, algorithm: Algorithm, env: TaskEnv[Any]) -> Rule:
    """What a policy does, by its weights alone. Raises MissingExtra, and BadInput where it is none of env."""
    try:
        import stable_baselines3  # noqa: F401
        import torch

        from softseam_studies.learn.weights import load_policy
    except ImportError as error:
        raise missing_extra(error, "judging a policy") from error
    torch.set_num_threads(1)  # networks this small are slower on two
    network = load_policy(algorithm, BytesIO(policy), env)
    return lambda seen, info: network.predict(seen, deterministic=True)[0]


def evaluate(wishes: Evaluate, console: Console) -> dict[str, Judged]:
    """Print a table, and record the best and the worst episode. Raises BadInput, MissingExtra and what `share` does."""
    if wishes.pieces < 1:
        raise BadInput(f"--pieces {wishes.pieces}: give 1 or more")
    training = read_training(wishes.policy)
    task = TASKS[training.task]
    make = partial(Judge, (wishes.policy / POLICY).read_bytes(), training, wishes.step)
    names = (THE_POLICY, *task.rules)
    work = [(name, number) for name in names for number in range(wishes.pieces)]
    judge, bar, over = make(), Bar(console, f"{training.task}, judged", float(len(work))), count(1)

    def see(ending: Ending) -> Ending:
        done = next(over)
        bar.show(float(done), f"{done:,} of {len(work):,} episodes")
        return ending

    try:
        if wishes.ray is None:
            endings = [see(judge(each)) for each in work]
        else:
            endings = share(wishes.ray, make, work, partial(console.print, style="yellow", highlight=False), see)
    finally:
        bar.stop()
        judge.close()
    each = (endings[place : place + wishes.pieces] for place in range(0, len(work), wishes.pieces))
    found = dict(zip(names, map(Judged.of, each), strict=True))
    _print(console, training.task, found, wishes)
    if wishes.record is not None:
        _record(partial(make, record=wishes.record), found[THE_POLICY], task.make.GOAL, wishes.record, console)
    return found


def episode(env: TaskEnv[Any], act: Rule, seed: int) -> dict[str, Any]:
    """What is known at its end."""
    seen, info = env.reset(seed=seed)
    while True:
        seen, _, terminated, truncated, info = env.step(act(seen, info))
        if terminated or truncated:
            return info


def _print(console: Console, name: str, found: dict[str, Judged], wishes: Evaluate) -> None:
    """A row a player: how its episodes ended, with the words of the task, and what bodies suffered."""
    task, table = TASKS[name], Table(box=None, pad_edge=False, header_style="dim")
    console.print(f"{name}, {wishes.pieces} pieces, steps of {1e3 * wishes.step:g} ms", highlight=False)
    words = (task.make.GOAL, *task.make.BAD, *ANY_TASK)
    table.add_column("")
    for heading in (*words, task.hardship.title, "worst"):
        table.add_column(heading, justify="right")
    for player, of in found.items():
        numbers = (of.hardship.mean(), of.hardship.max())
        table.add_row(player, *(f"{of.part(word):.1%}" for word in words), *map(task.hardship.text, numbers))
    console.print(table)


def _record(make: Callable[[], Judge], of: Judged, goal: str, folder: Path, console: Console) -> None:
    """The gentlest success, and the failure or else the hardest success."""
    cost, before = np.where(of.ending == goal, of.hardship, np.inf), set(folder.glob("*.mcap"))
    judge = make()
    for number in dict.fromkeys((int(np.argmin(cost)), int(np.argmax(cost)))):
        judge((THE_POLICY, number))
    judge.close()
    for path in sorted(set(folder.glob("*.mcap")) - before):
        console.print(f"softseam replay {path}", soft_wrap=True, highlight=False)
