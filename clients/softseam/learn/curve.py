"""The learning curve as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from softseam.learn.policy import Training
from softseam.view.paper import PAPER, heading, plain, write


def draw_curve(training: Training, path: Path) -> Path:
    """Return, success and stress of the last 100 episodes against steps."""
    steps, reward, success, stress = np.array(training.curve).T
    figure = Figure(figsize=(11.0, 3.4), dpi=150, facecolor=PAPER)
    text = (
        f"{training.done:,} steps of {training.environments} environments, seed {training.seed}; means of 100 episodes"
    )
    heading(figure, f"{training.task}, {training.algorithm.upper()}", text)
    figure.subplots_adjust(left=0.05, right=0.985, top=0.68, bottom=0.15, wspace=0.2)
    shown = (("succeeded [%]", 100.0 * success), ("largest stress [kPa]", 1e-3 * stress), ("return", reward))
    for axes, (title, values) in zip(figure.subplots(1, 3), shown, strict=True):
        plain(axes, title, "steps")
        axes.plot(steps, values, color="#2f6fed", linewidth=1.8)
        axes.set_ylim(min(0.0, float(values.min())), 100.0 if "[%]" in title else None)
    return write(figure, path)
