"""Which time integrator may meet which coupling scheme: `python tests/benchmarks/coupling_scan.py`.

The spectral radius of an oscillator split in two, scanned over mass and stiffness ratio, step and substeps; draws
docs/pictures/coupling_stability.png and the table of docs/results/verification.md. The far side is implicit Euler, as
XPBD is.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.linear_study.gravouil_combescure import GravouilCombescure
from analysis.linear_study.integrators import LinearSide
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.prakash_hjelmstad import PrakashHjelmstad
from analysis.linear_study.split import Scheme, Split, spectral_radius
from analysis.linear_study.velocity_constant import VelocityConstant

SCHEMES: dict[str, Scheme] = {
    "position, constant multiplier": PositionConstant(),
    "velocity, constant multiplier": VelocityConstant(),
    "Prakash-Hjelmstad": PrakashHjelmstad(),
    "Gravouil-Combescure": GravouilCombescure(),
}
NEAR = ("implicit_euler", "midpoint", "theta", "bdf2", "newmark", "generalised_alpha")
TITLES = {
    "implicit_euler": "implicit Euler",
    "theta": "theta 0.51",
    "bdf2": "BDF2",
    "newmark": "Newmark, trapezoidal",
    "generalised_alpha": "generalised-alpha, 0.8",
}
RATIOS = (0.01, 0.1, 1.0, 10.0, 99.0)
STEPS = (0.002, 0.02, 0.1, 0.3, 0.7, 2.0)
"""over the period of the whole"""
SUBSTEPS = (1, 3, 20)
STABLE = 1e-9
"""a spectral radius above 1 by less than this is rounding"""


def growth(scheme: Scheme, near: str, mass: float, stiffness: float, step: float, substeps: int) -> float:
    """Spectral radius - 1 of mass and stiffness (near, of far's 1) at a step of so many periods."""
    period = 2.0 * np.pi * np.sqrt((mass + 1.0) / (stiffness + 1.0))
    split = Split(
        LinearSide(np.array([[mass]]), np.array([[stiffness]]), np.array([[1.0]])),
        LinearSide(np.eye(1), np.eye(1), -np.eye(1)),
        step * period,
        near,
        "implicit_euler",
        substeps,
    )
    return spectral_radius(scheme, split) - 1.0


def worst(scheme: Scheme, near: str) -> float:
    """Largest growth of the scan."""
    cases = itertools.product(RATIOS, RATIOS, STEPS, SUBSTEPS)
    return max(growth(scheme, near, *case) for case in cases)


def over(scheme: Scheme, near: str, masses: Sequence[float], steps: Sequence[float]) -> NDArray[np.float64]:
    """Largest growth over stiffness ratio and substeps (masses, steps)."""
    found = np.empty((len(masses), len(steps)))
    for (i, mass), (j, step) in itertools.product(enumerate(masses), enumerate(steps)):
        found[i, j] = max(growth(scheme, near, mass, k, step, m) for k, m in itertools.product(RATIOS, SUBSTEPS))
    return found


def draw(path: Path) -> None:
    """A map a pair: blue is stable, the redder the faster it grows."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.colors import BoundaryNorm, ListedColormap

    masses, steps = np.geomspace(0.01, 99.0, 13), np.geomspace(0.002, 2.0, 13)
    levels = [-1.0, STABLE, 1e-4, 1e-2, 1.0, 1e6]
    colors = ListedColormap(["#3b6fb6", "#fddbc7", "#f4a582", "#d6604d", "#8b1a1a"])
    figure, axes = plt.subplots(len(SCHEMES), len(NEAR), figsize=(14, 9.2), sharex=True, sharey=True)
    for (row, (name, scheme)), (column, near) in itertools.product(enumerate(SCHEMES.items()), enumerate(NEAR)):
        axis = axes[row, column]
        grown = over(scheme, near, masses.tolist(), steps.tolist())
        mesh = axis.pcolormesh(
            steps, masses, grown, cmap=colors, norm=BoundaryNorm(levels, colors.N), shading="nearest"
        )
        axis.set(xscale="log", yscale="log")
        if row == 0:
            axis.set_title(TITLES.get(near, near), fontsize=11)
        if column == 0:
            axis.set_ylabel(f"{name.replace(', ', chr(10))}\n\nmass near / far", fontsize=9)
        if row == len(SCHEMES) - 1:
            axis.set_xlabel("step / period", fontsize=9)
    figure.suptitle(
        "Growth a step (spectral radius - 1) of a split oscillator, worst of 5 stiffness ratios and 1, 3, 20 substeps; "
        "far side: implicit Euler", fontsize=11,
    )  # fmt: skip
    figure.tight_layout(rect=(0, 0.05, 1, 0.97))
    bar = figure.add_axes((0.3, 0.032, 0.4, 0.012))
    scale = figure.colorbar(mesh, cax=bar, orientation="horizontal", spacing="uniform")
    scale.set_ticks(levels, labels=["", "stable below 1e-9", "1e-4", "1e-2", "1", ""], fontsize=9)
    figure.savefig(path, dpi=110)


def main() -> None:
    print("| near side | " + " | ".join(SCHEMES) + " |")
    print("|---" * (len(SCHEMES) + 1) + "|")
    for near in NEAR:
        grown = [worst(scheme, near) for scheme in SCHEMES.values()]
        shown = " | ".join("stable" if g < STABLE else f"**+{g:.2g}**" for g in grown)
        print(f"| {near.replace('_', ' ')} | {shown} |")
    draw(Path(__file__).resolve().parents[2] / "docs" / "pictures" / "coupling_stability.png")


if __name__ == "__main__":
    main()
