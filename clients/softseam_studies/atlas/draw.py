"""Maps as pictures: a square a run, coloured by what became of it, its error inside."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from softseam.view.paper import INK, PAPER, SOFT, heading, write
from softseam_studies.atlas.atlas import Filled
from softseam_studies.atlas.maps.grid import Cell
from softseam_studies.atlas.palette import LETTER, SILENT, TONES
from softseam_studies.atlas.table import NOT_COMPUTED
from softseam_studies.atlas.verdicts import KINDS, MEANING, Verdict

CELL_WIDTH, CELL_HEIGHT = 0.52, 0.36
"""of a run [inch]"""
LEFT, RIGHT, TOP, BOTTOM = 1.0, 0.25, 0.42, 0.62
"""around a panel [inch]"""
LETTER_WIDTH = 0.077
"""of a row's name [inch]"""
HEAD = 0.70
LINE = 0.19
LEGEND, WORDS = 0.62, 0.30
"""colours, and what stands in the cells [inch]"""
MARKS = {
    "0.3": "error in per cent",
    "0": "error below 0.1 %",
    ">999": "error of 1000 % and more",
    "0.3 R": "saved by a safeguard",
    "R": "saved, error below 0.1 %",
    "U": "unstable",
    "-": "refused",
    "": "wrong, without a figure",
}
"""what may stand in a cell (0.3 for any number), and what it means"""


def draw_map(path: Path, filled: Filled, machine: str) -> Path:
    """Write one map; returns its path."""
    of = filled.map
    widths = [
        max(LEFT, 0.35 + LETTER_WIDTH * max(len(row) for row in panel.rows)) + CELL_WIDTH * len(panel.columns) + RIGHT
        for panel in of.panels
    ]
    per_line = _per_line(widths)
    lines = [list(range(i, min(i + per_line, len(widths)))) for i in range(0, len(widths), per_line)]
    tall = [max(TOP + BOTTOM + CELL_HEIGHT * len(of.panels[i].rows) for i in line) for line in lines]
    width = max(12.6, *(sum(widths[i] for i in line) for line in lines))
    text = "\n".join([*textwrap.wrap(of.text, int(12.6 * width)), f"{_counted(filled)}; {machine}"])
    head = HEAD + LINE * (text.count("\n") + 1)
    height = head + sum(tall) + LEGEND + WORDS
    figure = Figure(figsize=(width, height), dpi=130, facecolor=PAPER)
    heading(figure, of.title, text)
    top = height - head
    for line, high in zip(lines, tall, strict=True):
        left = 0.0
        for i in line:
            panel = of.panels[i]
            wide, rows = CELL_WIDTH * len(panel.columns), CELL_HEIGHT * len(panel.rows)
            x = left + widths[i] - wide - RIGHT
            axes = figure.add_axes((x / width, (top - TOP - rows) / height, wide / width, rows / height))
            draw_panel(axes, filled, i, shown=True)
            left += widths[i]
        top -= high
    _legend(figure, height, WORDS)
    marks = "; ".join(f"{mark} = {meaning}" for mark, meaning in MARKS.items() if mark)
    figure.text(0.014, 0.12 / height, f"In the cells: {marks}.", fontsize=9, color=SOFT)
    return write(figure, path)


def draw_overview(path: Path, maps: Sequence[Filled], machine: str) -> Path:
    """Write all maps small, without words in the cells; those that were not computed say so."""
    across = 3
    n_lines = -(-len(maps) // across)
    width, height = 15.0, 1.35 + 3.75 * n_lines + LEGEND
    figure = Figure(figsize=(width, height), dpi=120, facecolor=PAPER)
    total = sum(len(filled.verdicts) for filled in maps)
    silent = sum(len(filled.silent) for filled in maps)
    text = f"{total} short runs; {silent} of them wrong without saying so, failing controls left out; {machine}"
    heading(figure, "Stability where methods fail", text)
    for number, filled in enumerate(maps):
        line, place = divmod(number, across)
        left, bottom = 0.35 + place * width / across, height - 1.15 - 3.75 * (line + 1) + 0.45
        figure.text(left / width, (bottom + 2.98) / height, filled.map.title, fontsize=12, color=INK, weight="bold")
        if not filled.verdicts:
            figure.text(left / width, (bottom + 2.5) / height, NOT_COMPUTED, fontsize=10, color=SOFT)
            continue
        panels = filled.map.panels
        n = len(panels)
        each = (width / across - 0.55) / n
        for i, panel in enumerate(panels):
            box = ((left + i * each) / width, bottom / height, (each - 0.14) / width, 2.5 / height)
            axes = figure.add_axes(box)
            draw_panel(axes, filled, i, shown=False)
            title = panel.short if n < 4 else panel.short.removeprefix("Rope, ")
            axes.set_title(title, loc="left", fontsize=8.5 if n < 4 else 7.5, color=SOFT, pad=4)
            axes.set_xlabel(panel.x if n < 4 else panel.x.partition(" a ")[0], fontsize=8.5, color=SOFT)
            # where there are many panels, rows are what the map is about
            y = panel.y.partition(";")[0].partition(" [")[0] if n < 4 else filled.map.title.rpartition(" against ")[2]
            if i == 0:
                axes.set_ylabel(y, fontsize=8.5, color=SOFT, labelpad=2)
    _legend(figure, height)
    return write(figure, path)


def draw_panel(axes: Axes, filled: Filled, number: int, *, shown: bool) -> None:
    """One grid. shown: with errors in the cells, and the scales named."""
    panel = filled.map.panels[number]
    for cell, verdict in filled.judged:
        if cell.panel == number:
            _cell(axes, cell, verdict, shown)
    axes.set_xlim(-0.5, len(panel.columns) - 0.5)
    axes.set_ylim(-0.5, len(panel.rows) - 0.5)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.tick_params(length=0, labelsize=9, colors=SOFT)
    if not shown:
        axes.set_xticks([])
        axes.set_yticks([])
        return
    axes.set_xticks(range(len(panel.columns)), panel.columns)
    axes.set_yticks(range(len(panel.rows)), panel.rows)
    axes.set_title(panel.title, loc="left", fontsize=11, color=INK, pad=7)
    axes.set_xlabel(panel.x, fontsize=9.5, color=SOFT)
    axes.set_ylabel(panel.y, fontsize=9.5, color=SOFT)


def _cell(axes: Axes, cell: Cell, verdict: Verdict, shown: bool) -> None:
    pad = 0.035
    box = (cell.column - 0.5 + pad, cell.row - 0.5 + pad)
    axes.add_patch(Rectangle(box, 1 - 2 * pad, 1 - 2 * pad, facecolor=TONES[verdict.kind], linewidth=0))
    if verdict.silent:
        inner = (cell.column - 0.5 + 2 * pad, cell.row - 0.5 + 2 * pad)
        size = 1 - 4 * pad
        axes.add_patch(
            Rectangle(inner, size, size, fill=False, edgecolor=SILENT, linewidth=1.5 if shown else 0.8, hatch=None)
        )
    if shown:
        light = verdict.kind == "unstable"
        axes.text(
            cell.column,
            cell.row,
            inside(verdict),
            ha="center",
            va="center",
            fontsize=7.5,
            color=PAPER if light else INK,
        )


def inside(verdict: Verdict) -> str:
    """What stands in a cell: the error in per cent, or a letter."""
    if verdict.kind == "unstable" or verdict.error is None:
        return LETTER[verdict.kind]
    shown = 100.0 * verdict.error
    if shown < 0.1:
        return "R" if verdict.kind == "recovered" else "0"
    text = f"{shown:.1f}" if shown < 9.95 else f"{shown:.0f}" if shown < 1e3 else ">999"
    return f"{text} R" if verdict.kind == "recovered" else text


def _counted(filled: Filled) -> str:
    count = filled.count()
    counted = ", ".join(f"{count[kind]} {kind}" for kind in KINDS if count[kind])
    return f"{len(filled.verdicts)} runs: {counted}"


def _per_line(widths: Sequence[float], most: float = 16.0) -> int:
    for n in range(len(widths), 1, -1):
        if sum(sorted(widths)[-n:]) <= most:
            return n
    return 1


def _legend(figure: Figure, height: float, above: float = 0.0) -> None:
    """What the colours mean; above the figure's lower end by that much [inch]."""
    entries = [Patch(facecolor=TONES[kind], label=f"{kind}: {MEANING[kind]}") for kind in KINDS]
    entries.append(Patch(fill=False, edgecolor=SILENT, linewidth=1.5, label="framed: wrong, and it did not say so"))
    figure.legend(
        handles=entries,
        loc="lower left",
        bbox_to_anchor=(0.006, (above + 0.05) / height),
        ncols=3,
        frameon=False,
        fontsize=9.5,
        labelcolor=INK,
        handlelength=1.2,
        columnspacing=2.0,
    )
