"""What messages alike have taught: layouts by what they have in common, such as their length or their sender."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Layout = TypeVar("Layout")

_LEARN_AT = 4
"""messages that are met before the last of them teaches"""
_REST = 1000
"""messages that are left in peace after one that could not teach"""
_MOST, _MET = 64, 1024
"""keys that are kept with layouts, and without yet"""


class Learned(Generic[Key, Layout]):
    """Layouts by key, the newest first; bounded, whatever is met."""

    def __init__(self, alike: int) -> None:
        self._alike = alike  # layouts of one key
        self._met: dict[Key, int] = {}
        self.known: dict[Key, list[Layout]] = {}

    def meet(self, key: Key, teach: Callable[[], Layout | None]) -> None:
        """A message came that no layout fits; `teach` finds its layout, or None where there is none."""
        if key not in self._met and len(self._met) >= _MET:
            self._met.clear()
        met = self._met[key] = self._met.get(key, 0) + 1
        if met < _LEARN_AT:
            return
        layout = teach()
        if layout is None:
            self._met[key] = -_REST
            return
        del self._met[key]
        if key not in self.known and len(self.known) >= _MOST:
            self.known.clear()
        self.known[key] = [layout, *self.known.get(key, ())][: self._alike]

    def prefer(self, key: Key, layout: Layout) -> None:
        """The next message is probably laid out like this one."""
        layouts = self.known[key]
        if layout is not layouts[0]:
            self.known[key] = [layout, *(other for other in layouts if other is not layout)]
