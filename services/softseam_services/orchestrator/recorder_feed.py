"""Publishes a session's messages, and never lets a recorder hold the simulation up for long.

A recorder says now and then how many messages are safe in its file. While too many (or too many bytes) are on their
way, publishing waits, `patience` seconds once; after that the run goes on, messages that do not fit are dropped on the
way, and an event says so. What is not safe yet when a recorder dies is held, and what comes then, as much as may be on
its way: the recorder that comes back is given the session's beginning, and all of it, for another file.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.inbox import Inbox, LiveChange, Received
from softseam_protocol.errors import NoReply, ProtocolError, Refused
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import RecordingState
from softseam_protocol.messages.recording import FINISH, Begin, End, Recorded
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.topics import Keys, topic_of
from softseam_protocol.wire.codec import decode, encode

MOST_MESSAGES = 2048
MOST_BYTES = 48 * 2**20
"""on their way to the recorder; it holds 64 MiB for its disk"""
PATIENCE = 2.0
_ANSWER = 5.0
"""longest wait for a recorder to begin, and for another one where it is lost at the end of a run [s]"""
_PACE = 1 / 20
"""of asking a recorder that has not been introduced yet [s]"""


def answer_of_recorder(bus: Bus, keys: Keys, request: Begin | End, timeout: float, introduced: float = 0.0) -> Recorded:
    """The recorder's answer, within `timeout` [s]. Raises Refused and ProtocolError.

    One that lives, but that a process which has just joined the bus has not been introduced to, is asked for
    `PATIENCE`; until `introduced`, on time.monotonic(), it is not known who lives.
    """
    end = max(time.monotonic() + PATIENCE, introduced)
    while True:
        try:
            answer: Recorded = bus.call(keys.recorder, request, Recorded, timeout)
            return answer
        except NoReply:
            now = time.monotonic()
            if now > end or (now > introduced and not bus.live(keys.every_live("recorder"))):
                raise
            time.sleep(_PACE)


@dataclass(frozen=True)
class _Held:
    """A message on its way."""

    header: Header
    kind: type
    payload: bytes


class RecorderFeed:
    """One session's publications. `record` wants them in a file too.

    warn    called with (kind, message) where a recording is at risk
    """

    def __init__(self, bus: Bus, keys: Keys, session: str, *, record: bool, warn: Callable[[str, str], None]) -> None:
        self._bus, self._keys, self._session = bus, keys, session
        self._record, self._warn = record, warn
        self._begun: Begin | None = None
        self._asked: Header | None = None
        """of the file that a recorder was asked for last"""
        self._following = False
        """a recorder keeps up with this session"""
        self._missing = False
        """a recorder is gone, or not there yet, and one is waited for"""
        self._known = False
        """one was there"""
        self._late = self._failed = False
        self._held: deque[_Held] = deque()
        """on their way to the recorder, and the step of what became safe last, which may go on"""
        self._let_go, self._bytes = 0, 0
        """messages since the beginning that are held no more; size of those that are"""
        self._acks = bus.subscribe(keys.session(session, Recorded), latest=True) if record else None
        self._recorders = bus.watch_live(keys.every_live("recorder")) if record else None
        self.waited = 0.0
        """wall time that the recorder cost the run [s]"""

    @property
    def begun(self) -> bool:
        return self._begun is not None

    def begin(self, begin: Begin) -> None:
        """Announce a run of the session; ends the run before."""
        if self._begun is not None:
            self.end("reset")
        self._begun = begin
        self._held.clear()
        self._bytes = 0
        self._missing, self._known = False, begin.header.step > 0  # what goes on had one
        self._publish(begin)
        if self._record:
            _empty(self._recorders)
            self._invite(begin)

    def publish(self, message: StepReport | Frame | Event) -> None:
        """Publish, after waiting for a recorder that lags behind (bounded)."""
        payload = self._publish(message)
        if not self._record or self._begun is None:
            return
        if self._following or self._missing:
            self._hold(_Held(message.header, type(message), payload or encode(message)))
        self._watch()
        if self._following:
            self._read_acks()
            if self._too_many():
                self._wait()

    def end(self, reason: str) -> Recorded | None:
        """The run is over: let the recorder finish its file, and say what became of it (None without one)."""
        if self._begun is None:
            return None
        if self._missing and self._known:
            self._watch(time.monotonic() + _ANSWER)
        end, recorded = End(self._begun.header, reason), None
        self._publish(end)
        while self._following and recorded is None:
            try:
                recorded = answer_of_recorder(self._bus, self._keys, end, FINISH)
            except NoReply:
                self._lose()
                self._watch(time.monotonic() + _ANSWER)
                self._publish(end)  # comes after what was held
            except ProtocolError as error:
                self._warn("recording", f"the recorder did not confirm the end of the recording: {error}")
                break
        self._begun, self._following, self._missing = None, False, False
        return recorded

    def close(self) -> None:
        """Forget the session."""
        for inbox in (self._acks, self._recorders):
            if inbox is not None:
                inbox.close()
        self._bus.forget(self._keys.session(self._session, StepReport).rpartition("/")[0] + "/")

    def _publish(self, message: Begin | End | StepReport | Frame | Event) -> bytes:
        """Publish; the message's bytes. A step's report to nobody is not even encoded."""
        key = self._keys.session(self._session, type(message))
        if isinstance(message, StepReport) and not self._following and not self._bus.listened(key):
            return b""
        payload = encode(message)
        # without a recorder that keeps up, nobody may slow the run down
        droppable = topic_of(type(message)).droppable or not self._following or self._late
        self._bus.publish(key, payload, droppable)
        return payload

    def _hold(self, held: _Held) -> None:
        """Until it is safe; while no recorder is there the oldest give way."""
        self._held.append(held)
        self._bytes += len(held.payload)
        while self._missing and self._too_many():
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        self._bytes -= len(self._held.popleft().payload)
        self._let_go += 1

    def _invite(self, begin: Begin) -> None:
        """Ask the recorder to open a file; the answer comes once it listens."""
        self._asked = begin.header
        _empty(self._acks)
        try:
            answer_of_recorder(self._bus, self._keys, begin, _ANSWER)
        except Refused as error:
            self._following = self._missing = False
            self._warn("recording", f"the recorder refuses: {error.failure.message}")
        except ProtocolError as error:
            self._following, self._missing = False, True
            self._warn("recording", f"nothing is recorded, no recorder answers: {error}")
        else:
            self._following = self._known = True
            self._missing = self._late = self._failed = False
            self._let_go = 0

    def _watch(self, until: float = 0.0) -> None:
        """Notice a recorder that dies or comes back; until: wait for one so long, on time.monotonic()."""
        assert self._recorders is not None and self._begun is not None
        while len(self._recorders) > 0 or not (self._following or time.monotonic() > until):
            change = self._recorders.get(max(0.0, until - time.monotonic()))
            if change is None:
                return
            if not change.alive and self._following:
                self._lose()
            elif change.alive and not self._following:
                self._come_back(self._begun)

    def _lose(self) -> None:
        self._following, self._missing = False, True
        self._warn(
            "recording", "the recorder is gone: what is not in its file yet waits for another one, the run goes on"
        )

    def _come_back(self, begun: Begin) -> None:
        """Give a recorder the beginning, and what is held: its file has steps from the first of these on, and none
        before the run's beginning, as an event may be that a run which was taken up begins with."""
        if self._held and (at := self._held[0].header).step > begun.header.step:
            begun = replace(begun, header=replace(begun.header, step=at.step, time=at.time))
        self._invite(begun)
        if self._following:
            for held in self._held:
                self._bus.publish(self._keys.session(self._session, held.kind), held.payload)
            self._warn("recording", f"a recorder is back and records from step {begun.header.step} on")

    def _read_acks(self, timeout: float = 0.0) -> None:
        assert self._acks is not None
        if timeout == 0.0 and len(self._acks) == 0:
            return
        received = self._acks.get(timeout)
        if received is None:
            return
        try:
            recorded = decode(received.payload, Recorded)
        except ProtocolError:
            return
        if recorded.header != self._asked:
            return  # of the file before
        self._acknowledge(min(recorded.messages + recorded.lost - self._let_go, len(self._held)))
        if recorded.state == RecordingState.FAILED and not self._failed:
            self._failed = True
            self._warn("recording", recorded.note)

    def _acknowledge(self, safe: int) -> None:
        """So many of those that are held are in the file, or given up."""
        while safe > 1 and self._held[0].header.step != self._held[safe - 1].header.step:
            self._drop_oldest()
            safe -= 1
        if self._late and not self._too_many():
            self._late = False
            self._warn("recording", "the recorder has caught up")

    def _too_many(self) -> bool:
        return len(self._held) > MOST_MESSAGES or self._bytes > MOST_BYTES

    def _wait(self) -> None:
        """Wait for acknowledgements, once; then the run goes on without looking back."""
        if self._late:
            return
        began = time.monotonic()
        while self._too_many() and (left := began + PATIENCE - time.monotonic()) > 0.0:
            self._read_acks(left)
        self.waited += time.monotonic() - began
        if self._too_many():
            self._late = True
            self._warn(
                "recording", f"the recorder lags behind after {PATIENCE:g} s: the run goes on, messages may be lost"
            )


def _empty(inbox: Inbox[Received] | Inbox[LiveChange] | None) -> None:
    """Forget what was said about files before."""
    while inbox is not None and inbox.get(0.0) is not None:
        continue
