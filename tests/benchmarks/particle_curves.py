"""Draws docs/pictures/particle_stiffness.png: what sweeps and the step do to a spring in XPBD and in classic PBD.

By hand: PYTHONPATH=tests python tests/benchmarks/particle_curves.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from spring import forced_spring, softness, transfer

from softseam.view import colors
from softseam.view.paper import PAPER, SOFT, heading, plain, write

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "particle_stiffness.png"
SWEEPS = (1, 2, 3, 4, 6, 8, 12, 16)
FREQUENCY, STEP, STIFFNESS = 10.0, 0.01, 1000.0


def tone(index: int) -> tuple[float, float, float]:
    red, green, blue = colors.SERIES[index]
    return red / 255.0, green / 255.0, blue / 255.0


def stiffness(axes: Axes) -> None:
    """Load over stretch of a hanging link against sweeps."""
    plain(axes, "effective stiffness [N/m], 1 N on a link", "sweeps a substep")
    for substeps, style in ((2, "-"), (8, "--")):
        step = f"h = {10.0 / substeps:g} ms"
        classic = [1.0 / softness(sweeps, substeps, "pbd") for sweeps in SWEEPS]
        axes.plot(SWEEPS, classic, color=tone(0), linestyle=style, linewidth=1.7, label=f"classic, k = 0.5, {step}")
        compliant = [1.0 / softness(sweeps, substeps, "xpbd") for sweeps in SWEEPS]
        axes.plot(SWEEPS, compliant, color=tone(1), linestyle=style, linewidth=1.7, label=f"XPBD, 100 N/m, {step}")
    axes.set_yscale("log")
    axes.set_xscale("log", base=2)
    axes.set_xticks(SWEEPS, [str(sweeps) for sweeps in SWEEPS])
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=8.5)


def answers(amplitude: Axes, phase: Axes) -> None:
    """Amplification and phase at 10 Hz against the spring's own frequency."""
    natural = np.geomspace(2.0, 60.0, 400)
    masses = STIFFNESS / (2.0 * np.pi * natural) ** 2
    exact = np.array([STIFFNESS * transfer(STIFFNESS, mass, STEP, FREQUENCY) for mass in masses])
    continuous = np.abs(1.0 / (1.0 - (FREQUENCY / natural) ** 2))
    some = natural[::33]
    measured = [forced_spring(STIFFNESS, STIFFNESS / (2.0 * np.pi * f) ** 2, STEP, FREQUENCY) for f in some]
    plain(amplitude, "amplitude over f/k at 10 Hz, dt = 0.01 s", "own frequency of the spring [Hz]")
    amplitude.plot(natural, np.minimum(continuous, 5.0), color=SOFT, linewidth=1.0, label="without a step")
    amplitude.plot(natural, np.abs(exact), color=tone(1), linewidth=1.7, label="discrete transfer function")
    amplitude.plot(
        some, [STIFFNESS * a for a, _ in measured], "o", color=tone(0), markersize=4, label="XPBD, step by step"
    )
    amplitude.axhline(1.0 / np.sin(2.0 * np.pi * FREQUENCY * STEP), color=tone(2), linewidth=1.0, linestyle=":")
    amplitude.text(2.1, 1.78, "1/sin(ωh) = 1.70", fontsize=8.5, color=tone(2))
    amplitude.set_ylim(0.0, 4.0)
    plain(phase, "phase [degrees]", "own frequency of the spring [Hz]")
    phase.plot(natural, np.degrees(np.angle(exact)), color=tone(1), linewidth=1.7)
    phase.plot(some, np.degrees([p for _, p in measured]), "o", color=tone(0), markersize=4)
    for axes in (amplitude, phase):
        axes.set_xscale("log")
        axes.set_xticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
        axes.minorticks_off()
    amplitude.legend(frameon=False, fontsize=8.5)


def main() -> None:
    figure = Figure(figsize=(12.6, 4.4), dpi=150, facecolor=PAPER)
    heading(
        figure,
        "One spring",
        "Sweeps and step change classic PBD's stiffness, not XPBD's; the step of XPBD damps what moves fast",
    )
    left, middle, right = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.05, right=0.985, top=0.72, bottom=0.14, wspace=0.2)
    stiffness(left)
    answers(middle, right)
    write(figure, PICTURE)


if __name__ == "__main__":
    main()
