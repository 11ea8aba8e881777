"""`softseam demo`: a scene through real processes on a bus, and everything that a run can leave behind."""

import shutil
import socket
import tempfile
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.text import Text

from softseam.checking import print_doubts
from softseam.closing import print_closing
from softseam.errors import BadInput, SoftseamError
from softseam.opening import open as open_session
from softseam.outputs import check_outputs
from softseam.processes import services
from softseam.report import write_report
from softseam.running import follow, note_recording, print_recording
from softseam.scenes import bundle_of, inputs_of
from softseam.showing import draw, drawing_errors, save_rrd
from softseam.variants import Model
from softseam_protocol.scene.scene import Scene


def run_demo(name: str, out: Path | None, console: Console) -> None:
    """Start router, FEM, PBD, orchestrator and recorder, step a scene as a client, stop them, draw what came out.

    Leaves run.mcap, run.rrd, report.json and pictures (PNG) in `out`; raises SoftseamError where anything is missing.
    """
    scene, _ = bundle_of(name)
    folder = out or Path("out") / f"demo-{scene.name}"
    check_outputs([("--out", folder / file) for file in ("run.mcap", "run.rrd", "report.json")], inputs=inputs_of(name))
    began = perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        scratch = tempfile.TemporaryDirectory(prefix=".recording-", dir=folder)
    except OSError as error:
        raise BadInput(f"cannot write into {folder}: {error.strerror}; choose another folder with --out") from None

    def say(text: str) -> None:
        console.print(Text(text, style="dim"), soft_wrap=True)

    with scratch as recordings:
        endpoint = f"tcp/127.0.0.1:{_free_port()}"
        console.print(
            f"starting router, fem, pbd, orchestrator and recorder at {endpoint}; "
            "the first time, their kernels are compiled for a minute or so",
            highlight=False,
        )
        with services(endpoint, Path(recordings), say):
            set_up = perf_counter()
            with open_session(name, endpoint, model=_both(scene), record=True) as session:
                print_doubts(session.doubts(), name, (), console)
                report = follow(session, console, began=set_up)
        written = sorted(Path(recordings).rglob("*.mcap"))
        if len(written) != 1:
            raise SoftseamError(f"the recorder left {len(written)} recordings instead of one: see what it says above")
        recording = folder / "run.mcap"
        shutil.move(written[0], recording)
    print_closing(console, report)
    console.print()
    note_recording(report, session, recording.relative_to(folder))
    write_report(report, folder / "report.json")
    with drawing_errors():
        from softseam.recording import Recording

        opened = Recording(recording)
        if opened.note:
            console.print(Text(f"the recording is not whole: {opened.note}", style="bold red"))
        print_recording(console, report)
        console.print(f"report: {folder / 'report.json'}", highlight=False)
        save_rrd(opened, folder / "run.rrd", console)
        draw(opened, folder, console)
    console.print(
        f"\neverything is in [bold]{folder}[/bold], after {perf_counter() - began:.0f} s; "
        f"look at it with: softseam replay {recording}",
        highlight=False,
        soft_wrap=True,
    )


def _both(scene: Scene) -> Model | None:
    """A demo shows the seam also where one model would do."""
    return "hybrid" if scene.regions.hybrid else None


def _free_port() -> int:
    """A port of the loopback interface that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
