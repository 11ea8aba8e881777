"""Reading recordings: whole, cut anywhere, damaged anywhere, or no recordings at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from squeeze import Squeeze

from softseam.recording import Recording, RecordingError
from softseam_protocol.wire import codec
from softseam_services.recorder.log_file import LogFile


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[bytes]]:
    """A small recording with several chunks, and its messages."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    run = Squeeze(6, cell=0.025)
    file = LogFile(path, run.begin)
    encoded = []
    for i, message in enumerate(run.messages()):
        encoded.append(codec.encode(message))
        file.add(type(message), message.header.time, encoded[-1], i)
        if i % 3 == 2:
            file.flush()
    file.close()
    return path.read_bytes(), encoded


def read(path: Path) -> tuple[list[bytes], str | None]:
    """Messages and note; they must agree with each other."""
    recording = Recording(path)
    messages = [data for kind, _, _, data in recording.raw() if kind != "SurfaceMesh"]
    assert len(list(recording)) == len(messages)
    assert sum(recording.counts.values()) - recording.counts.get("SurfaceMesh", 0) == len(messages)
    return messages, recording.note


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.0, 1.0, exclude_max=True))
def test_cut_anywhere_it_is_read_up_to_the_cut(tmp_path: Path, whole: tuple[bytes, list[bytes]], part: float) -> None:
    data, encoded = whole
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: int(part * len(data))])
    try:
        messages, note = read(path)
    except RecordingError as error:
        assert str(path) in str(error) and int(part * len(data)) < data.index(b"SurfaceMesh") + 1000
        return
    assert messages == encoded[: len(messages)]
    assert note is not None and "cut off" in note


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_damaged_anywhere_it_never_lies_and_never_raises_anything_else(
    tmp_path: Path, whole: tuple[bytes, list[bytes]], part: float, flip: int
) -> None:
    """What is read is a prefix of what was written, whatever byte changed (the index behind the data is not read)."""
    data, encoded = whole
    damaged = bytearray(data)
    damaged[int(part * len(data))] ^= flip
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    try:
        messages, _ = read(path)
    except RecordingError as error:
        assert str(path) in str(error)
        return
    assert messages == encoded[: len(messages)]


def test_a_damaged_seed_is_refused(tmp_path: Path, whole: tuple[bytes, list[bytes]]) -> None:
    """The one number in the head that no checksum covers; its length makes the rest of the head part of it."""
    data, _ = whole
    place = data.index(b"seed\x01\x00\x00\x00") + 8
    path = tmp_path / "seed.mcap"
    path.write_bytes(data[:place] + b"x" + data[place + 1 :])
    with pytest.raises(RecordingError, match="which seed"):
        read(path)


def test_every_flush_is_a_place_to_cut(tmp_path: Path, whole: tuple[bytes, list[bytes]]) -> None:
    """Cut right behind the last chunk: nothing is missing but the index, and the note says so."""
    data, encoded = whole
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[:-20])
    messages, note = read(path)
    assert messages == encoded
    assert note is not None and "no message is missing" in note


def foreign(path: Path) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="x")
        writer.finish()  # type: ignore[no-untyped-call]


def newer(path: Path) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="softseam", library="x")
        writer.add_metadata("softseam", {"schema": "99"})
        writer.finish()  # type: ignore[no-untyped-call]


def older(path: Path) -> None:
    """With a message of that schema in it, which is not damaged."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="softseam", library="x")
        writer.add_metadata("softseam", {"schema": "0"})
        writer.add_metadata("facts", {"softseam": "0.0.1"})
        schema = writer.register_schema("softseam.v0.StepReport", "protobuf", b"")
        channel = writer.register_channel("/softseam/StepReport", "protobuf", schema)
        name = b"softseam.v0.StepReport"
        writer.add_message(channel, 0, b"\x0a" + bytes([len(name)]) + name, 0)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "there is no recording"),
        (lambda path: path.mkdir(), "no recording .* in the folder"),
        (lambda path: path.write_bytes(b""), "does not begin like an MCAP file"),
        (lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" * 10), "does not begin like an MCAP file"),
        (lambda path: path.write_bytes(bytes((137, 77, 67, 65, 80, 48, 13, 10))), "cut off at once"),
        (foreign, "another program"),
        (newer, "schema version 99; .* or a newer one, or record its scene again"),
        (older, r"schema version 0; .* read it with the softseam that recorded it \(0\.0\.1\), or record its scene"),
    ],
)
def test_what_is_no_recording_is_one_clear_error(tmp_path: Path, make: object, words: str) -> None:
    path = tmp_path / "x.mcap"
    make(path)  # type: ignore[operator]
    with pytest.raises(RecordingError, match=words) as caught:
        Recording(path)
    assert str(path) in str(caught.value)


def test_a_folder_stands_for_its_newest_recording(tmp_path: Path) -> None:
    for i, name in enumerate(("b.mcap", "a.mcap")):
        LogFile(tmp_path / name, Squeeze(1, cell=0.025).begin).close()
        os.utime(tmp_path / name, (i, i))
    assert Recording(tmp_path).path.name == "a.mcap"
