"""Whose clients have gone: a client shows a token for its session, and the token goes when the client's process does.

A token also goes for a while where a client is frozen or cut off, where the router is restarted, and where this process
joins the bus anew; it comes back. So the time since counts only while a router answers that does not know the token
either. A client that never showed a token is not known to go: its session stays until another one needs the place.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.liveness import CLIENT
from softseam_protocol.bus.session import LEASE
from softseam_protocol.errors import BusError
from softseam_protocol.topics import Keys


class ClientLiveness:
    """Since when clients have been gone. One thread calls `look` again and again, any thread the rest."""

    def __init__(self, bus: Bus, keys: Keys) -> None:
        self._bus, self._keys = bus, keys
        self._every = keys.every_live("client", CLIENT)
        self._changes = bus.watch_live(self._every)
        self._gone: dict[str, float] = {}
        """session: since when its client has been gone [s]"""
        self._lock = threading.Lock()
        self._asked = 0.0

    def look(self, sessions: Collection[str], wait: float) -> None:
        """Hear who came and went, waiting for news at most `wait` [s]; ask the router about those of the sessions."""
        change = self._changes.get(wait)
        while change is not None:
            live = self._keys.read_live(change.key)
            if live is not None:
                with self._lock:
                    self._gone.pop(live.instance, None)
                    if not change.alive:
                        self._gone[live.instance] = time.monotonic()
            change = self._changes.get(0.0)
        if time.monotonic() - self._asked >= LEASE and not self._gone.keys().isdisjoint(sessions):
            self._ask()

    def gone(self, seconds: float = 0.0) -> set[str]:
        """Sessions whose clients have been gone for so long."""
        with self._lock:
            return {session for session, since in self._gone.items() if time.monotonic() - since >= seconds}

    def silent(self, sessions: Collection[str]) -> set[str]:
        """Those whose clients never showed a token; none where no router answers."""
        try:
            tokens = self._bus.live_at_router(self._every) | self._bus.live(self._every)
        except BusError:
            return set()
        live = {live.instance for live in map(self._keys.read_live, tokens) if live}
        with self._lock:
            return set(sessions) - live - self._gone.keys()

    def forget(self, session: str) -> None:
        """The session has ended."""
        with self._lock:
            self._gone.pop(session, None)

    def _ask(self) -> None:
        """Whom the router still knows, or all where it does not answer, may be about to be heard of again."""
        try:
            known = {live.instance for live in map(self._keys.read_live, self._bus.live_at_router(self._every)) if live}
        except BusError:
            known = self.gone()
        self._asked = time.monotonic()
        with self._lock:
            for session in known & self._gone.keys():
                self._gone[session] = self._asked
