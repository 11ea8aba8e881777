"""A process beside the training that replays its episodes by FEM: a line of JSON goes in for each, and one comes back.

It ends as its input does, so that it ends with the one that started it, whatever ends that.
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from softseam.gym.batch_env import BatchEnv
from softseam.gym.tofu_lift import TofuLift
from softseam_protocol.extensions import load_extensions
from softseam_studies.learn.check import CHECK_STEP, Check, Episode, Watched, compare, replay

_EVERY = 5_000
"""steps of training between checks, at least: what keeps their cost small"""


class Beside:
    """Has an episode of a batch checked from time to time, while that goes on; the process has one at a time."""

    def __init__(self, batch: BatchEnv, settings: Sequence[str] = (), every: int = _EVERY) -> None:
        """settings  of the scene, as the batch has them; every: steps of training between checks, at least"""
        self._process = subprocess.Popen(
            [sys.executable, "-m", __spec__.name, *settings],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches the training alone, which ends it
        )
        self._watched, self._every, self._last = Watched(batch), every, batch.steps - every
        self._under_way: Episode | None = None
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._reader = threading.Thread(target=self._read, name="softseam check", daemon=True)
        self._reader.start()

    @property
    def alive(self) -> bool:
        """Whether it can check any more."""
        return self._process.poll() is None

    def silence(self) -> str:
        """Why nothing more comes of checks."""
        if not self.alive:
            return f"its process ended by itself, with code {self._process.returncode}"
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
        self._process.kill()
        self._process.wait()
        self._reader.join()
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.close()
        except BrokenPipeError:
            pass  # it ended before it had read all
        self._process.stdout.close()

    def _begin(self, episode: Episode) -> None:
        assert self._process.stdin is not None
        self._under_way, self._last = episode, episode.steps
        try:  # less than a pipe holds: it waits there until the process has loaded the solvers
            self._process.stdin.write(json.dumps(asdict(episode)).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # `alive` shows it

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._answers.put(line)


def main() -> None:
    """Replay what comes in, until nothing more does."""
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else is printed is no answer
    load_extensions()
    env = TofuLift(step=CHECK_STEP, settings=sys.argv[1:])
    for line in sys.stdin:
        trace = replay(env, Episode(**json.loads(line)))
        print(json.dumps(trace.tolist()), file=out, flush=True)
    env.close()


if __name__ == "__main__":
    main()
