"""Work shared out over a Ray cluster, an actor a processor; what was lost with a worker is done anew by another one."""

from __future__ import annotations

import logging
import os
import socket
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from softseam.errors import BadInput, NoConnection, ServicesFailed, missing_extra
from softseam_protocol.extensions import load_extensions

Work = TypeVar("Work")
Result = TypeVar("Result")
Make = Callable[[], Callable[[Work], Result]]
"""what a worker calls once, for what it does with each piece of work; importable where the workers are"""

_LOCAL = "local"
"""of Ray: a cluster that this process begins for itself"""
ANSWER = 5.0
"""longest wait for it [s]"""
_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""that begins a connection of HTTP/2, which Ray speaks: its magic and a frame of no settings (RFC 9113, 3.4)"""
_SETTINGS = 4
"""kind of the frame that answers, the fourth of its first nine bytes"""
_BEGIN = 120.0
"""and for a first worker to begin [s]"""
LOSSES = 5
"""one after the other, nothing done between them, that are borne"""


def share(
    address: str,
    make: Make[Work, Result],
    work: Sequence[Work],
    lost: Callable[[str], None],
    over: Callable[[Result], object] = lambda result: None,
) -> list[Result]:
    """What each piece of work comes to, in the order of `work`, however many workers there are.

    over  called with each result as it comes in

    Other arguments, and what is raised, are those of `Workers`.
    """
    found = dict[int, Result]()
    with Workers(address, make, lost) as workers:
        for each in work:
            workers.begin(each)
        for number, result in workers.ended(0):
            found[number] = result
            over(result)
    return [found[number] for number in range(len(work))]


def reach(address: str) -> None:
    """Ask whether somebody is there who speaks as Ray does: Ray itself tries for minutes, then ends this process.

    Raises BadInput for what is no address, and NoConnection.
    """
    if address == _LOCAL:
        return
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise BadInput(f"--ray {address}: give HOST:PORT of a cluster's head, or {_LOCAL}")
    try:
        with socket.create_connection((host, int(port)), ANSWER) as connection:
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


class Workers(Generic[Work, Result]):
    """Those of a Ray cluster, at most one a processor, which take pieces of work as these come. A context manager.

    address  of a cluster that this machine is a part of: HOST:PORT of its head; local: this machine alone
    lost     called with each worker that is lost

    Entering it raises MissingExtra, BadInput for what is no address, NoConnection where nobody answers there; `ended`
    ServicesFailed where workers end again and again or none can begin, and what `make` and its product raise.
    """

    def __init__(self, address: str, make: Make[Work, Result], lost: Callable[[str], None]) -> None:
        self._address, self._make, self._lost = address, make, lost
        self._workers = f"of the Ray cluster at {address}"
        self.size = 1
        """how many there may be: processors of the cluster"""
        self._n_workers = self._n_begun = 0
        self._work = dict[int, Work]()
        """by its number, until it is done"""
        self._waiting = deque[int]()
        self._idle: list[Any] = []
        self._under_way: dict[Any, tuple[Any, int | None]] = {}
        """worker and number of its work by what is waited for; None: it begins"""
        self._losses = 0
        """one after the other"""

    def __enter__(self) -> Workers[Work, Result]:
        try:
            import ray
        except ImportError as error:
            raise missing_extra(error, "a cluster") from error
        reach(self._address)
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # of a cluster that begins here
        quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
        try:
            ray.init(self._address, **({"include_dashboard": False} if self._address == _LOCAL else {}), **quiet)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise _nobody(self._address, str(error)) from error
        self._ray, self._given = ray, ray.put(self._make)
        self._worker = ray.remote(num_cpus=1, max_restarts=0)(_Worker)
        self.size = max(int(ray.cluster_resources().get("CPU", 0)), 1)
        return self

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()

    def begin(self, work: Work) -> int:
        """Have it done, as soon as a worker is free; its number, 0 for the first."""
        number, self._n_begun = self._n_begun, self._n_begun + 1
        self._work[number] = work
        self._waiting.append(number)
        if self._n_workers < min(self.size, len(self._work)):
            self._n_workers += 1
            self._start()
        self._hand_out()
        return number

    def ended(self, most: int) -> Iterator[tuple[int, Result]]:
        """Number and result of what is done, waiting until no more than so many pieces are not."""
        while len(self._work) > most:
            ready, _ = self._ray.wait(list(self._under_way), timeout=_BEGIN)
            if not ready and all(number is None for _, number in self._under_way.values()):
                raise ServicesFailed(
                    f"no worker {self._workers} began within {_BEGIN:g} s: are its processors taken (ray status)?"
                )
            done = [self._take(each) for each in ready]
            self._hand_out()
            yield from (one for one in done if one is not None)

    def _hand_out(self) -> None:
        while self._waiting and self._idle:
            worker, number = self._idle.pop(), self._waiting.popleft()
            self._under_way[worker.do.remote(self._work[number])] = worker, number

    def _start(self) -> None:
        worker = self._worker.remote()
        self._under_way[worker.begin.remote(self._given)] = worker, None

    def _take(self, answer: Any) -> tuple[int, Result] | None:
        """What a worker did; None where it has begun, or is lost."""
        worker, number = self._under_way.pop(answer)
        try:
            result = self._ray.get(answer)
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, self._ray.exceptions.RayError):  # what was sent cannot be read there
                raise ServicesFailed(f"a worker {self._workers} cannot begin: {_why(error.cause)}") from error
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            self._lose(number, _why(error))
            return None
        self._idle.append(worker)
        if number is None:
            return None
        self._losses = 0
        del self._work[number]
        return number, result

    def _lose(self, number: int | None, why: str) -> None:
        self._losses += 1
        if self._losses > LOSSES:
            raise ServicesFailed(
                f"{self._losses} workers {self._workers} ended one after the other, the last because: {why}"
            )
        if number is not None:
            self._waiting.appendleft(number)
        self._lost(f"a worker is lost, and what it did is done anew ({why})")
        self._start()


def _why(error: Exception) -> str:
    """A line of what Ray says."""
    lines = str(error).strip().splitlines()
    return lines[-1] if "creation task" in lines[0] else lines[0]
