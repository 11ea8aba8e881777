"""What gradients do not go through is refused before anything is done, with the key and a remedy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gradient_cases import PADS, grasp, scene, squeeze

import softseam
from softseam.errors import BadInput, UnknownTool
from softseam.losses import Run, Slope, displacement, tool_force

pytestmark = pytest.mark.kernels

LOSS = tool_force("left", [1.0, 0.0, 0.0])
PRESS = {"tools": ["left", "right"], "close": 0.02, "until": {"force": 1.0}}
TURN = {"tools": ["left"], "turn": [0.1, 0.0, 0.0], "speed": 1.0}
LIMITED = {"left": {"kind": "box", "size": PADS["left"][1], "position": PADS["left"][0], "force_limit": 3.0}}
SOFT = {"kind": "neo_hookean", "young": 20e3, "poisson": 0.45, "density": 1050.0}
PART = {
    "shape": {"kind": "sphere", "position": [0, 0, 0.02], "radius": 0.01},
    "material": {"young": 5e3, "poisson": 0.45, "density": 1050.0},
}


@pytest.mark.parametrize(
    ("given", "wrt", "words"),
    [
        (
            {"models": {"fem": {"integrator": "bdf2"}}},
            "young",
            "`models.fem.integrator`: .*implicit_euler, not .* bdf2",
        ),
        ({"models": {"fem": {"step_error": 1e-3}}}, "young", "`models.fem.step_error`: .*leave it out"),
        ({"symmetry": ["x"]}, "young", "`symmetry`: .*leave it out"),
        ({"regions": {"default": "pbd"}}, "young", "`regions`: .*model='fem'"),
        (
            {"body": {"material": {**SOFT, "retardation_time": 0.02}}},
            "young",
            "retardation_time` is longer .*at most 0.005",
        ),
        ({"motion": [PRESS]}, "young", r"`motion.0` depends on a force.*until: {compression"),
        ({"motion": [TURN]}, "young", r"`motion.0.turn`"),
        ({"body": {"inclusions": [PART]}}, "young", "`body.inclusions`: .*leave 'young' out"),
        ({"body": {"fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.01]}]}}, "position", "`body.fixed`"),
    ],
)
def test_a_scene_is_refused_by_its_key(given: dict[str, Any], wrt: str, words: str) -> None:
    with softseam.open(grasp(0.5, **given)) as sim:
        before = sim.reset()
        with pytest.raises(BadInput, match=words):
            sim.gradient(LOSS, [wrt], commands=squeeze(2))
        assert sim.last is before


def test_a_drive_with_a_limit_is_refused() -> None:
    with softseam.open(scene(LIMITED)) as sim, pytest.raises(BadInput, match=r"`tools.left.force_limit`"):
        sim.gradient(LOSS, ["young"], commands=[{}])


@pytest.mark.parametrize(
    ("wrt", "words"),
    [
        (["yuong"], r"by 'yuong'; did you mean 'young'\?"),
        (["way.lefft"], r"did you mean 'way.left'\?"),
        ([], "wrt is empty"),
        ("young", r"give a list of names, e.g. wrt=\['young'\]"),
    ],
)
def test_names_are_refused_with_the_nearest(wrt: Any, words: str) -> None:
    with softseam.open(grasp(0.5)) as sim, pytest.raises(BadInput, match=words):
        sim.gradient(LOSS, wrt, commands=squeeze(2))


def test_losses_of_wrong_shapes_are_refused() -> None:
    def wrong(run: Run) -> tuple[float, Slope]:
        return 0.0, Slope({"left": np.zeros((1, 3))})

    def endless(run: Run) -> tuple[float, Slope]:
        return float("nan"), Slope()

    with softseam.open(grasp(0.5)) as sim:
        for loss, words in (
            (wrong, r"slope by the force on 'left' must be finite, of shape \(2, 3\)"),
            (endless, "the loss is nan"),
            (tool_force("left", [1.0, 2.0]), r"weight of shape \(2,\)"),
            (displacement([1.0, 0.0, 0.0], nodes=[10**6]), "the body has those from 0 to 124"),
        ):
            with pytest.raises(BadInput, match=words):
                sim.gradient(loss, ["young"], commands=squeeze(2))
        with pytest.raises(UnknownTool, match=r"a tool 'lefft'; the scene has: ground, left, right"):
            sim.gradient(tool_force("lefft", [1.0, 0.0, 0.0]), ["young"], commands=squeeze(2))


def test_steps_without_a_derivative_are_refused_in_words() -> None:
    """A turn by hand; cells squeezed to nearly half, where quadrature depends on where the step began."""
    with softseam.open(grasp(0.5)) as sim:
        with pytest.raises(BadInput, match="step 0 turned a tool"):
            sim.gradient(LOSS, ["young"], commands=[{"left": [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}])
        with pytest.raises(BadInput, match=r"squeezed to nearly half: squeeze less"):
            sim.gradient(LOSS, ["young"], commands=squeeze(32, speed=0.09))
