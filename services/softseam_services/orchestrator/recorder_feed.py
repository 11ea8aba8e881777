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
_PACE = 1 / 20
"""of asking a recorder that has not been introduced yet [s]"""


def answer_of_recorder(bus: Bus, keys: Keys, request: Begin | End, timeout: float) -> Recorded:
    """The recorder's answer, within `timeout` [s]. One that lives, but that a process which has just joined the bus has
    not been introduced to, is asked for `PATIENCE`. Raises Refused and ProtocolError."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            answer: Recorded = bus.call(keys.recorder, request, Recorded, timeout)
            return answer
        except NoReply:
            if time.monotonic() > end or not bus.live(keys.every_live("recorder")):
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
        self._sent = 0
        """messages since the beginning"""
        self._safe = 0
        """of these, what the recorder has in its file or has given up"""
        self._under_way: deque[_Held] = deque()
        self._last_step: list[_Held] = []
        """what is safe of the step of the message that became safe last"""
        self._bytes = 0
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
        self._hold_anew([])
        self._missing = self._known = False
        self._publish(begin)
        if self._record:
            self._drain()
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
            self._watch(time.monotonic() + PATIENCE)
        end = End(self._begun.header, reason)
        self._begun = None
        recorded = None
        self._publish(end)
        if self._following:
            try:
                recorded = answer_of_recorder(self._bus, self._keys, end, FINISH)
            except ProtocolError as error:
                self._warn("recording", f"the recorder did not confirm the end of the recording: {error}")
            self._following = False
        self._missing = False
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
        self._sent += 1
        self._under_way.append(held)
        self._bytes += len(held.payload)
        while self._missing and self._too_many():
            self._bytes -= len(self._under_way.popleft().payload)
            self._last_step.clear()

    def _hold_anew(self, held: list[_Held]) -> None:
        """These alone are under way, to a recorder that begins."""
        self._under_way, self._last_step = deque(held), []
        self._sent, self._safe, self._bytes = len(held), 0, sum(len(each.payload) for each in held)
        self._late = self._failed = False

    def _invite(self, begin: Begin) -> None:
        """Ask the recorder to open a file; the answer comes once it listens."""
        self._asked = begin.header
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
            self._missing = False

    def _drain(self) -> None:
        """Forget what was said about runs before."""
        for inbox in (self._acks, self._recorders):
            while inbox is not None and inbox.get(0.0) is not None:
                continue

    def _watch(self, until: float = 0.0) -> None:
        """Notice a recorder that dies or comes back; until: wait for one so long, on time.monotonic()."""
        assert self._recorders is not None and self._begun is not None
        while len(self._recorders) > 0 or not (self._following or time.monotonic() > until):
            change = self._recorders.get(max(0.0, until - time.monotonic()))
            if change is None:
                return
            if not change.alive and self._following:
                self._following, self._missing = False, True
                self._warn(
                    "recording",
                    "the recorder is gone: what is not in its file yet waits for another one, the run goes on",
                )
            elif change.alive and not self._following:
                self._come_back(self._begun)

    def _come_back(self, begun: Begin) -> None:
        """Give a recorder the beginning, and what is held from the first step that is not all safe."""
        same = [
            each
            for each in self._last_step
            if not self._under_way or each.header.step == self._under_way[0].header.step
        ]
        held = [*same, *self._under_way]
        if held:
            at = held[0].header
            begun = replace(begun, header=replace(begun.header, step=at.step, time=at.time))
        while self._acks is not None and self._acks.get(0.0) is not None:
            continue  # what the one before said
        self._invite(begun)
        if self._following:
            self._hold_anew(held)
            for each in held:
                self._bus.publish(self._keys.session(self._session, each.kind), each.payload)
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
        self._acknowledge(min(self._sent, recorded.messages + recorded.lost))
        if recorded.state == RecordingState.FAILED and not self._failed:
            self._failed = True
            self._warn("recording", recorded.note)

    def _acknowledge(self, safe: int) -> None:
        while self._safe < safe:
            self._safe += 1
            held = self._under_way.popleft()
            self._bytes -= len(held.payload)
            if self._last_step and self._last_step[0].header.step != held.header.step:
                self._last_step.clear()
            self._last_step.append(held)
        if self._late and not self._too_many():
            self._late = False
            self._warn("recording", "the recorder has caught up")

    def _too_many(self) -> bool:
        return len(self._under_way) > MOST_MESSAGES or self._bytes > MOST_BYTES

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
