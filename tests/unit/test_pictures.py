"""Pictures of a run: they exist, show both regions and the stress, and need no display."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import solids
from benchmarks.pictures import WIDTH, smaller
from damaged import with_a_bad_chunk
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image
from solids import obj
from squeeze import Squeeze

import softseam
from softseam.pictures import draw_pictures
from softseam.recording import Recording
from softseam.replay.facts import summary
from softseam.replay.show import save_rrd
from softseam.replay.world import find_scales
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.charts import drawn_quantities, hatch_holes
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.session import StepReport
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


@pytest.fixture(scope="module")
def drawn(recording: Path) -> subprocess.CompletedProcess[str]:
    """Pictures drawn into a new folder by a process of its own, which says their names and what else it loaded."""
    code = (
        "import sys; from softseam.pictures import draw_pictures; "
        f"folder = {str(recording.parent / 'new' / 'folder')!r}; "
        f"print(*(path.name for path in draw_pictures({str(recording)!r}, folder))); "
        "print(*({'rerun', 'numba', 'scipy', 'zenoh'} & set(sys.modules)))"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.kernels
def test_drawing_loads_neither_rerun_nor_a_solver(drawn: subprocess.CompletedProcess[str]) -> None:
    assert drawn.returncode == 0, drawn.stderr
    assert drawn.stdout.splitlines()[1] == ""


@pytest.mark.kernels
def test_three_pictures_that_show_something(recording: Path, drawn: subprocess.CompletedProcess[str]) -> None:
    assert drawn.stdout.splitlines()[0] == "snapshots.png curves.png time.png", drawn.stderr
    written = [recording.parent / "new" / "folder" / name for name in drawn.stdout.splitlines()[0].split()]
    snapshots = imread(written[0])
    assert hue_present(snapshots, colors.NEAR) > 0.01 and hue_present(snapshots, colors.FAR) > 0.005
    for path in written:
        picture = imread(path)
        assert picture.shape[0] > 400 and picture.shape[1] > 1000
        assert picture[..., :3].std() > 0.02, f"{path.name} is blank"
    assert set(written[0].parent.iterdir()) == set(written)


@pytest.mark.kernels
def test_curves_are_of_what_is_asked_for_or_else_of_what_is_not_nothing() -> None:
    """A grip that was asked for and never closed is drawn; nobody asks for the grip of a rod that presses."""
    run = Squeeze(3)
    builder = ReportBuilder(run.bundle)
    for message in run.messages():
        if isinstance(message, StepReport):
            wrench = message.wrench.copy()
            wrench[3, 2] = -0.4
            quantities = {"grip_force": 0.0, "sag": 1e-3, "slip": float("nan"), "compression": 0.0}
            builder.add(replace(message, wrench=wrench, quantities=quantities))
    assert drawn_quantities(("grip_force", "slip"), builder.columns) == ["grip_force"]
    assert drawn_quantities((), builder.columns) == ["sag", "ball.force"]


@pytest.mark.kernels
def test_fem_alone_is_painted_as_fem(tmp_path: Path) -> None:
    """In coral, though all of its cells are in the far region, and blue is PBD's."""
    with softseam.open("tofu_grasp", model="fem", record=tmp_path / "run.mcap") as session:
        session.reset()
        session.step(count=2)
    snapshots = imread(draw_pictures(tmp_path / "run.mcap", tmp_path)[0])
    body = snapshots[: len(snapshots) // 2]
    assert hue_present(body, colors.NEAR) > 0.01 and hue_present(body, colors.FAR) < 1e-4
    recording = Recording(tmp_path / "run.mcap")
    assert recording.surfaces
    builder = ReportBuilder(recording.bundle)
    for message in recording:
        builder.add(message)
    scales = find_scales(recording, "body", DisplaySurface(recording.surfaces["body"]))
    told = summary(recording, builder, {"body": scales})
    assert "Coral: FEM. Yellow" in told


def test_a_smaller_picture_keeps_the_scale_of_stress_even() -> None:
    """Beside a large picture of other colours; a palette chosen for the picture alone leaves bands."""
    other = np.linspace([255, 200, 180], [60, 20, 0], 500).astype(np.uint8)
    seen = np.broadcast_to(other[:, None], (500, WIDTH, 3)).copy()
    seen[:100], seen[100:112] = 255, colors.stress_colors(np.linspace(0.0, 1.0, WIDTH), 1.0)
    found = np.asarray(smaller(Image.fromarray(seen)).convert("RGB")).astype(int)
    assert (found[:90] == 255).all()
    assert np.abs(np.diff(found[106], axis=0)).max() < 10


@pytest.mark.kernels
def test_a_recording_cut_before_its_first_frame_still_gives_no_traceback(recording: Path, tmp_path: Path) -> None:
    data = recording.read_bytes()
    cut = tmp_path / "cut.mcap"
    for part in (0.3, 0.9):
        cut.write_bytes(data[: int(part * len(data))])
        assert Recording(cut).note is not None
        draw_pictures(cut, tmp_path / str(part))


@pytest.mark.kernels
def test_what_a_damaged_recording_lacks_is_hatched(tmp_path: Path) -> None:
    """Beside a recording of the steps that are left, whose curves are the same."""
    run = Squeeze(20, cell=0.025)
    damaged = with_a_bad_chunk(tmp_path / "damaged.mcap", run.begin, run.messages(), 3)
    (hole,) = Recording(damaged).holes
    assert hole.steps == 3
    with McapRecorder(tmp_path / "left.mcap", run.begin) as recorder:
        for message in Recording(damaged):
            recorder.write(message)
    left, hatched = (
        imread(draw_pictures(tmp_path / f"{name}.mcap", tmp_path / name)[1]) for name in ("left", "damaged")
    )
    assert 0.01 < (left != hatched).any(axis=2).mean() < 0.2


@pytest.mark.kernels
def test_a_beginning_that_is_missing_is_on_the_axis(tmp_path: Path) -> None:
    run = Squeeze(20, cell=0.025)
    recording = Recording(with_a_bad_chunk(tmp_path / "damaged.mcap", run.begin, run.messages(), 0))
    (hole,) = recording.holes
    assert hole.start == 0.0 and hole.steps and hole.end
    axes = Figure().subplots()
    axes.set_xlim(hole.end, 1.0)
    hatch_holes(axes, recording)
    assert axes.get_xlim() == (0.0, 1.0)


@pytest.mark.kernels
def test_tools_of_every_kind_are_recorded_drawn_and_replayed(tmp_path: Path) -> None:
    """Also a mesh, whose file is not at hand any more."""
    (tmp_path / "finger.obj").write_bytes(obj(*solids.box((0.01, 0.02, 0.04))))
    scene = {
        "softseam": 1,
        "name": "tools",
        "step": 0.01,
        "body": {
            "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
            "cell": 0.02,
            "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
        },
        "tools": {
            "ground": {"kind": "plane"},
            "finger": {"kind": "mesh", "path": "finger.obj", "position": [-0.026, 0, 0.02], "rotation": [0.1, 0, 0]},
            "box": {"kind": "box", "size": [0.01, 0.02, 0.02], "position": [0.03, 0, 0.02], "rotation": [0.5, 0, 0]},
            "rod": {"kind": "capsule", "radius": 0.004, "length": 0.02, "position": [0, 0, 0.045], "axis": [1, 0, 0]},
            "can": {"kind": "cylinder", "radius": 0.01, "length": 0.02, "position": [0, 0.04, 0.02], "axis": [1, 1, 0]},
        },
        "motion": [{"tools": ["finger"], "move": [0.004, 0, 0], "speed": 0.1}],
    }
    (tmp_path / "tools.yaml").write_text(json.dumps(scene))
    with softseam.open(tmp_path / "tools.yaml", record=tmp_path / "run.mcap") as session:
        assert session.run().momentum[0] > 1e-3, "the finger pushed the block"
    (tmp_path / "finger.obj").unlink()
    recording = Recording(tmp_path / "run.mcap")
    assert recording.surfaces and len(recording.surfaces["body"].tools["finger"].triangles) == 12
    assert len(draw_pictures(tmp_path / "run.mcap", tmp_path)) == 3
    save_rrd(recording, tmp_path / "run.rrd")
    assert (tmp_path / "run.rrd").stat().st_size > 10_000
