"""The recorder's process on a real bus: whole recordings, crashes, bad messages, an orderly end."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from squeeze import Squeeze

from softseam.recording import Recording
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.errors import Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Commit
from softseam_protocol.messages.recording import End, Recorded
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import encode
from softseam_services.bus_options import BusOptions
from softseam_services.orchestrator.recorder_feed import MOST_MESSAGES, PATIENCE, RecorderFeed

pytestmark = pytest.mark.slow

KEYS = Keys()
READY = 60.0


class Recorder:
    """A recorder's process that is up, writing into a folder."""

    def __init__(self, options: BusOptions, bus: Bus, folder: Path, largest_file: int | None = None) -> None:
        self.folder = folder

        def limit() -> None:
            if largest_file is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

        command = [sys.executable, "-m", "softseam_services", "serve", "recorder"]
        command += ["--connect", options.connect, "--directory", str(folder)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=limit)
        deadline = time.monotonic() + READY
        while not self.lives(bus):
            assert self.process.poll() is None and time.monotonic() < deadline, "the recorder does not come up"

    def lives(self, bus: Bus) -> bool:
        """Whether its token is seen."""
        return bool(bus.live(KEYS.every_live("recorder")))

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.stop(signal.SIGKILL)

    def stop(self, how: int = signal.SIGTERM) -> int:
        self.process.send_signal(how)
        code = self.process.wait(30.0)
        assert self.process.stderr is not None
        self.process.stderr.close()
        return code


@pytest.fixture(scope="module")
def options() -> Iterator[BusOptions]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(endpoint):
        yield BusOptions(connect=endpoint)


@pytest.fixture
def bus(options: BusOptions) -> Iterator[Bus]:
    with options.open() as bus:
        yield bus


@pytest.fixture
def recorder(options: BusOptions, bus: Bus, tmp_path: Path) -> Iterator[Recorder]:
    running = Recorder(options, bus, tmp_path / "recordings")
    yield running
    if running.process.poll() is None:
        running.stop()


def feed(bus: Bus, session: str, warnings: list[str]) -> RecorderFeed:
    return RecorderFeed(bus, KEYS, session, record=True, warn=lambda kind, message: warnings.append(message))


def encoded(path: Path) -> list[bytes]:
    return [data for kind, _, _, data in Recording(path).raw() if kind != "SurfaceMesh"]


def test_every_message_is_recorded_verbatim_the_first_and_the_last_too(bus: Bus, recorder: Recorder) -> None:
    for i in range(5):
        run = Squeeze(30, session=f"s{i}")
        messages = list(run.messages())
        warnings: list[str] = []
        source = feed(bus, run.session, warnings)
        source.begin(run.begin)
        for message in messages:
            source.publish(message)
        ended = source.end("done")
        source.close()
        assert isinstance(ended, Recorded) and warnings == []
        assert (ended.messages, ended.lost, ended.state) == (len(messages), 0, "closed")
        assert Path(ended.path) == recorder.folder / f"s{i}.mcap"
        assert encoded(Path(ended.path)) == [encode(message) for message in messages]
        assert Recording(ended.path).note is None


def test_a_second_run_of_a_session_gets_a_file_of_its_own(bus: Bus, recorder: Recorder) -> None:
    run = Squeeze(5)
    warnings: list[str] = []
    source = feed(bus, run.session, warnings)
    for _ in range(2):
        source.begin(run.begin)
        for message in run.messages():
            source.publish(message)
    assert source.end("done") is not None and warnings == []
    files = sorted(recorder.folder.iterdir())
    assert [file.name for file in files] == ["test-2.mcap", "test.mcap"]
    assert encoded(files[0]) == encoded(files[1])


def test_a_killed_recorder_costs_nothing_and_its_successor_goes_on(
    options: BusOptions, bus: Bus, recorder: Recorder
) -> None:
    run = Squeeze(3000, cell=0.025)
    warnings: list[str] = []
    source = feed(bus, run.session, warnings)
    source.begin(run.begin)
    successor = None
    longest, published, killed_at = 0.0, 0, 0
    for message in run.messages():
        began = time.monotonic()
        source.publish(message)
        longest = max(longest, time.monotonic() - began)
        published += 1
        if published == 600:
            assert bus.call(KEYS.recorder, Commit(run.begin.header), Recorded, 10.0).messages == 600
        if published == 700:
            os.kill(recorder.process.pid, signal.SIGKILL)
            recorder.process.wait()
            killed_at = published
        if published == 1500:
            successor = Recorder(options, bus, recorder.folder)
    assert successor is not None
    ended = source.end("done")
    assert successor.stop() == 0
    assert "the recorder is gone" in warnings[0] and "a recorder is back" in warnings[-1]
    assert longest < 3.0, "the run is never held up for long"
    first, second = Recording(recorder.folder / "test.mcap"), Recording(recorder.folder / "test-2.mcap")
    assert first.note is not None and "was cut off" in first.note
    assert 600 <= len(encoded(first.path)) <= killed_at, "what was committed is safe"
    assert second.note is None and ended is not None and ended.lost == 0
    assert encoded(second.path) == [encode(message) for message in run.messages()], "both, read as one"


def test_what_a_run_that_is_taken_up_says_first_takes_no_step_from_the_file_before(
    options: BusOptions, bus: Bus, recorder: Recorder
) -> None:
    """Its events have the header of the last step, which is in that file, where no recorder is there yet."""
    run = Squeeze(20)
    warnings: list[str] = []
    source = feed(bus, run.session, warnings)
    source.begin(run.begin)
    messages = list(run.messages())
    for message in messages:
        source.publish(message)
    assert bus.call(KEYS.recorder, Commit(run.begin.header), Recorded, 10.0).messages == len(messages)
    os.kill(recorder.process.pid, signal.SIGKILL)
    recorder.process.wait()
    source.close()
    while recorder.lives(bus):
        time.sleep(0.02)  # the pace of asking
    taken_up = feed(bus, run.session, warnings)
    taken_up.begin(replace(run.begin, header=replace(run.begin.header, step=20, time=0.2)))
    restored = Event(run.header(20), EventKind.RESTORED, "the orchestrator was lost")
    taken_up.publish(restored)
    with Recorder(options, bus, recorder.folder) as successor:
        taken_up.publish(restored)
        ended = taken_up.end("done")
        assert successor.stop() == 0
    assert ended is not None and ended.lost == 0
    assert [report.header.step for report in Recording(recorder.folder / "test-2.mcap").reports()] == list(range(20))


def test_a_frozen_recorder_is_waited_for_once_and_begins_anew_when_it_thaws(bus: Bus, recorder: Recorder) -> None:
    """More messages than may be on their way: the run waits two seconds once, and is never held up again."""
    run = Squeeze(MOST_MESSAGES, cell=0.025)  # two messages a step
    warnings: list[str] = []
    source = feed(bus, run.session, warnings)
    source.begin(run.begin)
    messages = list(run.messages())
    thaw = len(messages) - 50
    waits = []
    for n, message in enumerate(messages):
        if n == 100:
            assert bus.call(KEYS.recorder, Commit(run.begin.header), Recorded, 10.0).messages == 100
            os.kill(recorder.process.pid, signal.SIGSTOP)
        if n == thaw:
            os.kill(recorder.process.pid, signal.SIGCONT)
            deadline = time.monotonic() + READY
            while not recorder.lives(bus):
                code = recorder.process.poll()
                assert code is None and time.monotonic() < deadline, f"it does not come back: {code}, {warnings}"
                time.sleep(0.02)  # a flood of questions would keep it from coming back
        began = time.monotonic()
        source.publish(message)
        waits.append(time.monotonic() - began)
    said = " ".join(warnings)
    assert "lags behind" in said or "the recorder is gone" in said
    assert source.waited < PATIENCE + 0.5
    assert sorted(waits)[-3] < 0.5, "held up by its silence once, and by its return"
    ended = source.end("done")
    assert ended is not None and ended.state == "closed"
    kept = [data for path in sorted(recorder.folder.iterdir(), reverse=True) for data in encoded(path)]
    everything = [encode(message) for message in messages]
    assert kept[:100] == everything[:100], "what was committed is safe"
    assert kept[-40:] == everything[-40:], "and so is what came after"


def test_a_full_disk_ends_the_recording_not_the_run(options: BusOptions, bus: Bus, tmp_path: Path) -> None:
    """What fits is whole and readable, the loss is told, and the next recording gets its chance."""
    with Recorder(options, bus, tmp_path / "recordings", largest_file=400_000) as recorder:
        run = Squeeze(600, session="long")
        warnings: list[str] = []
        source = feed(bus, run.session, warnings)
        source.begin(run.begin)
        longest = 0.0
        messages = list(run.messages())
        for n, message in enumerate(messages):
            began = time.monotonic()
            source.publish(message)
            longest = max(longest, time.monotonic() - began)
            if n % 100 == 99:  # about what is simulated between two flushes
                bus.call(KEYS.recorder, Commit(run.begin.header), Recorded, 10.0)
        ended = source.end("done")
        assert longest < 1.0
        assert ended is not None and ended.lost > 0
        assert "File too large: the recording ends here, the run goes on" in ended.note
        assert warnings == [ended.note], "told once, while the run goes on"
        path = Path(ended.path)
        assert path.stat().st_size <= 400_000
        kept = encoded(path)
        assert 0 < len(kept) < len(messages)
        assert kept == [encode(message) for message in messages[: len(kept)]]
        short = Squeeze(5, session="short")
        source = feed(bus, short.session, warnings)
        source.begin(short.begin)
        for message in short.messages():
            source.publish(message)
        ended = source.end("done")
        assert ended is not None and (ended.lost, ended.state) == (0, "closed")
        assert recorder.stop() == 0


def test_bad_messages_are_counted_and_change_nothing(bus: Bus, recorder: Recorder) -> None:
    run = Squeeze(10)
    source = feed(bus, run.session, [])
    source.begin(run.begin)
    bus.publish(KEYS.session(run.session, Frame), b"\x00garbage")
    bus.publish(KEYS.session(run.session, StepReport), encode(Event(run.begin.header, EventKind.TOOLS, "y"))[:-3])
    for message in run.messages():
        source.publish(message)
    ended = source.end("done")
    assert ended is not None and ended.lost == 2
    assert encoded(Path(ended.path)) == [encode(message) for message in run.messages()]
    with pytest.raises(Refused, match="not being recorded: send Begin first"):
        bus.call(KEYS.recorder, Commit(Header(SCHEMA_VERSION, "nobody", "", 0, 0, 0, 0.0)), Recorded, 5.0)


def test_an_end_that_is_repeated_gets_the_same_answer(bus: Bus, recorder: Recorder) -> None:
    run = Squeeze(3)
    source = feed(bus, run.session, [])
    source.begin(run.begin)
    for message in run.messages():
        source.publish(message)
    ended = source.end("done")
    assert bus.call(KEYS.recorder, End(run.begin.header, "again"), Recorded, 5.0) == ended


def test_asked_to_stop_it_finishes_its_files(bus: Bus, recorder: Recorder) -> None:
    run = Squeeze(50)
    source = feed(bus, run.session, [])
    source.begin(run.begin)
    messages = list(run.messages())
    for message in messages:
        source.publish(message)
    assert bus.call(KEYS.recorder, Commit(run.begin.header), Recorded, 10.0).messages == len(messages)
    assert recorder.stop(signal.SIGTERM) == 0
    recording = Recording(recorder.folder / "test.mcap")
    assert recording.counts["StepReport"] == 50
    assert "was cut off: the recorder stops; read up to 0.5 s; 50 steps are read" in str(recording.note)


def test_a_folder_that_cannot_be_written_is_exit_2_and_one_line(options: BusOptions, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    command = [sys.executable, "-m", "softseam_services", "serve", "recorder", "--connect", options.connect]
    done = subprocess.run(
        [*command, "--directory", str(tmp_path / "file")], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.strip() == f"cannot record into {tmp_path / 'file'}: File exists"
