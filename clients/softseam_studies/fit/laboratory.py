"""`softseam fit CURVE` without a scene: a material's modulus and branches of a laboratory's curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.errors import BadInput
from softseam.outputs import check_ending, check_outputs
from softseam.view.paper import INK, PAPER, heading, plain, write
from softseam_protocol.scene.foods import FOODS
from softseam_studies.fit.branches import Branches, of_bar, of_sweep
from softseam_studies.fit.curve import check_order, read_columns

Floats = NDArray[np.float64]

SWEEP, BAR = ("frequency", "storage", "loss"), ("time", "stretch", "stress")
UNITS = {"frequency": "rad/s", "storage": "Pa", "loss": "Pa", "time": "s", "stretch": "1", "stress": "Pa"}
_POISSON = FOODS["tofu_firm"].numbers["poisson"].value


@dataclass(frozen=True)
class Measured:
    """A curve, by the names of its columns."""

    path: Path
    columns: dict[str, Floats]
    lines: list[int]

    @property
    def of_frequency(self) -> bool:
        """Whether it is a sweep, and no bar's."""
        return "frequency" in self.columns

    def fitted(self) -> Branches:
        """Its branches. Raises BadInput where no soft solid has such."""
        of = of_sweep if self.of_frequency else of_bar
        found = of(*(self.columns[name] for name in (SWEEP if self.of_frequency else BAR)))
        if not 100.0 <= found.quick <= 1e8:
            stress = "storage and loss are" if self.of_frequency else "stress is"
            raise BadInput(f"{self.path}: a shear modulus of {found.quick:.3g} Pa is no soft solid's: {stress} in Pa")
        return found


def fit_material(path: Path, picture: Path | None, console: Console) -> Branches:
    """Read, fit, print, and draw where asked. Raises BadInput."""
    if picture is not None:
        check_ending("--picture", picture, ".png", "a picture")
        check_outputs([("--picture", picture)], inputs={"the curve": path})
    measured = read_measured(path)
    found = measured.fitted()
    print_branches(found, console)
    if picture is not None:
        console.print(Text(str(draw_fit(measured, found, picture))))
    return found


def read_measured(path: Path) -> Measured:
    """A laboratory's CSV: frequency, storage and loss, or time, stretch and stress. Raises BadInput with its line."""
    names, table, lines = read_columns(path, [*SWEEP, *BAR], ",".join(SWEEP))
    if set(names) not in (set(SWEEP), set(BAR)):
        raise BadInput(
            f"{path}:1: columns are {', '.join(SWEEP)} [rad/s, Pa, Pa] of a sweep, or {', '.join(BAR)} [s, 1, Pa] of a "
            "bar whose sides are free"
        )
    if len(table) < 8:
        raise BadInput(f"{path}: {len(table)} rows are too few for a modulus and branches: 8 at least")
    columns = {name: table[:, place] for place, name in enumerate(names)}
    first = "frequency" if "frequency" in columns else "time"
    if first == "frequency":
        order = np.argsort(columns[first], kind="stable")
        columns, lines = {name: values[order] for name, values in columns.items()}, [lines[i] for i in order]
        for name in SWEEP:
            _refuse(path, columns[name] <= 0.0, lines, f"a {name} is above 0: leave the row out")
    check_order(path, first, UNITS[first], columns[first], lines)
    if first == "time":
        stretch = columns["stretch"]
        outside = (stretch < 0.2) | (stretch > 4.0)
        _refuse(path, outside, lines, "a stretch is a length over the first one, .9 where it is pressed by 10 %")
        if (stretch == 1.0).all() or not columns["stress"].any():
            raise BadInput(f"{path}: nothing is pulled or pressed: stretch is 1 or stress is 0 in every row")
    return Measured(path, columns, lines)


def _refuse(path: Path, wrong: NDArray[np.bool_], lines: Sequence[int], text: str) -> None:
    if wrong.any():
        raise BadInput(f"{path}:{lines[int(np.argmax(wrong))]}: {text}")


def print_branches(found: Branches, console: Console) -> None:
    """A table, and the line for a scene."""
    table = Table(title=f"{100.0 * found.off:.2g} % off (rms)", title_justify="left")
    for name in ("", "shear modulus [kPa]", "± standard error", "share", "time"):
        table.add_column(name, justify="right" if name else "left")
    shares = found.modulus / found.quick
    for place, (modulus, error, share) in enumerate(zip(found.modulus, found.error, shares, strict=True)):
        time = "" if place == 0 else f"{found.time[place - 1]:.3g} s"
        name = "fades" if place else "lasts"
        table.add_row(name, f"{1e-3 * modulus:.4g}", f"{1e-3 * error:.2g}", f"{100.0 * share:.3g} %", time)
    console.print(table)
    branches = ", ".join(
        f"{{share: {share:.3g}, time: {time:.3g}}}" for share, time in zip(found.share, found.time, strict=True)
    )
    young = float(f"{2.0 * (1.0 + _POISSON) * found.quick:.4g}")
    console.print(Text(f"material: {{young: {young:g}, poisson: {_POISSON}, density: 1050, relaxation: [{branches}]}}"))
    console.print(Text("poisson and density are assumed; young is that of a quick load", style="dim"))


def draw_fit(measured: Measured, found: Branches, path: Path) -> Path:
    """What was measured, by points, and what the branches make of it."""
    columns = measured.columns
    figure = Figure(figsize=(7.4, 4.8), dpi=150, facecolor=PAPER)
    heading(figure, measured.path.stem.replace("_", " "), f"{len(found.time)} branches, {100.0 * found.off:.2g} % off")
    axes = figure.subplots()
    figure.subplots_adjust(left=0.10, right=0.97, top=0.74, bottom=0.13)
    if measured.of_frequency:
        plain(axes, "storage and loss modulus [kPa]", "angular frequency [rad/s]")
        draw, at = axes.loglog, columns["frequency"]
        pairs = zip(SWEEP[1:], np.split(found.found, 2), strict=True)
    else:
        plain(axes, "force over first area [kPa]", "time [s]")
        draw, at = axes.plot, columns["time"]
        pairs = zip(BAR[2:], [found.found], strict=True)
    for (name, curve), tone in zip(pairs, ("#1d4ed8", "#c2410c"), strict=False):
        draw(at, 1e-3 * columns[name], "o", color=tone, markersize=3.5, label=f"{name}, measured")
        draw(at, 1e-3 * curve, color=tone, linewidth=1.6, label=f"{name}, fitted")
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.legend(frameon=False, fontsize=9, labelcolor=INK)
    return write(figure, path)
