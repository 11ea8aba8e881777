"""The only writer of MCAP files: one session, protobuf messages verbatim, readable up to the last flush at any time.

`log_time` is simulation time after a fixed epoch, `publish_time` is wall time. The scene and the files that it names
are attachments; seed, versions and machine are metadata, and so is, where the file ends before its run, why.
"""

import time
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer, Metadata
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.recording import Begin, SurfaceMesh
from softseam_protocol.wire import codec
from softseam_services.recorder.whole_file import Existing, RecordError, WholeFile

EPOCH = 946_684_800
"""simulation time 0 in the log: 2000-01-01T00:00:00Z [s]"""
CHUNK = 1 << 20
"""uncompressed bytes a chunk"""
TOPIC = "/softseam/"
_REASON = 160
"""bytes that a tail has for its reason"""


class LogFile:
    """One recording, written by one thread."""

    def __init__(self, path: Path, begin: Begin, *, existing: Existing = "error") -> None:
        if path.suffix != ".mcap":
            raise RecordError(f"{path}: a recording's name ends in .mcap")
        self._file = WholeFile(path, existing, _tail("was cut off: its recorder did not finish"))
        self.path = self._file.path
        self._writer = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD, enable_crcs=True)  # type: ignore[arg-type]
        self._channels: dict[type, int] = {}
        self._sequence = 0
        try:
            self._start(begin)
        except OSError as error:
            self._file.close()
            self.path.unlink(missing_ok=True)
            raise RecordError(f"cannot write {self.path}: {error.strerror or error}") from error

    @property
    def size(self) -> int:
        """Size of the file up to the last flush [B]."""
        return self._file.size

    def _start(self, begin: Begin) -> None:
        writer, now = self._writer, time.time_ns()
        writer.start(profile="softseam", library=f"softseam {begin.facts.get('softseam', '')}".strip())
        started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(now // 1_000_000_000))
        about = {"schema": str(SCHEMA_VERSION), "session": begin.header.session, "seed": str(begin.seed)}
        writer.add_metadata("softseam", {**about, "epoch": str(EPOCH), "started": started})
        if begin.header.step:  # an orchestrator, or a recorder, was lost: the steps before are in the file before
            writer.add_metadata("continues", {"file": self._file.before, "step": str(begin.header.step)})
        writer.add_metadata("facts", dict(begin.facts))
        writer.add_attachment(now, log_time(0.0), "scene.json", "application/json", begin.bundle.scene.encode())
        for name, data in begin.bundle.files.items():
            writer.add_attachment(now, log_time(0.0), f"files/{name}", "application/octet-stream", data)
        for surface in begin.surfaces.values():
            self.add(SurfaceMesh, surface.header.time, codec.encode(surface), now)
        self.flush()

    def add(self, kind: type, sim_time: float, data: bytes, wall_ns: int) -> None:
        """Append an encoded message of type `kind`; it is safe after the next flush."""
        channel = self._channels.get(kind)
        if channel is None:
            schema = self._writer.register_schema(codec.full_name(kind), "protobuf", codec.file_descriptor_set(kind))
            channel = self._writer.register_channel(TOPIC + kind.__name__, "protobuf", schema)
            self._channels[kind] = channel
        self._sequence += 1
        self._writer.add_message(channel, log_time(sim_time), data, wall_ns, self._sequence)

    def flush(self) -> None:
        """Hand everything to the operating system: what was added survives the death of this process.

        Raises OSError where the disk does not take it; the file then ends at the last record that it took.
        """
        self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self, why: str = "") -> None:
        """Write the index and close; after a failed write only a tail, so that readers scan instead.

        why  what the file lacks, where it ends before its run; completes "run.mcap ..."
        """
        try:
            if not self._file.failed:
                if why:
                    self.flush()
                    self._writer.add_metadata("end", {"why": why})
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._file.finish()
        finally:
            try:
                if self._file.failed:
                    self._file.finish(_tail(why or "has no index: the disk is full (no message is missing)"))
            finally:
                self._file.close()


def log_time(sim_time: float) -> int:
    """Nanoseconds since 1970 of a simulation time [s]."""
    return EPOCH * 1_000_000_000 + round(sim_time * 1e9)


def _tail(why: str) -> bytes:
    """End of a file without a summary, of the same length whatever the reason."""
    short = why.encode()[:_REASON].decode(errors="ignore")
    builder = RecordBuilder()
    Metadata("end", {"why": short + " " * (_REASON - len(short.encode()))}).write(builder)
    DataEnd(0).write(builder)
    Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC  # type: ignore[no-untyped-call]
