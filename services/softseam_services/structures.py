"""Structures that were asked for last: scenes that differ only in numbers share what is joined to what."""

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

    def __init__(self, build: Callable[[L], M], size: Callable[[M], int] = lambda model: 0, most: int = 0) -> None:
        """size: of a structure; the latest of them are kept, of no more than `most` together, but for the last one"""
        self._build, self._size, self._most = build, size, most
        self._kept: dict[bytes, M] = {}
        self._lock = Lock()

    def find(self, layout: L) -> M:
        """The structure of a layout, built where it is not known."""
        key, kept = layout.key, self._kept
        with self._lock:
            model = kept.pop(key) if key in kept else self._build(layout)
            kept[key] = model
            while len(kept) > _KEPT or (len(kept) > 1 and sum(map(self._size, kept.values())) > self._most):
                kept.pop(next(iter(kept)))
        return model


def key_of(*values: object) -> bytes:
    """A digest of arrays and numbers."""
    digest = hashlib.blake2b(digest_size=16)
    for value in values:
        array = np.ascontiguousarray(value)
        digest.update(repr((array.shape, array.dtype.str)).encode() + array.tobytes())
    return digest.digest()
