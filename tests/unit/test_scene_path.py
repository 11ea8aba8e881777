"""Which file a scene's name means: folders are none."""

from __future__ import annotations

from pathlib import Path

import pytest

import softseam
from softseam.scenes import bundle_of, inputs_of, scene_path
from softseam.variants import with_settings


def test_a_folder_does_not_hide_the_scene_of_that_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rope").mkdir()
    found = scene_path("rope")
    assert found.name == "rope.yaml" and found.is_file()
    (tmp_path / "jelly").write_text("a file does")
    assert scene_path("jelly") == Path("jelly")


@pytest.mark.parametrize("name", ["runs", "runs.yaml", "out/runs"])
def test_a_folder_is_said_to_be_one(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir(parents=True)
    with pytest.raises(softseam.SceneRefused, match=rf"^'{name}' is a folder: .*{name}/scene.yaml.* rope"):
        softseam.load_scene(name)


def test_what_is_not_there_is_left_to_whoever_reads_it(tmp_path: Path) -> None:
    with pytest.raises(softseam.SceneRefused, match=r"none\.yaml:1:1: cannot be read"):
        softseam.load_scene(tmp_path / "none.yaml")


def test_a_scene_made_in_code_names_meshes_from_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.obj").write_bytes(scene_path("dumpling").with_suffix(".obj").read_bytes())
    monkeypatch.chdir(tmp_path)
    scene = with_settings(softseam.load_scene("dumpling"), ["body.shape.path=mine.obj"])
    assert list(bundle_of(scene)[1].files) == ["mine.obj"]
    assert inputs_of(scene) == {"the scene's body.shape.path": Path("mine.obj")}
    with pytest.raises(softseam.BadInput, match="which would be lost"):
        softseam.open(scene, record="mine.obj")
    (tmp_path / "mine.obj").rename(tmp_path / "mina.obj")
    with pytest.raises(softseam.SceneRefused, match=r"body\.shape\.path: mine\.obj cannot be read.*'mina\.obj'"):
        softseam.open(scene)
