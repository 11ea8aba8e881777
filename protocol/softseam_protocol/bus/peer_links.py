"""Peers that a node was linked with: nobody but us sees to it that a link which broke comes back.

zenoh links two peers when the router introduces them, once. Where a link breaks on one side and both live on (one was
frozen for about the lease), the other side may refuse a new link for the sake of the old one, or take it for a part
of the old one, whose tokens and subscriptions it sent long ago. In either case the two do not hear of each other again,
or one of them does not hear of the other: a link that broke is looked at once more when there is another.
"""

import logging
import threading
import time
from collections.abc import Callable

_log = logging.getLogger(__name__)


class PeerLinks:
    """Hands peers to `mend`, in a thread of its own, a while after their links broke, or were made after they broke."""

    def __init__(self, mend: Callable[[frozenset[str]], bool], patience: float) -> None:
        """
        mend      given the names of peers; False: ask again later
        patience  time that a peer has to come back by itself, and to send what it has [s]
        """
        self._mend, self._patience = mend, patience
        self._due: dict[str, float] = {}
        """when peers are to be looked at, on this machine's clock [s]"""
        self._ever: set[str] = set()
        """broke so far"""
        self._changed = threading.Condition()
        self._closed = False
        self._thread: threading.Thread | None = None

    def broke(self, peer: str) -> None:
        """A link broke; called from zenoh's threads."""
        with self._changed:
            self._ever.add(peer)
            self._look_later(peer)

    def made(self, peer: str) -> None:
        """A link was made; called from zenoh's threads."""
        with self._changed:
            if peer in self._ever:
                self._look_later(peer)

    def _look_later(self, peer: str) -> None:
        """(lock held)"""
        self._due[peer] = time.monotonic() + self._patience
        if self._thread is None and not self._closed:
            self._thread = threading.Thread(target=self._watch, name="softseam links", daemon=True)
            self._thread.start()
        self._changed.notify()

    def _watch(self) -> None:
        while True:
            peers = self._next()
            if not peers:
                return
            try:
                mended = self._mend(peers)
            except Exception:  # whatever it is, links are looked after as long as the bus is open
                _log.exception("links that broke could not be looked at")
                mended = False
            if not mended:
                again = time.monotonic() + self._patience
                with self._changed:
                    for peer in peers:
                        self._due.setdefault(peer, again)

    def _next(self) -> frozenset[str]:
        """Wait for peers that are due; empty when closed."""
        with self._changed:
            while not self._closed:
                now = time.monotonic()
                peers = frozenset(peer for peer, due in self._due.items() if due <= now)
                if peers:
                    for peer in peers:
                        del self._due[peer]
                    return peers
                self._changed.wait(min(self._due.values()) - now if self._due else None)
        return frozenset()

    def close(self) -> None:
        """Look no more."""
        with self._changed:
            self._closed = True
            self._changed.notify()
