"""How long numba compiled, or read compiled kernels from its cache: what a measurement of speed leaves out."""

from __future__ import annotations

from time import perf_counter, process_time
from types import TracebackType

from numba.core.event import Event, Listener, register, unregister

_EVENT = "numba:compiler_lock"
"""numba holds this lock while it compiles a kernel or loads one from its cache"""


class CompileClock(Listener):
    """Counts the seconds that numba spends on kernels while the context lasts."""

    def __init__(self) -> None:
        self.wall = self.cpu = 0.0
        """wall and processor time so far [s]"""
        self._depth = 0
        self._began = (0.0, 0.0)

    @property
    def wall_so_far(self) -> float:
        """Wall time so far, with that of what is compiled right now [s]; may be read by another thread."""
        ongoing = perf_counter() - self._began[0] if self._depth > 0 else 0.0
        return self.wall + ongoing

    def on_start(self, event: Event) -> None:
        if self._depth == 0:
            self._began = perf_counter(), process_time()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.wall += perf_counter() - self._began[0]
            self.cpu += process_time() - self._began[1]

    def __enter__(self) -> CompileClock:
        register(_EVENT, self)  # type: ignore[no-untyped-call]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        unregister(_EVENT, self)  # type: ignore[no-untyped-call]
