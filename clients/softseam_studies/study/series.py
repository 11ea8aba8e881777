"""What one run did over time, and its place in a JSON file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.observation import Observation
from softseam_protocol.quantities import quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """Quantities over time, as one run reported them."""

    time: Floats
    """the start, then the end of each step (n,) [s]"""
    travel: Floats
    """path of the tool that has moved farthest so far (n,) [m]"""
    values: Mapping[str, Floats]
    """(n,) each, in SI units; NaN where a step has no value"""

    def finite(self) -> bool:
        """Whether no quantity became infinite or was lost at the end; single steps may lack a value."""
        return all(
            bool(np.isfinite(values[-1])) and not bool(np.isinf(values).any()) for values in self.values.values()
        )

    def at(self, name: str, time: Floats) -> Floats:
        """A quantity at other times (m,) by linear interpolation between the steps that have it."""
        values = self.values[name]
        known = np.isfinite(values)
        if not known.any():
            return np.full(len(time), np.nan)
        return np.asarray(np.interp(time, self.time[known], values[known]))

    def looked(self, name: str) -> Floats:
        """Times (k,) at which a quantity was looked at: stress and probes are, every few steps [s]."""
        return self.time[np.isfinite(self.values[name])]

    def as_json(self) -> dict[str, Any]:
        """Plain data with nine digits of every number."""
        return {
            "time": _plain(self.time),
            "travel": _plain(self.travel),
            "values": {name: _plain(values) for name, values in self.values.items()},
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Series:
        """Raises KeyError, TypeError or ValueError where the data are not a series."""
        time = _floats(data["time"])
        values = {str(name): _floats(column) for name, column in dict(data["values"]).items()}
        travel = _floats(data["travel"])
        if time.ndim != 1 or any(column.shape != time.shape for column in (travel, *values.values())):
            raise ValueError("columns of unequal length")
        return cls(time, travel, values)


@dataclass
class SeriesBuilder:
    """Collects a run's observations."""

    names: tuple[str, ...]
    step: float
    """macro step [s]"""
    _time: list[float] = field(default_factory=list)
    _rows: list[list[float]] = field(default_factory=list)
    _travelled: dict[str, float] = field(default_factory=dict)
    _travel: list[float] = field(default_factory=list)
    _told: set[str] = field(default_factory=set)

    def add(self, observation: Observation) -> None:
        """Take the observation after the reset, then that of each step."""
        for name, tool in observation.tools.items():
            way = self.step * float(np.linalg.norm(tool.velocity)) if observation.step else 0.0
            self._travelled[name] = self._travelled.get(name, 0.0) + way
        self._time.append(observation.time)
        self._travel.append(max(self._travelled.values(), default=0.0))
        names = self.names if observation.step else [name for name in self.names if _begins(name)]
        found = {name: observation.report.quantities.get(name, np.nan) for name in names}
        self._told |= observation.report.quantities.keys() & {*self.names}
        self._rows.append([found.get(name, np.nan) for name in self.names])

    def build(self) -> Series:
        """Of what was reported at any time: the particles of a body that has cells elsewhere have no stress."""
        columns = np.array(self._rows, dtype=np.float64).reshape(-1, len(self.names)).T
        values = {name: column.copy() for name, column in zip(self.names, columns, strict=True) if name in self._told}
        return Series(np.array(self._time), np.array(self._travel), values)


def _begins(name: str) -> bool:
    """Whether a series has the value at rest: of what is looked at now and then, it begins with the first look."""
    row = quantity(name)
    return row.always and row.at_rest is not None


def _plain(values: Floats) -> list[float | None]:
    return [float(f"{value:.9g}") if np.isfinite(value) else None for value in values]


def _floats(column: Any) -> Floats:
    return np.array([np.nan if value is None else float(value) for value in column], dtype=np.float64)
