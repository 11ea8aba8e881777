"""The recorder: what goes in comes out verbatim, and no disk holds the simulation up."""

from __future__ import annotations

import contextlib
import os
import platform
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest
from full_disk import files_up_to
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from squeeze import Squeeze

from softseam.recording import Recording
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.wire import codec
from softseam_services.recorder import room
from softseam_services.recorder.log_file import LogFile, log_time
from softseam_services.recorder.recorder import McapRecorder
from softseam_services.recorder.whole_file import RecordError, WholeFile

TESTS = Path(__file__).parents[1]


def record(path: Path, run: Squeeze) -> list[StepReport | Frame | Event]:
    messages = list(run.messages())
    with McapRecorder(path, run.begin) as recorder:
        for message in messages:
            recorder.write(message)
    assert recorder.lost == 0 and recorder.progress().state == "closed"
    return messages


@pytest.mark.kernels
def test_messages_are_recorded_verbatim_and_in_order(tmp_path: Path) -> None:
    run = Squeeze(20)
    messages = record(tmp_path / "run.mcap", run)
    recording = Recording(tmp_path / "run.mcap")
    raw = [entry for entry in recording.raw() if entry[0] != "SurfaceMesh"]
    assert [data for _, _, _, data in raw] == [codec.encode(message) for message in messages]
    assert [when for _, when, _, _ in raw] == [log_time(message.header.time) for message in messages]
    wall = [published for _, _, published, _ in raw]
    assert wall == sorted(wall) and abs(wall[-1] - time.time_ns()) < 60e9
    assert recording.note is None and recording.counts["Frame"] == 20


@pytest.mark.kernels
def test_a_recording_holds_what_it_takes_to_simulate_it_again(tmp_path: Path) -> None:
    run = Squeeze(2)
    record(tmp_path / "run.mcap", run)
    recording = Recording(tmp_path / "run.mcap")
    assert recording.bundle == run.bundle and recording.scene == run.scene
    assert recording.seed == 7 and recording.metadata["session"] == "test"
    assert {"softseam", "numpy", "numba", "python", "machine"} <= set(recording.facts)
    assert platform.release() not in recording.facts["machine"]  # whose computer it is is nobody's business
    assert recording.surfaces
    assert recording.surfaces["body"].triangles.tobytes() == run.body.surface.triangles.tobytes()


@pytest.mark.kernels
def test_surface_points_at_rest_are_the_nodes_of_a_block(tmp_path: Path) -> None:
    """A block's surface points are lattice nodes: each rest position is one of the body's."""
    run = Squeeze(1)
    nodes = {tuple(x) for x in run.body.x_rest.round(9)}
    assert {tuple(x) for x in run.begin.surfaces["body"].point_rest.round(9)} <= nodes


@pytest.mark.kernels
def test_any_mcap_reader_reads_it(tmp_path: Path) -> None:
    """Compressed, with checksums, an index and embedded descriptors."""
    record(tmp_path / "run.mcap", Squeeze(3))
    with (tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 3 + 3 + 3 + 1
        assert {schema.encoding for schema in summary.schemas.values()} == {"protobuf"}
        assert all(len(schema.data) > 1000 for schema in summary.schemas.values())
        assert {a.name for a in reader.iter_attachments()} == {"scene.json", "files/notes.txt"}
    with (tmp_path / "run.mcap").open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if isinstance(r, Chunk)]
        assert {chunk.compression for chunk in chunks} == {"zstd"} and all(chunk.uncompressed_crc for chunk in chunks)


@pytest.mark.kernels
def test_a_file_that_exists_is_refused_numbered_or_replaced(tmp_path: Path) -> None:
    path, begin = tmp_path / "run.mcap", Squeeze(1).begin
    path.write_text("precious")
    with pytest.raises(RecordError, match=r"run\.mcap exists: choose another name"):
        McapRecorder(path, begin)
    assert path.read_text() == "precious"
    with McapRecorder(path, begin, existing="number") as recorder:
        assert recorder.path.name == "run-2.mcap"
    with McapRecorder(path, begin, existing="replace"):
        assert Recording(path).metadata["session"] == "test"


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["run.bag", "no/such/folder/run.mcap"])
def test_a_file_that_cannot_be_created_is_one_clear_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordError, match=name.rpartition("/")[2]):
        McapRecorder(tmp_path / name, Squeeze(1).begin)
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.kernels
def test_a_stalled_disk_costs_one_short_wait_and_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = Squeeze(40)
    told: list[str] = []
    recorder = McapRecorder(tmp_path / "run.mcap", run.begin, queue_bytes=400_000, patience=0.05, on_loss=told.append)
    stalled = threading.Event()
    pwrite = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda *args: (stalled.wait(30.0), pwrite(*args))[1])
    messages = list(run.messages())
    waits = []
    deadline = time.monotonic() + 20.0
    while recorder.lost < 50 and time.monotonic() < deadline:
        for message in messages:
            began = time.monotonic()
            recorder.write(message)
            waits.append(time.monotonic() - began)
    stalled.set()
    ended = recorder.close()
    assert ended.lost == recorder.lost >= 50
    assert told == ["the disk is too slow: messages are dropped until it catches up"]
    assert sum(wait > 0.04 for wait in waits) <= 3, "it waits once a stall, not once a message"
    assert ended.messages + ended.lost == len(waits)
    assert f"lacks {ended.lost} messages, for which the disk was too slow" in str(Recording(tmp_path / "run.mcap").note)


# Two threads print: a line and its end in one write.
CHILD = """
    import sys, time, resource
    sys.path.insert(0, {tests!r})
    from squeeze import Squeeze
    from softseam_services.recorder.recorder import McapRecorder
    run = Squeeze(400)
    messages = list(run.messages())
    {limit}
    recorder = McapRecorder({path!r}, run.begin, on_loss=lambda why: print(f"LOST {{why}}\\n", end="", flush=True))
    print("READY", flush=True)
    for i in range({count}):
        recorder.write(messages[i % len(messages)])
        print(f"AT {{time.time_ns()}}\\n", end="", flush=True)
        time.sleep({pause})  # the pace of a run
    ended = recorder.close()
    print("END", ended.messages, ended.lost, ended.note, flush=True)
"""


def child(path: Path, *, count: int, pause: float, limit: str = "") -> subprocess.Popen[str]:
    code = textwrap.dedent(CHILD).format(tests=str(TESTS), path=str(path), count=count, pause=pause, limit=limit)
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def kill_while_recording(path: Path) -> float:
    """Seconds of messages that a recorder killed with SIGKILL lost."""
    process = child(path, count=10_000, pause=0.004)
    assert process.stdout is not None
    written = []
    for line in process.stdout:
        if line.startswith("AT"):
            written.append(int(line.split()[1]))
        if len(written) > 2 and written[-1] - written[0] > 1.1e9:
            break
    process.send_signal(signal.SIGKILL)
    written += [int(line.split()[1]) for line in process.stdout if line.startswith("AT") and line.endswith("\n")]
    process.wait()
    recording = Recording(path)
    assert recording.note is not None and "was cut off" in recording.note
    return (written[-1] - max(published for _, _, published, _ in recording.raw())) / 1e9


@pytest.mark.kernels
@pytest.mark.slow
def test_kill_9_loses_a_quarter_of_a_second_at_most(tmp_path: Path) -> None:
    """The best of three: on a busy machine the writing thread may be scheduled late."""
    lost = []
    for attempt in range(3):
        lost.append(kill_while_recording(tmp_path / f"run{attempt}.mcap"))
        if lost[-1] <= 0.25:
            return
    pytest.fail(f"lost {lost} s")


@pytest.mark.kernels
@pytest.mark.slow
def test_a_full_disk_ends_the_recording_not_the_run(tmp_path: Path) -> None:
    """A file size limit makes the system refuse to write, as a full disk does."""
    path = tmp_path / "run.mcap"
    limit = "resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))"
    process = child(path, count=1600, pause=0.001, limit=limit)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0, "the run goes on"
    losses = [line for line in out.splitlines() if line.startswith("LOST")]
    assert len(losses) == 1 and "the recording ends here, the run goes on" in losses[0]
    _, messages, lost, *_ = next(line for line in out.splitlines() if line.startswith("END")).split()
    assert int(messages) + int(lost) == 1600 and int(lost) > 0
    recording = Recording(path)
    assert sum(recording.counts.values()) == int(messages) + 1, "the surface mesh, and what was reported as safe"
    last = max(report.header.time for report in recording.reports())
    assert f"was cut off: File too large; read up to {last + 0.01:.6g} s;" in str(recording.note)
    with path.open("rb") as stream:
        assert make_reader(stream).get_summary() is None, "other readers find its end, and scan it"


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("name", "bound", "why"),
    [("MOST", 100_000, "holds the 100,000 B that a recording may"), ("FLOOR", 1 << 60, "B of its disk are free")],
)
def test_a_recording_leaves_room_for_others(
    name: str, bound: int, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a size or with a floor that is free: told while the run goes on; what was counted as safe is in the file."""
    run, told = Squeeze(400), list[str]()
    path = tmp_path / "run.mcap"
    recorder = McapRecorder(path, run.begin, on_loss=told.append)
    monkeypatch.setattr(room, name, bound)
    deadline = time.monotonic() + 30.0
    written = 0
    while not told and time.monotonic() < deadline:
        for message in run.messages():
            recorder.write(message)
            written += 1
            time.sleep(0.0002)
    assert len(told) == 1 and why in told[0] and "the recording ends here, the run goes on" in told[0]
    recorder.write(next(iter(run.messages())))
    ended = recorder.close()
    assert ended.messages + ended.lost == written + 1 and ended.lost > 0 and ended.state == "failed"
    recording = Recording(path)
    assert sum(recording.counts.values()) == ended.messages + 1 and why in str(recording.note)
    assert name == "FLOOR" or path.stat().st_size < 10 * bound
    if name == "FLOOR":
        with pytest.raises(RecordError, match=why):
            McapRecorder(tmp_path / "other.mcap", run.begin)
        assert not (tmp_path / "other.mcap").exists()


def fill(path: Path, run: Squeeze) -> int:
    """Record with a flush a message; how many are in the file."""
    file = LogFile(path, run.begin)
    whole = 0
    try:
        for i, message in enumerate(run.messages()):
            file.add(type(message), message.header.time, codec.encode(message), i)
            file.flush()
            whole = i + 1
    except OSError as error:
        file.close(f"was cut off: {error.strerror}")
    else:
        file.close()
    return whole


@pytest.mark.kernels
@pytest.mark.parametrize("short", [1, 3_000, 80_000, 100_000])
def test_however_full_the_disk_the_file_says_where_it_ends(tmp_path: Path, short: int) -> None:
    """Room for it is kept from the first flush on, whether the disk fills within messages or within the index."""
    path, run = tmp_path / "run.mcap", Squeeze(30)
    fill(tmp_path / "whole.mcap", run)
    room = (tmp_path / "whole.mcap").stat().st_size - short
    every = len(list(run.messages()))
    whole = every
    with files_up_to(room), contextlib.suppress(OSError):
        whole = fill(path, run)
    recording = Recording(path)
    assert path.stat().st_size <= room
    assert sum(recording.counts.values()) - 1 == whole
    assert (whole < every) == (short > 10_000)
    assert ("was cut off: File too large" if whole < every else "no message is missing") in str(recording.note)


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = WholeFile(tmp_path / "run.mcap", "error", b"<tail>")
    file.write(b"whole")
    file.flush()
    pwrite = os.pwrite

    def full(fd: int, data: bytes, offset: int) -> int:
        if offset > 10:
            raise OSError(28, "No space left on device")
        return pwrite(fd, bytes(data)[:3], offset)

    monkeypatch.setattr(os, "pwrite", full)
    file.write(b"half written")
    with pytest.raises(OSError, match="No space left"):
        file.flush()
    file.close()
    assert (tmp_path / "run.mcap").read_bytes() == b"whole<tail>"
