"""What is declared on a session of zenoh, and once more on the session that follows it."""

import threading
import time
from collections.abc import Callable
from typing import Any


class Declared:
    """A publisher, subscriber, queryable, querier or token, however often the bus is joined anew."""

    def __init__(self, make: Callable[[Any], Any], session: Any) -> None:
        """make: declares it on a session"""
        self._make = make
        self._lock = threading.Lock()
        self._undeclared = False
        self.current = make(session)
        """zenoh's own object"""
        self.since = time.monotonic()
        """when it was declared, on this machine's clock [s]"""

    def renew(self, session: Any) -> None:
        """Declare it on another session; the one before is closed."""
        with self._lock:
            if not self._undeclared:
                self.current, self.since = self._make(session), time.monotonic()

    def undeclare(self) -> None:
        """Take it back; a second call does nothing."""
        with self._lock:
            undeclared, self._undeclared = self._undeclared, True
        if not undeclared:
            self.current.undeclare()
