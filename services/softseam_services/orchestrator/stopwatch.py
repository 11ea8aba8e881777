"""Where the wall time of a step goes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from time import perf_counter

from softseam_protocol.messages.participant import Configure, Reply, Request, Worked
from softseam_protocol.models import MODELS
from softseam_services.orchestrator.transport import Transport, worked


class Stopwatch:
    """Runs from the beginning of one step to that of the next."""

    def __init__(self) -> None:
        self.begin(perf_counter())

    def begin(self, now: float) -> None:
        """A step begins."""
        self._began = now
        self._seconds = {**dict.fromkeys(MODELS, 0.0), "bus": 0.0}
        self._away = 0.0  # time in exchanges [s]

    def spent(self, model: str, seconds: float) -> None:
        """A participant worked this long on an exchange."""
        self._seconds[model] = self._seconds.get(model, 0.0) + seconds

    def exchanged(self, wall: float, work: Collection[float]) -> None:
        """An exchange took this long altogether; what exceeds the slowest participant's work is the bus's [s]."""
        self._seconds["bus"] += max(0.0, wall - max(work, default=0.0))
        self._away += wall

    def read(self) -> dict[str, float]:
        """Wall seconds by model, bus and coupling (what is not spent in exchanges), and in total."""
        total = perf_counter() - self._began
        return {**self._seconds, "total": total, "coupling": max(0.0, total - self._away)}


class TimedTransport:
    """A transport that tells a stopwatch how long exchanges took, and the models in them."""

    def __init__(self, inner: Transport, stopwatch: Stopwatch) -> None:
        self._inner, self._stopwatch = inner, stopwatch
        self._models: dict[str, str] = {}

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        """See `Transport`."""
        for name, request in requests.items():
            if isinstance(request, Configure):
                self._models[name] = request.model
        began = perf_counter()
        replies = self._inner.exchange(requests)
        wall = perf_counter() - began
        work = {name: worked(reply) for name, reply in replies.items() if isinstance(reply, Worked)}
        self._stopwatch.exchanged(wall, work.values())
        for name, seconds in work.items():
            self._stopwatch.spent(self._models[name], seconds)
        return replies

    def wait_alive(self, participant: str, timeout: float) -> bool:
        """See `Transport`."""
        return self._inner.wait_alive(participant, timeout)

    def close(self) -> None:
        """Close the other."""
        self._inner.close()
