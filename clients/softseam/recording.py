"""Reads recordings: whole ones, those that a crash or a full disk cut off, and what is whole of damaged ones.

>>> recording = Recording("run.mcap")
>>> for message in recording:            # StepReport, Frame and Event, in the order they were recorded
...     ...
>>> recording.note                       # None, or what is missing, and where
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO, TypeVar

from mcap.records import Attachment, Header, Message, Metadata
from pydantic import ValidationError

from softseam.errors import SoftseamError
from softseam.record_stream import MAGIC, Damage, Group, index_is_whole, walk
from softseam_protocol.errors import ProtocolError
from softseam_protocol.extensions import VARIABLE
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_protocol.wire import codec

_TYPES = (StepReport, Frame, Event, SurfaceMesh)
_SCHEMA = str(SCHEMA_VERSION)
_NAMED = 3
"""holes that a note describes; it counts the others"""

Recorded = StepReport | Frame | Event
T = TypeVar("T", StepReport, Frame, Event)


def time_of(frame: Frame, step: float) -> float:
    """Simulation time of a frame [s], in a run of steps of this length [s]."""
    return frame.header.time + (0.0 if frame.start else step)


class RecordingError(Exception):
    """A file is no recording that can be read; the text names the file, what is wrong and the remedy."""


@dataclass(frozen=True)
class Hole:
    """A place where bytes are damaged or missing."""

    why: str
    """completes "run.mcap ..." """
    bytes: int
    """that are left out [B]"""
    start: float
    """up to here the run is known [s]"""
    end: float | None
    """and from here on again [s]; None where the file has no step behind"""
    steps: int
    """that are missing; 0 where the file has no step behind"""

    def __str__(self) -> str:
        if self.end is None:
            rest = f"; {self.bytes} bytes behind are left out" if self.bytes else ""
            return f"{self.why}; read up to {self.start:.6g} s{rest}"
        lost = {0: "no step is missing", 1: "1 step is missing"}.get(self.steps, f"{self.steps} steps are missing")
        return f"{self.why}; {self.bytes} bytes from {self.start:.6g} s to {self.end:.6g} s are left out, {lost}"


class Recording:
    """A recording on disk. Opening it reads through the file once and checks it; iterating reads it again.

    path  a file, or a folder: then its newest recording
    """

    def __init__(self, path: Path | str, _until: int | None = None) -> None:
        self.path = _newest(Path(path))
        self.counts: dict[str, int] = {}
        """messages by type"""
        self.surfaces: dict[str, SurfaceMesh] = {}
        """the bodies' surface meshes by name; those that the file ends before are missing; where the ones recorded are
        damaged, they are built anew from the scene, if what simulates is installed"""
        self.holes: tuple[Hole, ...] = ()
        """what is damaged or missing, in the order of the file"""
        self._files: dict[str, bytes] = {}
        self._spans: list[tuple[int, int]] = []  # of the file, with messages
        self._about: dict[str, dict[str, str]] = {}
        self._profile = ""
        self._steps: list[tuple[str, int]] = []  # kind and step of every message that is read
        self._before: list[Recording] = []  # files that this one goes on from, oldest first
        self._gaps = self._scan()
        self._accept()
        self.bundle = Bundle(
            scene=self._files["scene.json"].decode(),
            files={n.removeprefix("files/"): data for n, data in self._files.items() if n.startswith("files/")},
        )
        """the scene and its files, as they were simulated"""
        self.scene = _scene_of(self.bundle.scene, self.path)
        self.seed = int(self.metadata.get("seed", self.scene.seed))
        if not self.surfaces and self.counts.get("Frame"):
            self._build_surfaces()
        self.holes = tuple(gap.hole(self.scene.step) for gap in self._gaps)
        self._until = sys.maxsize if _until is None else _until  # step at which the next file begins
        self._go_back() if _until is None else self._cut(_until)

    @property
    def metadata(self) -> dict[str, str]:
        """session, seed, schema, epoch, started"""
        return self._about.get("softseam", {})

    @property
    def facts(self) -> dict[str, str]:
        """versions and machine"""
        return self._about.get("facts", {})

    @property
    def note(self) -> str | None:
        """What is missing, in words, or None for a whole recording."""
        texts = [str(hole) for hole in self.holes[:_NAMED]]
        if not texts:
            return None
        more = self.holes[_NAMED:]
        others = f"; and {len(more)} more holes of {sum(hole.bytes for hole in more)} bytes" if more else ""
        return f"{self.path} {'; it '.join(texts)}{others}; {self.counts.get('StepReport', 0)} steps are read"

    def __iter__(self) -> Iterator[Recorded]:
        """All messages, in the order they were recorded."""
        for message in self._messages():
            if codec.peek(message.data) is not SurfaceMesh:
                yield codec.decode(message.data, Recorded)

    def only(self, kind: type[T]) -> Iterator[T]:
        """All messages of one type."""
        for message in self._messages():
            if codec.peek(message.data) is kind:
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
        for message in self._messages():
            yield codec.peek(message.data).__name__, message.log_time, message.publish_time, message.data

    def _messages(self) -> Iterator[Message]:
        for before in self._before:
            yield from before._messages()
        yield from islice(self._own(), len(self._steps))

    def _own(self) -> Iterator[Message]:
        with self._open() as stream:
            for start, end in self._spans:
                for group in walk(stream, start, end):
                    yield from (record for record in group.records if isinstance(record, Message))

    def _go_back(self) -> None:
        """Find the files beside this one with the steps before its own, which an orchestrator wrote that was lost."""
        at, holes = self, tuple[Hole, ...]()
        seen, until = {self.path.name}, sys.maxsize
        while link := at._about.get("continues"):
            name, step = link.get("file", ""), link.get("step", "")
            if not step.isdecimal():
                break
            until = min(until, int(step))
            try:
                if not name or Path(name).name != name or name in seen:  # no file of another folder
                    raise RecordingError("no file beside it is named")
                at = Recording(at.path.with_name(name), until)
                if at.bundle.scene != self.bundle.scene:
                    raise RecordingError(f"{at.path} is of another scene")
            except RecordingError as error:
                holes = (Hole(f"goes on from what cannot be read ({error})", 0, 0.0, until * self.scene.step, until),)
                break
            seen.add(name)
            self._before.insert(0, at)
            for kind, count in at.counts.items():
                self.counts[kind] = self.counts.get(kind, 0) + (count if kind != SurfaceMesh.__name__ else 0)
        known, dt = 0, self.scene.step
        for each in self._before:
            known = max(known, *(at + 1 for kind, at in each._steps if kind == StepReport.__name__), 0)
            lost = Hole("was cut off before the next file begins", 0, known * dt, each._until * dt, each._until - known)
            holes = (*holes, *each.holes, *([lost] if lost.steps > 0 else []))
        self.holes = (*holes, *self.holes)

    def _cut(self, step: int) -> None:
        """Leave out what comes after the last report of a step before this one: another file has it again."""
        reports = (i for i, (kind, at) in enumerate(self._steps) if kind == StepReport.__name__ and at < step)
        last = max(reports, default=-1)
        behind = (i for i, (_, at) in enumerate(self._steps) if i > last and at >= step)
        self._steps = self._steps[: next(behind, len(self._steps))]
        self.counts = dict(Counter(kind for kind, _ in self._steps))
        there = step * self.scene.step
        self.holes = tuple(hole for hole in self.holes if hole.end is not None and hole.end <= there)

    def _open(self) -> BinaryIO:
        try:
            stream = self.path.open("rb")
        except FileNotFoundError:
            raise RecordingError(f"there is no recording {self.path}") from None
        except OSError as error:
            raise RecordingError(f"cannot read {self.path}: {error.strerror or error}") from None
        return stream

    def _scan(self) -> list[_Gap]:
        """Read the whole file, checking lengths, checksums and every message; what is none."""
        found: list[_Gap] = []
        last: StepReport | None = None
        with self._open() as stream:
            size = self.path.stat().st_size
            for each in walk(stream, len(MAGIC) if stream.read(len(MAGIC)) == MAGIC else 0, size):
                try:
                    steps = self._take(each)
                except Damage as damage:
                    _leave_out(found, each, str(damage), last)
                    continue
                if steps:
                    found = [replace(gap, after=gap.after or steps[0]) for gap in found]
                    last = steps[-1]
                if any(isinstance(record, Message) for record in each.records):
                    self._spans.append((each.start, each.end))
            if "end" in self._about:  # as its recorder said
                found.append(_Gap(size, size, self._about["end"].get("why", "").rstrip(), last))
            elif not (found and found[-1].end == size) and not index_is_whole(stream, size):
                found.append(_Gap(size, size, "is cut off inside its index (no message is missing)", last))
        return found

    def _take(self, group: Group) -> list[StepReport]:
        """Take note of a group; its steps. Raises Damage where it is not whole, and takes nothing of it."""
        if group.damage is not None:
            raise Damage(group.damage)
        named = bool(self.metadata) or self._profile in ("", "softseam")  # the head itself may be damaged
        ours = named and self.metadata.get("schema", _SCHEMA) == _SCHEMA
        try:
            decoded = [codec.decode(each.data, _TYPES) for each in group.records if isinstance(each, Message) and ours]
        except ProtocolError as error:
            raise Damage(f"is damaged: a message cannot be decoded ({error})") from None
        for message in decoded:
            kind = type(message).__name__
            self._steps.append((kind, message.header.step))
            self.counts[kind] = self.counts.get(kind, 0) + 1
            if isinstance(message, SurfaceMesh):
                self.surfaces[message.body] = message
        for record in group.records:
            if isinstance(record, Header):
                self._profile = record.profile
            elif isinstance(record, Attachment):
                self._files[record.name] = record.data
            elif isinstance(record, Metadata):
                self._about[record.name] = dict(record.metadata)
        return [message for message in decoded if isinstance(message, StepReport)]

    def _build_surfaces(self) -> None:
        """As the recorder did, where that is possible here."""
        from softseam.resimulating import resimulate

        points = {frame.body: len(frame.point_x) for frame in islice(self.frames(), len(self.scene.bodies))}
        try:
            with resimulate(self.bundle, self.seed) as simulation:
                built = simulation.surfaces(self.bundle)
        except (SoftseamError, ImportError):
            return  # what is not drawn is read none the less
        if {name: len(mesh.point_rest) for name, mesh in built.items()} == points:
            self.surfaces = dict(built)

    def _accept(self) -> None:
        """Raises RecordingError where the file is not ours, of another schema, or too short to be of use."""
        if self._profile != "softseam" and not self.metadata:
            foreign = self._profile or not self._gaps
            what = "is an MCAP file of another program" if foreign else "is cut off or damaged at once"
            if self._gaps and self._gaps[0].start == 0:
                what = "does not begin like an MCAP file"
            raise RecordingError(f"{self.path} {what}, not a recording of softseam")
        version = self.metadata.get("schema", _SCHEMA if not self.metadata else "")
        if not version.isdecimal() or not self.metadata.get("seed", "0").isdecimal():
            raise RecordingError(
                f"{self.path} is damaged where it says which schema and seed it has: copy it once more"
            )
        if version != _SCHEMA:
            maker = self.facts.get("softseam", "")
            newer = "" if int(version) < SCHEMA_VERSION else ", or a newer one"
            raise RecordingError(
                f"{self.path} has schema version {version}; this softseam reads {SCHEMA_VERSION}: read it with the "
                f"softseam that recorded it{f' ({maker})' if maker else ''}{newer}, or record its scene again"
            )
        if "scene.json" not in self._files:
            what = self._gaps[0].why if self._gaps else "has no scene"
            raise RecordingError(f"{self.path} {what}, and its scene is not in what can be read: copy it once more")


@dataclass(frozen=True)
class _Gap:
    """Bytes of the file that are none of a recording, and the steps beside them."""

    start: int
    end: int
    why: str
    before: StepReport | None
    after: StepReport | None = None

    def hole(self, step: float) -> Hole:
        """In terms of the run; step [s]."""
        before, after = self.before, self.after
        return Hole(
            self.why,
            self.end - self.start,
            0.0 if before is None else before.header.time + step,
            None if after is None else after.header.time,
            0 if after is None else after.header.step - (0 if before is None else before.header.step + 1),
        )


def _leave_out(found: list[_Gap], group: Group, why: str, last: StepReport | None) -> None:
    """Add a gap, or make the last one longer."""
    if found and found[-1].end == group.start:
        found[-1] = replace(found[-1], end=group.end)
    else:
        found.append(_Gap(group.start, group.end, why, last))


def _newest(path: Path) -> Path:
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"), key=lambda file: file.stat().st_mtime)
    if not files:
        raise RecordingError(f"there is no recording (*.mcap) in the folder {path}")
    return files[-1]


def _scene_of(text: str, path: Path) -> Scene:
    """Raises RecordingError for a scene with what this process does not know."""
    try:
        return Scene.model_validate_json(text)
    except ValidationError:  # which the scene's own reader puts in words
        pass
    try:
        return parse_scene(text, f"scene of {path}")
    except SceneError as error:
        raise RecordingError(f"{error}; name the extension that adds it in {VARIABLE}") from None
