"""Where zenoh's threads leave what they receive, for one of ours to pick up."""

import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Received:
    """Something published."""

    key: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class LiveChange:
    """A liveliness token came or went."""

    key: str
    alive: bool


class Inbox(Generic[T]):
    """A bounded queue that never makes the sender wait: what does not fit is dropped and counted in `lost`."""

    def __init__(self, latest: bool = False, limit_bytes: int = 256 * 2**20) -> None:
        self.lost = 0
        self._latest, self._limit = latest, limit_bytes
        self._items: deque[tuple[T, int]] = deque()
        self._bytes = 0
        self._closed = False
        self._changed = threading.Condition()
        self._owned: list[Any] = []

    def own(self, declared: Any) -> None:
        """Keep a declaration that is undeclared on close."""
        self._owned.append(declared)

    def put(self, item: T, size: int) -> None:
        """Add an item of `size` [B]; called from zenoh's threads."""
        with self._changed:
            if self._latest:
                self._items.clear()
                self._bytes = 0
            elif self._bytes + size > self._limit:
                self.lost += 1
                return
            self._items.append((item, size))
            self._bytes += size
            self._changed.notify()

    def get(self, timeout: float) -> T | None:
        """The oldest item, or None if none came within `timeout` [s] or the inbox is closed."""
        end = time.monotonic() + timeout
        with self._changed:
            while not self._items:
                left = end - time.monotonic()
                if self._closed or left <= 0.0:
                    return None
                self._changed.wait(left)
            item, size = self._items.popleft()
            self._bytes -= size
            return item

    def __len__(self) -> int:
        return len(self._items)

    @property
    def closed(self) -> bool:
        return self._closed

    def close(self) -> None:
        """Stop receiving; what is inside can still be taken."""
        for declared in self._owned:
            declared.undeclare()
        self._owned.clear()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
