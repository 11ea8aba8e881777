"""Draws the pictures of docs/concepts/: `make figures`, or `PYTHONPATH=tests python -m pages.figures`."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from pages.drawing import FEM, INK, TOOL, XPBD, arrow, bare, box
from pages.figures_of_bodies import axes_and_tools, body, cell, regions

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures"


def step() -> Figure:
    """One step as messages: predict, advance both parts at once, solve, correct, report."""
    figure, axes = bare(10.4, 6.4, equal=False)
    lanes = {"client": 0.8, "orchestrator": 4.2, "near part (FEM)": 8.4, "far part (XPBD)": 11.0}
    for name, x in lanes.items():
        box(axes, x - 0.95, 9.4, 1.9, 0.55, name)
        axes.plot([x, x], [0.2, 9.4], color="#b5b9bf", lw=1, zorder=0)
    client, boss, near, far = lanes.values()

    def note(y: float, text: str) -> None:
        box(axes, boss - 1.95, y - 0.25, 3.9, 0.5, text, "#fff7d6", size=8.5)

    def send(y: float, a: float, b: float, text: str) -> None:
        arrow(axes, (a, y), (b, y))
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
    arrow(left, (3.05, 0.2), (3.75, 0.2), FEM, 2)
    arrow(left, (3.05, 0.2), (2.35, 0.2), XPBD, 2)
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
    arrow(cone, (0, 0), (0.35, 1.25), INK, 2)
    cone.text(0.66, 0.95, "contact_force\n(tool on body)", fontsize=8, va="center")
    arrow(cone, (0, 0), (-0.14, -0.42), "white", 2)
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
    figure, axes = bare(9.4, 3.0, equal=False)
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
        box(axes, x, 1.4, width, 1.2, text, "#fbe6d2", size=8.5)
        middles.append((x, x + width))
        x += width + 0.45
    for (_, a), (b, _) in pairwise(middles):
        arrow(axes, (a + 0.05, 2.0), (b - 0.05, 2.0))
    axes.plot([middles[-1][0] + 0.9, middles[-1][0] + 0.9, 0.9, 0.9], [1.35, 0.75, 0.75, 1.35], color=INK, lw=1.2)
    arrow(axes, (0.9, 1.1), (0.9, 1.36))
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
