"""The chart as a picture: speed along x, error along y, both logarithmic; the best corner is bottom right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from softseam.study.configurations import METHODS
from softseam.study.errors import not_counted
from softseam.study.landmarks import Landmark
from softseam.study.names import Box, Floats, Picture, along, places, together
from softseam.study.palette import ASKED, BAND, RIVAL, TONES
from softseam.study.pareto import worth_naming
from softseam.study.reference import Reference, origin
from softseam.study.table import Row, busy, unrun
from softseam.view import colors
from softseam.view.paper import INK, PAPER, RULE, SOFT, heading, plain, write

WIDTH, HEIGHT = 12.6, 8.2
"""of the picture [inch]"""
ABOVE, BELOW = 152, 180
"""characters in a line of the heading, and of the note below the axes"""
WORST = 1.0
"""error at the chart's upper edge, where runs that are farther off or failed are drawn [1]"""
ROOM = 0.16
"""of the range of speeds, added at the right: there names of the front cover nothing [1]"""


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
    band = _band(axes, reference)
    _front(axes, rows)
    for method in METHODS:
        _marks(axes, [row for row in rows if row.configuration.method == method], TONES[method])
    _landmarks(axes, asked, ASKED, "D")
    _landmarks(axes, rivals, RIVAL, "s")
    _legend(figure, rows, asked, rivals, down)
    figure.draw_without_rendering()
    _label(figure, axes, rows, [*asked, *rivals], band)
    return write(figure, path)


def subtitle(reference: Reference, machine: str, rows: Sequence[Row]) -> str:
    """What the error is the error of, how far the reference is known, and where it was measured."""
    names = ", ".join(colors.label(name) for name in reference.counted)
    worst = "the worst of " if len(reference.counted) > 1 else ""
    text = f"error: {worst}{names}, relative, L2 norm over time, against refined FEM, which {origin(reference)}\n"
    late = unrun(rows)
    ran = f"; {len(rows) - late} of {len(rows)} configurations were run, the others had no time" if late else ""
    text += f"{machine}, one process; compiling and setting up left out{busy(rows)}{ran}"
    return text + (
        "" if reference.complete or reference.bundled else "\nthe budget ended before every quantity was known to 1 %"
    )


def _wrapped(text: str, width: int) -> str:
    """Lines of at most so many characters, those that are there kept apart."""
    return "\n".join(fill(line, width) for line in text.splitlines())


def placed(row: Row) -> tuple[float, float, bool] | None:
    """Where a row is drawn (rtf, error, whether at the edge); None for what was not run to its end, or has no speed.

    A run that was stopped for lack of time has not failed, and may have slowed down later: it is in the table only.
    """
    if row.outcome.status not in ("done", "failed") or row.outcome.rtf <= 0.0:
        return None
    if row.error is None or not row.error.value < WORST:
        return row.outcome.rtf, WORST, True
    return row.outcome.rtf, row.error.value, False


def _limits(axes: Axes, rows: Sequence[Row], marks: Sequence[Landmark], reference: Reference) -> None:
    at = [place[:2] for row in rows if (place := placed(row))] + [(mark.rtf, mark.error) for mark in marks]
    speeds = [x for x, _ in at] or [1.0]
    floor = min([y for _, y in at if y > 0.0] + [reference.uncertainty if reference.uncertainty > 0.0 else 0.01, 0.1])
    least, most = min(speeds) / 1.7, max(speeds) * 2.2
    axes.set_xlim(least, most * (most / least) ** ROOM)
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


def _band(axes: Axes, reference: Reference) -> Text | None:
    """Errors that the reference cannot tell from none; returns what is written there."""
    top = reference.uncertainty
    low, high = axes.get_ylim()
    if not low < top < high:
        return None
    axes.axhspan(low, top, color=BAND, zorder=0, linewidth=0)
    text = "  errors down here cannot be told: the reference is as uncertain"
    return axes.text(axes.get_xlim()[0], top / 1.03, text, fontsize=9, color=SOFT, va="top")


def _line(axes: Axes, rows: Sequence[Row]) -> list[tuple[float, float]]:
    """Corners of the front, from the fastest down; none where there is no front."""
    at = sorted(((row.outcome.rtf, row.error.value) for row in rows if row.front and row.error), reverse=True)
    if not at:
        return []
    speeds, errors = (np.repeat(column, 2) for column in zip(*at, strict=True))
    return [*zip([*speeds, axes.get_xlim()[0]], [axes.get_ylim()[1], *errors], strict=True)]


def _front(axes: Axes, rows: Sequence[Row]) -> None:
    """Everything above and left of the line is beaten by a configuration on it."""
    corners = _line(axes, rows)
    if corners:
        x, y = zip(*corners, strict=True)
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


def _landmarks(axes: Axes, marks: Sequence[Landmark], tone: str, marker: str) -> None:
    look: dict[str, Any] = {"s": 34.0, "facecolors": "none", "edgecolors": tone, "linewidths": 1.3, "zorder": 6}
    for mark in marks:
        off = mark.error >= WORST
        axes.scatter([mark.rtf], [min(mark.error, WORST)], marker="^" if off else marker, clip_on=False, **look)


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
    front = mark("nothing is both faster and more accurate", SOFT, "o")
    front.set(linestyle="-", linewidth=1.1, color=INK, markersize=9, markeredgecolor=INK)
    above.append(front)
    above.append(Line2D([], [], color=SOFT, linewidth=0.9, alpha=0.6, label="slowest to fastest run"))
    below = []
    if asked:
        below.append(mark("targets of this project: a textbook's estimates, not measured", ASKED, "D", hollow=True))
    if rivals:
        below.append(mark("other simulators", RIVAL, "s", hollow=True))
    if any(row.error is not None and row.error.bound and placed(row) for row in rows):
        below.append(mark("error at most this", SOFT, "$\\downarrow$"))
    if any(row.error is None and placed(row) for row in rows):
        below.append(mark("failed, at the speed it had", SOFT, "x"))
    if any((place := placed(row)) and place[2] and row.error is not None for row in rows):
        below.append(mark("off by more than 100 %", SOFT, "^"))
    if any(one.error >= WORST for one in rivals):
        below.append(mark("other simulator, off by more than 100 %", RIVAL, "^", hollow=True))
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


def _label(figure: Figure, axes: Axes, rows: Sequence[Row], marks: Sequence[Landmark], band: Text | None) -> None:
    """Name the front and the marks that were not measured, each where it covers nothing."""
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    pt = 72.0 / figure.dpi

    def seen(artist: Artist) -> Box:
        box = artist.get_window_extent(renderer)
        return box.x0 * pt, box.y0 * pt, box.x1 * pt, box.y1 * pt

    def where(at: Iterable[tuple[float, float]]) -> Floats:
        return np.asarray(axes.transData.transform(np.array([*at]).reshape(-1, 2))) * pt

    wanted = list(_wanted(rows, marks))
    at = where((x, y) for x, y, _, _ in wanted)
    groups = together(at)
    texts = [
        axes.text(0.0, 0.0, "\n".join(wanted[i][2] for i in group), fontsize=8.5, va="bottom", zorder=6, transform=None)
        for group in groups
    ]
    sizes = [(right - left, top - bottom) for left, bottom, right, top in map(seen, texts)]
    named = [((float(at[g[0], 0]), float(at[g[0], 1])), size) for g, size in zip(groups, sizes, strict=True)]
    taken = (seen(band),) if band else ()
    picture = Picture(seen(axes), where(_places(rows, marks)), along(where(_line(axes, rows))), taken)
    found = places(picture, named)
    for group, text, place in zip(groups, texts, found, strict=True):
        if place is None:
            text.remove()
            continue
        text.set(position=(place.box[0] / pt, place.box[1] / pt), color=wanted[group[0]][3])
        if place.line is not None:
            (x0, y0), (x1, y1) = place.line
            ends = [x0 / pt, x1 / pt], [y0 / pt, y1 / pt]
            axes.add_artist(Line2D(*ends, transform=None, color=SOFT, linewidth=0.7, zorder=4.5))


def _wanted(rows: Sequence[Row], marks: Sequence[Landmark]) -> Iterator[tuple[float, float, str, str]]:
    """Where what is to be named is drawn, its name and that's colour: of the front, fastest first, and landmarks."""
    front = [(row, place) for row in rows if row.front and (place := placed(row))]
    front.sort(key=lambda each: -each[1][0])
    for i in worth_naming([place[:2] for _, place in front], _ERRORS):
        row, (x, y, _) = front[i]
        yield x, y, row.configuration.label, INK
    for mark in marks:
        yield mark.rtf, min(mark.error, WORST), mark.label, SOFT


def _places(rows: Sequence[Row], marks: Sequence[Landmark]) -> Iterator[tuple[float, float]]:
    for row in rows:
        place = placed(row)
        if place is not None:
            yield place[0], place[1]
    for mark in marks:
        yield mark.rtf, min(mark.error, WORST)
