"""A scene that is not symmetric where it says so is refused, with what breaks it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import block
from numpy.typing import NDArray
from symmetric import FINGERS, SPAN, TIPS, core

from softseam.errors import SceneRefused, SimulationFailed
from softseam.report import ReportBuilder
from softseam.scenes import load_scene
from softseam.session import open_as_given
from softseam.variants import with_model, with_settings
from softseam_protocol.scene.file import SceneError, bundle_scene, parse_scene
from softseam_services.body.build import build_body
from softseam_services.body.errors import SettingError
from softseam_services.tools.build import build_tools
from softseam_services.tools.symmetry import check_symmetry

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

CLAMP = {"min": (-1, -1, -1), "max": (-0.024, 1, 1)}
BROKEN: dict[str, tuple[dict[str, Any], str, str]] = {
    "an odd number of cells": ({"cell": (0.0166, 0.025, 0.025)}, "x", "the plane cuts cells"),
    "gravity across": ({"gravity": (1.0, 0.0, -9.81)}, "x", "gravity crosses the plane"),
    "weight": ({}, "z", "gravity crosses the plane"),
    "a tool at one side": ({"tools": {"left": {**TIPS, "position": (-0.0305, 0.0, 0.025)}}}, "x", "tool 'left' has no"),
    "an off-centre tool": ({"tools": {"tip": {**TIPS, "position": (0.0, 0.001, 0.06)}}}, "y", "tool 'tip' has no"),
    "heights": ({"tools": {**FINGERS, "left": {**TIPS, "position": (-0.0305, 0, 0.03)}}}, "x", "tool 'left' has no"),
    "friction": ({"tools": {**FINGERS, "left": {**FINGERS["left"], "friction": 0.2}}}, "x", "tool 'left' has no"),
    "a slope": ({"tools": {"ground": {"kind": "plane", "normal": (0.1, 0, 1), "point": (0, 0, -1)}}}, "x", "'ground'"),
    "a clamped face": ({"body": {"fixed": [CLAMP]}}, "x", "body.fixed clamps one side"),
    "a spin": ({"body": {"spin": (0.0, 0.0, 1.0)}}, "x", "body.spin crosses"),
    "a throw": ({"body": {"velocity": (0.0, 1.0, 1.0)}}, "y", "body.velocity or"),
    "an inclusion": ({"cell": 0.0125, "body": {"inclusions": [core(0.0125)]}}, "x", "an inclusion is not its own"),
    "a lone move": (
        {"tools": FINGERS, "motion": [{"tools": ["left"], "move": [0, 0, 0.01], "speed": 0.1}]}, "x",
        "motion.0 moves 'left' without its image",
    ),
    "a move across": (
        {"tools": FINGERS, "motion": [*SPAN, {"tools": ["left", "right"], "move": [0, 0.01, 0], "speed": 0.1}]}, "y",
        "motion.1 moves tools across the plane",
    ),
    "a turn": (
        {"tools": FINGERS, "motion": [{"tools": ["left", "right"], "turn": [0, 0, 0.1], "speed": 0.1}]}, "x",
        "motion.0 turns tools out of the plane",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_not_symmetric_is_refused(name: str) -> None:
    """With what breaks it; the same scene without `symmetry` is run."""
    keys, symmetry, said = BROKEN[name]
    scene = block(**{"gravity": (0, 0, -9.81), "cell": 0.025, "regions": {"default": "fem"}, **keys})
    check_symmetry(scene, build_body(scene, {}), build_tools(scene))
    scene = scene.model_copy(update={"symmetry": tuple(symmetry)})
    with pytest.raises(SettingError) as refused:
        check_symmetry(scene, build_body(scene, {}), build_tools(scene))
    assert str(refused.value).startswith(f"symmetry: the scene is not symmetric in {symmetry[0]}: ")
    assert said in str(refused.value)


def test_a_session_refuses_it_and_names_the_tool() -> None:
    """A shipped scene with a plate moved off-centre; and a session that steers one plate alone fails in that step."""
    scene = with_model(load_scene("tofu_grasp"), "fem").model_copy(update={"symmetry": ("y",)})
    off = with_settings(scene, ("tools.left.position=[-0.0431, 0.002, 0.029]",))
    with pytest.raises(SceneRefused, match="not symmetric in y: tool 'left' has no image"), open_as_given(off):
        pass
    with open_as_given(scene) as session:
        session.reset()
        report = ReportBuilder(bundle_scene(scene))
        report.add(session.step().report)
        assert report.build()["symmetry"].startswith("in y: where fem has all cells it solves for a half of them")
        with pytest.raises(SimulationFailed, match="tool 'left' leaves the plane"):
            session.step({"left": (0.0, 0.01, 0.0)})


UNUSED: dict[str, tuple[str, str]] = {
    "pbd alone": ("regions: {default: pbd}", "no region is fem's"),
    "tetrahedra": ("models: {fem: {element: tet10}}", "tet10 divides cells otherwise"),
    "explicit": ("models: {fem: {integrator: symplectic_euler}}", "solves no equations"),
    "twice": ("symmetry: [x, x]", "named twice"),
    "old": ("models: {fem: {mirrored: true}}", r"write e\.g\. `symmetry: \[x, y\]` at the top"),
    "old, off": ("models: {fem: {mirrored: false}}", "leave this key out"),
}


@pytest.mark.parametrize("name", UNUSED)
def test_what_no_solver_uses_is_refused_in_its_line(name: str) -> None:
    line, said = UNUSED[name]
    keys = {"symmetry": "symmetry: [x]", "regions": "regions: {default: fem}"}
    keys[line.partition(":")[0]] = line
    body = "body: {shape: {kind: block, size: [0.1, 0.1, 0.1]}, material: {kind: linear, young: 1e4, poisson: 0.3, "
    text = f"softseam: 1\nname: case\nduration: 1\n{body}density: 1000}}}}\n" + "\n".join(keys.values())
    with pytest.raises(SceneError, match=said) as refused:
        parse_scene(text)
    at = "mirrored" if name.startswith("old") else "symmetry"
    assert refused.value.key.endswith(at)
