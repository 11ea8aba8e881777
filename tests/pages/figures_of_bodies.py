"""Drawings of cells, bodies, their regions and tools."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon, Rectangle

from pages.drawing import FEM, INK, TOOL, XPBD, arrow, bare


def cell() -> Figure:
    """A cell as both models have it, and one that the body fills in part."""
    figure, panels = plt.subplots(1, 3, figsize=(9.6, 3.3))
    for axes in panels:
        axes.axis("off")
        axes.set_aspect("equal")
        axes.set_xlim(-0.15, 2.15)
        axes.set_ylim(-0.6, 2.35)
    ticks = np.array([0.0, 1.0, 2.0])
    nodes = np.array([(x, y) for x in ticks for y in ticks])
    points = np.array([(x, y) for x in (0.5, 1.5) for y in (0.5, 1.5)])
    one, eight, cut = panels
    for axes, color in ((one, FEM), (eight, XPBD)):
        axes.add_patch(Rectangle((0, 0), 2, 2, fc=color, alpha=0.18, ec=color, lw=2))
    eight.plot([1, 1], [0, 2], color=XPBD, lw=1.5)
    eight.plot([0, 2], [1, 1], color=XPBD, lw=1.5)
    one.plot([1, 1], [0, 2], color=FEM, lw=0.8, ls=":")
    one.plot([0, 2], [1, 1], color=FEM, lw=0.8, ls=":")
    one.plot(*points.T, "x", color=FEM, ms=8, mew=2)
    eight.plot(*points.T, "s", color=XPBD, ms=6)
    for axes in (one, eight):
        axes.plot(*nodes.T, "o", color=INK, ms=5)
    one.set_title("FEM: one element\n27 nodes, 9 in this section", fontsize=9)
    eight.set_title("XPBD: eight blocks\nthe same nodes", fontsize=9)
    one.text(1, -0.4, "x  a stress an octant", ha="center", fontsize=9, color=FEM)
    eight.text(1, -0.4, "■  a block an octant, with its stress", ha="center", fontsize=9, color=XPBD)
    cut.set_title("a cell that\nthe surface cuts", fontsize=9)
    body = np.array([(-0.1, -0.05), (1.35, -0.05), (1.5, 0.7), (1.1, 1.35), (0.35, 1.75), (-0.1, 1.8)])
    cut.add_patch(Polygon(body, fc="#d9c7a0", ec="#9a7b3c", lw=1.5, alpha=0.8))
    cut.add_patch(Rectangle((0, 0), 2, 2, fc="none", ec=INK, lw=1.2))
    cut.plot([1, 1], [0, 2], color=INK, lw=0.7, ls=":")
    cut.plot([0, 2], [1, 1], color=INK, lw=0.7, ls=":")
    for (x, y), fill in zip(points, ("1.00", "0.62", "0.44", "0.03"), strict=True):
        cut.text(x - (0.18 if fill == "0.44" else 0.0), y - 0.1, f"fill\n{fill}", ha="center", va="center", fontsize=8)
    surface = body[1:5]
    cut.plot(*surface.T, "o", color="#9a7b3c", ms=5)
    cut.text(1, -0.4, "●  surface points: contact and display", ha="center", fontsize=9, color="#7a5f2a")
    return figure


def body() -> Figure:
    """One body, its parts and their interfaces with each other and with tools."""
    figure, axes = bare(8.4, 3.6)
    for i in range(6):
        for j in range(3):
            near = i in (0, 5) or (j == 2 and i in (1, 4))
            axes.add_patch(Rectangle((i, j), 1, 1, fc=FEM if near else XPBD, alpha=0.45, ec="white", lw=1.5))
    seam = [(1, 0), (1, 2), (2, 2), (2, 3)]
    mirror = [(6 - x, y) for x, y in seam]
    for line in (seam, mirror):
        axes.plot(*zip(*line, strict=True), color="#b3202c", lw=3, marker="o", ms=5)
    for x in (-0.6, 6.0):
        axes.add_patch(Rectangle((x, 0.6), 0.6, 2.2, fc=TOOL, ec=INK, lw=0.8))
    axes.add_patch(Rectangle((-1.2, -0.25), 8.4, 0.25, fc="#c9ccd1", ec=INK, lw=0.8))
    axes.text(0.5, 1.4, "part\nnear\n(FEM)", ha="center", va="center", fontsize=9)
    axes.text(3, 1.1, "part far (XPBD)", ha="center", va="center", fontsize=10)
    axes.annotate(
        "interface: the seam\n(shared nodes, multipliers)",
        (1, 1),
        (2.0, 0.35),
        fontsize=9,
        color="#b3202c",
        va="center",
        arrowprops={"arrowstyle": "->", "color": "#b3202c"},
    )
    axes.text(-0.3, 3.0, "tool", ha="center", fontsize=9)
    axes.text(6.3, 3.0, "tool", ha="center", fontsize=9)
    axes.text(7.1, -0.5, "tool: ground", ha="right", fontsize=9, va="center")
    axes.text(3, 3.25, "one body", ha="center", fontsize=10, weight="bold")
    axes.set_xlim(-1.4, 7.4)
    axes.set_ylim(-0.7, 3.6)
    return figure


def regions() -> Figure:
    """Which cells FEM has while a finger comes, presses and goes."""
    figure, panels = plt.subplots(1, 3, figsize=(9.6, 2.9))
    cases = (
        ("far away: XPBD has all cells", 2.2, 0),
        ("within reach: FEM where it will press", 0.55, 1),
        ("gone again: FEM is released, later", 1.7, 2),
    )
    for axes, (title, height, case) in zip(panels, cases, strict=True):
        axes.axis("off")
        axes.set_aspect("equal")
        for i in range(6):
            for j in range(3):
                near = case > 0 and ((j == 2 and 1 <= i <= 4) or (j == 1 and 2 <= i <= 3))
                axes.add_patch(Rectangle((i, j), 1, 1, fc=FEM if near else XPBD, alpha=0.5, ec="white"))
        bottom = 3 + height
        axes.add_patch(Rectangle((2.3, bottom), 1.4, 1.1, fc=TOOL, ec=INK))
        if case == 1:
            arrow(axes, (3.0, bottom + 1.9), (3.0, bottom + 1.15))
        if case == 2:
            arrow(axes, (3.0, bottom + 1.15), (3.0, bottom + 1.9))
        axes.plot([0, 6], [3 + 0.9, 3 + 0.9], ls="--", color=FEM, lw=1)
        axes.plot([0, 6], [3 + 1.35, 3 + 1.35], ls=":", color=INK, lw=1)
        if case == 0:
            axes.text(0, 3.98, "within", fontsize=8, color=FEM)
            axes.text(0, 4.45, "release x within", fontsize=8)
        axes.set_title(title, fontsize=9)
        axes.set_xlim(-0.1, 6.1)
        axes.set_ylim(-0.1, 6.4)
    return figure


def axes_and_tools() -> Figure:
    """Axes, the body's place and the numbers of a tool."""
    figure, axes = bare(7.6, 3.8)
    axes.add_patch(Rectangle((-4, -0.25), 8, 0.25, fc="#c9ccd1", ec=INK))
    axes.add_patch(Rectangle((-1, 0), 2, 2, fc="#efe3c4", ec=INK, lw=1.3))
    for x in (-1.55, 1.15):
        axes.add_patch(Rectangle((x, 0.2), 0.4, 1.7, fc=TOOL, ec=INK))
        axes.plot(x + 0.2, 1.05, "+", color="white", ms=9, mew=2)
    axes.plot(0, 0, "o", color="#b3202c", ms=7)
    axes.annotate(
        "body.position:\nmiddle of the base of\nits bounding box",
        (0, 0),
        (-4.0, 0.62),
        fontsize=8,
        color="#b3202c",
        arrowprops={"arrowstyle": "->", "color": "#b3202c"},
    )
    axes.annotate("tool position: its centre", (1.35, 1.05), (1.9, 1.55), fontsize=8.5, arrowprops={"arrowstyle": "->"})
    axes.annotate("", (1.15, 2.1), (1.55, 2.1), arrowprops={"arrowstyle": "<->"})
    axes.text(1.35, 2.2, "size[0]", ha="center", fontsize=8.5)
    axes.annotate("", (-1, 2.2), (1, 2.2), arrowprops={"arrowstyle": "<->"})
    axes.text(0, 2.3, "body.shape.size[0]", ha="center", fontsize=8.5)
    arrow(axes, (-1.9, 1.5), (-1.6, 1.5))
    axes.text(-1.95, 1.5, "close", ha="right", va="center", fontsize=8.5)
    arrow(axes, (1.85, 1.0), (1.6, 1.0))
    arrow(axes, (2.6, 0.15), (3.5, 0.15), FEM, 2)
    arrow(axes, (2.6, 0.15), (2.6, 1.05), FEM, 2)
    axes.text(3.55, 0.15, "x", color=FEM, va="center")
    axes.text(2.6, 1.1, "z (up; gravity along -z)", color=FEM, ha="left", va="bottom", fontsize=8.5)
    axes.add_patch(Ellipse((2.6, 0.15), 0.2, 0.2, fc="white", ec=FEM, lw=1.5))
    axes.plot([2.53, 2.67], [0.08, 0.22], color=FEM)
    axes.plot([2.53, 2.67], [0.22, 0.08], color=FEM)
    axes.text(2.4, 0.18, "y", color=FEM, ha="right")
    axes.text(-3.9, -0.13, "plane: point and normal", fontsize=8.5, va="center")
    axes.set_xlim(-4.05, 4.6)
    axes.set_ylim(-0.4, 2.7)
    return figure
