"""A session on disk, so that it outlives its orchestrator: its scene, a state of it, and what was asked since.

One file a session, of records with a digest each: first the base, which is put in its place whole, then an entry for
each request, written before its answer is sent. A record that is not whole ends the file: its answer was never sent.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path

from softseam_protocol.bus.keys import state_place
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.session import Estimate, Load, Open, Reset, Save, Step
from softseam_protocol.topics import Keys, checked
from softseam_protocol.wire.codec import decode, encode
from softseam_services.recorder.room import check_room

MOST = 256 << 20
"""of a file [B]"""
SPELL = 2
"""wall time between states that are kept unasked [s], which is about what is simulated again after a loss"""
FORGOTTEN = 24 * 3600.0
"""age of files of sessions that nobody came back to [s]"""
_DIGEST, _LENGTH = 32, 8
_log = logging.getLogger(__name__)

Asked = Open | Reset | Step | Save | Load | Estimate


@dataclass(frozen=True)
class Base:
    """What a session is taken up from."""

    opened: Open
    """with the scene that it has now"""
    seed: int
    steps: int = 0
    """taken since the start"""
    number: int = 0
    """of the request in the middle of which it was"""
    taken: int = 0
    """steps of that request before"""
    state: bytes = b""
    """as for Saved; empty at the start of the scene"""


@dataclass(frozen=True)
class Entry:
    """A request that was answered, or failed after some steps."""

    request: Asked
    taken: int = 0
    """steps that it took after the base"""
    failed: bool = False
    answer: bytes = b""
    """where these steps do not yield it"""


class Damaged(Exception):
    """A session's file cannot be read."""


def kept_sessions(keys: Keys) -> Path | None:
    """The folder of a deployment's sessions, closed to others, without those that are forgotten; None, and logged,
    where there can be none: sessions then end with their orchestrator."""
    try:
        folder = state_place() / "sessions" / keys.deployment
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder.chmod(0o700)
        for path in folder.iterdir():
            if path.stat().st_mtime < time.time() - FORGOTTEN:
                path.unlink()
    except (OSError, RuntimeError) as error:
        _log.warning("sessions end with this orchestrator: nothing can be kept (%s)", error)
        return None
    return folder


class KeptSession:
    """One session's file; every method may be called again. One thread at a time."""

    def __init__(self, folder: Path | None, session: str) -> None:
        self._path = None if folder is None else folder / checked("session", session)
        self._file = -1
        self._size = 0
        self.since = 0.0 if folder else inf
        """time.monotonic() of the base; never where there is no place to keep it in"""

    @property
    def there(self) -> bool:
        """Whether a session can be taken up."""
        return self._path is not None and self._path.exists()

    def keep(self, base: Base | None, *entries: Entry) -> None:
        """Put a base in the place of all that was kept, where there is one, and add what was asked.

        Raises OSError where the disk does not take it; then nothing is kept, and nothing will be before the next base.
        """
        if self._path is None or (base is None and self._file < 0):
            return
        fresh = self._path.with_name(f".{self._path.name}")
        try:
            if base is None:
                self._append(*entries)
            else:
                self.since = time.monotonic()
                self.close()
                check_room(fresh, 0)
                fresh.unlink(missing_ok=True)
                self._file, self._size = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 0
                self._append(base, *entries)
                fresh.replace(self._path)
        except OSError:
            self.discard()
            with suppress(OSError):
                fresh.unlink(missing_ok=True)
            raise

    def read(self) -> tuple[Base, list[Entry]]:
        """What was kept. Raises Damaged, and then has discarded it."""
        assert self._path is not None
        try:
            records = list(_records(self._path.read_bytes()))
            if not records:
                raise ValueError("it has no base")
            (opened, (seed, steps, number, taken), state), *rest = records
            base = Base(decode(opened, Open), seed, steps, number, taken, state)
            entries = [Entry(decode(asked, Asked), n, bool(failed), answer) for asked, (n, failed), answer in rest]
        except (OSError, ValueError, TypeError, ProtocolError) as error:
            self.discard()
            raise Damaged(
                f"the session was lost with its orchestrator, and what was kept of it is damaged ({error}): "
                "open it again"
            ) from error
        return base, entries

    def discard(self) -> None:
        """The session has ended."""
        self.close()
        if self._path is not None:
            with suppress(OSError):
                self._path.unlink(missing_ok=True)

    def _append(self, *kept: Base | Entry) -> None:
        """Write a record of each: its first field is a message, its last one bytes, and between are numbers."""
        for each in kept:
            message, *numbers, data = vars(each).values()
            about = encode(message)
            content = json.dumps([len(about), *numbers]).encode() + b"\n" + about + data
            record = len(content).to_bytes(_LENGTH, "little") + hashlib.sha256(content).digest() + content
            self._size += len(record)
            if self._size > MOST:
                raise OSError(f"it takes more than {MOST:,} B")
            if os.write(self._file, record) < len(record):
                raise OSError("the disk is full")

    def close(self) -> None:
        """The orchestrator ends, and the session does not."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _records(content: bytes) -> Iterator[tuple[bytes, list[int], bytes]]:
    """Message, numbers and data of those that are whole. Raises ValueError for what is no record."""
    at = 0
    while (begin := at + _LENGTH + _DIGEST) <= len(content):
        end = begin + int.from_bytes(content[at : at + _LENGTH], "little")
        if end > len(content) or hashlib.sha256(content[begin:end]).digest() != content[at + _LENGTH : begin]:
            return
        head, _, data = content[begin:end].partition(b"\n")
        length, *numbers = json.loads(head)
        yield data[:length], numbers, data[length:]
        at = end
