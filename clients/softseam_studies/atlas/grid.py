"""What a map is made of: panels of cells, each a short run and the verdict on it; and maps from their files.

A file of `maps/` says what is asked, what is varied and of which scene; `runs.py` has what runs a cell of it:

    title, text       of the map
    x, y              what its columns and rows are, with the unit
    columns, rows     values, or values by label
    label             of a cell, with {panel}, {x} and {y}
    seconds           rough wall time of a cell [s]
    given             what each run is given beside column and row
    panels            by title what their runs are given, too; `as` has what differs of the above, and as `keeps` the
                      labels of columns and rows that it has alone
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from softseam_studies.atlas.scenes import data_of
from softseam_studies.atlas.verdicts import Verdict

Values = Iterable[Any] | Mapping[str, Any]
"""of columns or rows: by label, or those whose label they are themselves"""


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


def build(name: str, run: Callable[..., Verdict], columns: Values | None = None, rows: Values | None = None) -> Map:
    """The map of a file, whose cells are `run(column, row, **given)`; columns, rows: others, for tests."""
    data = data_of(name)
    data |= {axis: values for axis, values in (("columns", columns), ("rows", rows)) if values is not None}
    panels, cells = [], []
    for number, (title, given) in enumerate(data["panels"].items()):
        own = data | given.pop("as", {})
        across, up = (_kept(own[axis], own.get("keeps")) for axis in ("columns", "rows"))
        panels.append(Panel(title, own["x"], own["y"], tuple(across), tuple(up)))
        todo = partial(run, **data.get("given", {}), **given)
        for i, (x, column) in enumerate(across.items()):
            for j, (y, row) in enumerate(up.items()):
                label = own["label"].format(panel=title, x=x, y=y)
                control = "(control)" in title or "(control)" in y
                cells.append(Cell(number, i, j, label, partial(todo, column, row), own["seconds"], control))
    return Map(name, data["title"], data["text"], tuple(panels), tuple(cells))


def _kept(values: Values, labels: Iterable[str] | None) -> dict[str, Any]:
    """By label, where that is one of these."""
    named = (
        values
        if isinstance(values, Mapping)
        else {f"{value:g}" if isinstance(value, float) else str(value): value for value in values}
    )
    return {label: value for label, value in named.items() if labels is None or label in labels}
