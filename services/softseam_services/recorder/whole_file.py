"""A file that always ends at a whole record, and then in a tail: a write that the disk refuses is cut off again.

The tail lies behind what was flushed and is written anew by each flush, so that a full disk has room for another one.
"""

import os
from pathlib import Path
from typing import Literal

from softseam_services.recorder.room import check_room

Existing = Literal["error", "replace", "number"]
"""where a file of that name exists: refuse, put the new one in its place, or append -2, -3, ... to the name"""


class RecordError(Exception):
    """A recording cannot be opened or written; the text says why and what to do."""


class WholeFile:
    """Collects writes in memory and hands them to the system at `flush`, all or nothing.

    tail  what the file ends in between two flushes
    """

    def __init__(self, path: Path, existing: Existing, tail: bytes) -> None:
        self.path, self._fd, self.before = _create(path, existing)
        """before: name of the file that has the number before this one's; empty where there is none"""
        self._tail = tail
        self._pending = bytearray()
        self.size = 0
        """bytes that the system took, without the tail [B]"""
        self.failed = False

    def write(self, data: bytes) -> int:
        self._pending += data
        return len(data)

    def tell(self) -> int:
        return self.size + len(self._pending)

    def flush(self) -> None:
        """Raises OSError where the disk is full or broken; the file then is as it was after the last good flush."""
        if self.failed:
            raise OSError("an earlier write failed")
        data = bytes(self._pending)
        self._pending.clear()
        try:
            self._put(data + self._tail)
        except OSError:
            self.failed = True
            if self.size:
                os.ftruncate(self._fd, self.size + len(self._tail))
                self._put(self._tail)
            raise
        self.size += len(data)

    def finish(self, tail: bytes = b"") -> None:
        """Flush, with nothing behind; after a failure end the file in `tail`, no longer than the one that it had."""
        if not self.failed:
            self.flush()
            tail = b""
        self._put(tail)
        os.ftruncate(self._fd, self.size + len(tail))

    def _put(self, data: bytes) -> None:
        """Behind what is safe. Raises OSError."""
        done = 0
        while done < len(data):
            done += os.pwrite(self._fd, memoryview(data)[done:], self.size + done)

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def _create(path: Path, existing: Existing) -> tuple[Path, int, str]:
    before, flags = "", os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        check_room(path, 0)
        if existing == "replace":
            fresh = path.with_name(f".{path.name}.{os.getpid()}")
            fd = os.open(fresh, flags, 0o644)
            os.replace(fresh, path)
            return path, fd, before
        for i in range(1, 10_000 if existing == "number" else 2):
            candidate = path if i == 1 else path.with_stem(f"{path.stem}-{i}")
            try:
                return candidate, os.open(candidate, flags, 0o644), before
            except FileExistsError:
                before = candidate.name
    except OSError as error:
        raise RecordError(f"cannot create the recording {path}: {error.strerror or error}") from error
    raise RecordError(f"{path} exists: choose another name, or remove it first")
