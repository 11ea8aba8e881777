"""The chart as a picture: speed along x, error along y, both logarithmic; the best corner is bottom right."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import Bbox

from softseam.chart.configurations import METHODS
from softseam.chart.errors import not_counted
from softseam.chart.landmarks import Landmark
from softseam.chart.palette import ASKED, BAND, RIVAL, TONES
from softseam.chart.reference import Reference, origin
from softseam.chart.table import Row, busy
from softseam.view import colors
from softseam.view.paper import INK, PAPER, RULE, SOFT, heading, plain, write

WIDTH, HEIGHT = 12.6, 8.2
"""of the picture [inch]"""
ABOVE, BELOW = 152, 180
"""characters in a line of the heading, and of the note below the axes"""
WORST = 1.0
"""error at the chart's upper edge, where runs that are farther off or failed are drawn [1]"""


def draw_chart(
    path: Path,
    title: str,
    machine: str,
    rows: Sequence[Row],
    reference: Reference,
    asked: Sequence[Landmark],
    rivals: Sequence[Landmark],
) -> Path:
    """Write the picture; returns its path."""
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=150, facecolor=PAPER)
    told = _wrapped(subtitle(reference, machine, rows), ABOVE)
    heading(figure, f"Accuracy against speed: {title}", told)
    below = _wrapped(f"not counted: {left_out}" if (left_out := not_counted(reference.truth)) else "", BELOW)
    figure.text(0.93, 0.012, below, fontsize=8.5, color=SOFT, ha="right", va="bottom", multialignment="left")
    # lines of text move the axes
    down, up = 0.21 * max(0, told.count("\n") - 1), 0.15 * below.count("\n")
    axes = figure.subplots()
    figure.subplots_adjust(left=0.068, right=0.93, top=1.0 - (1.72 + down) / HEIGHT, bottom=(0.80 + up) / HEIGHT)
    plain(axes, "")
    axes.set_xscale("log")
    axes.set_yscale("log")
    _limits(axes, rows, [*asked, *rivals], reference)
    _scales(axes)
    _band(axes, reference)
    _front(axes, rows)
    for method in METHODS:
        _marks(axes, [row for row in rows if row.configuration.method == method], TONES[method])
    _landmarks(axes, asked, ASKED, "D", 34.0)
    _landmarks(axes, rivals, RIVAL, "s", 34.0)
    _legend(figure, rows, asked, rivals, down)
    figure.draw_without_rendering()
    _label(figure, axes, rows, [*asked, *rivals], reference)
    return write(figure, path)


def subtitle(reference: Reference, machine: str, rows: Sequence[Row]) -> str:
    """What the error is the error of, how far the reference is known, and where it was measured."""
    names = ", ".join(colors.label(name) for name in reference.counted)
    worst = "the worst of " if len(reference.counted) > 1 else ""
    text = f"error: {worst}{names}, in L2 over time, against refined FEM, which {origin(reference)}\n"
    text += f"{machine}, one process; compiling and setting up left out{busy(rows)}"
    return text + (
        "" if reference.complete or reference.shipped else "\nthe budget ended before every quantity was known to 1 %"
    )


def _wrapped(text: str, width: int) -> str:
    """Lines of at most so many characters, those that are there kept apart."""
    return "\n".join(fill(line, width) for line in text.splitlines())


def placed(row: Row) -> tuple[float, float, bool] | None:
    """Where a row is drawn (rtf, error, whether at the edge); None for what was not run, or has no speed."""
    if row.outcome.status in ("left out", "refused") or row.outcome.rtf <= 0.0:
        return None
    if row.error is None or not row.error.value < WORST:
        return row.outcome.rtf, WORST, True
    return row.outcome.rtf, row.error.value, False


def _limits(axes: Axes, rows: Sequence[Row], marks: Sequence[Landmark], reference: Reference) -> None:
    at = [place[:2] for row in rows if (place := placed(row))] + [(mark.rtf, mark.error) for mark in marks]
    speeds = [x for x, _ in at] or [1.0]
    floor = min([y for _, y in at if y > 0.0] + [reference.uncertainty if reference.uncertainty > 0.0 else 0.01, 0.1])
    axes.set_xlim(min(speeds) / 1.7, max(speeds) * 2.2)
    axes.set_ylim(floor / 1.9, WORST * 1.12)


def _scales(axes: Axes) -> None:
    """Both axes in words: 0.1x .. 100x real time, errors in per cent, accuracies at the right."""
    axes.set_xlabel("real-time factor: simulated / wall seconds    (faster: right)", fontsize=10.5, color=SOFT)
    axes.set_ylabel("error [%]    (more accurate: down)", fontsize=10.5, color=SOFT)
    low, high = axes.get_xlim()
    ticks = [s * 10.0**p for p in range(-4, 6) for s in (1, 3) if low <= s * 10.0**p <= high]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}x"))
    axes.xaxis.set_minor_locator(NullLocator())
    errors = [e for e in _ERRORS if axes.get_ylim()[0] <= e <= axes.get_ylim()[1]]
    axes.yaxis.set_major_locator(FixedLocator(errors))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(axis="x", color=RULE, linewidth=0.6)
    right = axes.secondary_yaxis("right")
    right.yaxis.set_major_locator(FixedLocator(errors))
    right.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * (1 - value):g}"))
    right.yaxis.set_minor_locator(NullLocator())
    right.set_ylabel("accuracy [%]", fontsize=10.5, color=SOFT)
    right.tick_params(colors=SOFT, labelsize=9, length=0)
    right.spines["right"].set_visible(False)


_ERRORS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


def _band(axes: Axes, reference: Reference) -> None:
    """Errors that the reference cannot tell from none."""
    top = reference.uncertainty
    low, high = axes.get_ylim()
    if low < top < high:
        axes.axhspan(low, top, color=BAND, zorder=0, linewidth=0)
        text = "  below: as good as the reference is known"
        axes.text(axes.get_xlim()[0], top / 1.03, text, fontsize=9, color=SOFT, va="top")


def _front(axes: Axes, rows: Sequence[Row]) -> None:
    """Everything above and left of the line is beaten by a configuration on it."""
    at = sorted((row.outcome.rtf, row.error.value) for row in rows if row.front and row.error is not None)
    if not at:
        return
    speeds, errors = (np.array(column) for column in zip(*at, strict=True))
    x = [axes.get_xlim()[0], *np.repeat(speeds, 2)]
    y = [*np.repeat(errors, 2), axes.get_ylim()[1]]
    axes.plot(x, y, color=INK, linewidth=1.1, zorder=2, alpha=0.75, solid_joinstyle="miter")


def _marks(axes: Axes, rows: Sequence[Row], tone: str) -> None:
    for row in rows:
        place = placed(row)
        if place is None:
            continue
        x, y, edge = place
        failed = row.error is None
        marker = "x" if failed else "^" if edge else "*" if row.configuration.method == "as it is" else "o"
        size = (95.0 if marker == "*" else 44.0) * (1.5 if row.front else 1.0)
        low, high = row.outcome.spread
        axes.plot([low, high], [y, y], color=tone, linewidth=0.9, alpha=0.3, zorder=1)
        if row.error is not None and row.error.bound:
            axes.annotate(
                "", (x, y / 1.16), (x, y), arrowprops={"arrowstyle": "-|>", "color": tone, "linewidth": 1.0}, zorder=3
            )
        zorder = 5 if row.front else 4
        if failed:
            axes.scatter([x], [y], s=size, marker=marker, color=tone, zorder=zorder, clip_on=False)
        else:
            edge_tone, wide = (INK, 1.0) if row.front else (PAPER, 0.6)
            axes.scatter(
                [x],
                [y],
                s=size,
                marker=marker,
                color=tone,
                edgecolors=edge_tone,
                linewidths=wide,
                zorder=zorder,
                clip_on=False,
            )


def _landmarks(axes: Axes, marks: Sequence[Landmark], tone: str, marker: str, size: float) -> None:
    for mark in marks:
        y = min(mark.error, WORST)
        axes.scatter(
            [mark.rtf], [y], s=size, marker=marker, facecolors="none", edgecolors=tone, linewidths=1.3, zorder=3
        )


def _legend(
    figure: Figure, rows: Sequence[Row], asked: Sequence[Landmark], rivals: Sequence[Landmark], lower: float
) -> None:
    """Below the heading, `lower` by so much [inch]."""

    def mark(text: str, tone: str, marker: str, hollow: bool = False) -> Line2D:
        face = "none" if hollow else tone
        return Line2D(
            [], [], color=tone, marker=marker, linestyle="none", markersize=7, markerfacecolor=face, label=text
        )

    present = [m for m in METHODS if any(row.configuration.method == m and placed(row) for row in rows)]
    above = [mark(m, TONES[m], "*" if m == "as it is" else "o") for m in present]
    below = [Line2D([], [], color=INK, linewidth=1.1, label="nothing is both faster and more accurate")]
    if asked:
        below.append(mark("asked for, not measured", ASKED, "D", hollow=True))
    if rivals:
        below.append(mark("other simulators", RIVAL, "s", hollow=True))
    if any(row.error is not None and row.error.bound and placed(row) for row in rows):
        below.append(mark("error at most this", SOFT, "$\\downarrow$"))
    if any(row.error is None and placed(row) for row in rows):
        below.append(mark("failed, at the speed it had", SOFT, "x"))
    if any((place := placed(row)) and place[2] and row.error is not None for row in rows):
        below.append(mark("off by more than 100 %", SOFT, "^"))
    for entries, down in ((above, 1.04 + lower), (below, 1.29 + lower)):
        figure.legend(
            handles=entries,
            loc="upper left",
            bbox_to_anchor=(0.006, 1.0 - down / HEIGHT),
            ncols=len(entries),
            frameon=False,
            fontsize=9.5,
            labelcolor=INK,
            handletextpad=0.3,
            columnspacing=1.5,
        )


def _label(figure: Figure, axes: Axes, rows: Sequence[Row], marks: Sequence[Landmark], reference: Reference) -> None:
    """Name the front and the marks that were not measured, each where it covers nothing."""
    taken: list[Bbox] = []
    for x, y in _places(rows, marks):
        at = axes.transData.transform((x, y))
        taken.append(Bbox.from_bounds(at[0] - 7.0, at[1] - 7.0, 14.0, 14.0))
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    frame = axes.get_window_extent(renderer)
    wanted = [
        (row.outcome.rtf, row.error.value, row.configuration.label, INK) for row in rows if row.front and row.error
    ]
    wanted += [(mark.rtf, min(mark.error, WORST), mark.label, SOFT) for mark in marks]
    for x, y, label, tone in wanted:
        for dx, dy, across, along in _OFFSETS:
            text = axes.annotate(
                label,
                (x, y),
                (dx, dy),
                textcoords="offset points",
                fontsize=8.5,
                color=tone,
                ha=across,
                va=along,
                zorder=6,
            )
            box = text.get_window_extent(renderer)
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1 + 2.0
            if inside and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
            text.remove()


_OFFSETS = (
    (8, -1, "left", "center"),
    (6, -8, "left", "top"),
    (6, 7, "left", "bottom"),
    (-8, -1, "right", "center"),
    (-6, -8, "right", "top"),
    (-6, 7, "right", "bottom"),
    (0, -10, "center", "top"),
    (0, 10, "center", "bottom"),
    (12, -18, "left", "top"),
    (-12, -18, "right", "top"),
)
"""where a label may stand beside its mark [pt], best first"""


def _places(rows: Sequence[Row], marks: Sequence[Landmark]) -> Iterator[tuple[float, float]]:
    for row in rows:
        place = placed(row)
        if place is not None:
            yield place[0], place[1]
    for mark in marks:
        yield mark.rtf, min(mark.error, WORST)
