"""Reading recordings: whole, cut anywhere, damaged anywhere, or no recordings at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from squeeze import Squeeze

from softseam.recording import Recording, RecordingError
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import Event, StepReport
from softseam_protocol.wire import codec
from softseam_services.recorder.log_file import LogFile


@dataclass(frozen=True)
class Whole:
    """A small recording with several chunks, its messages, and where each chunk of them is: (start, end, messages)."""

    data: bytes
    encoded: list[bytes]
    chunks: list[tuple[int, int, int]]

    def without(self, *lost: int) -> list[bytes]:
        """The messages but for those of some chunks."""
        kept, at = [], 0
        for i, (_, _, count) in enumerate(self.chunks):
            kept += [] if i in lost else self.encoded[at : at + count]
            at += count
        return kept


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    run = Squeeze(25, cell=0.025)
    file = LogFile(path, run.begin)
    encoded: list[bytes] = []
    chunks = []
    for i, message in enumerate(islice(run.messages(), 45)):
        encoded.append(codec.encode(message))
        file.add(type(message), message.header.time, encoded[-1], i)
        if i % 3 == 2:
            start = file.size
            file.flush()
            chunks.append((start, file.size, 3))
    assert len(chunks) == 15
    file.close()
    return Whole(path.read_bytes(), encoded, chunks)


def read(path: Path) -> tuple[list[bytes], Recording]:
    """Messages, which agree with what else the recording says."""
    recording = Recording(path)
    messages = [data for kind, _, _, data in recording.raw() if kind != "SurfaceMesh"]
    assert len(list(recording)) == len(messages)
    assert sum(recording.counts.values()) - recording.counts.get("SurfaceMesh", 0) == len(messages)
    return messages, recording


@pytest.mark.kernels
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.0, 1.0, exclude_max=True))
def test_cut_anywhere_it_is_read_up_to_the_cut(tmp_path: Path, whole: Whole, part: float) -> None:
    size = int(part * len(whole.data))
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.data[:size])
    try:
        messages, recording = read(path)
    except RecordingError as error:
        assert str(path) in str(error) and size < whole.chunks[0][0]
        return
    assert messages == whole.without(*(i for i, (_, end, _) in enumerate(whole.chunks) if _chunk_end(whole, i) > size))
    assert recording.note is not None and "cut off" in recording.note


def _chunk_end(whole: Whole, i: int) -> int:
    """End of a chunk without the indices of its messages."""
    start = whole.chunks[i][0]
    return start + 9 + int.from_bytes(whole.data[start + 1 : start + 9], "little")


@pytest.mark.kernels
@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@example(part=0.0003, flip=1)  # in the head's name of who recorded it
def test_damaged_anywhere_it_loses_that_chunk_alone(tmp_path: Path, whole: Whole, part: float, flip: int) -> None:
    """Whatever byte changes, all chunks that are whole are read (of a chunk's prefix no checksum tells: it may be)."""
    place = int(part * len(whole.data))
    damaged = bytearray(whole.data)
    damaged[place] ^= flip
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    hit = [i for i, (start, _, _) in enumerate(whole.chunks) if start <= place < _chunk_end(whole, i)]
    try:
        messages, recording = read(path)
    except RecordingError as error:
        assert str(path) in str(error) and place < whole.chunks[0][0]
        return
    assert messages in (whole.without(*hit), whole.encoded)
    if messages != whole.encoded:
        assert recording.note is not None and "damaged" in recording.note


def spoil(data: bytes, place: int, new: bytes) -> bytes:
    return data[:place] + new + data[place + len(new) :]


def bad_bytes(whole: Whole, i: int) -> bytes:
    return spoil(whole.data, _chunk_end(whole, i) - 90, b"\xff\x00\xff\x00")


def broken_block(whole: Whole, i: int) -> bytes:
    """The first bytes of what is compressed."""
    return spoil(whole.data, whole.chunks[i][0] + 58, b"\xff\xff\xff")


def zeros(whole: Whole, i: int) -> bytes:
    """As of a page that never came to the disk."""
    start, end, _ = whole.chunks[i]
    return spoil(whole.data, start, bytes(end - start))


def piece_missing(whole: Whole, i: int) -> bytes:
    start = whole.chunks[i][0]
    return whole.data[: start + 60] + whole.data[start + 93 :]


def longer(whole: Whole, i: int) -> bytes:
    """A length that ends in another record."""
    return spoil(whole.data, whole.chunks[i][0] + 2, bytes([whole.data[whole.chunks[i][0] + 2] ^ 0x10]))


def absurd(whole: Whole, i: int) -> bytes:
    """A length beyond the file's end."""
    return spoil(whole.data, whole.chunks[i][0] + 6, b"\x07")


@pytest.mark.kernels
@pytest.mark.parametrize("spoiled", [bad_bytes, broken_block, zeros, piece_missing, longer, absurd])
@pytest.mark.parametrize("i", [0, 4, 14])
def test_a_damaged_chunk_is_a_hole_between_two_times(
    tmp_path: Path, whole: Whole, spoiled: Callable[[Whole, int], bytes], i: int
) -> None:
    """The first of them declares what messages are in all; steps of 10 ms, one a chunk and the event beside some."""
    path = tmp_path / "run.mcap"
    path.write_bytes(spoiled(whole, i))
    messages, recording = read(path)
    assert messages == whole.without(i)
    (hole,) = recording.holes
    steps = [codec.decode(each, StepReport).header.step for each in messages if codec.peek(each) is StepReport]
    before = [step for step in steps if step < missing_in(whole, i)[0]]
    after = [step for step in steps if step > missing_in(whole, i)[-1]]
    assert hole.start == pytest.approx(0.01 * len(before))
    assert hole.end == (pytest.approx(0.01 * after[0]) if after else None)
    assert hole.steps == (len(missing_in(whole, i)) if after else 0)
    start, end, _ = whole.chunks[i]
    assert abs(hole.bytes - (end - start)) <= 40, "the piece that is missing is none of the file's"
    assert recording.note is not None and f"{hole.bytes} bytes" in recording.note


def missing_in(whole: Whole, i: int) -> list[int]:
    """Steps of a chunk."""
    found = whole.encoded[3 * i : 3 * i + 3]
    return [codec.decode(each, StepReport).header.step for each in found if codec.peek(each) is StepReport]


@pytest.mark.kernels
def test_a_damaged_index_of_a_chunk_loses_no_message(tmp_path: Path, whole: Whole) -> None:
    """Its length is made longer, so that it would swallow the chunks behind it."""
    path = tmp_path / "run.mcap"
    place = _chunk_end(whole, 3)
    path.write_bytes(spoil(whole.data, place + 2, bytes([whole.data[place + 2] ^ 0x08])))
    messages, recording = read(path)
    assert messages == whole.encoded
    (hole,) = recording.holes
    assert hole.steps == 0 and "no step is missing" in str(recording.note)


@pytest.mark.kernels
def test_several_holes_are_told_one_by_one_and_the_rest_is_counted(tmp_path: Path, whole: Whole) -> None:
    data = whole.data
    for i in (1, 3, 6, 9, 11):
        data = bad_bytes(replace(whole, data=data), i)
    path = tmp_path / "run.mcap"
    path.write_bytes(data[: whole.chunks[13][0] + 100])
    messages, recording = read(path)
    assert messages == whole.without(1, 3, 6, 9, 11, 13, 14)
    assert len(recording.holes) == 6
    assert all(0.0 < one.end - one.start < 0.035 for one in recording.holes[:-1] if one.end is not None)
    assert recording.note is not None and "and 3 more holes of" in recording.note


@pytest.mark.kernels
def test_bodies_surfaces_that_are_damaged_are_built_anew(tmp_path: Path, whole: Whole) -> None:
    """From the scene, as the recorder built them; they stand before everything that is simulated."""
    place = whole.data.index(b"zstd")
    assert place < whole.chunks[0][0]
    path = tmp_path / "run.mcap"
    path.write_bytes(spoil(whole.data, place + 60, b"\xff\x00\xff\x00"))
    messages, recording = read(path)
    assert messages == whole.encoded and len(recording.holes) == 1
    (tmp_path / "whole.mcap").write_bytes(whole.data)
    known = Recording(tmp_path / "whole.mcap").surfaces["body"]
    assert recording.surfaces["body"].triangles.tobytes() == known.triangles.tobytes()
    assert recording.surfaces["body"].point_rest.tobytes() == known.point_rest.tobytes()


@pytest.mark.kernels
@pytest.mark.parametrize("place", [0, 3, 9, 14])
def test_a_damaged_beginning_is_a_hole_too(tmp_path: Path, whole: Whole, place: int) -> None:
    """The magic, or the record behind it, without which nothing is lost."""
    path = tmp_path / "run.mcap"
    path.write_bytes(spoil(whole.data, place, bytes([whole.data[place] ^ 0x55])))
    messages, recording = read(path)
    assert messages == whole.encoded and recording.seed == 7
    assert recording.note is not None and "no step is missing" in recording.note


@pytest.mark.kernels
def test_without_what_is_known_of_it_a_recording_is_shown(tmp_path: Path, whole: Whole) -> None:
    """Seed and schema are lost; the messages have a schema, and the scene a seed of its own."""
    path = tmp_path / "run.mcap"
    place = whole.data.index(b"softseam", whole.data.index(b"\x0c")) - 13
    path.write_bytes(spoil(whole.data, place, b"\xee"))
    messages, recording = read(path)
    assert messages == whole.encoded and recording.metadata == {} and recording.seed == recording.scene.seed
    assert recording.note is not None and "unknown kind of record" in recording.note


@pytest.mark.kernels
def test_a_damaged_seed_is_refused(tmp_path: Path, whole: Whole) -> None:
    """The one number in the head that no checksum covers; its length makes the rest of the head part of it."""
    data = whole.data
    place = data.index(b"seed\x01\x00\x00\x00") + 8
    path = tmp_path / "seed.mcap"
    path.write_bytes(data[:place] + b"x" + data[place + 1 :])
    with pytest.raises(RecordingError, match="which schema and seed"):
        read(path)


@pytest.mark.kernels
def test_every_flush_is_a_place_to_cut(tmp_path: Path, whole: Whole) -> None:
    """Cut right behind the last chunk: nothing is missing but the index, and the note says so."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.data[:-20])
    messages, recording = read(path)
    assert messages == whole.encoded
    assert recording.note is not None and "no message is missing" in recording.note


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
        (lambda path: path.write_bytes(bytes((137, 77, 67, 65, 80, 48, 13, 10))), "cut off or damaged at once"),
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


@pytest.mark.kernels
def test_a_folder_stands_for_its_newest_recording(tmp_path: Path) -> None:
    for i, name in enumerate(("b.mcap", "a.mcap")):
        LogFile(tmp_path / name, Squeeze(1, cell=0.025).begin).close()
        os.utime(tmp_path / name, (i, i))
    assert Recording(tmp_path).path.name == "a.mcap"


def continued(folder: Path, cut: int = 45) -> tuple[list[bytes], Recording]:
    """Two files: the first has `cut` messages, the second all from step 10 on; what is read of the second."""
    run = Squeeze(25, cell=0.025)
    messages = list(run.messages())
    first = LogFile(folder / "run.mcap", run.begin)
    for i, message in enumerate(messages[:cut]):
        first.add(type(message), message.header.time, codec.encode(message), i)
    late = Event(replace(run.begin.header, step=9), EventKind.RESTORED, "heard before the next file was begun")
    first.add(Event, 0.0, codec.encode(late), cut)
    first.close("was cut off: it goes on in another file")
    begin = replace(run.begin, header=replace(run.begin.header, step=10, time=10 * run.scene.step))
    second = LogFile(folder / "run.mcap", begin, existing="number")
    assert second.path == folder / "run-2.mcap"
    for i, message in enumerate(messages):
        if message.header.step >= 10:
            second.add(type(message), message.header.time, codec.encode(message), i)
    second.close()
    return [codec.encode(message) for message in messages], Recording(folder / "run-2.mcap")


@pytest.mark.kernels
def test_a_run_in_several_files_is_read_as_one(tmp_path: Path) -> None:
    """What both have is read once; the first ends later than the second begins."""
    wanted, recording = continued(tmp_path)
    assert read(recording.path)[0] == wanted and recording.note is None
    steps = [report.header.step for report in recording.reports()]
    assert steps == list(range(25)) and recording.counts["StepReport"] == 25
    assert Recording(tmp_path / "run.mcap").note is not None


@pytest.mark.kernels
def test_a_file_may_begin_before_the_one_that_it_goes_on_from(tmp_path: Path) -> None:
    """As where the recorder was lost, and the orchestrator after it: what a later file has counts."""
    wanted, _ = continued(tmp_path)
    run = Squeeze(25, cell=0.025)
    begin = replace(run.begin, header=replace(run.begin.header, step=7))
    third = LogFile(tmp_path / "run.mcap", begin, existing="number")
    for i, message in enumerate(run.messages()):
        if message.header.step >= 7:
            third.add(type(message), message.header.time, codec.encode(message), i)
    third.close()
    assert read(tmp_path / "run-3.mcap")[0] == wanted and Recording(tmp_path / "run-3.mcap").note is None


@pytest.mark.kernels
def test_what_lies_between_two_files_of_a_run_is_told(tmp_path: Path) -> None:
    """Steps that the first lacks, or all of it."""
    _, recording = continued(tmp_path, cut=12)
    first = sum(1 for _ in Recording(tmp_path / "run.mcap").reports())
    assert 0 < first < 10 and [hole.steps for hole in recording.holes] == [10 - first]
    assert f"{10 - first} steps are missing" in str(recording.note)
    (tmp_path / "run.mcap").unlink()
    alone = Recording(recording.path)
    assert [hole.steps for hole in alone.holes] == [10] and "there is no recording" in str(alone.note)
    assert alone.counts["StepReport"] == 15


@pytest.mark.kernels
@pytest.mark.parametrize("link", ["../run.mcap", "/etc/passwd", "run-2.mcap", ""])
def test_a_recording_names_no_file_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    """Nor itself: it may come from a stranger."""
    add = Writer.add_metadata

    def spoilt(writer: Writer, name: str, data: dict[str, str]) -> None:
        add(writer, name, {**data, "file": link} if name == "continues" else data)

    monkeypatch.setattr(Writer, "add_metadata", spoilt)
    (tmp_path / "a").mkdir()
    _, recording = continued(tmp_path / "a")
    assert recording.counts["StepReport"] == 15 and [hole.steps for hole in recording.holes] == [10]
    assert "no file beside it is named" in str(recording.note)
