"""Grains from outside, and what a model from outside moves, are recorded, drawn, replayed, and called by their names.

Apart from the rows themselves, so that services which import these load no viewer.
"""

from __future__ import annotations

from pathlib import Path

import mass_springs
import numpy as np
import pytest
import rerun as rr
import test_discretisation
import test_model_with_a_service
from extended_services import without
from matplotlib.image import imread

import softseam
from softseam.recording import Recording, RecordingError
from softseam.replay import convert, verify
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.snapshots import draw_snapshots

ROWS = (*test_discretisation.ROWS, *test_model_with_a_service.ROWS)
TAN = (190, 150, 90)


def read(path: Path) -> tuple[Recording, ReportBuilder]:
    recording = Recording(path)
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    for message in recording:
        builder.add(message)
    return recording, builder


@pytest.mark.parametrize("model", ["pbd", "springs"])
def test_grains_are_recorded_drawn_and_replayed(tmp_path: Path, model: str) -> None:
    """A replay is the run, bit for bit."""
    scene = test_discretisation.scene(regions={"default": model}, duration=0.1)
    with softseam.open(scene, record=tmp_path / "grains.mcap") as sim:
        seen = sim.run(fields=True)
    recording, builder = read(tmp_path / "grains.mcap")
    *_, last = recording.frames()
    np.testing.assert_array_equal(last.x, seen.positions)
    assert last.point_x.shape == (6 * 27, 3) and verify(recording).same
    picture = imread(draw_snapshots(recording, builder, tmp_path / "grains.png"))
    assert (np.ptp(picture[..., :3], axis=2) > 0.15).mean() > 0.01  # pixels that are neither paper, ink nor ground


def test_a_model_has_its_own_label_colour_and_cost(tmp_path: Path) -> None:
    """In reports, pictures and replays, beside another model's part, too; without its row a recording asks for it."""
    with softseam.open(test_model_with_a_service.scene(), record=tmp_path / "falls.mcap") as sim:
        sim.run(max_steps=20)
    recording, builder = read(tmp_path / "falls.mcap")
    report, columns = builder.build(), builder.columns
    assert report["model"] == "springs" and report["models"]["body"].startswith("Springs on all 1 cells")
    assert report["wall"]["springs"] == pytest.approx(columns["seconds.springs"].sum()) and report["wall"]["springs"]
    assert [*colors.parts(columns.models).values()] == [("Springs", TAN)]
    cut = {"body.near": "fem", "body.far": "springs"}
    assert colors.parts(cut)["body.far"] == ("far part: Springs", TAN) and colors.tones("body", cut)[1] == TAN
    convert.convert(recording, rr.RecordingStream("springs"))
    asks = pytest.raises(RecordingError, match=r"springs.*name the extension that adds it in SOFTSEAM_EXTENSIONS")
    with without(mass_springs), asks:
        Recording(tmp_path / "falls.mcap")
