"""A session of zenoh: opened, closed once, and followed by another where its links must be made anew."""

import atexit
import itertools
import json
import logging
import os
import threading
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import TracebackType
from typing import Any, Self

import zenoh

from softseam_protocol.bus.declared import Declared
from softseam_protocol.errors import BusError, ForkedBus

LEASE = 1.0
"""time after which a frozen or unreachable process counts as gone [s]"""

_BATCHES = 16
"""of 64 kB each may wait for a link, zenoh's most: what is droppable is dropped where they are full"""

_log = logging.getLogger(__name__)


def _config(mode: str, listen: Sequence[str], connect: Sequence[str], extra: Mapping[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    settings = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        # always explicit: the router's default is not loopback
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "transport/link/tx/lease": int(LEASE * 1000),
        "transport/link/tx/queue/size/data": _BATCHES,
        **extra,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


class BusSession:
    """A zenoh session that is closed once, before the interpreter ends, and may give way to another before."""

    def __init__(self, mode: str, listen: Sequence[str], connect: Sequence[str], extra: Mapping[str, Any]) -> None:
        """Listen and connect at endpoints; `extra` zenoh settings. Raises zenoh.ZError."""
        self._pid = os.getpid()
        self._settings = mode, listen, connect, extra
        self._zenoh: Any = zenoh.open(_config(*self._settings))
        self._closed = False
        self._declared: weakref.WeakValueDictionary[int, Declared] = weakref.WeakValueDictionary()
        """in their order: who sees a token counts on what was declared before it"""
        self._numbers = itertools.count()
        self._joining = threading.RLock()
        """held while one session takes the place of another"""
        self._reference = weakref.ref(self)
        # a session left open while a Python callback exists hangs the interpreter at exit
        atexit.register(_close, self._reference)

    @property
    def _session(self) -> Any:
        if os.getpid() != self._pid:
            raise ForkedBus(
                "this bus was opened before a fork, and what it sends here is lost: open one in this process"
            )
        with self._joining:
            if self._zenoh is None:
                raise BusError("the bus is closed" if self._closed else "the router is gone: start it again")
            return self._zenoh

    @property
    def name(self) -> str:
        """What zenoh calls this session; another one after it was joined anew."""
        return str(self._session.info.zid())

    def _on_session(self, act: Callable[[Any], Any]) -> Any:
        """`act` on the session, on the next one where this one is closed meanwhile. Raises BusError."""
        try:
            return act(self._session)
        except zenoh.ZError:
            try:
                return act(self._session)  # waits while the bus is joined anew
            except zenoh.ZError as error:
                raise BusError(first_sentence(error)) from None

    def _declare(self, make: Callable[[Any], Any]) -> Declared:
        """Declare something on this session and on those that follow it."""
        with self._joining:
            declared = Declared(make, self._session)
            self._declared[next(self._numbers)] = declared
        return declared

    def rejoin(self) -> bool:
        """Leave and join with everything that was declared; False where that fails, as without a router."""
        with self._joining:
            if self._closed:
                return True
            self._leave(LEASE)
            config = _config(*self._settings)
            config.insert_json5("connect/timeout_ms", str(int(LEASE * 1000)))
            try:
                joined: Any = zenoh.open(config)
            except zenoh.ZError:
                return False
            try:
                for declared in list(self._declared.values()):
                    declared.renew(joined)
            except zenoh.ZError:
                _close_session(joined)
                return False
            except BaseException:
                _close_session(joined)
                raise
            self._zenoh = joined
        return True

    def _leave(self, patience: float | None = None) -> None:
        """Close the session, or go on after `patience` [s] while it is being closed (lock held)."""
        session, self._zenoh = self._zenoh, None
        if session is None:
            return
        if patience is None:
            _close_session(session)
            return
        closing = threading.Thread(target=_close_session, args=(session,), name="softseam leaves", daemon=True)
        closing.start()
        closing.join(patience)

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        if os.getpid() != self._pid:
            self._zenoh = None
            return
        with self._joining:
            self._closed = True
            self._leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()


def _close_session(session: Any) -> None:
    """Close; zenoh gives up after 10 s where links are full and nobody reads them."""
    try:
        session.close()
    except zenoh.ZError as error:
        _log.warning("the bus was left without a word to some: %s", first_sentence(error))


def _close(reference: weakref.ref[BusSession]) -> None:
    bus = reference()
    if bus is not None:
        bus.close()


def as_endpoints(endpoints: str | Iterable[str]) -> tuple[str, ...]:
    return (endpoints,) if isinstance(endpoints, str) else tuple(endpoints)


def direct(callback: Callable[[Any], None]) -> Any:
    """A callback run on zenoh's own thread: it must only enqueue.

    zenoh would otherwise add a Python thread, which costs a hop and hangs an interpreter that exits without `close`.
    """
    return zenoh.handlers.Callback(callback, None, indirect=False)


def first_sentence(error: Exception) -> str:
    """zenoh's errors without the places in its source."""
    return str(error).split(" at /")[0].strip()
