"""Peers that a node was linked with: nobody but us sees to it that a link which broke comes back.

zenoh links two peers when the router introduces them, once. Where a link breaks on one side and both live on (one was
frozen for about the lease), the other side may refuse a new link for the sake of the old one, or take it for a part
of the old one, whose tokens and subscriptions it told long ago. In either case the two do not hear of each other again,
or one of them does not hear of the other: a link that broke is looked at once more when there is another.
"""

from __future__ import annotations

import threading
from collections.abc import Callable


class PeerLinks:
    """Hands peers to `mend`, in a thread of its own, a while after their links broke."""

    def __init__(self, mend: Callable[[frozenset[str]], bool], patience: float) -> None:
        """
        mend      given the names of peers; False: ask again later
        patience  time that a peer has to come back by itself [s]
        """
        self._mend, self._patience = mend, patience
        self._broken: set[str] = set()
        self._ever: set[str] = set()
        """broke so far"""
        self._changed = threading.Condition()
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    def broke(self, peer: str) -> None:
        """A link broke; called from zenoh's threads."""
        with self._changed:
            self._broken.add(peer)
            self._ever.add(peer)
            if self._thread is None and not self._closed.is_set():
                self._thread = threading.Thread(target=self._watch, name="softseam links", daemon=True)
                self._thread.start()
            self._changed.notify()

    def made(self, peer: str) -> None:
        """A link was made; called from zenoh's threads."""
        if peer in self._ever:
            self.broke(peer)

    def _watch(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._broken or self._closed.is_set())
            if self._closed.wait(self._patience):
                return
            with self._changed:
                broken = frozenset(self._broken)
            if self._mend(broken):
                with self._changed:
                    self._broken -= broken

    def close(self) -> None:
        """Look no more."""
        self._closed.set()
        with self._changed:
            self._changed.notify()
