"""What a map is made of: panels of cells, each a short run and the verdict on it."""

from collections.abc import Callable
from dataclasses import dataclass

from softseam_studies.atlas.verdicts import Verdict


@dataclass(frozen=True)
class Cell:
    """One run of a map."""

    panel: int
    column: int
    row: int
    label: str
    """names the run for people"""
    run: Callable[[], Verdict]
    seconds: float = 0.3
    """rough wall time [s]"""
    control: bool = False
    """whether it is there to be seen to fail"""


@dataclass(frozen=True)
class Panel:
    """One grid, rows from the bottom up."""

    title: str
    x: str
    y: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]

    @property
    def short(self) -> str:
        """The title's first words, where there is little room."""
        return self.title.partition(":")[0].partition(" (")[0]


@dataclass(frozen=True)
class Map:
    """One question, and the runs that answer it."""

    name: str
    title: str
    text: str
    """one sentence: what was run, and what accurate means"""
    panels: tuple[Panel, ...]
    cells: tuple[Cell, ...]

    def key(self, cell: Cell) -> str:
        """Names the file of a cell."""
        return f"{self.name}-{cell.panel}-{cell.column}-{cell.row}"
