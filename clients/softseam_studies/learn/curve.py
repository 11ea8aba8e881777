"""The learning curve as a picture."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from softseam.view.paper import PAPER, heading, plain, write
from softseam_studies.learn.check import Check, ratios, summary
from softseam_studies.learn.policy import Training
from softseam_studies.learn.tasks import TASKS


def draw_curve(training: Training, path: Path) -> Path:
    """Success, what bodies suffered and return of the last 100 episodes against steps, and what FEM says of some."""
    steps, reward, success, suffered = np.array(training.curve).T
    hardship = TASKS[training.task].hardship
    panels = 4 if training.checks else 3
    figure = Figure(figsize=(11.0 * panels / 3, 3.4), dpi=150, facecolor=PAPER)
    text = (
        f"{training.done:,} steps of {training.environments} environments, seed {training.seed}; means of 100 episodes"
    )
    if training.begun:
        text += f"; dotted: from {' to '.join(map(str, training.stages[: len(training.begun) + 1]))}"
    if training.checks:
        text += f"; {summary(training.checks)}"
    heading(figure, f"{training.task}, {training.algorithm.upper()}", text)
    figure.subplots_adjust(left=0.05, right=0.985, top=0.68, bottom=0.15, wspace=0.2)
    shown = (
        ("succeeded [%]", 100.0 * success),
        (f"{hardship.title} [{hardship.unit}]", suffered / hardship.scale),
        ("return", reward),
    )
    all_axes = figure.subplots(1, panels)
    for axes, (title, values) in zip(all_axes, shown, strict=False):
        plain(axes, title, "steps")
        axes.locator_params(axis="x", nbins=4)
        axes.plot(steps, values, color="#2f6fed", linewidth=1.8)
        for begun in training.begun:
            axes.axvline(begun, color="#8a8f98", linewidth=1.0, linestyle=":")
        axes.set_ylim(min(0.0, float(values.min())), 100.0 if "[%]" in title else None)
    if training.checks:
        _draw_checks(all_axes[-1], training.checks)
    return write(figure, path)


def _draw_checks(axes: Any, checks: tuple[Check, ...]) -> None:
    """What FEM says of the same actions, relative to XPBD."""
    plain(axes, "largest stress: FEM to XPBD [%]", "steps")
    stressed = [check for check in checks if check.of("stress", "end")[0] > 0.0]
    steps, more = np.array([check.steps for check in stressed]), 100.0 * (ratios(stressed, "stress", "end") - 1.0)
    alike = np.array([check.ended_alike for check in stressed], dtype=np.bool_)
    axes.axhline(0.0, color="#2f6fed", linewidth=1.0)
    axes.plot(steps[alike], more[alike], ".", color="#2f6fed")
    axes.locator_params(axis="x", nbins=4)
    axes.plot(steps[~alike], more[~alike], "x", color="#c8423b")
