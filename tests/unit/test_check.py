"""Episodes of training replayed by FEM: the same piece, the same actions, compared at the moments that matter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.gym import BatchEnv, TofuLift
from softseam_studies.learn.check import (
    CHECK_STEP,
    MOMENTS,
    Beside,
    Check,
    Episode,
    Watched,
    compare,
    moments,
    replay,
    show_checks,
)
from softseam_studies.learn.curve import draw_curve
from softseam_studies.learn.policy import Training

PIECES = 8


def lifted(watch: Any, batch: BatchEnv, steps: int, force: float = 2.0) -> list[Any]:
    """What `watch` returns at each step of a rule that closes to a force, then rises."""
    _, told = batch.reset(seed=3)
    found = []
    for _ in range(steps):
        actions = np.where((told["grip_force"] < force)[:, None], [[0.4, 0.0]], [[0.0, 0.6]])
        _, _, terminated, truncated, told = batch.step(actions)
        found.append(watch(actions, told, terminated | truncated))
    return found


@pytest.fixture(scope="module")
def episode() -> Episode:
    """The second one of the first environment."""
    batch = BatchEnv(PIECES, autoreset_mode="SAME_STEP")
    watched = Watched(batch)
    found = lifted(lambda actions, told, over: watched.see(actions[0], told, bool(over[0])), batch, 110)
    batch.close()
    episodes: list[Episode] = [each for each in found if each is not None]
    assert len(episodes) >= 1  # the first one's piece is not known
    return episodes[0]


@pytest.fixture(scope="module")
def fem() -> Iterator[TofuLift]:
    env = TofuLift(step=CHECK_STEP)
    yield env
    env.close()


@pytest.mark.kernels
def test_the_piece_and_the_actions_are_those_of_training(episode: Episode) -> None:
    """By the ordinary session's XPBD, which a batch follows to roundings, the trace comes out again."""
    env = TofuLift(model="xpbd")
    again = replay(env, episode)
    env.close()
    trace = np.array(episode.trace)
    assert len(again) == len(trace) == len(episode.actions) > 20
    np.testing.assert_allclose(again[:, 0], trace[:, 0], rtol=0.01, atol=5.0)
    np.testing.assert_allclose(again[:, 2], trace[:, 2], atol=2e-4)
    other = replace(episode, random=dict(episode.random) | {"state": {"state": 1, "inc": 1}})
    env = TofuLift(model="xpbd")
    assert abs(replay(env, other)[-1, 0] / trace[-1, 0] - 1.0) > 0.02  # another piece is told apart
    env.close()


@pytest.mark.kernels
def test_fem_lifts_what_xpbd_lifts(episode: Episode, fem: TofuLift) -> None:
    check = compare(episode, replay(fem, episode))
    assert check.ended_alike and check.steps == episode.steps
    for moment in MOMENTS[1:]:
        xpbd, by_fem = check.of("stress", moment)
        assert 0.0 < abs(by_fem / xpbd - 1.0) < 0.3, moment
    xpbd, by_fem = check.of("force", "end")
    assert by_fem == pytest.approx(xpbd, rel=0.25)
    xpbd, by_fem = check.of("lift", "end")
    assert xpbd >= 0.03 and by_fem == pytest.approx(xpbd, abs=2e-3)
    said = Console(file=StringIO(), width=120)
    show_checks(said, [check])
    assert isinstance(said.file, StringIO) and "start of lift" in said.file.getvalue()


@pytest.mark.kernels
def test_an_episode_that_fem_ends_sooner_stays_as_it_ended(episode: Episode, fem: TofuLift) -> None:
    """Crushed by actions that close for ever."""
    crushing = replace(episode, actions=[[1.0, 0.0]] * 40, trace=[[0.0, 0.0, 0.0]] * 40)
    trace = replay(fem, crushing)
    assert len(trace) == 40 and (trace[-1] == trace[-10]).all() and trace[-1, 0] > 5e3
    assert compare(crushing, trace).ended_alike  # neither lifts


def test_moments_are_where_xpbd_has_them() -> None:
    """Columns: largest stress so far, force, lift; of a piece that is dropped again, too."""
    trace = np.array([[0, 0, 0], [1, 0.1, 0], [5, 2, 0.0005], [5, 2, 0.002], [7, 2, 0.01], [7, 0, 0.0]], np.float64)
    assert moments(trace) == [1, 3, 4, 5]
    assert moments(np.zeros((3, 3))) == [2, 2, 0, 2]


def test_pieces_that_were_never_pressed_have_no_ratio(tmp_path: Path) -> None:
    """Where all checks are such, the table and the curve are drawn without."""
    untouched = Check(5, ((0.0, 0.0, 0.0),) * 4, ((0.0, 0.0, 0.0),) * 4)
    said = Console(file=StringIO(), width=120)
    show_checks(said, [untouched])
    assert isinstance(said.file, StringIO) and "1 episodes replayed" in said.file.getvalue()
    training = Training("TofuLift", "ppo", 0, 4, 100, curve=((5, -1.0, 0.0, 0.0),), checks=(untouched,))
    assert draw_curve(training, tmp_path / "curve.png").stat().st_size > 10_000


def test_a_check_is_written_and_read() -> None:
    rows = tuple((1e3 * k, 0.5, 0.01) for k in range(4))
    check = Check(5000, rows, rows)
    document = asdict(check)
    assert Check.read(document) == check
    for spoilt in (document | {"xpbd": rows[:3]}, document | {"fem": "x"}, {"steps": 1}):
        with pytest.raises((ValueError, KeyError)):
            Check.read(spoilt)


@pytest.mark.kernels
@pytest.mark.slow
def test_a_process_beside_finds_the_same(episode: Episode, fem: TofuLift) -> None:
    """And episodes go on when it is ended from outside."""
    other, batch = (BatchEnv(count, autoreset_mode="SAME_STEP") for count in (1, PIECES))
    other.reset(seed=5)
    beside = Beside(other, every=1)
    try:
        beside.follow(batch)  # that goes on where the other one stopped
        lifted(beside.see, batch, 110)
        check = beside.ended(60.0)
        assert check == compare(episode, replay(fem, episode))
        assert beside.ended(0.1) is None and beside.alive
        beside.child.process.kill()
        beside.child.process.wait()
        lifted(beside.see, batch, 110)
        assert not beside.alive and beside.ended(0.1) is None
    finally:
        beside.close()
        batch.close()
        other.close()
