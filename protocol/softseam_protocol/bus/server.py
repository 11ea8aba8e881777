"""The answering side of requests: one queue, one thread, and an answer to everything."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from softseam_protocol.errors import DecodeError, Refused, SchemaMismatch
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Failure
from softseam_protocol.wire.codec import encode

Handler = Callable[[bytes], bytes]
"""answers a request's payload; raises Refused to refuse it"""

MOST_WAITING = 256
LAST_ANSWERS = 5.0
"""longest wait for requests at hand when the server is closed [s]"""

_log = logging.getLogger(__name__)


class Server:
    """Answers requests one at a time, in the order in which they came, so that one thread owns the state."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.answered = 0
        """requests answered so far"""
        self.turned_away = 0
        """requests refused because too many were waiting"""
        self._busy_since: dict[int, float] = {}
        self._waiting: queue.SimpleQueue[tuple[Any, Handler] | None] = queue.SimpleQueue()
        self._owned: list[Any] = []
        self._threads: list[threading.Thread] = []
        self._closed = False

    @property
    def busy(self) -> float:
        """Time spent in the request at hand (the longest of several), 0 when idle [s]."""
        since = list(self._busy_since.values())
        return time.monotonic() - min(since) if since else 0.0

    @property
    def waiting(self) -> int:
        """Requests in the queue."""
        return self._waiting.qsize()

    def own(self, declared: Any) -> None:
        """Keep a declaration that is undeclared on close."""
        self._owned.append(declared)

    def entrance(self, handler: Handler) -> Callable[[Any], None]:
        """The callback for zenoh's threads: it only enqueues."""

        def enter(query: Any) -> None:
            if self._waiting.qsize() >= MOST_WAITING:
                self.turned_away += 1
                with query:
                    query.reply_err(
                        encode(Failure(FailureKind.BUSY, f"{MOST_WAITING} requests are waiting: ask less often"))
                    )
            else:
                self._waiting.put((query, handler))

        return enter

    def start(self, threads: int = 1) -> Server:
        """Answer in a thread of its own; in several only if the handlers may run at the same time."""
        for _ in range(threads):
            thread = threading.Thread(target=self.run, name=self.name, daemon=True)
            self._threads.append(thread)
            thread.start()
        return self

    def run(self) -> None:
        """Answer in this thread until `close`."""
        me = threading.get_ident()
        while True:
            item = self._waiting.get()
            if item is None:
                return
            query, handler = item
            self._busy_since[me] = time.monotonic()
            with query:
                self._answer(query, handler)
            self.answered += 1
            del self._busy_since[me]

    def _answer(self, query: Any, handler: Handler) -> None:
        key = query.key_expr
        try:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            query.reply(key, handler(payload))
        except Refused as error:
            query.reply_err(encode(error.failure))
        except SchemaMismatch as error:
            query.reply_err(encode(Failure(FailureKind.SCHEMA, str(error))))
        except DecodeError as error:
            query.reply_err(encode(Failure(FailureKind.INVALID, f"{key}: {error}")))
        except Exception as error:
            # whatever happens in a handler, the other side must not wait for its timeout
            _log.exception("a request to %s failed", key)
            query.reply_err(encode(Failure(FailureKind.INTERNAL, f"{key}: {type(error).__name__}: {error}")))

    def close(self) -> None:
        """Take no more requests, answer those that wait, and stop."""
        if self._closed:
            return
        self._closed = True
        for declared in self._owned:
            declared.undeclare()
        self._owned.clear()
        for _ in range(max(1, len(self._threads))):
            self._waiting.put(None)
        end = time.monotonic() + LAST_ANSWERS
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=max(0.0, end - time.monotonic()))
