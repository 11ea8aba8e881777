"""Pictures of a run for people who have only the files: snapshots, curves, and where the time went."""

from pathlib import Path

from softseam.recording import Recording
from softseam.report import ReportBuilder
from softseam.view.charts import draw_curves, draw_time
from softseam.view.snapshots import draw_snapshots

__all__ = ["draw_pictures"]


def draw_pictures(recording: Recording | Path | str, folder: Path | str) -> list[Path]:
    """Write snapshots.png, curves.png and time.png into `folder`, which is created; returns what was written.

    Raises RecordingError where the recording cannot be read, and OSError where the folder cannot be written.
    """
    if not isinstance(recording, Recording):
        recording = Recording(recording)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    for message in recording:
        builder.add(message)
    written = []
    if recording.surfaces and recording.counts.get("Frame"):
        written.append(draw_snapshots(recording, builder, folder / "snapshots.png"))
    if len(builder.columns):
        written.append(draw_curves(recording, builder, folder / "curves.png"))
        written.append(draw_time(recording, builder, folder / "time.png"))
    return written
