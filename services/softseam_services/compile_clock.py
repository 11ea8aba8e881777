"""How long numba compiled, or read compiled kernels from its cache: what a measurement of speed leaves out."""

from __future__ import annotations

from types import TracebackType

from numba.core.event import TimingListener, register, unregister

_EVENT = "numba:compiler_lock"
"""numba holds this lock while it compiles a kernel or loads one from its cache"""


class CompileClock:
    """Counts the seconds that numba spends on kernels while the context lasts."""

    def __init__(self) -> None:
        self._listener = TimingListener()  # type: ignore[no-untyped-call]

    @property
    def seconds(self) -> float:
        """Wall time so far [s]."""
        return float(self._listener.duration) if self._listener.done else 0.0

    def __enter__(self) -> CompileClock:
        register(_EVENT, self._listener)  # type: ignore[no-untyped-call]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        unregister(_EVENT, self._listener)  # type: ignore[no-untyped-call]
