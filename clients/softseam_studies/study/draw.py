"""The chart as a picture: speed along x, error along y, both logarithmic; the best corner is bottom right.

Marks of the front have numbers and others' marks have letters, which a list beside the axes explains.
"""

import math
from collections.abc import Iterator, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from softseam.view import colors
from softseam.view.paper import INK, PAPER, RULE, SOFT, heading, plain
from softseam_studies.study.configurations import METHODS, Method
from softseam_studies.study.errors import not_counted
from softseam_studies.study.landmarks import Landmark
from softseam_studies.study.reference import Reference, origin
from softseam_studies.study.table import Row, busy, unrun

TONES: dict[Method, str] = {
    "FEM": "#e8794a",
    "FEM, other elements": "#b98bd0",
    "XPBD": "#5f8cc4",
    "PBD": "#c9a227",
    "hybrid": "#3fb383",
    "as it is": "#23262d",
}
"""the first, third and fourth as replays paint FEM, PBD and the seam"""
MARKERS: dict[Method, str] = {"PBD": "P", "as it is": "*"}
"""of methods that have no circle: what is only a control, and what nobody chose"""
ASKED, RIVAL, BAND = "#a2a7b0", "#7a5c3e", "#f3f4f1"
WIDTH, HEIGHT = 14.6, 8.2
"""of the picture [inch]"""
ABOVE, BELOW = 176, 205
"""characters in a line of the heading, and of the note below the axes"""
WORST = 1.0
"""error at the chart's upper edge, where runs that are farther off or failed are drawn [1]"""
LEAST = 1e-5
"""smaller errors are drawn as this one [1]"""
NEAR = 0.05
"""marks that are closer to one with a number have none in the picture, but in the list [decades]"""


def draw_chart(
    title: str,
    machine: str,
    rows: Sequence[Row],
    reference: Reference,
    asked: Sequence[Landmark],
    rivals: Sequence[Landmark],
) -> Figure:
    """The picture, in which the group of a run's mark is called run-KEY."""
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=150, facecolor=PAPER)
    below_title = _wrapped(subtitle(reference, machine, rows), ABOVE)
    heading(figure, f"Accuracy against speed: {title}", below_title)
    below = _wrapped("\n".join(_notes(rows, reference)), BELOW)
    figure.text(0.06, 0.012, below, fontsize=8.5, color=SOFT, ha="left", va="bottom")
    # lines of text move the axes
    down, up = 0.21 * max(0, below_title.count("\n") - 1), 0.15 * below.count("\n")
    axes = figure.subplots()
    figure.subplots_adjust(left=0.06, right=0.66, top=1.0 - (1.72 + down) / HEIGHT, bottom=(0.80 + up) / HEIGHT)
    plain(axes, "")
    axes.set_xscale("log")
    axes.set_yscale("log")
    _scales(axes, [*_places(rows, [*asked, *rivals])], reference)
    front = sorted((row for row in rows if row.front and row.error), key=lambda row: -row.outcome.rtf)
    _front(axes, front)
    for row in rows:
        _mark(axes, row)
    _landmarks(axes, asked, ASKED, "D")
    _landmarks(axes, rivals, RIVAL, "s")
    _names(figure, axes, front, [*asked, *rivals])
    handles = [*_handles(rows, asked, rivals)]
    many = sum(str(each.get_label()) in METHODS for each in handles) + 2
    for line, shown in enumerate((handles[:many], handles[many:])):
        at = (0.006, 1.0 - (1.04 + 0.25 * line + down) / HEIGHT)
        look: dict[str, Any] = {"frameon": False, "fontsize": 9.5, "labelcolor": INK, "handletextpad": 0.3}
        figure.legend(handles=shown, loc="upper left", bbox_to_anchor=at, ncols=max(1, len(shown)), **look)
    return figure


def subtitle(reference: Reference, machine: str, rows: Sequence[Row]) -> str:
    """What the error is the error of, how far the reference is known, and where it was measured."""
    names = ", ".join(colors.label(name) for name in reference.counted)
    worst = "the worst of " if len(reference.counted) > 1 else ""
    text = f"error: {worst}{names}, relative, L2 norm over time, against refined FEM, which {origin(reference)}\n"
    late = unrun(rows)
    ran = f"; {len(rows) - late} of {len(rows)} configurations were run, the others had no time" if late else ""
    text += f"{machine}; compiling and setting up left out{busy(rows)}{ran}"
    return text + (
        "" if reference.complete or reference.bundled else "\nthe budget ended before every quantity was known to 1 %"
    )


def _notes(rows: Sequence[Row], reference: Reference) -> Iterator[str]:
    """What stands below the axes."""
    if any(row.configuration.method == "PBD" and placed(row) for row in rows):
        yield "PBD: the classic one, a control without Young's modulus: its stiffness follows from step and iterations"
    if left_out := not_counted(reference.truth):
        yield f"not counted: {left_out}"


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
    return row.outcome.rtf, max(row.error.value, LEAST), False


def _places(rows: Sequence[Row], marks: Sequence[Landmark]) -> Iterator[tuple[float, float]]:
    yield from (place[:2] for row in rows if (place := placed(row)))
    yield from ((mark.rtf, min(mark.error, WORST)) for mark in marks)


def _scales(axes: Axes, at: Sequence[tuple[float, float]], reference: Reference) -> None:
    """Both axes in words: 0.1x .. 100x real time, errors in per cent, accuracies at the right; and the errors that the
    reference does not distinguish from none."""
    speeds, known = [x for x, _ in at] or [1.0], reference.uncertainty
    low = min([y for _, y in at if y > 0.0] + [known if known > 0.0 else 0.01, 0.1]) / 1.9
    axes.set_xlim(min(speeds) / 1.7, 2.2 * max(speeds))
    axes.set_ylim(low, WORST * 1.12)
    axes.set_xlabel("real-time factor: simulated / wall seconds    (faster: right)", fontsize=10.5, color=SOFT)
    axes.set_ylabel("error [%]    (more accurate: down)", fontsize=10.5, color=SOFT)
    ticks = [s * 10.0**p for p in range(-4, 6) for s in (1, 3)]
    ticks = [each for each in ticks if axes.get_xlim()[0] <= each <= axes.get_xlim()[1]]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}x"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(axis="x", color=RULE, linewidth=0.6)
    right = axes.secondary_yaxis("right")
    right.set_ylabel("accuracy [%]", fontsize=10.5, color=SOFT)
    right.tick_params(colors=SOFT, labelsize=9, length=0)
    right.spines["right"].set_visible(False)
    ticks = [float(f"{digit}e{power}") for power in range(-4, 1) for digit in (1, 2, 5)]
    for axis, less in ((axes.yaxis, 0.0), (right.yaxis, 100.0)):
        axis.set_major_locator(FixedLocator([each for each in ticks if low <= each <= WORST]))
        axis.set_major_formatter(FuncFormatter(lambda value, _, less=less: f"{abs(less - 100 * value):g}"))
        axis.set_minor_locator(NullLocator())
    if low < known < WORST:
        axes.axhspan(low, known, color=BAND, zorder=0, linewidth=0)
        text = "  errors down here are not known: the reference is as uncertain"
        axes.text(axes.get_xlim()[0], known / 1.03, text, fontsize=9, color=SOFT, va="top")


def _front(axes: Axes, front: Sequence[Row]) -> None:
    """Everything above and left of the line is beaten by a configuration on it."""
    at = [*_places(front, ())]
    if at:
        speeds, errors = (np.repeat(column, 2) for column in zip(*at, strict=True))
        x, y = [*speeds, axes.get_xlim()[0]], [axes.get_ylim()[1], *errors]
        axes.plot(x, y, color=INK, linewidth=1.1, zorder=2, alpha=0.75, solid_joinstyle="miter")


def _mark(axes: Axes, row: Row) -> None:
    place = placed(row)
    if place is None:
        return
    (x, y, edge), tone, failed = place, TONES[row.configuration.method], row.error is None
    marker = "x" if failed else "^" if edge else MARKERS.get(row.configuration.method, "o")
    look: dict[str, Any] = {"color": tone} if failed else {"color": tone, "edgecolors": INK if row.front else PAPER}
    low, high = row.outcome.spread
    axes.plot([low, high], [y, y], color=tone, linewidth=0.9, alpha=0.3, zorder=1)
    if row.error is not None and row.error.bound:
        arrow = {"arrowstyle": "-|>", "color": tone, "linewidth": 1.0}
        axes.annotate("", (x, y / 1.16), (x, y), arrowprops=arrow, zorder=3)
    size = (2.0 if marker == "*" else 1.0) * (110.0 if row.front else 44.0)
    wide, above = (1.0, 5) if row.front else (0.6, 4)
    look |= {"s": size, "marker": marker, "linewidths": wide, "zorder": above}
    axes.scatter([x], [y], clip_on=False, gid=f"run-{row.configuration.key}", **look)


def _landmarks(axes: Axes, marks: Sequence[Landmark], tone: str, marker: str) -> None:
    look: dict[str, Any] = {"s": 34.0, "facecolors": "none", "edgecolors": tone, "linewidths": 1.3, "zorder": 6}
    for mark in marks:
        off = mark.error >= WORST
        axes.scatter([mark.rtf], [min(mark.error, WORST)], marker="^" if off else marker, clip_on=False, **look)


def _names(figure: Figure, axes: Axes, front: Sequence[Row], marks: Sequence[Landmark]) -> None:
    """Numbers in the front's marks and letters beside others', and what they are, in a list."""
    lines, numbered = ["nothing is both faster and more accurate than"], list[tuple[float, float]]()
    for number, row in enumerate(front, 1):
        (place,) = [*_places([row], ())]
        sign = "<= " if row.error and row.error.bound else ""
        lines.append(f"{number:>2}  {row.configuration.label}:  {place[0]:.3g}x, {sign}{100 * place[1]:.2g} %")
        if all(math.dist(np.log10(place), np.log10(other)) > NEAR for other in numbered):
            numbered.append(place)
            axes.text(*place, str(number), fontsize=7, color=PAPER, weight="bold", ha="center", va="center", zorder=7)
    lines += [""] if marks else []
    for letter, mark in zip("abcdefghijklmnopqrstuvwxyz", marks, strict=False):
        at = (mark.rtf, min(mark.error, WORST))
        axes.annotate(letter, at, (5, 4), textcoords="offset points", fontsize=8, color=SOFT)
        lines.append(f" {letter}  {mark.label}:  {mark.rtf:.3g}x, {100 * mark.error:.3g} %")
    text = "\n".join(fill(line, 58, subsequent_indent="      ") for line in lines)
    figure.text(0.715, axes.get_position().y1, text, fontsize=8.5, color=INK, va="top", linespacing=1.35)


def _handles(rows: Sequence[Row], asked: Sequence[Landmark], rivals: Sequence[Landmark]) -> Iterator[Line2D]:
    """What the legend explains: what is drawn."""

    def mark(text: str, tone: str, marker: str, face: str | None = None, **more: Any) -> Line2D:
        look: dict[str, Any] = {"linestyle": "none", "markersize": 7, "markerfacecolor": face or tone} | more
        return Line2D([], [], color=tone, marker=marker, label=text, **look)

    drawn = [(row, place) for row in rows if (place := placed(row))]
    for method in METHODS:
        if any(row.configuration.method == method for row, _ in drawn):
            yield mark(method, TONES[method], MARKERS.get(method, "o"))
    line = {"linestyle": "-", "linewidth": 1.1, "markeredgecolor": INK, "markersize": 9}
    yield mark("nothing is both faster and more accurate", INK, "o", SOFT, **line)
    yield Line2D([], [], color=SOFT, linewidth=0.9, alpha=0.6, label="slowest to fastest run")
    if asked:
        yield mark("targets of this project: a textbook's estimates, not measured", ASKED, "D", "none")
    if rivals:
        yield mark("other simulators", RIVAL, "s", "none")
    if any(row.error is not None and row.error.bound for row, _ in drawn):
        yield mark("error at most this", SOFT, "$\\downarrow$")
    if any(row.error is None for row, _ in drawn):
        yield mark("failed, at the speed it had", SOFT, "x")
    if any(place[2] and row.error is not None for row, place in drawn):
        yield mark("off by more than 100 %", SOFT, "^")
    if any(one.error >= WORST for one in rivals):
        yield mark("other simulator, off by more than 100 %", RIVAL, "^", "none")
