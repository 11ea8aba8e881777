"""`softseam run`: one scene from its file to a report, a recording and pictures."""

import shutil
import tempfile
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from rich.console import Console
from rich.text import Text

from softseam.checking import print_doubts
from softseam.choice import choice
from softseam.claims.estimate import Estimate
from softseam.claims.voice import speak
from softseam.closing import print_closing
from softseam.commands import planner
from softseam.embedded import compile_clock, conditions
from softseam.errors import BadInput, SoftseamError
from softseam.observation import Observation
from softseam.opening import open as open_session
from softseam.outputs import cannot_write, check_ending, check_outputs
from softseam.progress import RunProgress
from softseam.report import ReportBuilder, write_report
from softseam.scenes import bundle_of, inputs_of
from softseam.session import Session
from softseam.showing import draw, drawing_errors
from softseam.step_watch import StepWatch, limit_for
from softseam.variants import Model, with_settings
from softseam_protocol.facts import facts

_WAITING = "waiting for the run on longer cells that the claims come from"


@dataclass(frozen=True)
class Wishes:
    """What `softseam run` was asked for."""

    scene: str
    model: Model | None = None
    settings: tuple[str, ...] = ()
    connect: str | None = None
    record: Path | None = None
    report: Path | None = None
    pictures: Path | None = None
    view: bool = False
    tolerance: float | None = None
    step_limit: float | None = None
    """see `StepWatch` [s]; None: as long as suits the body"""
    estimate: bool | None = None
    """whether to run the sibling that claims come from; None: where it takes little of the run's time"""
    condition: bool = False
    """whether to report condition numbers, see `condition`"""


def run(wishes: Wishes, console: Console) -> dict[str, Any]:
    """Run a scene, show its progress and its closing table; returns the report."""
    settings = wishes.settings
    if wishes.tolerance is not None and wishes.model is not None:
        raise BadInput("--model and --tolerance exclude each other: a tolerance chooses the model, too")
    _check_outputs(wishes)
    if wishes.model is None and (wishes.tolerance is not None or _tolerance(wishes) is not None):
        planned = planner().planned_settings(wishes.scene, settings, wishes.tolerance, console)
        settings = (*settings, *planned)
    with tempfile.TemporaryDirectory(prefix="softseam-") as scratch:
        recording = wishes.record
        if recording is None and (wishes.pictures is not None or wishes.view):
            recording = Path(scratch) / "run.mcap"
        record: Path | bool | None = recording
        if wishes.connect is not None:
            record = recording is not None
        began = perf_counter()
        with Estimate(wishes.connect, wishes.estimate) as estimate:
            with open_session(
                wishes.scene, wishes.connect, model=wishes.model, settings=settings, record=record
            ) as session:
                print_doubts(session.doubts(), wishes.scene, settings, console)
                report = follow(
                    session,
                    console,
                    began=began,
                    model=wishes.model,
                    limit=wishes.step_limit,
                    compiles_here=wishes.connect is None,
                    begun=estimate.begin,
                    condition=wishes.condition,
                )
            speak(report, estimate.found(report, lambda: console.print(_WAITING)))
        if recording is not None:
            note_recording(report, session, _brought(session, recording))
        print_closing(console, report)
        if wishes.report is not None:
            write_report(report, wishes.report)
            console.print(f"\nreport: {wishes.report}", highlight=False)
        if wishes.record is not None:
            print_recording(console, report)
        if wishes.pictures is not None or wishes.view:
            assert recording is not None
            if not recording.exists():
                raise SoftseamError("nothing to draw: the recorder wrote no file that can be read from here")
            _show(recording, wishes, console)
    return report


def _tolerance(wishes: Wishes) -> float | None:
    return with_settings(bundle_of(wishes.scene)[0], wishes.settings).tolerance


def _check_outputs(wishes: Wishes) -> None:
    """Refuse an output before the run rather than after it."""
    files = []
    for option, path, ending, what in (
        ("--record", wishes.record, ".mcap", "a recording"),
        ("--report", wishes.report, ".json", "a report"),
    ):
        if path is not None:
            check_ending(option, path, ending, what)
            files.append((option, path))
    folders = [] if wishes.pictures is None else [("--pictures", wishes.pictures)]
    if files or folders:
        check_outputs(files, folders, inputs=inputs_of(wishes.scene))


def follow(
    session: Session,
    console: Console,
    *,
    began: float,
    model: Model | None = None,
    limit: float | None = None,
    compiles_here: bool = False,
    begun: Callable[[Session], None] | None = None,
    condition: bool = False,
) -> dict[str, Any]:
    """Run an open session to its end with progress; returns its report.

    began          when its set-up began, on the clock of perf_counter [s]
    limit          longest time in which it does not get on [s], 0 for ever; None: as long as suits the bodies
    compiles_here  whether this process compiles kernels, which may take longer than any step
    begun          called once the session was reset, before its first step
    condition      whether the report has condition numbers, see `condition`
    Raises SimulationFailed where it does not get on within the limit.
    """
    scene = session.scene
    builder = ReportBuilder(session.bundle, facts=facts(), model=None if model == "hybrid" else model)
    setup: float | None = None

    def step(observation: Observation) -> None:
        nonlocal setup
        if setup is None:
            setup = perf_counter() - began - observation.seconds.get("total", 0.0)
            console.print(Text(f"{scene.name}: {choice(scene, observation)}"), soft_wrap=True)
        builder.see(observation)
        progress.update(observation)
        watch.taken(observation)

    with (
        RunProgress(scene, console, scene.name) as progress,
        compile_clock() if compiles_here else nullcontext(_nothing) as compiled,
    ):
        frames = session.reset().frames
        limit = limit_for(sum(len(each.x) for each in frames.values()), not compiles_here) if limit is None else limit
        if begun is not None:
            begun(session)
        clock = process_time() - compiled()[1]
        with StepWatch(limit, progress.wait, lambda: compiled()[0]) as watch:
            session.run(step)
        cpu = process_time() - compiled()[1] - clock
    report = builder.build(setup_seconds=setup or 0.0)
    report["wall"]["cpu"] = cpu if compiles_here else None
    if condition:
        last = session.last.frames or session.restore(session.snapshot()).frames
        report["condition"] = conditions(session.bundle, frames, last)
    return report


def _nothing() -> tuple[float, float]:
    """Wall and processor time that is spent compiling elsewhere [s]."""
    return 0.0, 0.0


def note_recording(report: dict[str, Any], session: Session, path: Path | None) -> None:
    """Say in a report what became of the recording of a closed session, which lies here at `path` if anywhere.

    Where nobody knows how many messages it lost, that is None.
    """
    recorded = session.recorded
    lost, note = (None, session.unrecorded) if recorded is None else (recorded.lost, recorded.note)
    report["recording"].update(path=None if path is None else str(path), lost_messages=lost, note=note or None)


def print_recording(console: Console, report: Mapping[str, Any]) -> None:
    """One line on what `note_recording` said."""
    path, lost, note = (report["recording"][name] for name in ("path", "lost_messages", "note"))
    text = f"recording: {path or 'none'}"
    if lost:
        text += f", {lost} messages lost"
    elif lost is None and path is not None:
        text += ", nobody knows what it lost"
    console.print(Text(f"{text}: {note}" if note else text, style="bold red" if lost or note else ""), soft_wrap=True)


def _brought(session: Session, wanted: Path) -> Path | None:
    """Bring the recording here where a recorder of this machine wrote it; where it is now."""
    if session.recorded is None:
        return None
    path = Path(session.recorded.path)
    if path.is_file() and path.resolve() != wanted.resolve():
        try:
            shutil.copyfile(path, wanted)
        except OSError as error:
            raise cannot_write(wanted, error) from None
        path = wanted
    return path


def _show(path: Path, wishes: Wishes, console: Console) -> None:
    with drawing_errors():
        from softseam.recording import Recording

        recording = Recording(path)
        if wishes.pictures is not None:
            draw(recording, wishes.pictures, console)
        if wishes.view:
            from softseam.replay import replay

            replay(recording)
