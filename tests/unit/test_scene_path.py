"""Which file a scene's name means: folders are none."""

from __future__ import annotations

from pathlib import Path

import pytest

import softseam
from softseam.scenes import scene_path


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
