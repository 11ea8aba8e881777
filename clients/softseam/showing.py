"""`softseam replay`: a recording in rerun, in a file, in pictures, or simulated again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from softseam.errors import BadInput, SoftseamError, missing_extra
from softseam.outputs import check_ending, check_outputs

if TYPE_CHECKING:
    from softseam.recording import Recording


def show(
    path: Path,
    console: Console,
    *,
    save: Path | None = None,
    web: bool = False,
    verify: bool = False,
    pictures: Path | None = None,
    bind: str = "127.0.0.1",
    port: int = 9090,
) -> int:
    """Do what is asked with a recording, in the order verify, save, pictures; show it where nothing is.

    Returns the exit code: 1 where a verification finds a difference.
    """
    if save is not None and web:
        raise BadInput("--save and --web exclude each other: save the file first, then show it")
    if save is not None:
        check_ending("--save", save, ".rrd", "a replay")
    code = 0
    with drawing_errors():
        from softseam.recording import Recording

        recording = Recording(path)
        if path.is_dir():
            console.print(f"newest recording: {recording.path}", highlight=False, soft_wrap=True)
        files = [] if save is None else [("--save", save)]
        folders = [] if pictures is None else [("--pictures", pictures)]
        check_outputs(files, folders, inputs={"the recording": recording.path})
        if recording.note:
            console.print(f"[yellow]{recording.note}", highlight=False)
        if verify:
            code = _verify(recording, console)
        if save is not None:
            save_rrd(recording, save, console)
        if pictures is not None:
            draw(recording, pictures, console)
        if web or not (verify or save or pictures):
            from softseam.replay import replay

            replay(recording, web=web, bind=bind, port=port)
    return code


def save_rrd(recording: Recording, path: Path, console: Console) -> None:
    """Save a recording for rerun."""
    from softseam.replay import replay

    with written_to(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replay(recording, save=path)
    console.print(f"for rerun: {path}", highlight=False)


def draw(recording: Recording, folder: Path, console: Console) -> None:
    """Draw a recording into a folder."""
    from softseam.pictures import draw_pictures

    with written_to(folder):
        written = draw_pictures(recording, folder)
    for path in written:
        console.print(f"picture: {path}", highlight=False)


def _verify(recording: Recording, console: Console) -> int:
    from softseam.replay import verify

    verification = verify(recording)
    console.print(verification.text, style="green" if verification.same else "bold red", highlight=False)
    return 0 if verification.same else 1


@contextmanager
def written_to(path: Path) -> Iterator[None]:
    """Name what could not be written, where the system does not: a full disk has no name."""
    try:
        yield
    except OSError as error:
        raise SoftseamError(f"cannot write {error.filename or path}: {error.strerror or error}") from error


@contextmanager
def drawing_errors() -> Iterator[None]:
    """Turn what recordings, replays and pictures raise into the client's errors."""
    try:
        from softseam.recording import RecordingError
    except ImportError as error:
        raise missing_extra(error, "reading a recording") from error
    try:
        yield
    except ImportError as error:
        raise missing_extra(error, "showing a recording") from error
    except RecordingError as error:
        raise BadInput(str(error)) from error
    except OSError as error:
        raise SoftseamError(f"cannot read or write {error.filename or 'a file'}: {error.strerror or error}") from error
    except Exception as error:
        # the replay's own error cannot be named here: its package needs rerun
        if type(error).__name__ == "ReplayError":
            raise SoftseamError(str(error)) from error
        raise
