"""`softseam evaluate`: a policy on pieces that it has not seen, beside rules, and the best and the worst to replay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from softseam.errors import BadInput, missing_extra
from softseam.gym.tofu_lift import TofuLift
from softseam.learn.policy import POLICY, read_training
from softseam.learn.tasks import TASKS, Task

UNSEEN = 1_000_000
"""the first seed of pieces that no training begins with"""
Act = Callable[[Any, dict[str, Any]], Any]


@dataclass(frozen=True)
class Wishes:
    """What `softseam evaluate` was asked for."""

    policy: Path
    pieces: int = 64
    step: float = 0.01
    record: Path | None = None


@dataclass(frozen=True)
class Judged:
    """What became of each of n pieces."""

    success: np.ndarray[Any, np.dtype[np.bool_]]
    """(n,)"""
    crushed: np.ndarray[Any, np.dtype[np.bool_]]
    """squeezed by half, or beyond what has a solution (n,)"""
    stress: np.ndarray[Any, np.dtype[np.float64]]
    """largest (n,) [Pa]"""


def evaluate(wishes: Wishes, console: Console) -> dict[str, Judged]:
    """Print a table, and record the best and the worst episode. Raises BadInput and MissingExtra."""
    if wishes.pieces < 1:
        raise BadInput(f"--pieces {wishes.pieces}: give 1 or more")
    training = read_training(wishes.policy)
    try:
        from softseam.learn.train import algorithm

        learner = algorithm(training.algorithm).load(wishes.policy / POLICY, device="cpu")
    except ImportError as error:
        raise missing_extra(error, "judging a policy") from error
    task = TASKS[training.task]

    def follow_policy(seen: Any, info: dict[str, Any]) -> Any:
        return learner.predict(seen, deterministic=True)[0]

    env = task.make(step=wishes.step, settings=training.settings)
    found = {"the policy": judged(env, follow_policy, wishes.pieces)}
    for name, rule in task.rules.items():
        found[name] = judged(env, lambda seen, info, rule=rule: rule(info), wishes.pieces)  # type: ignore[misc]
    env.close()
    _print(console, training.task, found, wishes)
    if wishes.record is not None:
        _record(task, training.settings, follow_policy, found["the policy"], wishes, console)
    return found


def judged(env: TofuLift, act: Act, pieces: int) -> Judged:
    """Every piece once."""
    ends = [episode(env, act, UNSEEN + number) for number in range(pieces)]
    return Judged(
        np.array([info["is_success"] for _, info in ends]),
        np.array([terminated and not info["is_success"] for terminated, info in ends]),
        np.array([info["stress"] for _, info in ends], dtype=np.float64),
    )


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


def _record(task: Task, settings: tuple[str, ...], act: Act, of: Judged, wishes: Wishes, console: Console) -> None:
    """The gentlest success, and the failure or else the hardest success."""
    assert wishes.record is not None
    cost, before = np.where(of.success, of.stress, np.inf), set(wishes.record.glob("*.mcap"))
    for number in dict.fromkeys((int(np.argmin(cost)), int(np.argmax(cost)))):
        env = task.make(step=wishes.step, settings=settings, record=wishes.record)
        episode(env, act, UNSEEN + number)
        env.close()
    for path in sorted(set(wishes.record.glob("*.mcap")) - before):
        console.print(f"softseam replay {path}", soft_wrap=True, highlight=False)
