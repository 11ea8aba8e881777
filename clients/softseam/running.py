"""`softseam run`: one scene from its file to a report, a recording and pictures."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

from rich.console import Console

from softseam.closing import print_closing
from softseam.errors import BadInput, SoftseamError
from softseam.observation import Observation
from softseam.progress import RunProgress
from softseam.report import ReportBuilder, write_report
from softseam.session import Session
from softseam.session import open as open_session
from softseam.showing import draw, drawing_errors
from softseam.variants import Model


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


def run(wishes: Wishes, console: Console) -> dict[str, Any]:
    """Run a scene, show its progress and its closing table; returns the report."""
    if wishes.record is not None and wishes.record.suffix != ".mcap":
        raise BadInput(f"--record {wishes.record}: a recording's name ends in .mcap")
    for path in (wishes.record, wishes.report):
        if path is not None:
            _writable(path)
    with tempfile.TemporaryDirectory(prefix="softseam-") as scratch:
        recording = wishes.record
        if recording is None and (wishes.pictures is not None or wishes.view):
            recording = Path(scratch) / "run.mcap"
        record: Path | bool | None = recording
        if wishes.connect is not None:
            record = recording is not None
        began = perf_counter()
        with open_session(
            wishes.scene, wishes.connect, model=wishes.model, settings=wishes.settings, record=record
        ) as session:
            report = follow(session, console, began=began, model=wishes.model)
        if recording is not None:
            _keep(session, recording, report)
        print_closing(console, report)
        if wishes.report is not None:
            write_report(report, wishes.report)
            console.print(f"\nreport: {wishes.report}", highlight=False)
        if wishes.record is not None:
            told = report["recording"]
            lost = f", {told['lost_messages']} messages lost: {told['note']}" if told["lost_messages"] else ""
            console.print(f"recording: {told['path'] or 'none: ' + str(told['note'])}{lost}", highlight=False)
        if wishes.pictures is not None or wishes.view:
            assert recording is not None
            if not recording.exists():
                raise SoftseamError("nothing to draw: the recorder wrote no file that can be read from here")
            _show(recording, wishes, console)
    return report


def follow(
    session: Session, console: Console, *, began: float, model: Model | None = None, label: str | None = None
) -> dict[str, Any]:
    """Run an open session to its end with progress; returns its report.

    began    when its set-up began, on the clock of perf_counter [s]
    """
    scene = session.scene
    builder = ReportBuilder(session.bundle, facts=_facts(), model=None if model == "hybrid" else model)
    setup: float | None = None

    def step(observation: Observation) -> None:
        nonlocal setup
        if setup is None:
            setup = perf_counter() - began - observation.seconds.get("total", 0.0)
        for event in observation.events:
            builder.add(event)
        builder.add(observation.report)
        progress.update(observation)

    with RunProgress(scene, console, label or scene.name) as progress:
        session.reset()
        session.run(step)
    return builder.build(setup_seconds=setup or 0.0)


def _keep(session: Session, wanted: Path, report: dict[str, Any]) -> None:
    """Note in the report what became of the recording, and bring it here where a recorder of this machine wrote it."""
    recorded = session.recorded
    if recorded is None:
        report["recording"]["note"] = "no recorder answered"
        return
    path = Path(recorded.path)
    if path.is_file() and path.resolve() != wanted.resolve():
        shutil.copyfile(path, wanted)
        path = wanted
    note = None if recorded.note == "closed" else recorded.note
    report["recording"].update(path=str(path), lost_messages=recorded.lost, note=note)


def _show(path: Path, wishes: Wishes, console: Console) -> None:
    with drawing_errors():
        from softseam.recording import Recording

        recording = Recording(path)
        if wishes.pictures is not None:
            draw(recording, wishes.pictures, console)
        if wishes.view:
            from softseam.replay import replay

            replay(recording)


def _writable(path: Path) -> None:
    """Refuse an output before the run rather than after it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot make the folder of {path}: {error.strerror}") from None
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise BadInput(f"cannot write {path}: choose a file in a folder that you may write to")


def _facts() -> Mapping[str, str]:
    """Versions and machine of this process."""
    found = {"python": platform.python_version(), "machine": platform.platform(), "cores": str(os.cpu_count() or 0)}
    for package in ("softseam", "numpy", "numba", "scipy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
