"""Episodes of training by XPBD, replayed by FEM with the same actions, and compared at the moments that matter.

A process beside the training replays them: a line of JSON goes in for each, and one comes back.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from softseam.child import Child, answers
from softseam.gym.batch_env import BatchEnv
from softseam.gym.lift_scene import BY_FEM, BY_XPBD, HEIGHT, PADS, SPEED
from softseam.gym.sight import FORCE, SEEN
from softseam.gym.task_env import ACT
from softseam.gym.tofu_lift import TofuLift
from softseam_protocol.extensions import load_extensions

Floats = NDArray[np.float64]

CHECK_STEP = 0.01
"""of FEM [s]"""
MOMENTS = ("first touch", "start of lift", "largest stress", "end")
"""of an episode, by XPBD; one that never comes is the end, as in most failures"""
LEFT_GROUND = 1e-3
"""lift from which on a piece counts as lifted off [m]"""
MEASURED = ("stress", "force", "lift")
"""largest von Mises stress so far [Pa], force of the weaker pad, mean over an action [N], height [m]"""
_FORCES = [SEEN.index(f"force of the {pad} pad") for pad in PADS]


@dataclass(frozen=True)
class Episode:
    """One of training, from its beginning to its end of n actions."""

    steps: int
    """of all environments together, at its end"""
    random: Mapping[str, Any]
    """state of the generator that its piece is drawn with"""
    actions: list[list[float]]
    """(n, 2)"""
    trace: list[list[float]]
    """`MEASURED`, after each action (n, 3)"""


@dataclass(frozen=True)
class Check:
    """What XPBD and FEM say of the same actions on the same piece."""

    steps: int
    """of training"""
    xpbd: tuple[tuple[float, ...], ...]
    """`MEASURED` at `MOMENTS` (4, 3)"""
    fem: tuple[tuple[float, ...], ...]

    @classmethod
    def read(cls, row: Mapping[str, Any]) -> Check:
        """From a document. Raises ValueError, TypeError or KeyError where that holds none."""
        xpbd, fem = (np.array(row[model], np.float64) for model in (BY_XPBD, BY_FEM))
        if xpbd.shape != (len(MOMENTS), len(MEASURED)) or fem.shape != xpbd.shape:
            raise ValueError("a check has a row a moment")
        return cls(int(row["steps"]), _rows(xpbd), _rows(fem))

    @property
    def ended_alike(self) -> bool:
        """Whether both lifted the piece, or neither; open-loop, within the rise of one action."""
        lifted = [of[-1][MEASURED.index("lift")] >= HEIGHT - SPEED * ACT for of in (self.xpbd, self.fem)]
        return lifted[0] == lifted[1]

    def of(self, what: str, moment: str) -> tuple[float, float]:
        """By XPBD and by FEM."""
        row, column = MOMENTS.index(moment), MEASURED.index(what)
        return self.xpbd[row][column], self.fem[row][column]


class Watched:
    """Follows the first environment of a batch, and keeps each of its episodes."""

    def __init__(self, batch: BatchEnv) -> None:
        self._batch = batch
        self._random: Mapping[str, Any] | None = None
        """of the episode under way; not known of the first"""
        self._next: Mapping[str, Any] | None = None
        self._actions: list[list[float]] = []
        self._trace: list[list[float]] = []

    def see(self, action: Floats, info: Mapping[str, Any], over: bool) -> Episode | None:
        """A step of the batch, that ended with `info`; the episode that is over with it."""
        if self._next is None:
            self._next = self._state()
        last = info["final_info"] if over else info
        self._actions.append([float(part) for part in np.clip(action, -1.0, 1.0)])
        row = np.nan_to_num([last[name][0] for name in ("stress", "grip_force", "lift_height")])
        self._trace.append([float(number) for number in row])
        if not over:
            return None
        random, self._random, self._next = self._random, self._next, self._state()
        actions, self._actions, trace, self._trace = self._actions, [], self._trace, []
        return None if random is None else Episode(self._batch.steps, random, actions, trace)

    def _state(self) -> Mapping[str, Any]:
        """Of the generator, after a piece was drawn: that of the next one."""
        state: Mapping[str, Any] = self._batch.snapshot(0)["random"]
        return state


def moments(trace: Floats) -> list[int]:
    """Places of `MOMENTS` in an episode's trace (n, 3)."""
    stress, force, lift = trace.T
    first = [force > 0.0, lift > LEFT_GROUND, stress >= stress[-1]]
    return [int(np.argmax(each)) if each.any() else len(trace) - 1 for each in first] + [len(trace) - 1]


def replay(env: TofuLift, episode: Episode) -> Floats:
    """By FEM: `MEASURED` after each action (n, 3); from its end on, where it ends sooner, as it ended."""
    env.np_random, _ = seeding.np_random(0)
    env.np_random.bit_generator.state = episode.random
    env.reset()
    trace, over = [], False
    for action in np.array(episode.actions):
        if not over:
            seen, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            force = FORCE * np.expm1(seen[_FORCES].min())
            row = [info["stress"], force, info["lift_height"]]
        trace.append(row)
    return np.array(trace)


def compare(episode: Episode, fem: Floats) -> Check:
    """At the moments that XPBD's trace has."""
    xpbd = np.array(episode.trace)
    at = moments(xpbd)
    return Check(episode.steps, _rows(xpbd[at]), _rows(fem[at]))


def _rows(of: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(number) for number in row) for row in of)


def ratios(checks: Sequence[Check], what: str, moment: str) -> Floats:
    """FEM's to XPBD's (n,), of checks where XPBD's is not 0."""
    xpbd, fem = np.array([check.of(what, moment) for check in checks]).reshape(-1, 2).T
    return np.asarray(fem[xpbd != 0.0] / xpbd[xpbd != 0.0])


def summary(checks: Sequence[Check]) -> str:
    """How many end alike, and by how much largest stresses differ."""
    alike = sum(check.ended_alike for check in checks)
    stress = _spread(ratios(checks, "stress", "end"))
    return f"{len(checks)} replayed by FEM: {alike} end alike, stress {stress}"


def show_checks(console: Console, checks: Sequence[Check]) -> None:
    """A table: what FEM says of the same actions, by moment."""
    title = f"{len(checks)} episodes replayed by FEM, steps of {1e3 * CHECK_STEP:g} ms: what it has more than XPBD"
    console.print(f"{title}; the median, and 80 % of them between", soft_wrap=True, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("", "largest stress so far", "force of a pad", "lift"):
        table.add_column(heading, justify="right" if heading else "left")
    for moment in MOMENTS:
        lift = np.array([check.of("lift", moment) for check in checks])
        low, middle, high = 1e3 * np.percentile(lift[:, 1] - lift[:, 0], [10, 50, 90])
        shares = [_spread(ratios(checks, what, moment)) for what in ("stress", "force")]
        table.add_row(moment, *shares, f"{middle:+.1f} mm ({low:+.1f} .. {high:+.1f})")
    console.print(table)


def _spread(ratios: Floats) -> str:
    """Median and 80 % of them, in percent."""
    if not len(ratios):
        return "-"
    low, middle, high = 100.0 * (np.percentile(ratios, [10, 50, 90]) - 1.0)
    return f"{middle:+.0f} % ({low:+.0f} .. {high:+.0f})"


_EVERY = 5_000
"""steps of training between checks, at least: what keeps their cost small"""


class Beside:
    """Has an episode of a batch checked from time to time, while that goes on; the process has one at a time."""

    def __init__(self, batch: BatchEnv, settings: Sequence[str] = (), every: int = _EVERY) -> None:
        """settings  of the scene, as the batch has them; every: steps of training between checks, at least"""
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self.child = Child(__spec__.name, settings, self._read)
        self._watched, self._every, self._last = Watched(batch), every, batch.steps - every
        self._under_way: Episode | None = None

    @property
    def alive(self) -> bool:
        """Whether it can check any more."""
        return self.child.process.poll() is None

    def silence(self) -> str:
        """Why nothing more comes of checks."""
        if not self.alive:
            return f"its process ended by itself, with code {self.child.process.returncode}"
        if self._under_way is None:
            return "no episode of the first environment was over that it could replay from its beginning"
        return "its process still compiled, or replayed the first (what it compiled is kept for the next training)"

    def follow(self, batch: BatchEnv) -> None:
        """Another one, which goes on where that stopped."""
        self._watched = Watched(batch)

    def see(self, actions: Any, info: Mapping[str, Any], over: Any) -> None:
        """A step of the batch: actions (k, 2), what it reported, and which episodes ended with it (k,)."""
        episode = self._watched.see(actions[0], info, bool(over[0]))
        if episode is not None and self._under_way is None and episode.steps >= self._last + self._every:
            self._begin(episode)

    def ended(self, seconds: float = 0.0) -> Check | None:
        """What came of a check, once, if one is over, waiting for that no longer than this [s]."""
        if self._under_way is None:
            return None
        try:
            answer = self._answers.get(seconds > 0.0, seconds or None)
        except Empty:
            return None
        episode, self._under_way = self._under_way, None
        return compare(episode, np.array(json.loads(answer)))

    def close(self) -> None:
        """End it, whatever it does."""
        self.child.close()

    def _begin(self, episode: Episode) -> None:
        self._under_way, self._last = episode, episode.steps
        self.child.write(json.dumps(asdict(episode)).encode() + b"\n")

    def _read(self, answers: BinaryIO) -> None:
        for line in answers:
            self._answers.put(line)


def main() -> None:
    """Replay what comes in, until nothing more does."""
    out = answers()
    load_extensions()
    env = TofuLift(step=CHECK_STEP, settings=sys.argv[1:])
    for line in sys.stdin:
        trace = replay(env, Episode(**json.loads(line)))
        print(json.dumps(trace.tolist()), file=out, flush=True)
    env.close()


if __name__ == "__main__":
    main()
