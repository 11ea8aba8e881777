"""Shows a recording: into a file, a window or a browser."""

import socket
import tempfile
from pathlib import Path
from urllib.parse import quote

import rerun as rr

from softseam.outputs import whole
from softseam.recording import Recording
from softseam.replay.convert import convert
from softseam.replay.viewer import running

LOOPBACK = "127.0.0.1"


class ReplayError(Exception):
    """A replay cannot be written or shown; the text says why and what to do."""


def replay(
    recording: Recording | Path | str,
    *,
    save: Path | str | None = None,
    web: bool = False,
    bind: str = LOOPBACK,
    port: int = 9090,
) -> Path | None:
    """Write a .rrd file, or show the recording until the viewer is closed (or, in a browser, until Ctrl-C).

    save  the file to write; nothing is shown then
    web   serve a viewer for browsers
    bind  address at which browsers reach it; the default is this machine alone, a container wants 0.0.0.0
    port  the browser's port; another free one where it is taken
    Raises RecordingError and ReplayError; returns the file that was saved.
    """
    if not isinstance(recording, Recording):
        recording = Recording(recording)
    if save is not None:
        return save_rrd(recording, save)
    with tempfile.TemporaryDirectory(prefix="softseam-") as folder:
        file = save_rrd(recording, Path(folder) / f"{recording.path.stem}.rrd")
        if web:
            http = free_port(port)
            grpc = free_port(9876)
            arguments = web_arguments(file, http, grpc, bind)
            print(f"open {web_address(http, grpc)} in a browser on this machine; Ctrl-C ends it", flush=True)
        else:
            arguments = [str(file), "--bind", LOOPBACK, "--port", str(free_port(9876))]
        _show(arguments)
    return None


def save_rrd(recording: Recording, path: Path | str) -> Path:
    """Write a .rrd file, all or nothing."""
    path = Path(path)
    if path.suffix != ".rrd":
        raise ReplayError(f"{path}: a replay's name ends in .rrd")
    if not path.parent.is_dir():
        raise ReplayError(f"cannot write {path}: there is no folder {path.parent}")
    name = f"{recording.scene.name}-{recording.metadata.get('started', '')}"
    try:
        with whole(path) as fresh:
            with rr.RecordingStream("softseam", recording_id=name) as stream:
                stream.save(fresh)
                stream.send_recording_name(recording.scene.name)
                stream.send_blueprint(convert(recording, stream))
            stream.disconnect()
    except (OSError, RuntimeError) as error:
        raise ReplayError(f"cannot write {path}: {error}") from error
    return path


def web_address(http: int, grpc: int) -> str:
    """The page that shows what a viewer with `web_arguments` serves."""
    source = quote(f"rerun+http://{LOOPBACK}:{grpc}/proxy", safe="")
    return f"http://{LOOPBACK}:{http}/?url={source}"


def web_arguments(file: Path, http: int, grpc: int, bind: str = LOOPBACK) -> list[str]:
    """Serve `file` to browsers on this machine; rerun's own default would be every interface."""
    ports = ["--port", str(grpc), "--web-viewer-port", str(http)]
    return [str(file), "--serve-web", "--bind", bind, *ports]


def _show(arguments: list[str]) -> None:
    """Until the viewer is closed, or Ctrl-C."""
    try:
        with running(arguments) as process:
            code = process.wait()
    except KeyboardInterrupt:
        return
    if code:
        raise ReplayError(
            f"the viewer ended with code {code}: without a display, use --save FILE.rrd or --web (rerun says why above)"
        )


def free_port(wanted: int) -> int:
    """`wanted` where it is free on the loopback interface, else any free port."""
    for port in (wanted, 0):
        with socket.socket() as probe:
            try:
                probe.bind((LOOPBACK, port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    raise ReplayError("no port is free on this machine")
