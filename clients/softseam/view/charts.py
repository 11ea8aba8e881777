"""Curves of a run, and where its wall time went."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from softseam.columns import Columns, shown_unit, spent
from softseam.recording import Recording
from softseam.report import ReportBuilder
from softseam.verdict import lifters, tool_rise
from softseam.view import colors
from softseam.view.paper import INK, PAPER, RULE, SOFT, heading, plain, write

Floats = NDArray[np.float64]

_STILL = 1e-6
"""way of tools that is none [m]"""
_TIME = "simulated time [s]"


def draw_curves(recording: Recording, builder: ReportBuilder, path: Path) -> Path:
    """The quantities, then the seam's and the ledger's account of how far to trust them."""
    columns = builder.columns
    time = columns["time"]
    quantities = columns.drawn(drawn_quantities(recording.scene.asked, columns))
    coupled = bool(((columns["seam_nodes"] > 0.0) & (columns["exchanges"] > 0.0)).any())  # not within a solver alone
    n_plots = len(quantities) + (2 if coupled else 0) + 1
    rows = -(-n_plots // 3)
    figure = Figure(figsize=(12.6, 1.25 + 2.55 * rows), dpi=150, facecolor=PAPER)
    heading(figure, recording.scene.name.replace("_", " "), builder.verdict.text)
    grid = figure.subplots(rows, 3, squeeze=False)
    tall = figure.get_figheight()
    figure.subplots_adjust(left=0.055, right=0.985, top=1.0 - 1.3 / tall, bottom=0.55 / tall, wspace=0.2, hspace=0.42)
    every = list(grid.ravel())
    for axes in every[n_plots:]:
        axes.set_axis_off()
    for i, (title, names) in enumerate(quantities.items()):
        unit, factor = shown_unit(names[0])
        plain(every[i], f"{colors.label(title)} [{unit}]")
        for number, name in enumerate(names):
            values = columns[f"quantity.{name}"]
            seen = np.isfinite(values)  # some are measured in some steps only
            every[i].plot(time[seen], values[seen] * factor, color=_tone(number), linewidth=1.8)
        if title == "lift_height":
            draw_tool_rise(every[i], recording, columns)
    at = len(quantities)
    if coupled:
        _gap(every[at], columns)
        _exchanges(every[at + 1], columns)
    _energy(every[n_plots - 1], columns)
    for axes in every[:n_plots]:
        _phases(axes, columns)
        axes.set_xlim(time[0] - 0.015 * np.ptp(time), time[-1] + 0.015 * np.ptp(time))
        hatch_holes(axes, recording)
    for axes in every[max(0, n_plots - 3) : n_plots]:
        axes.set_xlabel(_TIME, fontsize=9.5, color=SOFT)
    return write(figure, path)


def drawn_quantities(asked: Sequence[str], columns: Columns) -> list[str]:
    """What was measured of what the scene asks for; where it asks for nothing, all that was not 0 throughout."""
    found = {name: columns[f"quantity.{name}"] for name in asked or columns.names("quantity.")}
    return [name for name, values in found.items() if (np.isfinite(values) if asked else np.nan_to_num(values)).any()]


def draw_time(recording: Recording, builder: ReportBuilder, path: Path) -> Path:
    """Wall time by part, and step by step beside the regions' sizes."""
    columns = builder.columns
    time, total = columns["time"], columns["seconds.total"]
    wall = builder.build()["wall"]
    figure = Figure(figsize=(12.6, 4.6), dpi=150, facecolor=PAPER)
    rtf = f"real-time factor {wall['rtf']:.3g}" if wall["rtf"] else "real-time factor not known"
    each = 1e3 * wall["total"] / max(len(columns), 1)
    text = f"{rtf}: {each:.2f} ms a step for {1e3 * recording.scene.step:g} ms of motion"
    heading(figure, "Where the time went", text)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.25, 1.0])
    figure.subplots_adjust(left=0.075, right=0.985, top=0.70, bottom=0.13, wspace=0.22)
    parts = [(name, wall[name]) for name in reversed(spent()) if wall[name] > 0.0]
    plain(left, "part of the wall time [%]; parts may overlap")
    shares = [100.0 * seconds / wall["total"] if wall["total"] else 0.0 for _, seconds in parts]
    tones = {name: i for i, name in enumerate(spent())}
    left.barh([name for name, _ in parts], shares, color=[_tone(tones[name]) for name, _ in parts], height=0.62)
    left.grid(axis="y", visible=False)
    left.grid(axis="x", color=RULE, linewidth=0.8)
    left.set_xlim(0.0, max([*shares, 1.0]) * 1.18)
    for row, share in enumerate(shares):
        left.text(share, row, f" {share:.0f}", va="center", fontsize=9, color=INK)
    plain(middle, "wall time of a step [ms]", _TIME)
    middle.plot(time, 1e3 * total, color="#c3c7ce", linewidth=0.8)
    middle.plot(time, 1e3 * _running_median(total), color=INK, linewidth=1.6)
    middle.set_ylim(0.0, 1e3 * max(float(np.quantile(total, 0.99)), 1e-9) * 1.35)
    _phases(middle, columns)
    hatch_holes(middle, recording)
    hatch_holes(right, recording)
    plain(right, "cells in each part", _TIME)
    for label, (tone, names) in colors.grouped(columns.models).items():
        cells = np.sum([np.nan_to_num(columns[f"{name}.cells"]) for name in names], axis=0)
        right.step(time, cells, where="post", color=_shade(tone), linewidth=1.8, label=label)
    right.set_ylim(bottom=0.0)
    right.legend(frameon=False, fontsize=9, labelcolor=INK)
    return write(figure, path)


def draw_tool_rise(axes: Axes, recording: Recording, columns: Columns) -> None:
    """How far the middle of the tools that lift has risen, as the verdict has it, to compare: from its lowest place."""
    names = lifters(recording.scene)
    rise = tool_rise(names, columns) if names else np.zeros(1)
    if rise.max() > 0.0:
        up = slice(int(np.argmax(rise <= _STILL)), None)
        axes.plot(columns["time"][up], 1e3 * rise[up], color=SOFT, linewidth=1.1, linestyle=(0, (4, 3)), label="tools")
        axes.legend(frameon=False, fontsize=9, loc="upper left", labelcolor=INK)


def _gap(axes: Axes, columns: Columns) -> None:
    plain(axes, "seam gap at commit [µm]")
    gap = np.where(columns["gap"] > 0.0, 1e6 * columns["gap"], np.nan)
    if np.isfinite(gap).any():
        axes.semilogy(columns["time"], gap, color=_tone(2), linewidth=1.2)
        axes.tick_params(axis="y", which="both", length=0, colors=SOFT, labelsize=9)


def _exchanges(axes: Axes, columns: Columns) -> None:
    counts = columns["exchanges"]
    plain(axes, f"exchanges a step; mean {np.nanmean(counts):.2f}")
    axes.plot(columns["time"], counts, linestyle="none", marker=".", markersize=3.5, color=_tone(2))
    axes.set_ylim(0.0, max(4.0, float(np.nanmax(counts))) + 0.5)


def _energy(axes: Axes, columns: Columns) -> None:
    plain(axes, "energy [mJ]; work and loss summed")
    for i, name in enumerate(("strain", "kinetic", "tool_work", "dissipation", "contact_loss", "material")):
        if name not in columns.names("energy."):  # where nothing dissipates, and in recordings from before it was known
            continue
        values = 1e3 * np.nan_to_num(columns[f"energy.{name}"])
        shown = np.cumsum(values) if i >= 2 else values
        label = "lost in the material" if name == "material" else name.replace("_", " ")
        axes.plot(columns["time"], shown, color=_tone(i), linewidth=1.6, label=label)
    axes.legend(frameon=False, fontsize=8.5, loc="upper left", labelcolor=INK, ncols=2)


def _phases(axes: Axes, columns: Columns) -> None:
    """Every other phase of the motion on a faint ground."""
    time, phase = columns["time"], columns["phase"]
    borders = [time[0], *time[1:][np.diff(phase) != 0.0], time[-1]]
    for i in range(1, len(borders) - 1, 2):
        axes.axvspan(borders[i], borders[i + 1], color="#f5f5f3", zorder=0, linewidth=0)


def hatch_holes(axes: Axes, recording: Recording) -> None:
    """Hatched, as curves go straight from one side to the other."""
    for hole in recording.holes:
        if hole.end is not None and hole.steps:
            axes.axvspan(hole.start, hole.end, fill=False, hatch="////", edgecolor=RULE, zorder=0.5)
            axes.set_xlim(left=min(hole.start, axes.get_xlim()[0]))  # of a run whose beginning is missing


def _running_median(values: Floats, reach: int = 7) -> Floats:
    padded = np.pad(values, reach, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1))


def _tone(index: int) -> tuple[float, float, float]:
    return _shade(colors.SERIES[index % len(colors.SERIES)])


def _shade(tone: colors.Tone) -> tuple[float, float, float]:
    red, green, blue = tone
    return red / 255.0, green / 255.0, blue / 255.0
