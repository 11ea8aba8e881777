"""What the runs of `front` are held against: a reference that is made up of runs, each finer in one way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from benchmarks.front_runs import Choice, Material
from numpy.typing import NDArray

Floats = NDArray[np.float64]

COARSE, FINE = 4, 6
"""cells along an edge of the gripped cube by FEM, extrapolated in the square of a cell's edge"""


@dataclass(frozen=True)
class Found:
    """What a run came to."""

    force: Floats
    """of the fingers, held on the tray and in the air (2,) [N]"""
    stress: Floats
    """von Mises, at points of a lattice (2, p) [Pa]"""
    seconds: float
    """CPU time a simulated second, from when fingers close on [s]"""
    awake: float
    """bodies awake in the mean then"""
    stopped: str = ""
    """why it came to nothing"""

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Self:
        """From what is kept of it."""
        if "stopped" in found:
            steps, spent = found["stopped"], found["spent"]
            text = f"{steps} of {found['expected']} steps took {spent:.0f} CPU s"
            return cls(np.zeros(2), np.zeros((2, 0)), np.inf, 0.0, text)
        return cls(np.array(found["force"]), np.array(found["stress"]), found["seconds"], found["awake"])


@dataclass(frozen=True)
class Truth:
    """Of one material."""

    force: Floats
    """(2,) [N]"""
    stress: Floats
    """(2, p) [Pa]"""
    force_known: float
    """uncertainty of the force [1]"""
    stress_known: float
    """and of stress, rms over the peak [1]"""
    said: Mapping[str, tuple[float, float]]
    """by how much force and stress change with what is refined [1]"""

    def force_error(self, found: Found) -> float:
        """Of the worse of both states [1]."""
        return float(np.abs(found.force / self.force - 1.0).max())

    def stress_error(self, found: Found) -> float:
        """Root mean square over both states and all points, over the peak [1]."""
        return _size(found.stress - self.stress) / float(self.stress.max())


@dataclass(frozen=True)
class Mark:
    """A choice, with its errors."""

    choice: Choice
    found: Found
    force: float
    stress: float

    @classmethod
    def of(cls, choice: Choice, found: Found, truth: Truth) -> Self:
        """Held against the truth; NaN of a run that was stopped."""
        if found.stopped:
            return cls(choice, found, np.nan, np.nan)
        return cls(choice, found, truth.force_error(found), truth.stress_error(found))


def needed(material: Material) -> list[Choice]:
    """The runs that a reference is made of: finer cells of the gripped cube, and beside those that are coarser finer
    cells of the others, and shorter steps. None sleeps in them."""
    fine, base = (Choice(material, "fem", cells, 1, sleep=False) for cells in (FINE, COARSE))
    return [fine, base, replace(base, beside=4), replace(base, step=0.0025)]


def truth_of(runs: Mapping[Choice, Found], material: Material) -> Truth:
    """The reference: each refinement adds what it changes."""
    fine, base, beside, shorter = (runs[choice] for choice in needed(material))
    share = 1.0 / ((FINE / COARSE) ** 2 - 1.0)
    changes = {
        f"cells of the gripped cube, from {FINE}^3 to none": (
            share * (fine.force - base.force),
            share * (fine.stress - base.stress),
        ),
        "cells of the others, from 1 to 4^3": (beside.force - base.force, beside.stress - base.stress),
        "steps, from 5 to 2.5 ms": (shorter.force - base.force, shorter.stress - base.stress),
    }
    force = fine.force + sum(change[0] for change in changes.values())
    stress = fine.stress + sum(change[1] for change in changes.values())
    said = {
        name: (float(np.abs(change[0] / force).max()), _size(change[1]) / float(stress.max()))
        for name, change in changes.items()
    }
    known = np.linalg.norm(np.array(list(said.values())), axis=0).tolist()
    return Truth(force, stress, known[0], known[1], said)


def _size(stress: Floats) -> float:
    return float(np.sqrt(np.mean(stress * stress)))
