"""Reads recordings: whole ones, and those that a crash or a full disk cut off.

>>> recording = Recording("run.mcap")
>>> for message in recording:            # StepReport, Frame and Event, in the order they were recorded
...     ...
>>> recording.note                       # None, or what is missing at the end
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TypeVar

from mcap.records import Attachment, Channel, Header, Message, Metadata

from softseam.record_stream import MAGIC, Damage, Group, groups
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.scene.scene import Scene
from softseam_protocol.wire import codec

TOPIC = "/softseam/"
TYPES = {"StepReport": StepReport, "Frame": Frame, "Event": Event, "SurfaceMesh": SurfaceMesh}

Recorded = StepReport | Frame | Event
T = TypeVar("T", StepReport, Frame, Event)


def time_of(frame: Frame, step: float) -> float:
    """Simulation time of a frame [s], in a run of steps of this length [s]."""
    return frame.header.time + (0.0 if frame.start else step)


class RecordingError(Exception):
    """A file is no recording that can be read; the text names the file, what is wrong and the remedy."""


class Recording:
    """A recording on disk. Opening it reads through the file once and checks it; iterating reads it again.

    path  a file, or a folder: then its newest recording
    """

    def __init__(self, path: Path | str) -> None:
        self.path = _newest(Path(path))
        self.counts: dict[str, int] = {}
        """messages by type"""
        self.surfaces: dict[str, SurfaceMesh] = {}
        """the bodies' surface meshes by name; those that the file ends before are missing"""
        self.metadata: dict[str, str] = {}
        """session, seed, schema, epoch, started"""
        self.facts: dict[str, str] = {}
        """versions and machine"""
        self._files: dict[str, bytes] = {}
        self._profile = ""
        self._good = len(MAGIC)
        self._size = 0
        self._damage: str | None = None
        self._scan()
        self._accept()
        self.bundle = Bundle(
            scene=self._files["scene.json"].decode(),
            files={n.removeprefix("files/"): data for n, data in self._files.items() if n.startswith("files/")},
        )
        """the scene and its files, as they were simulated"""
        self.scene = Scene.model_validate_json(self.bundle.scene)
        self.seed = int(self.metadata.get("seed", "0"))

    @property
    def note(self) -> str | None:
        """What is missing, in words, or None for a whole recording."""
        if self._damage is None:
            return None
        left = self._size - self._good
        rest = f"; {left} bytes behind are left out" if left else ""
        return f"{self.path} {self._damage}; read up to there: {self.counts.get('StepReport', 0)} steps{rest}"

    def __iter__(self) -> Iterator[Recorded]:
        """All messages, in the order they were recorded."""
        for kind, message in self._messages():
            if kind != "SurfaceMesh":
                yield codec.decode(message.data, TYPES[kind])

    def only(self, kind: type[T]) -> Iterator[T]:
        """All messages of one type."""
        for name, message in self._messages():
            if name == kind.__name__:
                yield codec.decode(message.data, kind)

    def reports(self) -> Iterator[StepReport]:
        """Step after step."""
        return self.only(StepReport)

    def frames(self, body: str | None = None) -> Iterator[Frame]:
        """Of one body, or of all, step after step."""
        return (frame for frame in self.only(Frame) if body in (None, frame.body))

    def events(self) -> Iterator[Event]:
        """As they came."""
        return self.only(Event)

    def raw(self) -> Iterator[tuple[str, int, int, bytes]]:
        """(type, log time [ns], publish time [ns], encoded message), verbatim."""
        for kind, message in self._messages():
            yield kind, message.log_time, message.publish_time, message.data

    def _messages(self) -> Iterator[tuple[str, Message]]:
        channels: dict[int, str] = {}
        with self._open() as stream:
            for group in groups(stream, self._size):
                yield from _named(group, channels)
                if group.end >= self._good:
                    return

    def _open(self) -> BinaryIO:
        try:
            stream = self.path.open("rb")
        except FileNotFoundError:
            raise RecordingError(f"there is no recording {self.path}") from None
        except OSError as error:
            raise RecordingError(f"cannot read {self.path}: {error.strerror or error}") from None
        if stream.read(len(MAGIC)) != MAGIC:
            stream.close()
            raise RecordingError(f"{self.path} is not a recording: it does not begin like an MCAP file")
        return stream

    def _scan(self) -> None:
        """Read the whole file, checking lengths, checksums and every message."""
        channels: dict[int, str] = {}
        with self._open() as stream:
            self._size = self.path.stat().st_size
            try:
                for group in groups(stream, self._size):
                    self._take(group, channels)
                    self._good = group.end
            except Damage as damage:
                self._damage = str(damage)
            else:
                self._good = self._size

    def _take(self, group: Group, channels: dict[int, str]) -> None:
        counts = dict(self.counts)
        for kind, message in _named(group, channels):
            try:
                decoded: object = codec.decode(message.data, TYPES[kind])
            except ProtocolError as error:
                raise Damage(f"is damaged: a {kind} cannot be decoded ({error})") from None
            counts[kind] = counts.get(kind, 0) + 1
            if isinstance(decoded, SurfaceMesh):
                self.surfaces[decoded.body] = decoded
        self.counts = counts
        for record in group.records:
            if isinstance(record, Header):
                self._profile = record.profile
            elif isinstance(record, Attachment):
                self._files[record.name] = record.data
            elif isinstance(record, Metadata):
                if record.name == "softseam":
                    self.metadata = dict(record.metadata)
                elif record.name == "facts":
                    self.facts = dict(record.metadata)

    def _accept(self) -> None:
        """Raises RecordingError where the file is not ours, of another schema, or too short to be of use."""
        if self._profile != "softseam":
            foreign = self._profile or self._damage is None
            what = "is an MCAP file of another program" if foreign else "is cut off at once"
            raise RecordingError(f"{self.path} {what}, not a recording of softseam")
        version = self.metadata.get("schema", "0")
        if version != str(SCHEMA_VERSION):
            maker = self.facts.get("softseam", "")
            newer = "" if version.isdecimal() and int(version) < SCHEMA_VERSION else ", or a newer one"
            raise RecordingError(
                f"{self.path} has schema version {version}; this softseam reads {SCHEMA_VERSION}: read it with the "
                f"softseam that recorded it{f' ({maker})' if maker else ''}{newer}, or record its scene again"
            )
        if not self.metadata.get("seed", "0").isdecimal():
            raise RecordingError(f"{self.path} is damaged where it says which seed it had: copy it once more")
        if "scene.json" not in self._files:
            raise RecordingError(f"{self.path} ends before its scene: there is nothing in it to read")


def _newest(path: Path) -> Path:
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"), key=lambda file: file.stat().st_mtime)
    if not files:
        raise RecordingError(f"there is no recording (*.mcap) in the folder {path}")
    return files[-1]


def _named(group: Group, channels: dict[int, str]) -> Iterator[tuple[str, Message]]:
    """The messages of the types that we know."""
    for record in group.records:
        if isinstance(record, Channel):
            channels[record.id] = record.topic.removeprefix(TOPIC)
        elif isinstance(record, Message) and channels.get(record.channel_id) in TYPES:
            yield channels[record.channel_id], record
