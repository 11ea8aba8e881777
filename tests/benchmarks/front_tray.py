"""The tray of `front_runs` for other simulators: what it is, and what a run of it comes to. Needs nothing but numpy."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MEAN = 0.04
"""forces are means over so long before a look [s]: not all rest by then"""


@dataclass(frozen=True)
class Tray:
    """Cubes of one material, walls and a floor, and fingers that follow given ways; the last cube is gripped."""

    edge: float
    """of a cube [m]"""
    cubes: Sequence[Sequence[float]]
    """their centres (n, 3) [m]"""
    velocities: Sequence[Sequence[float]]
    """at first (n, 3) [m/s]"""
    material: Mapping[str, float]
    """young [Pa], poisson [1], density [kg/m^3], damping: retardation time [s], friction between bodies [1]"""
    walls: Sequence[Mapping[str, Any]]
    """size and position [m], friction [1]"""
    floor: float
    """friction [1]"""
    gravity: float
    """[m/s^2]; 0: there is no floor either"""
    finger: Mapping[str, Any]
    """size [m], friction [1]"""
    times: Sequence[float]
    """of the fingers' ways [s]"""
    ways: Mapping[str, Sequence[Sequence[float]]]
    """places of the fingers then, by name (t, 3) [m]"""
    looks: Mapping[str, float]
    """when shapes are looked at, by name [s]"""
    closes: float
    """when fingers close [s]; CPU time counts from then on"""
    duration: float
    """[s]"""

    @classmethod
    def read(cls, path: Path) -> Self:
        """From a file that holds its fields."""
        return cls(**json.loads(path.read_text()))

    @property
    def mass(self) -> float:
        """Of a cube [kg]."""
        return float(self.material["density"] * self.edge**3)

    def place(self, finger: str, time: float) -> Floats:
        """Of a finger (3,) [m]."""
        way = np.array(self.ways[finger])
        return np.array([np.interp(time, self.times, way[:, axis]) for axis in range(3)])

    def looked(self, time: float, step: float) -> str:
        """Which look is at the end of this step, if any."""
        return next((name for name, at in self.looks.items() if abs(time - at) < 0.5 * step), "")

    def near_look(self, time: float) -> bool:
        """Whether forces count."""
        return any(at - MEAN < time <= at for at in self.looks.values())


def grid_of(rest: Floats, bodies: int) -> list[list[float]]:
    """Places of a cube's points at rest, alike in all, about its middle (p, 3) [m]."""
    own = rest.reshape(bodies, -1, 3)[0]
    return (own - 0.5 * (own.min(axis=0) + own.max(axis=0))).tolist()  # type: ignore[no-any-return]


def ended(
    tray: Tray,
    grid: Sequence[Sequence[float]],
    looks: Mapping[str, Any],
    time: Floats,
    forces: Mapping[str, Floats],
    momenta: tuple[Floats, Floats],
    cpu: float,
) -> dict[str, Any]:
    """A run that came to its end, as JSON: force of each finger as it is held, and of the floor over the weight as all
    rests, sizes of means over `MEAN`; None where a simulator does not give them."""
    weight = tray.mass * tray.gravity

    def mean(name: str, look: str) -> float | None:
        if name not in forces or look not in tray.looks:
            return None
        inside = (time > tray.looks[look] - MEAN) & (time <= tray.looks[look] + 1e-9)
        return abs(float(np.mean(np.array(forces[name])[inside])))

    grips = [[mean(name, look) for name in ("left", "right")] for look in ("held", "air")]
    floor, under = mean("floor", "rest"), mean("under", "rest")
    before, after = momenta
    return {
        "force": [None if None in pair else 0.5 * sum(pair) for pair in grips],  # type: ignore[arg-type]
        "seconds": cpu / max(tray.duration - tray.closes, 1e-9),
        "floor": None if floor is None else floor / (weight * len(tray.cubes)),
        "under": None if under is None else under / weight,
        "momentum": float(np.linalg.norm(after - before)) / max(float(np.linalg.norm(before)), 1e-30),
        "grid": grid,
        "looks": looks,
    }
