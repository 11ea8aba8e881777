"""The bar that shows on a terminal how a run or a chart gets on."""

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn


class Bar:
    """A bar that is shown from now until `stop`: what runs, how much of it is done, and how it stands."""

    def __init__(self, console: Console, text: str, total: float | None, state: str) -> None:
        """total  of the work, in the unit of `done`; None where it is not known"""
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[state]}"),
            console=console,
            refresh_per_second=10,
        )
        self._task: TaskID = self._progress.add_task(text, total=total, state=state)
        self._progress.start()

    def show(self, done: float | None, state: str, text: str | None = None) -> None:
        """Show how much is done; None of either keeps what is shown."""
        self._progress.update(self._task, completed=done, state=state, description=text)

    def stop(self) -> None:
        self._progress.stop()
