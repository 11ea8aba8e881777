"""Recordings that are damaged."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from softseam_protocol.messages.recording import Begin
from softseam_protocol.wire.codec import encode
from softseam_services.recorder.log_file import LogFile
from softseam_services.recorder.recorder import Recordable


def with_a_bad_chunk(path: Path, begin: Begin, messages: Iterable[Recordable], hit: int) -> Path:
    """A recording in chunks of six messages, four bytes of one of which are bad."""
    file, places = LogFile(path, begin), []
    for i, message in enumerate(messages):
        file.add(type(message), message.header.time, encode(message), i)
        if i % 6 == 5:
            places.append(file.size + 90)
            file.flush()
    file.close()
    data = bytearray(path.read_bytes())
    data[places[hit] : places[hit] + 4] = b"\xff\x00\xff\x00"
    path.write_bytes(data)
    return path
