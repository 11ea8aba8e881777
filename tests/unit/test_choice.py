"""The first line of a run: which model has which cells, and why."""

from __future__ import annotations

import re

import numpy as np
import pytest
from gymnasium.spaces import Box
from several_bodies import several

import softseam
from softseam.choice import choice
from softseam.gym import SceneEnv
from softseam.observation import Observation


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("scene", "settings", "said"),
    [
        ("tofu_grasp", [], r"^FEM on all 12 cells, for one model is enough: .* of pbd at rest"),
        ("tofu_slab", [], r"^FEM on \d+, XPBD on \d+ of 80 cells, as the scene's regions say$"),
        (
            "tofu_push",
            ["regions={default: pbd}"],
            r"^XPBD on all \d+ cells, as the scene's regions say$",
        ),
        ("tofu_push", ["regions={}"], r"^FEM on all \d+ cells, for the scene names no model, and fem costs some"),
        ("tofu_push", ["regions={default: fem}"], r"^FEM on all \d+ cells, as the scene's regions say$"),
    ],
)
def test_it_says_which_model_has_which_cells(scene: str, settings: list[str], said: str) -> None:
    with softseam.open(scene, settings=settings) as session:
        session.reset()
        first = session.step()
        assert re.search(said, choice(session.scene, first)), choice(session.scene, first)


@pytest.mark.kernels
def test_it_says_so_of_each_body() -> None:
    with softseam.open(several()) as session:
        session.reset()
        told = choice(session.scene, session.step())
    tofu, jelly, nori = told.split("; ")
    assert tofu.startswith("tofu: FEM on 32, XPBD on 32 of 64 cells") and jelly.startswith("jelly: FEM on all 8 cells")
    assert nori == "nori: XPBD, which moves particles"


@pytest.mark.kernels
def test_an_observation_prints_in_a_line() -> None:
    with softseam.open("tofu_grasp") as session:
        session.reset()
        told = repr(session.step(fields=False))
    assert told.startswith("<Observation: step 1, 0.01 s; grip_force 0, ") and "\n" not in told and len(told) < 400


@pytest.mark.kernels
def test_one_model_alone_needs_no_seam() -> None:
    """newmark cannot meet a seam, and FEM alone has none; what names the seam itself is refused as before."""
    with softseam.open("cantilever", model="fem", settings=["models.fem.integrator=newmark"]) as session:
        session.reset()
        assert [part.model for part in session.step().parts.values()] == ["fem"]
    with pytest.raises(softseam.SceneRefused, match="newmark cannot meet a seam"):
        softseam.open("cantilever", settings=["models.fem.integrator=newmark"])


class TwoThreads(SceneEnv):
    """Its actions are said by the class."""

    action_space = Box(-1.0, 1.0, (2,), np.float32)

    def reward(self, before: Observation, after: Observation) -> float:
        return 0.0


def test_an_action_space_of_the_class_is_kept() -> None:
    env = TwoThreads("tofu_grasp", settings=["duration=0.1"])
    assert env.action_space.shape == (2,)
    env.close()
