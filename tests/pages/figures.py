"""Draws the pictures of docs/concepts/: `make figures`, or `PYTHONPATH=tests python -m pages.figures`."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures"
FEM, XPBD, TOOL, INK, PALE = "#3b6fb6", "#e08a3c", "#8b8f94", "#222222", "#f3f4f6"


def _bare(width: float, height: float, *, equal: bool = True) -> tuple[Figure, Axes]:
    figure, axes = plt.subplots(figsize=(width, height))
    axes.axis("off")
    if equal:
        axes.set_aspect("equal")
    return figure, axes


def _arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str = INK, wide: float = 1.4
) -> None:
    axes.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=color, lw=wide, shrinkA=0, shrinkB=0)
    )


def _box(
    axes: Axes, x: float, y: float, w: float, h: float, text: str, color: str = PALE, ink: str = INK, size: float = 9
) -> None:
    axes.add_patch(FancyBboxPatch((x, y), w, h, boxstyle="round,pad=0.02,rounding_size=0.06", fc=color, ec=INK, lw=0.8))
    axes.text(x + w / 2, y + h / 2, text, ha="center", va="center", fontsize=size, color=ink)


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
    figure, axes = _bare(8.4, 3.6)
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


def step() -> Figure:
    """One step as messages: predict, advance both parts at once, solve, correct, report."""
    figure, axes = _bare(10.4, 6.4, equal=False)
    lanes = {"client": 0.8, "orchestrator": 4.2, "near part (FEM)": 8.4, "far part (XPBD)": 11.0}
    for name, x in lanes.items():
        _box(axes, x - 0.95, 9.4, 1.9, 0.55, name)
        axes.plot([x, x], [0.2, 9.4], color="#b5b9bf", lw=1, zorder=0)
    client, boss, near, far = lanes.values()

    def note(y: float, text: str) -> None:
        _box(axes, boss - 1.95, y - 0.25, 3.9, 0.5, text, "#fff7d6", size=8.5)

    def send(y: float, a: float, b: float, text: str) -> None:
        _arrow(axes, (a, y), (b, y))
        axes.text(
            (a + min(b, near)) / 2 if b > a else (min(a, near) + b) / 2,
            y + 0.08,
            text,
            ha="center",
            va="bottom",
            fontsize=8.5,
            bbox={"fc": "white", "ec": "none", "pad": 0.6},
        )

    send(8.85, client, boss, "Step (tool velocities)")
    note(8.3, "move the tools; predict the multiplier λ")
    send(7.65, boss, near, "Advance (+λ, tool poses)")
    send(7.15, boss, far, "Advance (-λ, tool poses)")
    for x, color, what in ((near, FEM, "Newton"), (far, XPBD, "substeps")):
        axes.add_patch(Rectangle((x - 0.12, 6.12), 0.24, 0.93, fc=color, alpha=0.85))
        axes.text(x + 0.22, 6.55, what, fontsize=8.5, va="center")
    send(5.9, near, boss, "Advanced (nodes' positions, compliance)")
    send(5.4, far, boss, "Advanced")
    note(4.75, "one solve: the λ that closes all gaps")
    axes.text(
        boss + 2.15,
        4.75,
        "in doubt: another coupling iteration, with this λ\nno agreement: subdivide the step",
        fontsize=8.5,
        va="center",
        bbox={"fc": "white", "ec": "none", "pad": 0.6},
    )
    send(4.0, boss, near, "Correct (by its linear answer)")
    send(3.5, boss, far, "Correct")
    send(3.0, near, boss, "Advanced (energies, wrenches, then)")
    send(2.5, far, boss, "Advanced")
    note(1.9, "measure; adapt the regions; report")
    send(1.2, boss, client, "Observation (report, fields, events)")
    send(0.6, boss, far, "the next Advance commits the step")
    axes.set_xlim(-0.3, 12.1)
    axes.set_ylim(0, 10.1)
    return figure


def multiplier() -> Figure:
    """Two springs that share a node, apart and joined, and the iteration that finds the force."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.2), gridspec_kw={"width_ratios": [1.5, 1]})
    left.axis("off")

    def spring(x0: float, x1: float, y: float, color: str) -> None:
        s = np.linspace(0, 1, 200)
        left.plot(
            x0 + (x1 - x0) * s, y + 0.16 * np.sin(2 * np.pi * 7 * s) * ((s > 0.08) & (s < 0.92)), color=color, lw=1.8
        )

    for y, a, b in ((2.0, 2.7, 3.5), (0.6, 3.05, 3.05)):
        left.plot([0, 0], [y - 0.35, y + 0.35], color=INK, lw=3)
        left.plot([6, 6], [y - 0.35, y + 0.35], color=INK, lw=3)
        spring(0, a, y, FEM)
        spring(b, 6, y, XPBD)
        left.plot(a, y, "o", color=FEM, ms=9)
        left.plot(b, y, "o", color=XPBD, ms=9 if a != b else 5)
    left.annotate("", (3.5, 1.62), (2.7, 1.62), arrowprops={"arrowstyle": "<->", "color": "#b3202c"})
    left.text(3.1, 1.36, "gap g = x_near - x_far", color="#b3202c", ha="center", fontsize=9)
    left.text(1.3, 2.45, "near", color=FEM, fontsize=9)
    left.text(4.7, 2.45, "far", color=XPBD, fontsize=9)
    _arrow(left, (3.05, 0.2), (3.75, 0.2), FEM, 2)
    _arrow(left, (3.05, 0.2), (2.35, 0.2), XPBD, 2)
    left.text(3.85, 0.2, "+λ on near", color=FEM, va="center", fontsize=9)
    left.text(2.25, 0.2, "-λ on far", color=XPBD, va="center", ha="right", fontsize=9)
    left.set_xlim(-0.2, 6.3)
    left.set_ylim(-0.1, 2.8)
    force = np.linspace(0, 1.6, 50)
    right.plot(force, force - 1.0, color="#b3202c")
    right.axhline(0, color=INK, lw=0.8)
    right.plot([0.55], [-0.45], "o", color=INK)
    right.annotate("predicted", (0.55, -0.45), (0.75, -0.75), fontsize=9, arrowprops={"arrowstyle": "->"})
    right.annotate("", (1.0, 0.0), (0.55, -0.45), arrowprops={"arrowstyle": "->", "color": FEM, "lw": 2})
    right.text(0.0, 0.35, "Δλ = -(H_near + H_far)⁻¹ g", color=FEM, fontsize=9, ha="left")
    right.set_xlabel("multiplier λ [N]")
    right.set_ylabel("gap [m]")
    right.set_xticks([])
    right.set_yticks([])
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
            _arrow(axes, (3.0, bottom + 1.9), (3.0, bottom + 1.15))
        if case == 2:
            _arrow(axes, (3.0, bottom + 1.15), (3.0, bottom + 1.9))
        axes.plot([0, 6], [3 + 0.9, 3 + 0.9], ls="--", color=FEM, lw=1)
        axes.plot([0, 6], [3 + 1.35, 3 + 1.35], ls=":", color=INK, lw=1)
        if case == 0:
            axes.text(0, 3.98, "within", fontsize=8, color=FEM)
            axes.text(0, 4.45, "release x within", fontsize=8)
        axes.set_title(title, fontsize=9)
        axes.set_xlim(-0.1, 6.1)
        axes.set_ylim(-0.1, 6.4)
    return figure


def contact() -> Figure:
    """Force over gap, friction over slip, and the cone."""
    figure, (gap, slip, cone) = plt.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
    g = np.linspace(-1, 1, 200)
    gap.plot([-0.02, -0.02, 1], [1, 0, 0], color=FEM, lw=2.5, label="at rest: p ≥ 0, g ≥ 0, p g = 0")
    gap.plot(g, np.maximum(0, 0.45 - 1.1 * g), color=XPBD, lw=1.5, ls="--", label="one step: max(0, λₙ - r g)")
    gap.set_xlabel("gap g (negative: inside the tool)")
    gap.set_ylabel("pressure force p")
    gap.set_ylim(-0.1, 1.7)
    gap.legend(fontsize=7, loc="upper right")
    s = np.linspace(0, 2, 100)
    slip.plot(s, np.minimum(1.0, 1.6 * s), color=FEM, lw=2.5)
    slip.axhline(1.0, color=INK, lw=0.8, ls=":")
    slip.text(1.9, 1.04, "μ p", fontsize=9, ha="right")
    slip.text(0.14, 0.1, "sticks: held at its anchor", fontsize=8, color=FEM)
    slip.text(1.0, 0.72, "slips: the anchor\ngoes along", fontsize=8)
    slip.set_xlabel("displacement from the anchor")
    slip.set_ylabel("friction force |τ|")
    slip.set_ylim(0, 1.3)
    cone.axis("off")
    cone.set_aspect("equal")
    cone.add_patch(Rectangle((-1.6, -0.5), 3.2, 0.5, fc=TOOL, ec=INK))
    cone.add_patch(Polygon([(0, 0), (-0.7, 1.5), (0.7, 1.5)], fc=FEM, alpha=0.25))
    cone.plot([-0.7, 0, 0.7], [1.5, 0, 1.5], color=FEM)
    _arrow(cone, (0, 0), (0.35, 1.25), INK, 2)
    cone.text(0.66, 0.95, "contact_force\n(tool on body)", fontsize=8, va="center")
    _arrow(cone, (0, 0), (-0.14, -0.42), "white", 2)
    cone.text(-0.24, -0.27, "in wrench\n(body on tool)", fontsize=7.5, ha="right", color="white", va="center")
    cone.text(0, 1.58, "cone |τ| ≤ μ p", fontsize=9, ha="center", color=FEM)
    cone.text(1.55, -0.25, "tool", fontsize=9, ha="right", va="center", color="white")
    cone.set_xlim(-1.7, 1.7)
    cone.set_ylim(-0.6, 1.9)
    return figure


def _oscillator(kind: str, dt: float, steps: int) -> np.ndarray:
    """Positions (steps + 1,) of x'' = -x, x(0) = 1, by an integrator."""
    x, v, xs = 1.0, 0.0, [1.0]
    past = (x, v)
    for i in range(steps):
        if kind == "bdf2" and i > 0:
            big_x, big_v = (4 * x - past[0]) / 3, (4 * v - past[1]) / 3
            g = 2 / 3 * dt
            x_next = (big_x + g * big_v) / (1 + g * g)
            v_next = (x_next - big_x) / g
        elif kind == "implicit Euler":
            x_next = (x + dt * v) / (1 + dt * dt)
            v_next = (x_next - x) / dt
        else:  # midpoint, and BDF2's first step
            theta = 2 / 3 if kind == "midpoint, radius .5" else 0.5
            # v1 = v0 - dt (x0 + theta (x1 - x0)), x1 = x0 + dt ((1 - theta) v0 + theta v1)
            x_next = (x + dt * v - theta * dt * dt * (1 - theta) * x) / (1 + theta * theta * dt * dt)
            v_next = v - dt * (x + theta * (x_next - x))
        past, x, v = (x, v), x_next, v_next
        xs.append(x)
    return np.array(xs)


def time() -> Figure:
    """What each integrator leaves of a free oscillation with 20 steps a period."""
    figure, axes = plt.subplots(figsize=(8.4, 3.0))
    dt, steps = 2 * np.pi / 20, 80
    t = np.arange(steps + 1) / 20
    fine = np.linspace(0, 4, 400)
    axes.plot(fine, np.cos(2 * np.pi * fine), color="#b5b9bf", lw=3, label="exact")
    for kind, color in (
        ("implicit Euler", "#b3202c"),
        ("midpoint, radius .5", XPBD),
        ("bdf2", "#3a9b57"),
        ("midpoint", FEM),
    ):
        axes.plot(
            t,
            _oscillator(kind, dt, steps),
            color=color,
            lw=1.4,
            label=kind.replace("bdf2", "BDF2"),
        )
    axes.set_xlabel("periods (20 steps each)")
    axes.set_ylabel("displacement")
    axes.legend(ncol=5, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 1.18), frameon=False)
    return figure


def error() -> Figure:
    """How errors of stress, energy norm and force fall with the cells."""
    figure, axes = plt.subplots(figsize=(6.4, 3.2))
    h = np.array([1.0, 0.5, 0.25, 0.125])
    e = 0.35 * h**0.75
    axes.loglog(1 / h, e, "o-", color="#b3202c", label="e: energy norm; local stress errs like this")
    axes.loglog(1 / h, 0.6 * e**2, "s-", color=FEM, label="c e²: forces and displacements")
    axes.axhline(0.05, color=INK, lw=0.8, ls=":")
    axes.text(1.7, 0.053, "5 %: beyond it a run says what to do", fontsize=8, va="bottom", ha="left")
    axes.set_xticks(1 / h, ["1", "2", "4", "8"])
    axes.minorticks_off()
    axes.set_xlabel("cells across (a sketch, c = 0.6 of hex27)")
    axes.set_ylabel("relative error")
    axes.legend(fontsize=8, loc="upper right")
    axes.set_ylim(2e-3, 2.0)
    return figure


def xpbd() -> Figure:
    """A substep of XPBD as a loop."""
    figure, axes = _bare(9.4, 3.0, equal=False)
    texts = (
        "predict\nx* = x + h v\n+ h²(g + A)",
        "contacts\nfirst",
        "sweep: each block moves\nits nodes until its stress is\nwhat its shape asks for",
        "contacts\nlast",
        "finish\nA += (x - x*)/h²\nv = (x - xₙ)/h",
    )
    widths, x = (1.7, 1.2, 2.7, 1.2, 1.8), 0.1
    middles = []
    for text, width in zip(texts, widths, strict=True):
        _box(axes, x, 1.4, width, 1.2, text, "#fbe6d2", size=8.5)
        middles.append((x, x + width))
        x += width + 0.45
    for (_, a), (b, _) in pairwise(middles):
        _arrow(axes, (a + 0.05, 2.0), (b - 0.05, 2.0))
    axes.plot([middles[-1][0] + 0.9, middles[-1][0] + 0.9, 0.9, 0.9], [1.35, 0.75, 0.75, 1.35], color=INK, lw=1.2)
    _arrow(axes, (0.9, 1.1), (0.9, 1.36))
    axes.text(
        x / 2,
        0.45,
        "next substep: blocks keep their stress, contacts their force: statics depend on no substep or sweep",
        ha="center",
        fontsize=8.5,
    )
    axes.set_xlim(0, x)
    axes.set_ylim(0.2, 2.9)
    return figure


def axes_and_tools() -> Figure:
    """Axes, the body's place and the numbers of a tool."""
    figure, axes = _bare(7.6, 3.8)
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
    _arrow(axes, (-1.9, 1.5), (-1.6, 1.5))
    axes.text(-1.95, 1.5, "close", ha="right", va="center", fontsize=8.5)
    _arrow(axes, (1.85, 1.0), (1.6, 1.0))
    _arrow(axes, (2.6, 0.15), (3.5, 0.15), FEM, 2)
    _arrow(axes, (2.6, 0.15), (2.6, 1.05), FEM, 2)
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


FIGURES: dict[str, Callable[[], Figure]] = {
    "concept_cell": cell,
    "concept_body": body,
    "concept_step": step,
    "concept_multiplier": multiplier,
    "concept_regions": regions,
    "concept_contact": contact,
    "concept_time": time,
    "concept_error": error,
    "concept_xpbd": xpbd,
    "axes_and_tools": axes_and_tools,
}


if __name__ == "__main__":
    for name, draw in FIGURES.items():
        drawn = draw()
        drawn.savefig(PICTURES / f"{name}.png", dpi=110, bbox_inches="tight", metadata={"Software": None})
        plt.close(drawn)
        print(f"docs/pictures/{name}.png")
