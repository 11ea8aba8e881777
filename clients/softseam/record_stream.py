"""Walks the records of an MCAP file and says exactly where, and why, it stops being one.

Every length is checked against what is left of the file and every checksum is verified, so that a file that was cut or
damaged at any byte yields its good beginning and a sentence, never an exception of a parser.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata
from mcap.stream_reader import CRCValidationError, breakup_chunk

MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
LARGEST_CHUNK = 1 << 30
"""uncompressed bytes that a chunk may claim"""
_PREFIX = struct.Struct("<BQ")
_PARSERS = {
    Opcode.HEADER: Header.read,
    Opcode.METADATA: Metadata.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.CHUNK: Chunk.read,
}


class Damage(Exception):
    """The file cannot be read past here; the text completes 'run.mcap ...'."""


@dataclass(frozen=True)
class Group:
    """Records that stand or fall together, and the offset behind them."""

    records: list[Header | Metadata | Attachment | Channel | Message]
    end: int


def groups(stream: BinaryIO, size: int) -> Iterator[Group]:
    """The file's records after the magic, a chunk's together, up to the data section's end; raises Damage.

    size  bytes of the file that may be read
    """
    position = stream.tell()
    while True:
        prefix = stream.read(_PREFIX.size)
        if len(prefix) < _PREFIX.size or position + _PREFIX.size > size:
            raise Damage("was cut off: its recorder did not finish" if not prefix else "is cut off inside a record")
        opcode, length = _PREFIX.unpack(prefix)
        position += _PREFIX.size + length
        if position > size:
            raise Damage("is cut off inside a record")
        if opcode == Opcode.DATA_END:
            _check_end(stream, length, position, size)
            return
        payload = stream.read(length)
        parser = _PARSERS.get(opcode)
        if parser is None:
            if not 0 < opcode <= 0x0F:
                raise Damage("is damaged: an unknown kind of record")
            yield Group([], position)
            continue
        yield Group(_parse(opcode, payload), position)


def _parse(opcode: int, payload: bytes) -> list[Header | Metadata | Attachment | Channel | Message]:
    try:
        record = _PARSERS[Opcode(opcode)](ReadDataStream(BytesIO(payload)))
        if isinstance(record, Attachment) and struct.unpack("<I", payload[-4:])[0] not in (0, zlib.crc32(payload[:-4])):
            raise Damage("is damaged: the checksum of an attachment is wrong")
        if not isinstance(record, Chunk):
            return [record]
        if record.uncompressed_size > LARGEST_CHUNK:
            raise Damage("is damaged: a chunk claims an absurd size")
        return [inner for inner in breakup_chunk(record, validate_crc=True) if isinstance(inner, Channel | Message)]
    except CRCValidationError:
        raise Damage("is damaged: the checksum of a chunk is wrong") from None
    except (McapError, struct.error, UnicodeDecodeError, zstandard.ZstdError, ValueError, OverflowError, MemoryError):
        raise Damage("is damaged: a record cannot be parsed") from None


def _check_end(stream: BinaryIO, length: int, position: int, size: int) -> None:
    """The data is whole; the rest must end in the magic."""
    stream.seek(max(position, size - len(MAGIC)))
    if stream.read(len(MAGIC)) != MAGIC:
        raise Damage("is cut off inside its index (no message is missing)")
