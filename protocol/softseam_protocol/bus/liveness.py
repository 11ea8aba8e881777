"""Which liveliness tokens exist, as one watch of a bus knows them."""

import threading

from softseam_protocol.bus.inbox import Inbox, LiveChange

CLIENT = "session"
"""service in the tokens of clients, whose instance is the client's session"""


class LiveTokens:
    """What a watch knows; everyone who watches the same key gets an inbox of it.

    zenoh may report the same token twice: only changes are passed on.
    """

    def __init__(self) -> None:
        self._known: set[str] = set()
        self._inboxes: list[Inbox[LiveChange]] = []
        self._lock = threading.Lock()

    def heard(self, key: str, alive: bool) -> None:
        """A token came or went; called from zenoh's threads."""
        with self._lock:
            if alive == (key in self._known):
                return
            if alive:
                self._known.add(key)
            else:
                self._known.remove(key)
            self._forget_closed()
            for inbox in self._inboxes:
                inbox.put(LiveChange(key, alive), 0)

    def forget(self) -> None:
        """Nothing is known any more: what exists will be reported anew."""
        for key in self.known():
            self.heard(key, False)

    def known(self) -> frozenset[str]:
        """Tokens that came and did not go."""
        with self._lock:
            return frozenset(self._known)

    def inbox(self) -> Inbox[LiveChange]:
        """Comings and goings from now on, beginning with those that exist."""
        inbox: Inbox[LiveChange] = Inbox()
        with self._lock:
            self._forget_closed()
            for key in sorted(self._known):
                inbox.put(LiveChange(key, True), 0)
            self._inboxes.append(inbox)
        return inbox

    def _forget_closed(self) -> None:
        """Inboxes that nobody reads any more (lock held)."""
        self._inboxes = [inbox for inbox in self._inboxes if not inbox.closed]

    def close(self) -> None:
        """Nothing more will be heard."""
        with self._lock:
            inboxes, self._inboxes = self._inboxes, []
        for inbox in inboxes:
            inbox.close()
