"""The curves of a replay, logged as whole columns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from softseam.columns import Columns, shown_unit, spent
from softseam.replay import paths
from softseam.view import colors
from softseam_protocol.messages.names import local
from softseam_protocol.quantities import quantity
from softseam_protocol.scene.scene import Scene

_TABS = {"grip": "Grip", "shape": "Shape", "error": "Error"}


@dataclass
class Plot:
    """One set of axes: a title with the unit, and the entities drawn in it."""

    title: str
    origin: str
    logarithmic: bool = False
    names: list[str] = field(default_factory=list)


def log_curves(stream: rr.RecordingStream, columns: Columns, scene: Scene) -> dict[str, list[Plot]]:
    """Log all curves; returns the plots by tab."""
    writer = _Writer(stream, columns)
    tabs: dict[str, list[Plot]] = {"Grip": [], "Shape": [], "Error": []}
    for title, names in columns.drawn(columns.names("quantity.")).items():
        unit, factor = shown_unit(names[0])
        plot = writer.plot(f"{colors.label(title)} [{unit}]", f"quantities/{title}")
        tab = tabs[_TABS[quantity(names[0]).group]]
        for i, name in enumerate(names):
            writer.curve(plot, name.replace("_", " "), columns[f"quantity.{name}"] * factor, len(tab) + i)
        tab.append(plot)
    tabs["Seam"] = _seam(writer, columns)
    spent = tuple(
        name
        for name in ("tool_work", "dissipation", "seam_work", "switch", "drive_work", "contact_loss")
        if name in columns.names("energy.")
    )
    tabs["Energy"] = [
        _energy(writer, columns, ("kinetic", "strain"), "stored energy [mJ]", "stored"),
        _energy(writer, columns, spent, "work and loss, summed [mJ]", "spent"),
    ]
    tabs["Parts"] = _parts(writer, columns)
    tabs["Speed"] = _speed(writer, columns, scene)
    return tabs


def _seam(writer: _Writer, columns: Columns) -> list[Plot]:
    gap = writer.plot("seam gap [µm]", "seam/gap")
    writer.curve(gap, "gap", columns["gap"] * 1e6, 2)
    exchanges = writer.plot("exchanges a step", "seam/exchanges")
    writer.curve(exchanges, "exchanges", columns["exchanges"], 1)
    force = writer.plot("largest multiplier [N]", "seam/multiplier")
    writer.curve(force, "multiplier", columns["multiplier"], 2)
    return [gap, exchanges, force]


def _energy(writer: _Writer, columns: Columns, names: tuple[str, ...], title: str, where: str) -> Plot:
    plot = writer.plot(title, f"energy/{where}")
    for i, name in enumerate(names):
        values = 1e3 * np.nan_to_num(columns[f"energy.{name}"])
        writer.curve(plot, name.replace("_", " "), values if where == "stored" else np.cumsum(values), i)
    return plot


def _parts(writer: _Writer, columns: Columns) -> list[Plot]:
    cells = writer.plot("cells", "parts/cells")
    iterations = writer.plot("iterations or sweeps a step", "parts/iterations")
    for i, (_, names) in enumerate(colors.grouped(columns.models).values()):
        model = columns.models[names[0]]
        label = f"{names[0]} ({model})" if len(names) == 1 else f"{len(names)} parts ({model})"
        color = i if i >= 2 else 0 if local(names[0]) == "near" else 1
        for plot, what in ((cells, "cells"), (iterations, "iterations")):
            values = np.sum([np.nan_to_num(columns[f"{name}.{what}"]) for name in names], axis=0)
            writer.curve(plot, label, values, color)
    return [cells, iterations]


def _speed(writer: _Writer, columns: Columns, scene: Scene) -> list[Plot]:
    rtf = writer.plot("real-time factor", "speed/rtf")
    total = columns["seconds.total"]
    writer.curve(rtf, "rtf", scene.step / np.where(total > 0.0, total, np.nan), 2)
    wall = writer.plot("wall time of a step [ms]", "speed/wall")
    for i, name in enumerate(spent()):
        values = 1e3 * columns[f"seconds.{name}"]
        if np.nanmax(values, initial=0.0) > 0.0:
            writer.curve(wall, name, values, i)
    return [rtf, wall]


class _Writer:
    def __init__(self, stream: rr.RecordingStream, columns: Columns) -> None:
        self._stream = stream
        self._time: NDArray[np.float64] = columns["time"]
        self._step = columns["step"].astype(np.int64)

    def plot(self, title: str, where: str) -> Plot:
        return Plot(title, f"{paths.CURVES}/{where}")

    def curve(self, plot: Plot, name: str, values: NDArray[np.float64], color: int) -> None:
        """Log one curve; steps without a value are left out."""
        path = f"{plot.origin}/{name.replace(' ', '_').replace('(', '').replace(')', '')}"
        known = np.isfinite(values)
        tone = colors.SERIES[color % len(colors.SERIES)]
        self._stream.log(path, rr.SeriesLines(colors=tone, widths=2.0, names=name), static=True)
        times = [
            rr.TimeColumn("sim_time", duration=self._time[known]),
            rr.TimeColumn("step", sequence=self._step[known]),
        ]
        self._stream.send_columns(path, times, rr.Scalars.columns(scalars=values[known]))
        plot.names.append(path)
