"""What the drawings of docs/concepts/ share: colours, arrows and boxes."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

FEM, XPBD, TOOL, INK, PALE = "#3b6fb6", "#e08a3c", "#8b8f94", "#222222", "#f3f4f6"


def bare(width: float, height: float, *, equal: bool = True) -> tuple[Figure, Axes]:
    figure, axes = plt.subplots(figsize=(width, height))
    axes.axis("off")
    if equal:
        axes.set_aspect("equal")
    return figure, axes


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str = INK, wide: float = 1.4
) -> None:
    axes.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=color, lw=wide, shrinkA=0, shrinkB=0)
    )


def box(
    axes: Axes, x: float, y: float, w: float, h: float, text: str, color: str = PALE, ink: str = INK, size: float = 9
) -> None:
    axes.add_patch(FancyBboxPatch((x, y), w, h, boxstyle="round,pad=0.02,rounding_size=0.06", fc=color, ec=INK, lw=0.8))
    axes.text(x + w / 2, y + h / 2, text, ha="center", va="center", fontsize=size, color=ink)
