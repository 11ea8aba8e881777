"""SliceLift: any shape between the pads, lifted as TofuLift lifts tofu; shapes that are none are refused by name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from episodes import bits, episode

import softseam
from softseam.gym import Randomise, SliceLift, TofuLift
from softseam.gym.reward import Lift, Nearness, StressConcentration, Touch, Way
from softseam.scenes import scene_path

MESH = scene_path("dumpling").with_suffix(".obj")
SMALL = ["body.shape.scale=0.001", "body.cell=0.016"]
FULL = (Lift(), Way(), Touch(), StressConcentration(0.5))


@pytest.fixture(scope="module")
def env() -> Iterator[SliceLift]:
    env = SliceLift(MESH, settings=SMALL, reward=FULL)
    yield env
    env.close()


@pytest.mark.kernels
def test_a_mesh_of_ones_own_is_lifted_and_gently_is_worth_more(env: SliceLift) -> None:
    def close_to(force: float) -> Any:
        return lambda info: [0.4, 0.0] if info["grip_force"] < force else [0.0, 0.6]

    nothing, idle = episode(env, lambda info: [0.0, 0.0], seed=0)
    gentle, lifted = episode(env, close_to(0.5), seed=0)
    hard, pressed = episode(env, close_to(1.5), seed=0)
    assert (idle["ending"], lifted["ending"], pressed["ending"]) == ("time", "lifted", "lifted")
    assert lifted["lift_height"] >= 0.03 and lifted["stress"] < 0.8 * pressed["stress"]
    assert nothing < 0.0 < hard < gentle


@pytest.mark.kernels
def test_what_is_squeezed_by_half_is_crushed(env: SliceLift) -> None:
    total, info = episode(env, lambda info: [1.0, 0.0], seed=0)
    assert total < 0.0 and info["ending"] in ("crushed", "failed")


@pytest.mark.kernels
def test_it_is_tofu_lift_but_for_the_shape(env: SliceLift) -> None:
    tofu = TofuLift()
    assert (env.action_space, env.observation_space) == (tofu.action_space, tofu.observation_space)
    for name in ("act", "look", "stands", "ending", "vary", "step", "reset"):
        assert getattr(SliceLift, name) is getattr(TofuLift, name)


@pytest.mark.kernels
def test_pads_begin_clear_of_all_that_is_drawn_and_grip_the_shorter_side(env: SliceLift) -> None:
    widths = []
    for seed in range(6):
        env.reset(seed=seed)
        last, scene = env.session.last, env.session.scene
        pads = [np.array(last.tools[name].position) for name in ("left", "right")]
        along = (pads[1] - pads[0]) / np.linalg.norm(pads[1] - pads[0])
        assert abs(along[1]) > 0.98  # the dumpling is longer along x
        across = last.surface @ along
        assert pads[0] @ along + 5e-3 < across.min() and across.max() < pads[1] @ along - 5e-3
        widths.append(np.ptp(last.surface[:, 1]))
        assert scene.tools["ground"].friction != scene.tools["left"].friction
    assert max(widths) > 1.1 * min(widths)  # its size is drawn, too


@pytest.mark.kernels
def test_an_episode_knows_nothing_of_those_before_it(env: SliceLift) -> None:
    fresh = SliceLift(MESH, settings=SMALL, reward=FULL)
    assert bits(env, 5, 40) == bits(fresh, 5, 40)
    fresh.close()


@pytest.mark.kernels
def test_a_scene_lends_its_body_whatever_else_is_in_it() -> None:
    """Here a block that a plate pushes, cut in two models, with a probe."""
    env = SliceLift("tofu_push", randomise=None)
    assert list(env.scene.tools) == ["ground", "left", "right"]
    assert env.scene.body.material.retardation_time == 0.0025  # type: ignore[attr-defined]
    env.reset(seed=0)
    assert env.session.last.surface[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    env.close()


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("shape", "given", "refused", "told"),
    [
        ("dumplin", {}, softseam.SceneRefused, "did you mean 'dumpling'"),
        ("nothing.stl", {}, softseam.SceneRefused, "nothing.stl cannot be read"),
        (MESH, {"settings": ["body.shape.scale=0.005"]}, softseam.BadInput, "144 mm wide .* 120 mm .*scale"),
        (MESH, {"settings": SMALL, "randomise": Randomise(size=0.9, offset=0.05)}, softseam.BadInput, "do not fit"),
        ("cloth_fold", {}, softseam.BadInput, "no body in cells"),
        (MESH, {"settings": SMALL, "reward": [Nearness()]}, softseam.BadInput, "Nearness looks at 'distance'"),
        (MESH, {"settings": SMALL, "step": 0.03}, softseam.BadInput, "step=0.03"),
    ],
)
def test_what_cannot_be_lifted_is_refused(shape: str | Path, given: dict[str, Any], refused: Any, told: str) -> None:
    with pytest.raises(refused, match=told):
        SliceLift(shape, **given)


def test_a_file_that_is_no_mesh_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "broken.stl"
    broken.write_text("solid nothing\nendsolid nothing\n")
    with pytest.raises(softseam.SceneRefused, match=r"broken\.stl"):
        SliceLift(broken)
