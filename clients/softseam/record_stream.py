"""Walks the records of an MCAP file: what is whole comes as groups, what is not as holes between them.

Every length is checked against what is left of the file and every checksum is verified, so that a file that was cut or
damaged anywhere yields all that is whole, before and behind, and a sentence for each hole, never an exception of a
parser.
"""

import re
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
from mcap.records import Attachment, Chunk, DataEnd, Header, Message, MessageIndex, Metadata
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
    Opcode.MESSAGE_INDEX: MessageIndex.read,
    Opcode.DATA_END: DataEnd.read,
}
"""all that a recording has before its index"""
_SEARCHED = 1 << 20
"""bytes that are searched at a time [B]"""
_CANDIDATE = re.compile(rb"(?=[\x06\x09\x0c\x0f].{4}\x00{4})", re.DOTALL)
"""where a chunk, attachment, metadata or the data's end may begin: less than 4 GiB long"""
_CUT = "is cut off inside a record"

Record = Header | Metadata | Attachment | Message | DataEnd


class Damage(Exception):
    """A record is not whole; the text completes 'run.mcap ...'."""


@dataclass(frozen=True)
class Group:
    """Records that stand or fall together, or a gap of none that can be read; where they are, from `start` to `end`."""

    records: list[Record]
    start: int
    end: int
    damage: str | None = None
    """of a gap: completes 'run.mcap ...'"""


def walk(stream: BinaryIO, start: int, end: int) -> Iterator[Group]:
    """Records and gaps from `start` up to `end`, which is the file's end or that of an earlier group [B].

    A chunk's records come together. A file without its data's end has a gap of its last bytes, or of none.
    """
    position = start
    while position < end:
        try:
            records, behind = _read(stream, position, end)
        except Damage as damage:
            behind = _next_whole(stream, position + 1, end)
            wrong_length = str(damage) == _CUT and behind < end
            yield Group(
                [], position, behind, "is damaged: the length of a record is wrong" if wrong_length else str(damage)
            )
            if behind == end:
                return
        else:
            if any(isinstance(each, DataEnd) for each in records):
                return
            yield Group(records, position, behind)
        position = behind
    yield Group([], end, end, "was cut off: its recorder did not finish")


def _read(stream: BinaryIO, position: int, end: int) -> tuple[list[Record], int]:
    """The record that begins here, with a chunk's messages in its place, and the offset behind. Raises Damage."""
    stream.seek(position)
    prefix = stream.read(_PREFIX.size)
    if len(prefix) < _PREFIX.size:
        raise Damage(_CUT)
    opcode, length = _PREFIX.unpack(prefix)
    if opcode not in _PARSERS:
        raise Damage("is damaged: an unknown kind of record")
    behind = position + _PREFIX.size + length
    if behind > end:
        raise Damage(_CUT)
    return _parse(Opcode(opcode), stream.read(length)), behind


def _parse(opcode: Opcode, payload: bytes) -> list[Record]:
    try:
        data = BytesIO(payload)
        record = _PARSERS[opcode](ReadDataStream(data))
        if data.tell() != len(payload):
            raise Damage("is damaged: the length of a record is wrong")
        if isinstance(record, Attachment) and struct.unpack("<I", payload[-4:])[0] not in (0, zlib.crc32(payload[:-4])):
            raise Damage("is damaged: the checksum of an attachment is wrong")
        if isinstance(record, MessageIndex):
            return []
        if not isinstance(record, Chunk):
            return [record]
        if record.uncompressed_size > LARGEST_CHUNK:
            raise Damage("is damaged: a chunk claims an absurd size")
        return [inner for inner in breakup_chunk(record, validate_crc=True) if isinstance(inner, Message)]
    except CRCValidationError:
        raise Damage("is damaged: the checksum of a chunk is wrong") from None
    except (McapError, struct.error, UnicodeDecodeError, zstandard.ZstdError, ValueError, OverflowError, MemoryError):
        raise Damage("is damaged: a record cannot be parsed") from None


def _next_whole(stream: BinaryIO, position: int, end: int) -> int:
    """Where the first whole record from `position` on begins; `end` where there is none."""
    while position < end:
        stream.seek(position)
        data = stream.read(_SEARCHED + _PREFIX.size - 1)
        for found in _CANDIDATE.finditer(data):
            try:
                _read(stream, position + found.start(), end)
            except Damage:
                continue
            return position + found.start()
        position += _SEARCHED
    return end


def index_is_whole(stream: BinaryIO, size: int) -> bool:
    """Whether the file ends as it should: in the magic."""
    stream.seek(max(0, size - len(MAGIC)))
    return stream.read(len(MAGIC)) == MAGIC
