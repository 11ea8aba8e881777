"""Environments are shown and copied in Gymnasium's ways: pictures without a display, videos, deepcopy and pickle."""

from __future__ import annotations

import copy
import importlib.util
import pickle
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo, TimeLimit
from numpy.typing import NDArray

import softseam
from softseam.gym import BatchEnv, PointCloud, PushGentle, SliceLift, TofuLift, TowelFold

NAME = "softseam.gym:softseam/TofuLift-v0"
SHAPE = (360, 480, 3)
MADE: dict[str, Any] = {
    "lift": lambda: TofuLift(render_mode="rgb_array"),
    "lift by XPBD": lambda: TofuLift(model="xpbd", render_mode="rgb_array"),
    "slice": lambda: SliceLift("sausage", render_mode="rgb_array"),
    "push": lambda: PushGentle(render_mode="rgb_array"),
    "fold": lambda: TowelFold(render_mode="rgb_array"),
}


def actions(env: gymnasium.Env[Any, Any], count: int) -> NDArray[np.float64]:
    shape = env.action_space.shape
    assert shape is not None
    return np.random.default_rng(1).uniform(-0.2, 0.8, (count, *shape))


@pytest.mark.kernels
@pytest.mark.parametrize("name", MADE)
def test_each_is_drawn_and_copied_with_the_same_bits(name: str) -> None:
    """In the middle of an episode; the copies' next episode is the original's, too."""
    env = MADE[name]()
    env.reset(seed=3)
    at_rest = env.render()
    assert at_rest.shape == SHAPE and at_rest.dtype == np.uint8
    assert not (at_rest == 255).all() and np.array_equal(at_rest, env.render())
    taken = actions(env, 8)
    for action in taken[:5]:
        env.step(action)
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    went = env.render()
    assert (went != at_rest).any()
    for other in others:
        assert np.array_equal(other.render(), went)
    for action in taken[5:]:
        seen, reward, *ended, info = env.step(action)
        for other in others:
            found, gained, *over, told = other.step(action)
            assert np.array_equal(found, seen) and (gained, over, told) == (reward, ended, info)
    env.reset()
    again = [env.step(action)[0] for action in taken[:5]]
    for other in others:
        other.reset()
        assert np.array_equal([other.step(action)[0] for action in taken[:5]], again)
        other.close()
    env.close()


@pytest.mark.kernels
def test_an_environment_that_has_not_begun_or_has_failed_is_copied() -> None:
    env = TofuLift()
    other = copy.deepcopy(env)
    assert np.array_equal(other.reset(seed=0)[0], env.reset(seed=0)[0])
    env.close()
    with pytest.raises(softseam.NotReset):
        copy.deepcopy(env).step([0.0, 0.0])
    other.close()


def test_one_that_records_says_that_it_has_no_copies(tmp_path: Path) -> None:
    with pytest.raises(softseam.BadInput, match="records its episodes, so it has no copies: make one without `record`"):
        copy.deepcopy(TofuLift(record=tmp_path))


@pytest.mark.kernels
def test_gymnasium_checks_pictures_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    env = gymnasium.make(NAME, render_mode="rgb_array").unwrapped
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(env)
    assert not [str(each.message) for each in warned]
    env.close()


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_a_window_without_a_display_names_what_needs_none(make: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(softseam.BadInput, match=r"needs a display, .* take render_mode='rgb_array'"):
        make(NAME, render_mode="human")
    with pytest.raises(softseam.BadInput, match="there are 'rgb_array', 'human', and None"):
        TofuLift(render_mode="ansi")


@pytest.mark.kernels
def test_a_display_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(softseam.BadInput, match="take render_mode='rgb_array'"):
        TofuLift(render_mode="human").reset(seed=0)


@pytest.mark.kernels
def test_one_that_was_not_asked_to_be_shown_says_how() -> None:
    env = TofuLift(randomise=None)
    env.reset(seed=0)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        assert env.render() is None
    assert "make it with render_mode='rgb_array'" in str(warned[0].message)
    env.close()


@pytest.mark.kernels
def test_many_at_once_give_a_picture_each_and_are_copied() -> None:
    envs = gymnasium.make_vec(NAME, num_envs=3, render_mode="rgb_array")
    assert isinstance(envs, BatchEnv)
    envs.reset(seed=0)
    taken = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 3, 2))
    for action in taken[:6]:
        envs.step(action)
    other = pickle.loads(pickle.dumps(copy.deepcopy(envs)))
    pictures = envs.render()
    assert isinstance(pictures, tuple) and [each.shape for each in pictures] == 3 * [SHAPE]
    assert (pictures[0] != pictures[1]).any()
    assert all(np.array_equal(*each) for each in zip(pictures, other.render(), strict=True))
    for action in taken[6:]:
        for mine, others in zip(envs.step(action)[:4], other.step(action)[:4], strict=True):
            assert np.array_equal(np.asarray(mine), np.asarray(others))
    other.close()
    envs.close()


@pytest.mark.kernels
def test_a_batch_is_drawn_as_its_environments_are() -> None:
    """The same piece between the same pads, by other models' surfaces: half of the pixels at most differ by a shade."""
    envs = BatchEnv(1, randomise=None, render_mode="rgb_array")
    env = TofuLift(randomise=None, render_mode="rgb_array")
    envs.reset(seed=0)
    env.reset(seed=0)
    pictures = envs.render()
    assert pictures is not None
    one = env.render()
    assert one is not None
    different = np.abs(pictures[0].astype(int) - one.astype(int)).max(axis=2)
    assert (different > 40).mean() < 0.06
    envs.close()
    env.close()


@pytest.mark.kernels
def test_wrappers_show_and_limit_what_they_wrap(tmp_path: Path) -> None:
    """A video where moviepy is installed, Gymnasium's own words where it is not."""
    env = PointCloud(TofuLift(randomise=None, render_mode="rgb_array"))
    if importlib.util.find_spec("moviepy") is None:
        with pytest.raises(gymnasium.error.DependencyNotInstalled, match="moviepy"):
            RecordVideo(env, str(tmp_path))
        shown: gymnasium.Env[Any, Any] = env
    else:
        shown = RecordVideo(env, str(tmp_path))
    limited = RecordEpisodeStatistics(TimeLimit(shown, 3))
    limited.reset(seed=0)
    for _ in range(3):
        *_, over, info = limited.step([0.4, 0.0])
    assert over and info["episode"]["l"] == 3
    picture: Any = limited.render()
    assert picture.shape == SHAPE
    limited.close()


@pytest.mark.kernels
def test_actions_that_are_no_numbers_are_called_so() -> None:
    env = TofuLift(randomise=None)
    env.reset(seed=0)
    with pytest.raises(softseam.BadInput, match=r"action\[1\] is nan, which is not finite"):
        env.step([0.0, np.nan])
    env.close()
    envs = BatchEnv(2, randomise=None)
    envs.reset(seed=0)
    with pytest.raises(softseam.BadInput, match=r"actions\[1, 0\] is inf, which is not finite"):
        envs.step([[0.0, 0.0], [np.inf, 0.0]])
    envs.close()
