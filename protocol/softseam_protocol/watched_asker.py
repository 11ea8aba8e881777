"""Requests to a server whose life is watched: a wait ends soon after the last of its liveliness tokens has gone.

A request that the router hands to a process in the moment of its death is answered by nobody, and zenoh may not notice
before the request's timeout.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softseam_protocol.bus_client import no_reply, timed_out, understood, unwrapped
from softseam_protocol.codec import encode
from softseam_protocol.inbox import Inbox, LiveChange
from softseam_protocol.live_tokens import LiveTokens

GRACE = 1.0
"""an answer that was sent before the token went may come after it [s]"""

Send = Callable[[bytes, Callable[[Any], None], Callable[[], None]], None]
"""sends a payload; the first callback is given each reply, the second is called when there are no more"""


@dataclass(frozen=True, slots=True)
class _Ended:
    """No more replies will come."""


class WatchedAsker:
    """Asks one key again and again, as `Asker`, and gives up a request whose server has gone."""

    def __init__(self, key: str, timeout: float, tokens: LiveTokens, send: Send) -> None:
        self._key, self._timeout, self._tokens, self._send = key, timeout, tokens, send

    def call(self, message: Any, allowed: Any, timeout: float | None = None) -> Any:
        """Send a message and decode its reply; errors as `Bus.call`.

        timeout  longest wait [s], where it is shorter than this asker's
        """
        payload = encode(message)
        inbox: Inbox[Any] = Inbox()
        gone = self._tokens.tell(inbox)
        try:
            self._send(payload, lambda reply: inbox.put(reply, 0), lambda: inbox.put(_Ended(), 0))
            wait = self._timeout if timeout is None else min(timeout, self._timeout)
            return understood(self._key, self._collect(inbox, wait, gone), allowed)
        finally:
            inbox.close()

    def _collect(self, inbox: Inbox[Any], wait: float, gone: bool) -> bytes:
        end = time.monotonic() + (min(wait, GRACE) if gone else wait)
        shown: set[str] = set()
        while True:
            item = inbox.get(max(0.0, end - time.monotonic()))
            if isinstance(item, LiveChange):
                if item.alive:
                    shown.add(item.key)
                    continue
                shown.discard(item.key)
                if not shown:  # any of them may be the one that was asked
                    gone, end = True, min(end, time.monotonic() + GRACE)
            elif isinstance(item, _Ended) or (item is None and (gone or inbox.closed)):
                raise no_reply(self._key)
            elif item is None:
                raise timed_out(self._key, wait)
            else:
                return unwrapped(self._key, self._timeout, item)
