"""A file that always ends at a whole record: a write that the disk refuses is cut off again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

Existing = Literal["error", "replace", "number"]
"""where a file of that name exists: refuse, put the new one in its place, or append -2, -3, ... to the name"""


class RecordError(Exception):
    """A recording cannot be opened or written; the text says why and what to do."""


class WholeFile:
    """Collects writes in memory and hands them to the system at `flush`, all or nothing."""

    def __init__(self, path: Path, existing: Existing) -> None:
        self.path, self._fd = _create(path, existing)
        self._pending = bytearray()
        self.size = 0
        """bytes that the system took [B]"""
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
        data = memoryview(bytes(self._pending))
        self._pending.clear()
        done = 0
        try:
            while done < len(data):
                done += os.pwrite(self._fd, data[done:], self.size + done)
        except OSError:
            self.failed = True
            os.ftruncate(self._fd, self.size)
            raise
        self.size += done

    def finish_with(self, tail: bytes) -> None:
        """After a failure: forget what is pending and end the file with `tail`, if it goes in whole."""
        self._pending.clear()
        self.failed = False
        self.write(tail)
        self.flush()

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def _create(path: Path, existing: Existing) -> tuple[Path, int]:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        if existing == "replace":
            fresh = path.with_name(f".{path.name}.{os.getpid()}")
            fd = os.open(fresh, flags, 0o644)
            os.replace(fresh, path)
            return path, fd
        for i in range(1, 10_000 if existing == "number" else 2):
            candidate = path if i == 1 else path.with_stem(f"{path.stem}-{i}")
            try:
                return candidate, os.open(candidate, flags, 0o644)
            except FileExistsError:
                continue
    except OSError as error:
        raise RecordError(f"cannot create the recording {path}: {error.strerror or error}") from error
    raise RecordError(f"{path} exists: choose another name, or remove it first")
