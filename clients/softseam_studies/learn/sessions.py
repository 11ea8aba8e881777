"""Environments of one task, each with a session of its own, in a process a processor that has its share of them."""

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from softseam.errors import ServicesFailed
from softseam.gym.scene_env import Numbers
from softseam.gym.task_env import TaskEnv
from softseam_protocol.extensions import load_extensions

Make = Callable[[], TaskEnv[Any]]
"""what makes an environment; importable in another process"""
Row = tuple[Numbers, float, bool, bool, Numbers | None, dict[str, Any]]
"""of a step: what is seen, reward, terminated, truncated; of an episode that it ended what was seen last, and `info`"""
_CLOSING = 5.0
"""longest wait for a process to end by itself [s]"""


class Sessions(VectorEnv[Numbers, Numbers, Any]):
    """Many environments of a task as one of Gymnasium, whose episodes are followed at once (SAME_STEP).

    `info` is empty but where an episode ended: then it has `final_obs` and, of numbers alone, `final_info`, as
    Gymnasium has them. What becomes of an environment does not depend on how many processes there are.

    make       makes an environment; count of them
    processes  that share them out

    Raises what `make` raises.
    """

    def __init__(self, make: Make, count: int, processes: int) -> None:
        self.num_envs = count
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        shares = np.array_split(np.arange(count), min(count, processes))
        self._shares = [slice(int(share[0]), int(share[-1]) + 1) for share in shares]
        context = multiprocessing.get_context("spawn")  # a fork would share what the learner's library has locked
        self._pipes: list[Connection] = []
        self.processes = []
        try:
            for share in self._shares:
                here, there = context.Pipe()
                self._pipes.append(here)
                process = context.Process(target=work, args=(there, make, share.stop - share.start), daemon=True)
                process.start()
                there.close()
                self.processes.append(process)
            spaces = [self._answer(pipe) for pipe in self._pipes]
        except BaseException:
            self.close()
            raise
        self.single_observation_space, self.single_action_space = spaces[0]
        self.observation_space = batch_space(self.single_observation_space, count)
        self.action_space = batch_space(self.single_action_space, count)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin all episodes; environment i takes seed + i, or the i-th seed."""
        seeds = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, int):
            seeds = [seeds + i for i in range(self.num_envs)]
        return np.concatenate(self._ask("reset", list(seeds))), {}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Numbers, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One action in each (num_envs, actions). Raises ServicesFailed where a process ended."""
        rows = [row for share in self._ask("step", np.asarray(actions)) for row in share]
        seen, reward, terminated, truncated, last, info = zip(*rows, strict=True)
        ended = np.array([bool(each) for each in info])
        shown: dict[str, Any] = {}
        if ended.any():
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(ended):
                final[i] = last[i]
            numbers = [name for name, value in info[int(np.argmax(ended))].items() if not isinstance(value, str)]
            all_of = {name: np.array([each.get(name, 0.0) for each in info]) for name in numbers}
            shown = {"final_obs": final, "final_info": all_of, "_final_obs": ended, "_final_info": ended}
        return np.array(seen), np.array(reward), np.array(terminated), np.array(truncated), shown

    def close_extras(self, **kwargs: Any) -> None:
        for pipe in self._pipes:
            pipe.close()  # ends who reads it
        for process in self.processes:
            process.join(_CLOSING)
            if process.is_alive():
                process.kill()
                process.join()

    # ----

    def _ask(self, what: str, given: Any) -> list[Any]:
        """Of all processes, each with its share of what is given."""
        for pipe, share in zip(self._pipes, self._shares, strict=True):
            try:
                pipe.send((what, given[share]))
            except OSError as error:
                raise _ended() from error
        return [self._answer(pipe) for pipe in self._pipes]

    def _answer(self, pipe: Connection) -> Any:
        try:
            answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise _ended() from error
        if isinstance(answer, Exception):
            raise answer
        return answer


def _ended() -> ServicesFailed:
    return ServicesFailed(
        "a process that simulates for the training ended (out of memory?): go on with --resume, or train anew with "
        "fewer --environments"
    )


def work(pipe: Connection, make: Make, count: int) -> None:
    """Do what is asked through a pipe, until it ends: in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the training, which ends this
    envs: list[TaskEnv[Any]] = []
    try:
        load_extensions()
        envs += [make() for _ in range(count)]
        pipe.send((envs[0].observation_space, envs[0].action_space))
        while True:
            what, given = pipe.recv()
            if what == "reset":
                pipe.send(np.array([env.reset(seed=seed)[0] for env, seed in zip(envs, given, strict=True)]))
            else:
                pipe.send([_step(env, action) for env, action in zip(envs, given, strict=True)])
    except (EOFError, BrokenPipeError):
        pass  # nobody asks any more
    except Exception as error:
        with suppress(OSError):  # nobody asks any more
            pipe.send(error)
    finally:
        for env in envs:
            env.close()


def _step(env: TaskEnv[Any], action: NDArray[np.float32]) -> Row:
    seen, reward, terminated, truncated, info = env.step(action)
    if not (terminated or truncated):
        return seen, reward, terminated, truncated, None, {}
    return env.reset()[0], reward, terminated, truncated, seen, info
