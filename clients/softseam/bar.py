"""How work gets on: a bar on a terminal; elsewhere, as in a log, a line every tenth of it or every few seconds."""

import math
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn

_REFRESH = 0.1
"""time between updates of the bar [s]"""
LINE = 10.0
"""longest time between lines where there is no terminal [s]"""


class Bar:
    """Shown from now until `stop`: what runs, how much of it is done, and how it stands."""

    def __init__(self, console: Console, text: str, total: float | None, state: str = "") -> None:
        """total  of the work, in the unit of `done`; None where it is not known"""
        self._console, self._text, self._total = console, text, total
        self._shown, self._tenth = -math.inf, 0
        self._progress: Progress | None = None
        if console.is_terminal:
            self._progress = Progress(
                SpinnerColumn(),
                TextColumn("[bold]{task.description}"),
                BarColumn(bar_width=None),
                TextColumn("{task.fields[state]}"),
                console=console,
                refresh_per_second=1.0 / _REFRESH,
            )
            self._task: TaskID = self._progress.add_task(text, total=total, state=state)
            self._progress.start()

    def show(self, done: float | None, state: str, text: str | None = None, force: bool = False) -> None:
        """Show how much is done, unless something was shown a moment ago; None of done or text keeps what is shown."""
        now, tenth = perf_counter(), int(10.0 * (done or 0.0) / self._total) if self._total else 0
        self._text = text or self._text
        if self._progress is not None:
            if force or now - self._shown >= _REFRESH or (done is not None and done == self._total):
                self._shown = now
                self._progress.update(self._task, completed=done, state=state, description=text)
        elif force or tenth > self._tenth or now - self._shown >= LINE:
            self._shown, self._tenth = now, max(tenth, self._tenth)
            self._console.print(f"{self._text}: {state}" if state else self._text, highlight=False)

    def stop(self) -> None:
        if self._progress is not None:
            self._progress.stop()
