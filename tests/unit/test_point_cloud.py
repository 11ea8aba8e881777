"""PointCloud: points of the surface beside what is seen, drawn by the seed, the same through an episode."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import softseam
from softseam.gym import PointCloud, PushGentle, TowelFold


@pytest.fixture(scope="module")
def push() -> Iterator[PushGentle]:
    env = PushGentle()
    yield env
    env.close()


@pytest.mark.kernels
def test_points_are_those_of_the_surface_as_it_moves(push: PushGentle) -> None:
    env = PointCloud(push, points=98)  # all that a block of 2x2x2 cells has
    first, _ = env.reset(seed=0)
    surface = push.session.last.surface
    assert len(np.unique(surface, axis=0)) == 98 and first["points"].shape == (98, 3)
    assert np.ptp(first["points"], axis=0).max() == pytest.approx(1.0)
    for _ in range(9):
        seen, *_ = env.step([0.3, 0.0])
    _, places = np.unique(surface, axis=0, return_index=True)
    ahead = (push.session.last.surface - surface)[places, 0].mean()
    assert ahead > 2e-3
    moved = (seen["points"] - first["points"])[:, 0].mean() * np.ptp(surface, axis=0).max()
    assert moved == pytest.approx(ahead, rel=1e-3)


@pytest.mark.kernels
def test_the_seed_draws_them_and_changes_nothing_else(push: PushGentle) -> None:
    env, few = PointCloud(push, points=90), PointCloud(push, points=7)
    one, other, again = (env.reset(seed=seed)[0] for seed in (1, 2, 1))
    assert (one["points"] == again["points"]).all() and not (one["points"] == other["points"]).all()
    alone = [push.reset(seed=1)[0], push.reset()[0]]
    for each in (env, few):
        shown = [each.reset(seed=1)[0]["seen"], each.reset()[0]["seen"]]
        np.testing.assert_array_equal(shown, alone)
    assert len(np.unique(one["points"], axis=0)) == 90


@pytest.mark.kernels
def test_checkers_find_nothing_to_object() -> None:
    env = PointCloud(TowelFold(divisions=12), points=300)  # of 169 particles, some twice
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(env, skip_close_check=True)
    env.close()
    of_wrappers = ("render modes", "different from the unwrapped version")
    assert not [each for each in warned if not any(known in str(each.message) for known in of_wrappers)]


@pytest.mark.kernels
def test_a_simulation_that_fails_shows_the_surface_as_it_was(push: PushGentle, monkeypatch: pytest.MonkeyPatch) -> None:
    env = PointCloud(push)
    before, _ = env.reset(seed=0)

    def fails(*_: object, **__: object) -> None:
        raise softseam.SimulationFailed("no")

    monkeypatch.setattr(type(push.session), "step", fails)
    after, _, terminated, _, info = env.step([1.0, 0.0])
    assert terminated and info["ending"] == "failed" and (after["points"] == before["points"]).all()


@pytest.mark.parametrize("points", [0, 2.5, True])
def test_no_number_of_points_is_refused(push: PushGentle, points: Any) -> None:
    with pytest.raises(softseam.BadInput, match="points="):
        PointCloud(push, points=points)


def test_what_has_no_surface_is_refused() -> None:
    with pytest.raises(softseam.BadInput, match="no surface"):
        PointCloud(gymnasium.make("CartPole-v1"))
