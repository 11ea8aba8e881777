"""Pictures of a run: they exist, show both regions and the stress, and need no display."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from squeeze import Squeeze

from softseam.pictures import draw_pictures
from softseam.recording import Recording
from softseam.view import colors
from softseam_services.recorder.recorder import McapRecorder


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures") / "run.mcap"
    run = Squeeze(20, cell=0.025)
    with McapRecorder(path, run.begin) as recorder:
        for message in run.messages():
            recorder.write(message)
    return path


def hue_present(picture: np.ndarray, tone: tuple[int, int, int]) -> float:
    """Part of the pixels whose colour is the tone's, lighter or darker."""
    rgb = picture[..., :3].reshape(-1, 3)
    lit = rgb / np.maximum(np.linalg.norm(rgb, axis=1, keepdims=True), 1e-9)
    wanted = np.array(tone) / np.linalg.norm(tone)
    return float((lit @ wanted > 0.998).mean())


def test_three_pictures_that_show_something(recording: Path, tmp_path: Path) -> None:
    written = draw_pictures(recording, tmp_path / "new" / "folder")
    assert [path.name for path in written] == ["snapshots.png", "curves.png", "time.png"]
    snapshots = imread(written[0])
    assert hue_present(snapshots, colors.NEAR) > 0.01 and hue_present(snapshots, colors.FAR) > 0.005
    for path in written:
        picture = imread(path)
        assert picture.shape[0] > 400 and picture.shape[1] > 1000
        assert picture[..., :3].std() > 0.02, f"{path.name} is blank"
    assert {p.name for p in (tmp_path / "new" / "folder").iterdir()} == {p.name for p in written}


def test_a_recording_cut_before_its_first_frame_still_gives_no_traceback(recording: Path, tmp_path: Path) -> None:
    data = recording.read_bytes()
    cut = tmp_path / "cut.mcap"
    for part in (0.3, 0.9):
        cut.write_bytes(data[: int(part * len(data))])
        assert Recording(cut).note is not None
        draw_pictures(cut, tmp_path / str(part))


def test_drawing_loads_neither_rerun_nor_a_solver(recording: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from softseam.pictures import draw_pictures; "
        f"draw_pictures({str(recording)!r}, {str(tmp_path)!r}); "
        "bad = {'rerun', 'numba', 'scipy', 'zenoh'} & set(sys.modules); assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
