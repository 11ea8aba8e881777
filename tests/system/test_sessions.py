"""Environments shared out over processes: the bits of one alone, whatever the number of processes; losses are named."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest

from softseam.errors import BadInput, ServicesFailed
from softseam.gym import PushGentle
from softseam_studies.learn.sessions import Sessions, work

MAKE = partial(PushGentle, step=0.04, stress_limit=500.0)
"""which the first touch ends"""
AHEAD = np.array([0.4, 0.0], np.float32)


@pytest.fixture(scope="module")
def many() -> Iterator[Sessions]:
    """Three environments in two processes."""
    many = Sessions(MAKE, 3, 2)
    yield many
    many.close()


@pytest.mark.slow
def test_an_environment_has_the_same_bits_alone(many: Sessions) -> None:
    """Through the end of an episode, which the next one follows at once, drawn as the environment itself draws it."""
    alone = [MAKE() for _ in range(3)]
    seen, _ = many.reset(seed=5)
    np.testing.assert_array_equal(seen, [env.reset(seed=5 + i)[0] for i, env in enumerate(alone)])
    ended = 0
    for _ in range(12):
        seen, reward, terminated, truncated, told = many.step(np.tile(AHEAD, (3, 1)))
        for i, env in enumerate(alone):
            one, worth, over, cut, info = env.step(AHEAD)
            assert (reward[i], terminated[i], truncated[i]) == (worth, over, cut)
            if over or cut:
                ended += 1
                assert told["_final_info"][i] and told["final_info"]["is_success"][i] == info["is_success"]
                assert told["final_info"]["stress"][i] == info["stress"] > 0.0
                np.testing.assert_array_equal(told["final_obs"][i], one)
                one, _ = env.reset()
            np.testing.assert_array_equal(seen[i], one)
    for env in alone:
        env.close()
    assert ended >= 2


@pytest.mark.slow
def test_what_makes_no_environment_is_told_here() -> None:
    with pytest.raises(BadInput, match=r"stress_limit=-1\.0: give more than 0 Pa"):
        Sessions(partial(PushGentle, stress_limit=-1.0), 2, 1)


def test_a_process_that_nobody_asks_any_more_ends_in_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several that cannot make an environment, the first says so, and the others tell nobody."""
    monkeypatch.setattr(signal, "signal", lambda *given: None)  # this process goes on
    here, there = multiprocessing.Pipe()
    here.close()
    work(there, partial(PushGentle, stress_limit=-1.0), 1)
    there.close()


@pytest.mark.slow
def test_a_process_that_ends_is_named(many: Sessions) -> None:
    """The last test of these processes."""
    many.processes[1].kill()
    many.processes[1].join()
    with pytest.raises(ServicesFailed, match=r"simulates for the training ended .*--resume"):
        many.step(np.tile(AHEAD, (3, 1)))
