"""Maps as pictures: a square a run, coloured by what became of it, its error inside."""

import textwrap
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch, Rectangle

from softseam.view.paper import INK, PAPER, SOFT, heading, write
from softseam_studies.atlas.atlas import NOT_COMPUTED, Filled
from softseam_studies.atlas.grid import Cell
from softseam_studies.atlas.verdicts import KINDS, MEANING, Kind, Verdict

TONES: dict[Kind, str] = {
    "accurate": "#3fb383",
    "recovered": "#a9d8b8",
    "inaccurate": "#f2b84b",
    "unstable": "#d0503f",
    "refused": "#c9ccd2",
}
LETTER: dict[Kind, str] = {"accurate": "", "recovered": "R", "inaccurate": "", "unstable": "U", "refused": "-"}
"""drawn in a cell that has no error to show"""
SILENT = "#23262d"


CELL_WIDTH, CELL_HEIGHT = 0.52, 0.36
"""of a run [inch]"""
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
    across = min(len(of.panels), 2 if len(of.panels) == 4 else 3)
    lines = [of.panels[i : i + across] for i in range(0, len(of.panels), across)]
    wide = max(sum(len(panel.columns) + 3 for panel in line) for line in lines)
    heights = [max(len(panel.rows) for panel in line) + 4 for line in lines]
    text = "\n".join([*textwrap.wrap(of.text, 150), f"{_counted(filled)}; {machine}"])
    marks = "; ".join(f"{mark} = {meaning}" for mark, meaning in MARKS.items() if mark)
    rows = sum(heights) + 6.0 + 0.5 * text.count("\n")
    figure = Figure((max(12.6, CELL_WIDTH * wide), CELL_HEIGHT * rows), dpi=130, facecolor=PAPER)
    heading(figure, of.title, text)
    below = _legend(figure, f"In the cells: {marks}.")
    space = (0.0, below, 1.0, sum(heights) / rows)
    figure.set_layout_engine(ConstrainedLayoutEngine(rect=space, w_pad=0.15, h_pad=0.1))
    parts = figure.subfigures(len(lines), 1, squeeze=False, height_ratios=heights)
    number = count()
    for part, line in zip(parts.ravel(), lines, strict=True):
        part.set_facecolor(PAPER)
        for axes in part.subplots(1, len(line), squeeze=False, width_ratios=[len(p.columns) for p in line]).ravel():
            draw_panel(axes, filled, next(number), shown=True)
            axes.set_aspect(CELL_HEIGHT / CELL_WIDTH)
    return write(figure, path)


def draw_overview(path: Path, maps: Sequence[Filled], machine: str) -> Path:
    """Write all maps small, without words in the cells; those that were not computed say so."""
    across = 3
    n_lines = -(-len(maps) // across)
    width, height = 15.0, 2.0 + 3.75 * n_lines
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
    _legend(figure)
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


def _legend(figure: Figure, words: str = "") -> float:
    """What the colours mean, and words below, at the lower end; how much of the figure that takes [1]."""
    entries = [Patch(facecolor=TONES[kind], label=f"{kind}: {MEANING[kind]}") for kind in KINDS]
    entries.append(Patch(fill=False, edgecolor=SILENT, linewidth=1.5, label="framed: wrong, and it did not say so"))
    line = 0.12 / figure.get_figheight()
    figure.text(0.014, line, words, fontsize=9, color=SOFT)
    below = 3.0 * line if words else 0.5 * line
    legend = figure.legend(
        handles=entries,
        loc="lower left",
        bbox_to_anchor=(0.006, below),
        ncols=3,
        frameon=False,
        fontsize=9.5,
        labelcolor=INK,
        handlelength=1.2,
        columnspacing=2.0,
    )
    legend.set_in_layout(False)
    return below + 4.0 * line
