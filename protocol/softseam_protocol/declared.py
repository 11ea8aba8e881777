"""What is declared on a session of zenoh, and once more on the session that follows it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any


class Declared:
    """A subscriber, queryable, querier or token, however often the bus is joined anew."""

    def __init__(self, make: Callable[[Any], Any], session: Any) -> None:
        """make: declares it on a session"""
        self._make = make
        self._lock = threading.Lock()
        self._undeclared = False
        self.current = make(session)
        """zenoh's own object"""

    def renew(self, session: Any) -> None:
        """Declare it on another session; the one before is closed."""
        with self._lock:
            if not self._undeclared:
                self.current = self._make(session)

    def undeclare(self) -> None:
        """Take it back; a second call does nothing."""
        with self._lock:
            undeclared, self._undeclared = self._undeclared, True
        if not undeclared:
            self.current.undeclare()
