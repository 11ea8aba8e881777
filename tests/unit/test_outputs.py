"""Outputs: nothing that a command reads is lost to what it writes, and what cannot be written is told beforehand."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
import solids
from solids import obj
from squeeze import Squeeze

import softseam
from softseam.errors import BadInput, SoftseamError
from softseam.outputs import check_outputs
from softseam.report import write_report
from softseam.scenes import inputs_of
from softseam.showing import drawing_errors, written_to


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene with a mesh as its body, and one as a tool."""
    (tmp_path / "body.json").write_bytes(obj(*solids.box((0.04, 0.04, 0.04))))
    (tmp_path / "finger.obj").write_bytes(obj(*solids.box((0.01, 0.02, 0.04))))
    run = Squeeze(1)
    document = json.loads(run.bundle.scene)
    document["tools"]["finger"] = {"kind": "mesh", "path": "finger.obj", "position": [0, 0, 1]}
    path = tmp_path / "scene.yaml"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.kernels
def test_files_that_a_scene_reads_are_no_outputs(scene: Path) -> None:
    """Also by another name: a link, or a way round."""
    inputs = inputs_of(scene)
    assert list(inputs) == ["the scene itself", "the scene's tools.finger.path"]
    link = scene.with_name("link.json")
    link.symlink_to(scene)
    for path, what in (
        (scene, "the scene itself"),
        (link, "the scene itself"),
        (scene.parent / ".." / scene.parent.name / "finger.obj", "the scene's tools.finger.path"),
    ):
        with pytest.raises(BadInput, match=f"--report .*: that is {what}, which would be lost"):
            check_outputs([("--report", path)], inputs=inputs)
    check_outputs([("--report", scene.with_name("run.json"))], inputs=inputs)
    assert {path.name for path in scene.parent.iterdir()} == {"scene.yaml", "body.json", "finger.obj", "link.json"}
    with pytest.raises(BadInput, match="which would be lost"):
        softseam.open(scene, record=scene)
    assert softseam.load_scene(scene).tools["finger"].kind == "mesh"


def test_outputs_do_not_take_each_other_s_place(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"--pictures .*x: --report is to be written there, too"):
        check_outputs([("--report", tmp_path / "x")], [("--pictures", tmp_path / "y" / ".." / "x")], inputs={})


def test_what_cannot_be_written_is_found_beforehand(tmp_path: Path) -> None:
    """By trying: root may write everywhere, by its rights, and not in /proc."""
    with pytest.raises(BadInput, match=r"--report /proc/run.json: cannot write there"):
        check_outputs([("--report", Path("/proc/run.json"))], inputs={})
    with pytest.raises(BadInput, match=r"--report /dev/null: .* no plain file"):
        check_outputs([("--report", Path("/dev/null"))], inputs={})
    with pytest.raises(BadInput, match=r"--pictures .*run.json/folder: cannot make the folder"):
        (tmp_path / "run.json").touch()
        check_outputs([], [("--pictures", tmp_path / "run.json" / "folder")], inputs={})
    check_outputs([("--report", tmp_path / "new" / "run.json")], [("--pictures", tmp_path / "pictures")], inputs={})
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["new", "pictures", "run.json"]


def test_a_report_that_cannot_be_written_is_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match=r"cannot write .*none/run.json: No such file"):
        write_report({}, tmp_path / "none" / "run.json")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(BadInput, match=r"cannot write .*/run.json: No space left on device"):
        write_report({"far": np.pi}, tmp_path / "run.json")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_told_by_what_was_to_be_written(tmp_path: Path) -> None:
    """The system says no file's name where a write fails, only where opening does."""
    with pytest.raises(SoftseamError, match=f"cannot write {tmp_path}: No space left"):
        with drawing_errors(), written_to(tmp_path):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
