"""Camera: depth and labels of pixels against closed forms; the same state gives the same bits."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

import softseam
from softseam.gym import PointCloud, PushGentle, SceneEnv
from softseam.gym.camera import Camera
from softseam.observation import Observation
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]

EYE, TARGET, FOV, HEIGHT, WIDTH = (0.11, -0.26, 0.20), (0.0, 0.0, 0.02), 40.0, 90, 120
EDGE, BALL, RADIUS = 0.05, np.array([0.07, -0.02, 0.02]), 0.012
BOX, SIZE = np.array([-0.06, -0.03, 0.02]), np.array([0.02, 0.03, 0.04])


class Still(SceneEnv):
    """A block on a table, a ball and a box beside it, not moved."""

    def reward(self, before: Observation, after: Observation) -> float:
        return 0.0


def still(walls: Sequence[int] = ()) -> Still:
    """walls: the axes along which a plate stands before the block, on a camera's side, instead"""
    block = {"kind": "block", "size": [EDGE] * 3}
    tools: dict[str, Any] = {
        "table": {"kind": "plane"},
        "ball": {"kind": "sphere", "radius": RADIUS, "position": BALL.tolist()},
        "box": {"kind": "box", "size": SIZE.tolist(), "position": BOX.tolist()},
    }
    if walls:
        tools = {"table": {"kind": "plane"}}
    for axis in walls:
        at, thin = [0.0, 0.0, 0.05], [0.1, 0.1, 0.1]
        at[axis], thin[axis] = (0.05, -0.05)[axis], 0.01
        tools[f"plate{axis}"] = {"kind": "box", "size": thin, "position": at}
    material = {"kind": "neo_hookean", "young": 20e3, "poisson": 0.4, "density": 1000.0}
    body = {"shape": block, "cell": 0.025, "material": material}
    regions = {"default": "pbd"}
    return Still(
        Scene.model_validate(
            {"softseam": 1, "name": "still", "duration": 0.2, "body": body, "tools": tools, "regions": regions}
        )
    )


def rays() -> Floats:
    """Through the middles of pixels, with 1 along the axis (h, w, 3)."""
    forward = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pixel = 2.0 * np.tan(np.radians(0.5 * FOV)) / HEIGHT
    across = pixel * (np.arange(WIDTH) + 0.5 - 0.5 * WIDTH)
    down = pixel * (np.arange(HEIGHT) + 0.5 - 0.5 * HEIGHT)
    return np.asarray(forward + across[None, :, None] * right - down[:, None, None] * np.cross(right, forward))


def of_plane(ray: Floats) -> Floats:
    """Depth of z = 0."""
    with np.errstate(divide="ignore"):
        return np.where(ray[..., 2] < 0.0, -EYE[2] / ray[..., 2], np.inf)


def of_box(ray: Floats, middle: Floats, size: Floats) -> Floats:
    sides = np.stack([(middle + sign * 0.5 * size - EYE) / ray for sign in (-1.0, 1.0)])
    first, last = sides.min(axis=0).max(axis=-1), sides.max(axis=0).min(axis=-1)
    return np.where(first <= last, first, np.inf)


def of_ball(ray: Floats, middle: Floats, radius: float) -> Floats:
    away = middle - EYE
    a, b, c = (ray**2).sum(axis=-1), ray @ away, away @ away - radius**2
    with np.errstate(invalid="ignore"):
        return np.where(b * b >= a * c, (b - np.sqrt(b * b - a * c)) / a, np.inf)


@pytest.fixture(scope="module")
def shown() -> Iterator[dict[str, NDArray[Any]]]:
    env = Camera(still(), HEIGHT, WIDTH, eye=EYE, target=TARGET, fov=FOV)
    assert env.names == ("body", "table", "ball", "box")
    yield env.reset(seed=0)[0]
    env.close()


@pytest.mark.kernels
def test_depth_is_that_of_plane_box_ball_and_block(shown: dict[str, NDArray[Any]]) -> None:
    """To 1e-4 m where a pixel's middle shows the same. A ball of 48 flat sides is off by up to twice .0021 of its
    radius, over the cosine along a ray that grazes it: its outer fifth is left out."""
    ray = rays()
    block = of_box(ray, np.array([0.0, 0.0, 0.5 * EDGE]), np.full(3, EDGE))
    closed = np.stack([block, of_plane(ray), of_ball(ray, BALL, RADIUS), of_box(ray, BOX, SIZE)])
    nearest, depth = closed.argmin(axis=0), closed.min(axis=0)
    assert (np.bincount(nearest.ravel(), minlength=4) > 80).all() and np.isfinite(depth).all()
    inside = nearest == shown["mask"] - 1
    assert inside.mean() > 0.995  # others are pixels on an outline
    grazed = (nearest == 2) & ~np.isfinite(of_ball(ray, BALL, 0.8 * RADIUS))
    off = np.abs(depth - shown["depth"])[inside & ~grazed]
    assert off.max() < 1e-4
    assert shown["depth"].dtype == np.float32 and shown["mask"].dtype == np.uint8


@pytest.mark.kernels
def test_a_mask_is_as_large_as_the_block_is_projected(shown: dict[str, NDArray[Any]]) -> None:
    """The block's outline is a hexagon of its corners; the ball and the box do not hide it."""
    forward = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    corners = EDGE * (np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - [0.5, 0.5, 0.0]) - EYE
    scale = 0.5 * HEIGHT / np.tan(np.radians(0.5 * FOV)) / (corners @ forward)
    at = np.stack([corners @ right * scale, corners @ np.cross(right, forward) * scale], axis=1)
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)
    support = (at @ np.stack([np.cos(angles), np.sin(angles)])).argmax(axis=0)
    outline = at[[one for one, before in zip(support[1:], support[:-1], strict=True) if one != before]]
    x, y = outline.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    assert len(outline) == 6
    # each pixel is in or out by its middle: the count is off by less than the square root of the outline's pixels
    assert (shown["mask"] == 1).sum() == pytest.approx(area, abs=np.sqrt(4.0 * np.sqrt(area)))


@pytest.mark.kernels
def test_nothing_is_seen_beyond_far_and_straight_down_is_a_view() -> None:
    env = Camera(still(), 16, 24, eye=(0.0, 0.0, 0.3), target=(0.0, 0.0, 0.0), far=0.26)
    seen, _ = env.reset(seed=0)
    assert (seen["mask"] == 1).any() and set(np.unique(seen["mask"])) == {0, 1}  # the table is 0.3 m away
    assert (seen["depth"][seen["mask"] == 0] == np.float32(0.26)).all()
    assert seen["depth"][8, 12] == pytest.approx(0.25, abs=1e-4)
    assert env.observation_space.contains(seen)
    env.close()


@pytest.fixture(scope="module")
def push() -> Iterator[PushGentle]:
    env = PushGentle()
    yield env
    env.close()


@pytest.mark.kernels
def test_the_same_state_gives_the_same_bits_and_motion_is_seen(push: PushGentle) -> None:
    env = Camera(push, eye=[0.0, 0.0, 0.4], target=[0.0, 0.0, 0.0])
    runs = []
    for _ in range(2):
        seen = [env.reset(seed=3)[0]]
        seen += [env.step([0.4, 0.0])[0] for _ in range(6)]
        runs.append(seen)
    for one, other in zip(*runs, strict=True):
        assert all((one[name] == other[name]).all() for name in ("seen", "depth", "mask"))
    finger = 1 + env.names.index("finger")
    columns = [np.nonzero(seen["mask"] == finger)[1].mean() for seen in (runs[0][0], runs[0][-1])]
    assert columns[1] > columns[0] + 1.0  # it goes to the right


@pytest.mark.kernels
def test_a_camera_without_a_place_sees_the_piece() -> None:
    """Over half of the picture, from where a plate before it, or one on either side, hides it least."""
    for walls in ((0,), (1,), (0, 1)):
        env = Camera(still(walls))
        seen, _ = env.reset(seed=0)
        rows, columns = np.nonzero(seen["mask"] == 1)
        assert max(np.ptp(rows), np.ptp(columns)) == pytest.approx(32, abs=3)
        assert len(rows) > 400
        env.close()


@pytest.mark.kernels
def test_checkers_find_nothing_to_object(push: PushGentle) -> None:
    env = Camera(PointCloud(push, points=20), 8, 12)
    assert isinstance(env.observation_space, gymnasium.spaces.Dict)
    assert set(env.observation_space.spaces) == {"seen", "points", "depth", "mask"}
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(env, skip_close_check=True)
    of_wrappers = ("render modes", "different from the unwrapped version")
    assert not [each for each in warned if not any(known in str(each.message) for known in of_wrappers)]


@pytest.mark.kernels
@pytest.mark.skipif(
    find_spec("stable_baselines3") is None and not os.environ.get("CI"), reason="pip install 'softseam[learn]'"
)
def test_stable_baselines3_finds_nothing_to_object(push: PushGentle) -> None:
    """But for what it says of all that are neither a list nor a coloured picture."""
    from stable_baselines3.common.env_checker import check_env as check

    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check(Camera(push, 8, 12))
    assert not [each for each in warned if "neither an image, nor a 1D vector" not in str(each.message)]


@pytest.mark.kernels
def test_a_simulation_that_fails_shows_what_was_seen_last(push: PushGentle, monkeypatch: pytest.MonkeyPatch) -> None:
    env = Camera(push, 8, 8)
    before, _ = env.reset(seed=0)

    def fails(*_: object, **__: object) -> None:
        raise softseam.SimulationFailed("no")

    monkeypatch.setattr(type(push.session), "step", fails)
    after, _, terminated, _, info = env.step([1.0, 0.0])
    assert terminated and info["ending"] == "failed" and (after["depth"] == before["depth"]).all()


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"height": 0}, "height=0"),
        ({"width": 2.5}, "width="),
        ({"fov": 180.0}, "fov="),
        ({"far": 0.0}, "far="),
        ({"eye": [0, 0, 1]}, "target=None"),
        ({"eye": [0, 0], "target": [0, 0, 0]}, "three numbers"),
        ({"eye": [0, 0, 0], "target": [0, 0, 0]}, "the same place"),
    ],
)
def test_what_is_no_picture_is_refused(push: PushGentle, given: dict[str, Any], text: str) -> None:
    with pytest.raises(softseam.BadInput, match=text):
        Camera(push, **given)


def test_what_has_nothing_to_see_is_refused() -> None:
    with pytest.raises(softseam.BadInput, match="nothing to see"):
        Camera(gymnasium.make("CartPole-v1"))
