"""`softseam evaluate`: a policy on pieces that it has not seen, beside rules, and the best and the worst to replay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from softseam.cluster import share
from softseam.errors import BadInput, missing_extra
from softseam.gym.tofu_lift import TofuLift
from softseam.learn.policy import POLICY, Training, read_training
from softseam.learn.tasks import TASKS

UNSEEN = 1_000_000
"""the first seed of pieces that no training begins with"""
THE_POLICY = "the policy"
"""its row beside those of the rules"""
Act = Callable[[Any, dict[str, Any]], Any]
Ending = tuple[bool, bool, float]
"""of an episode: whether it succeeded, whether the piece was crushed, its largest stress [Pa]"""


@dataclass(frozen=True)
class Wishes:
    """What `softseam evaluate` was asked for."""

    policy: Path
    pieces: int = 64
    step: float = 0.01
    record: Path | None = None
    ray: str | None = None
    """address of a Ray cluster that shares the pieces out, see `share`"""


@dataclass(frozen=True)
class Judged:
    """What became of each of n pieces."""

    success: np.ndarray[Any, np.dtype[np.bool_]]
    """(n,)"""
    crushed: np.ndarray[Any, np.dtype[np.bool_]]
    """squeezed by half, or beyond what has a solution (n,)"""
    stress: np.ndarray[Any, np.dtype[np.float64]]
    """largest (n,) [Pa]"""

    @classmethod
    def of(cls, endings: Sequence[Ending]) -> Judged:
        success, crushed, stress = zip(*endings, strict=True)
        return cls(np.array(success), np.array(crushed), np.array(stress, dtype=np.float64))


class Judge:
    """Lifts unseen pieces by a policy, or by a rule of its task; what becomes of one does not depend on those before.

    policy    what stable-baselines3 saved
    training  that made it
    step      of the simulation [s]
    record    folder for a recording of each episode
    """

    def __init__(self, policy: bytes, training: Training, step: float, record: Path | None = None) -> None:
        """Raises BadInput and MissingExtra."""
        try:
            import torch

            from softseam.learn.train import algorithm

            learner = algorithm(training.algorithm).load(BytesIO(policy), device="cpu")
        except ImportError as error:
            raise missing_extra(error, "judging a policy") from error
        torch.set_num_threads(1)  # networks this small are slower on two
        task = TASKS[training.task]
        self._rules: dict[str, Act] = {name: partial(_by_rule, rule) for name, rule in task.rules.items()}
        self._rules[THE_POLICY] = lambda seen, info: learner.predict(seen, deterministic=True)[0]
        self._env = task.make(step=step, settings=training.settings, record=record)

    def __call__(self, work: tuple[str, int]) -> Ending:
        """By whom, and the number of the piece."""
        name, number = work
        terminated, info = episode(self._env, self._rules[name], UNSEEN + number)
        return bool(info["is_success"]), terminated and not info["is_success"], float(info["stress"])

    def close(self) -> None:
        self._env.close()


def _by_rule(rule: Callable[[dict[str, Any]], list[float]], seen: Any, info: dict[str, Any]) -> list[float]:
    return rule(info)


def evaluate(wishes: Wishes, console: Console) -> dict[str, Judged]:
    """Print a table, and record the best and the worst episode. Raises BadInput, MissingExtra and what `share` does."""
    if wishes.pieces < 1:
        raise BadInput(f"--pieces {wishes.pieces}: give 1 or more")
    training = read_training(wishes.policy)
    make = partial(Judge, (wishes.policy / POLICY).read_bytes(), training, wishes.step)
    names = (THE_POLICY, *TASKS[training.task].rules)
    work = [(name, number) for name in names for number in range(wishes.pieces)]
    judge = make()
    if wishes.ray is None:
        endings = [judge(each) for each in work]
    else:
        endings = share(wishes.ray, make, work, lambda text: console.print(text, style="yellow", highlight=False))
    judge.close()
    each = (endings[place : place + wishes.pieces] for place in range(0, len(work), wishes.pieces))
    found = dict(zip(names, map(Judged.of, each), strict=True))
    _print(console, training.task, found, wishes)
    if wishes.record is not None:
        _record(partial(make, record=wishes.record), found[THE_POLICY], wishes.record, console)
    return found


def episode(env: TofuLift, act: Act, seed: int) -> tuple[bool, dict[str, Any]]:
    """Whether it ended before its time was over, and what is known of its end."""
    seen, info = env.reset(seed=seed)
    while True:
        seen, _, terminated, truncated, info = env.step(act(seen, info))
        if terminated or truncated:
            return terminated, {"stress": 0.0, **info}


def _print(console: Console, task: str, found: dict[str, Judged], wishes: Wishes) -> None:
    table = Table(box=None, pad_edge=False, header_style="dim")
    console.print(f"{task}, {wishes.pieces} pieces, steps of {1e3 * wishes.step:g} ms", highlight=False)
    table.add_column("")
    for heading in ("succeeded", "dropped", "crushed", "largest stress", "worst"):
        table.add_column(heading, justify="right")
    for name, of in found.items():
        dropped = ~of.success & ~of.crushed
        shares = [f"{share.mean():.1%}" for share in (of.success, dropped, of.crushed)]
        table.add_row(name, *shares, f"{1e-3 * of.stress.mean():.2f} kPa", f"{1e-3 * of.stress.max():.2f} kPa")
    console.print(table)


def _record(make: Callable[[], Judge], of: Judged, folder: Path, console: Console) -> None:
    """The gentlest success, and the failure or else the hardest success."""
    cost, before = np.where(of.success, of.stress, np.inf), set(folder.glob("*.mcap"))
    judge = make()
    for number in dict.fromkeys((int(np.argmin(cost)), int(np.argmax(cost)))):
        judge((THE_POLICY, number))
    judge.close()
    for path in sorted(set(folder.glob("*.mcap")) - before):
        console.print(f"softseam replay {path}", soft_wrap=True, highlight=False)
