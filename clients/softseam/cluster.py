"""Work shared out over a Ray cluster, an actor a processor; what was lost with a worker is done anew by another one."""

from __future__ import annotations

import logging
import os
import socket
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from softseam.errors import BadInput, NoConnection, ServicesFailed, missing_extra
from softseam_protocol.extensions import load_extensions

Work = TypeVar("Work")
Result = TypeVar("Result")
Make = Callable[[], Callable[[Work], Result]]
"""what a worker calls once, for what it does with each piece of work; importable where the workers are"""

_LOCAL = "local"
"""of Ray: a cluster that this process begins for itself"""
_ANSWER = 5.0
"""longest wait for it [s]"""
_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""that begins a connection of HTTP/2, which Ray speaks: its magic and a frame of no settings (RFC 9113, 3.4)"""
_SETTINGS = 4
"""kind of the frame that answers, the fourth of its first nine bytes"""
_BEGIN = 120.0
"""and for a first worker to begin [s]"""
_LOSSES = 5
"""one after the other, nothing done between them, that are borne"""


def share(address: str, make: Make[Work, Result], work: Sequence[Work], told: Callable[[str], None]) -> list[Result]:
    """What each piece of work comes to, in the order of `work`, however many workers there are.

    address  of a cluster that this machine is a part of: HOST:PORT of its head; local: this machine alone
    told     of each worker that is lost

    Raises MissingExtra, BadInput for what is no address, NoConnection where nobody answers there, ServicesFailed where
    workers end again and again or none can begin, and what `make` and its product raise.
    """
    try:
        import ray
    except ImportError as error:
        raise missing_extra(error, "a cluster") from error
    _reach(address)
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # of a cluster that begins here
    quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
    try:
        ray.init(address, **({"include_dashboard": False} if address == _LOCAL else {}), **quiet)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise _nobody(address, str(error)) from error
    try:
        return _Sharing(address, make, work, told).run()
    finally:
        ray.shutdown()


def _reach(address: str) -> None:
    """Ask whether somebody is there who speaks as Ray does: Ray itself tries for minutes, then ends this process."""
    if address == _LOCAL:
        return
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise BadInput(f"--ray {address}: give HOST:PORT of a cluster's head, or {_LOCAL}")
    try:
        with socket.create_connection((host, int(port)), _ANSWER) as connection:
            connection.sendall(_PREFACE)
            answer = connection.recv(9)
    except (OSError, OverflowError) as error:
        raise _nobody(address, str(error)) from error
    if len(answer) < 4 or answer[3] != _SETTINGS:
        raise _nobody(address, "something else is there")


def _nobody(address: str, why: str) -> NoConnection:
    return NoConnection(
        f"no Ray cluster answers at {address} ({why}): ray start --head begins one, and ray start --address HOST:PORT "
        "makes a machine part of it"
    )


class _Worker:
    """An actor: it begins, which may take long, and then does one piece of work after the other."""

    def begin(self, make: Make[Any, Any]) -> None:
        load_extensions()
        self._do = make()

    def do(self, work: Any) -> Any:
        return self._do(work)


class _Sharing(Generic[Work, Result]):
    """Who does what, and what came of it."""

    def __init__(
        self, address: str, make: Make[Work, Result], work: Sequence[Work], told: Callable[[str], None]
    ) -> None:
        import ray

        self._ray, self._work, self._told = ray, work, told
        self._workers = f"of the Ray cluster at {address}"
        self._worker, self._make = ray.remote(num_cpus=1, max_restarts=0)(_Worker), ray.put(make)
        self._waiting = deque(range(len(work)))
        self._idle: list[Any] = []
        self._under_way: dict[Any, tuple[Any, int | None]] = {}
        """worker and place of its work by what is waited for; None: it begins"""
        self._found: dict[int, Result] = {}
        self._losses = 0
        """one after the other"""

    def run(self) -> list[Result]:
        """All results, in the order of the work."""
        for _ in range(min(max(int(self._ray.cluster_resources().get("CPU", 0)), 1), len(self._work))):
            self._start()
        while len(self._found) < len(self._work):
            ready, _ = self._ray.wait(list(self._under_way), timeout=_BEGIN)
            if not ready and all(place is None for _, place in self._under_way.values()):
                raise ServicesFailed(
                    f"no worker {self._workers} began within {_BEGIN:g} s: are its processors taken (ray status)?"
                )
            for each in ready:
                self._take(each)
            while self._waiting and self._idle:
                worker, place = self._idle.pop(), self._waiting.popleft()
                self._under_way[worker.do.remote(self._work[place])] = worker, place
        return [self._found[place] for place in range(len(self._work))]

    def _start(self) -> None:
        worker = self._worker.remote()
        self._under_way[worker.begin.remote(self._make)] = worker, None

    def _take(self, answer: Any) -> None:
        """What a worker answered, or that it is lost."""
        worker, place = self._under_way.pop(answer)
        try:
            result = self._ray.get(answer)
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, self._ray.exceptions.RayError):  # what was sent cannot be read there
                raise ServicesFailed(f"a worker {self._workers} cannot begin: {_why(error.cause)}") from error
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            self._lose(place, _why(error))
            return
        if place is not None:
            self._found[place], self._losses = result, 0
        self._idle.append(worker)

    def _lose(self, place: int | None, why: str) -> None:
        self._losses += 1
        if self._losses > _LOSSES:
            raise ServicesFailed(
                f"{self._losses} workers {self._workers} ended one after the other, the last because: {why}"
            )
        if place is not None:
            self._waiting.appendleft(place)
        self._told(f"a worker is lost, and what it did is done anew ({why})")
        self._start()


def _why(error: Exception) -> str:
    """A line of what Ray says."""
    lines = str(error).strip().splitlines()
    return lines[-1] if "creation task" in lines[0] else lines[0]
