"""What the Python client makes of a scene: its settings changed, and one model or both of them instead of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from held_cube import CLOSE, SCENE

import softseam
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.motion import HoldPhase
from softseam_protocol.scene.regions import RegionsSpec


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "cube.yaml"
    file.write_text(SCENE)
    return file


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (["step=0.01", "body.material.young=-1"], "--set body.material.young=-1: body.material.young: should be"),
        (["step=0.01", "body.material={young: -1}"], "--set body.material={young: -1}: body.material"),
        (["step=0.01", "body.material.yung=1"], "--set body.material.yung=1: body.material.yung: "),
        (["step=0.01", "regions={default: pbd}", "symmetry=[x]"], "--set symmetry=[x]: symmetry: "),
    ],
)
def test_of_several_settings_that_is_named_which_is_wrong(path: Path, settings: list[str], told: str) -> None:
    with pytest.raises(softseam.SceneRefused) as refused:
        softseam.with_settings(softseam.load_scene(path), settings)
    assert str(refused.value).startswith(told)


@pytest.mark.kernels
def test_models(path: Path) -> None:
    """A scene is simulated with one model alone, or as it says."""
    scene = softseam.load_scene(path)
    for model in ("fem", "pbd"):
        varied = softseam.with_model(scene, model)
        assert (varied.regions.default, varied.regions.near) == (model, None)
        with softseam.open(varied) as session:
            session.reset()
            assert {region.model for region in session.step(CLOSE).parts.values()} == {model}
    assert softseam.with_model(scene, "hybrid") == scene
    spared = softseam.with_settings(scene, ["regions.near.split=when_cheaper"])
    assert softseam.with_model(spared, "hybrid") == scene


@pytest.mark.parametrize(("cell", "within"), [("cell=0.01", 0.005), ("cell=[0.01, 0.0125, 0.01]", 0.00625), ("", 0.0)])
@pytest.mark.parametrize("moves", [True, False])
def test_a_hybrid_without_regions_is_fem_near_tools(path: Path, cell: str, within: float, moves: bool) -> None:
    """Within half a cell of those that move, of all where none does; a block's own cells are a third of its extent."""
    settings = [f"body.{cell}" if cell else "body.cell=null"]
    settings += ["regions.goal=grip_force"] if moves else ["motion=[]", "duration=0.1"]
    scene = softseam.with_settings(softseam.with_model(softseam.load_scene(path), "fem"), settings)
    regions = softseam.with_model(scene, "hybrid").regions
    assert regions.near is not None and (regions.default, regions.near.model, regions.near.split) == (
        ("pbd", "fem", "always")
    )
    assert isinstance(scene.body, BodySpec) and isinstance(scene.body.shape, BlockShape)
    assert regions.near.within == pytest.approx(within or min(scene.body.shape.size) / 6.0, rel=1e-5)
    assert regions.near.tools == (None if moves else tuple(scene.tools))
    assert regions.goal == ("grip_force" if moves else None)


@pytest.mark.parametrize("name", ["null", "true", "no"])
def test_a_tool_may_be_called_what_means_something_in_a_file(path: Path, name: str) -> None:
    scene = softseam.load_scene(path)
    still = scene.model_copy(update={"tools": {name: scene.tools["ground"]}, "motion": (), "duration": 0.1})
    near = softseam.with_model(still.model_copy(update={"regions": RegionsSpec()}), "hybrid").regions.near
    assert near is not None and near.tools == (name,)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["tools={}", "motion=[]", "duration=0.1"], "it has no tools: add one to it, e.g. regions"),
        (
            ["body.shape={kind: mesh, path: a.stl}", "body.cell=null"],
            "its cells' size, which only its file has, is not",
        ),
        (["models.fem.step_error=0.01"], "cannot be cut into FEM and PBD: "),
    ],
)
def test_what_cannot_be_cut_is_refused(path: Path, settings: list[str], words: str) -> None:
    scene = softseam.with_settings(softseam.with_model(softseam.load_scene(path), "fem"), settings)
    with pytest.raises(softseam.BadInput, match=words):
        softseam.with_model(scene, "hybrid")


def test_settings(path: Path) -> None:
    """Settings walk through mappings and lists, begin absent parts, and are validated together."""
    scene = softseam.load_scene(path)
    varied = softseam.with_settings(scene, ["tools.left.friction=0.05", "motion.1.hold=0.2", "seed=4"])
    assert varied.tools["left"].friction == 0.05
    assert isinstance(varied.motion[1], HoldPhase) and varied.motion[1].hold == 0.2
    assert varied.seed == 4
    bare = softseam.with_model(scene, "pbd")
    near = softseam.with_settings(bare, ["regions.near.within=0.01"]).regions.near
    assert near is not None and near.within == 0.01
    for bad in ("motion.7.hold=1", "motion.x.hold=1", "step.deep=1", "=1", "step"):
        with pytest.raises(softseam.SoftseamError, match="--set"):
            softseam.with_settings(scene, [bad])
