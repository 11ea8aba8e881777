"""A run's step reports as columns of numbers, of which report, curves and pictures are made; and the norm of a column.

|J|^2 = (1/T) int_0^T J(t)^2 dt
"""

from collections.abc import Collection, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.session import StepReport
from softseam_protocol.models import MODELS
from softseam_protocol.quantities import QUANTITIES, quantity

Floats = NDArray[np.float64]

LEDGER = (
    *("kinetic", "strain", "gravity", "drive_work", "contact_loss", "tool_work", "seam_work", "dissipation", "switch"),
)
TOTAL = "total"
MANY = 6
"""bodies beyond which not each has figures of its own in what people read"""
Entry = TypeVar("Entry", bound=Mapping[str, Any])


def spent() -> tuple[str, ...]:
    """On what a step spends wall time, models first; besides these there is `TOTAL`."""
    return (*MODELS, "coupling", "bus", "record")


_SHOWN = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3), "1": ("%", 1e2), "J": ("mJ", 1e3)}


def unit_of(name: str) -> str:
    """Unit of a quantity, or of what a probe reports. Raises MissingRow."""
    return quantity(name).unit


def shown_unit(name: str) -> tuple[str, float]:
    """Unit in which people read a quantity, and its factor. Raises MissingRow."""
    unit = unit_of(name)
    return _SHOWN.get(unit, (unit, 1.0))


class Columns:
    """Grows by a row a step; a name that a step does not have is NaN there.

    step     of the scene [s]
    tools    by name, in the order of reports
    pressing those whose force is a quantity, quantity.<name>.force [N]

    Names: time [s], quantity.*, energy.* [J], seconds.* [s], gap [m], exchanges, multiplier [N], seam_nodes,
    penetration [m], momentum.x .. .z, angular_momentum.x .. .z, tool.<name>.fx .. .z (force [N] and position [m]), and
    for each part <part>.cells, .nodes, .iterations.
    """

    def __init__(self, step: float, tools: tuple[str, ...], pressing: Collection[str] = ()) -> None:
        self._step, self._tools, self._pressing = step, tools, pressing
        self._rows: list[dict[str, float]] = []
        self.models: dict[str, str] = {}
        """model of each part"""

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, report: StepReport) -> None:
        row = {
            "time": report.header.time + self._step,
            "step": float(report.header.step),
            "phase": float(report.phase),
            "gap": report.seam.gap,
            "exchanges": float(report.seam.exchanges),
            "multiplier": report.seam.force,
            "seam_nodes": float(report.seam.n_nodes),
            "penetration": report.penetration,
        }
        row.update((f"quantity.{name}", value) for name, value in report.quantities.items())
        for tool, wrench in zip(self._tools, report.wrench, strict=True):
            if tool in self._pressing:
                row[f"quantity.{tool}.force"] = float(np.linalg.norm(wrench[:3]))
        row.update((f"energy.{name}", value) for name, value in report.energy.items())
        row.update((f"seconds.{name}", report.seconds.get(name, 0.0)) for name in (*spent(), TOTAL))
        for name, part in report.parts.items():
            self.models[name] = part.model
            row[f"{name}.cells"], row[f"{name}.nodes"] = float(part.n_cells), float(part.n_nodes)
            row[f"{name}.iterations"] = float(part.iterations)
        for axis, label in enumerate("xyz"):
            row[f"momentum.{label}"] = float(report.momentum[axis])
            row[f"angular_momentum.{label}"] = float(report.angular_momentum[axis])
            for tool, position, wrench in zip(self._tools, report.tool_position, report.wrench, strict=True):
                row[f"tool.{tool}.{label}"] = float(position[axis])
                row[f"tool.{tool}.f{label}"] = float(wrench[axis])
        self._rows.append(row)

    def names(self, prefix: str) -> list[str]:
        """Names after a prefix such as 'quantity.', the known ones first, in a fixed order."""
        found = {name.removeprefix(prefix) for row in self._rows for name in row if name.startswith(prefix)}
        known = [name for name in (*QUANTITIES, *LEDGER) if name in found]
        return known + sorted(found.difference(known))

    def drawn(self, names: Collection[str]) -> dict[str, list[str]]:
        """Quantities by the plot that shows them: each has its own, but of many bodies, of which those share one whose
        values are not nothing throughout, or the first where all are."""
        found: dict[str, list[str]] = {}
        for name in names:
            found.setdefault(name.rpartition(".")[2], []).append(name)
        plots: dict[str, list[str]] = {}
        for title, own in found.items():
            if len(own) <= MANY:
                plots |= {name: [name] for name in own}
            else:
                plots[title] = [name for name in own if np.nan_to_num(self[f"quantity.{name}"]).any()] or own[:1]
        return plots

    def __getitem__(self, name: str) -> Floats:
        return np.array([row.get(name, np.nan) for row in self._rows])

    def last(self, name: str) -> float:
        """The last row's value, or NaN."""
        return self._rows[-1].get(name, float("nan")) if self._rows else float("nan")


def most_telling(found: Mapping[str, Entry]) -> dict[str, Entry]:
    """Of entries by quantity those that people read: where many bodies have one, of the three whose most is largest."""
    by_quantity: dict[str, list[str]] = {}
    for name in found:
        by_quantity.setdefault(name.rpartition(".")[2], []).append(name)
    few: set[str] = set()
    for names in by_quantity.values():
        if len(names) > MANY:
            most = {name: max(abs(found[name][end] or 0.0) for end in ("min", "max")) for name in names}
            names = sorted((name for name in names if most[name] > 0.0), key=lambda name: -most[name])[:3] or names[:1]
        few.update(names)
    return {name: entry for name, entry in found.items() if name in few}


NOTHING = {"m": 1e-6, "N": 1e-6, "Pa": 1e-3, "1": 1e-9}
"""a quantity whose norm is below this is zero in its scene, by unit"""


def rms(values: Floats, time: Floats) -> float:
    """|J| of a curve (n,) at times (n,) [s], by the trapezoidal rule; the plain value of a single time."""
    if len(time) < 2:
        return float(np.abs(values).max(initial=0.0))
    return float(np.sqrt(np.trapezoid(values * values, time) / (time[-1] - time[0])))


def is_nothing(name: str, scale: float) -> bool:
    """Whether a quantity is zero in this scene, so that no error is relative to it."""
    return not scale > NOTHING.get(unit_of(name), 0.0)
