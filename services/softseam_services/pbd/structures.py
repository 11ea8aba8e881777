"""Structures that a process was asked for last: scenes that differ only in numbers share one."""

import hashlib
from collections.abc import Callable
from threading import Lock
from typing import Generic, Protocol, TypeVar

import numpy as np

_KEPT = 8


class Keyed(Protocol):
    """What a structure follows from."""

    @property
    def key(self) -> bytes:
        """What distinguishes it from others."""
        ...


L = TypeVar("L", bound=Keyed)
M = TypeVar("M")


class Structures(Generic[L, M]):
    """The latest last. Structures never change, so any number of solvers, and threads, may have the same one."""

    def __init__(self, build: Callable[[L], M]) -> None:
        self._build = build
        self._kept: dict[bytes, M] = {}
        self._lock = Lock()

    def find(self, layout: L) -> M:
        """The structure of a layout, built where it is not known."""
        key = layout.key
        with self._lock:
            model = self._kept.pop(key) if key in self._kept else self._build(layout)
            self._kept[key] = model
            while len(self._kept) > _KEPT:
                self._kept.pop(next(iter(self._kept)))
        return model


def key_of(*values: object) -> bytes:
    """A digest of arrays and numbers."""
    digest = hashlib.blake2b(digest_size=16)
    for value in values:
        array = np.ascontiguousarray(value)
        digest.update(repr((array.shape, array.dtype.str)).encode() + array.tobytes())
    return digest.digest()
