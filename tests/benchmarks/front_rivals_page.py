"""What the page and the picture of `front` have of other simulators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from softseam.view.paper import INK, PAPER, RULE, SOFT

OWN, MUJOCO, NEWTON = "#23262d", "#3d8f6f", "#9a5fb0"
SECTION = """## Beside other simulators

The same tray with {bodies} bodies ({side}³ and the gripped one), for with 28 most rivals take from half an hour to
hours. Cubes, walls, friction and, where they have it, retardation time are ours; fingers go the way that ours went. One
process on one thread each, one after the other. The force is held against {force} N, which is FEM 4³ in this tray,
corrected by what it is off in the larger one; it is known to {known:.1%} at best. Forces of others are means of the
last 40 ms, for not all rest by then.

| | CPU s a second | force [%] | held, in the air [N] | in one another [mm] | floor | between | momentum |
|---|---|---|---|---|---|---|---|
{rows}

*In one another*: the deepest point of a cube's surface in another, at rest, held and in the air. *Floor*: as all rests.
*Between*: what the gripped cube stands on, as the simulator gives it, over its weight, as all rests.
*Momentum*: two such cubes, free, one running into the other with .2 m/s, the second by what the others are simulated
with: change over what there was. "-": the simulator does not give it. Of stress none gives anything.

MuJoCo has trilinear flex cells and St. Venant-Kirchhoff's law; *stiff* contact is `solref` 4 ms, `solimp` .95 .99
.5 mm, the softest that lets nothing sink; *default* is MuJoCo's own. It sleeps at 5 mm/s. Newton's VBD has five
tetrahedra a cell; what coupled solvers bear at the fingers is computed here from the shape, by VBD's law.
"""


def rivals_section(rivals: Mapping[str, Any] | None) -> str:
    """The section; of rivals that were not run a line."""
    if rivals is None:
        return "## Beside other simulators\n\nNot run this time: `make front RIVALS=1`.\n"
    lines = []
    for row in rivals["rows"]:
        lost = "-" if row["momentum"] is None else f"{row['momentum']:.1g}"
        if row["stopped"] is not None:
            lines.append(f"| {row['label']} | {row['stopped']} | | | | | | {lost} |")
            continue
        force = ", ".join(f"{each:.3g}" for each in row["force"])
        floor, under = ("-" if row[name] is None else f"{row[name]:.3f}" for name in ("floor", "under"))
        lines.append(
            f"| {row['label']} | {row['seconds']:.3g} | {100 * row['error']:.2g} | {force} | "
            f"{1e3 * row['deepest']:.2g} | {floor} | {under} | {lost} |"
        )
    side = round((rivals["cubes"] - 1) ** (1 / 3))
    force = " and ".join(f"{each:.3g}" for each in rivals["force"])
    return SECTION.format(bodies=rivals["cubes"], side=side, force=force, known=rivals["known"], rows="\n".join(lines))


def draw_rivals(ax: Axes, rivals: Mapping[str, Any]) -> None:
    """Error of force over time, of ours and of others."""
    ax.set(xscale="log", yscale="log", xlabel="CPU seconds a simulated second", ylabel="error of force [%]")
    ax.set_title(
        f"tofu among {rivals['cubes'] - 1}: force, beside other simulators", color=INK, loc="left", fontsize=11
    )
    ax.set_facecolor(PAPER)
    ax.grid(True, which="major", color=RULE, linewidth=0.6)
    for row in rivals["rows"]:
        if row["stopped"] is not None:
            continue
        color = OWN if row["own"] else MUJOCO if row["label"].startswith("MuJoCo") else NEWTON
        at = row["seconds"], max(100 * row["error"], 0.1)
        ax.plot(*at, "o" if row["own"] else "D", color=color, markersize=7)
        ax.annotate(row["label"], at, textcoords="offset points", xytext=(7, 3), fontsize=8, color=color)
    ax.axhline(100 * rivals["known"], color=SOFT, lw=0.8, ls="--", zorder=0)
    ax.set_xlim(right=3.0 * ax.get_xlim()[1])
    plain_logs(ax)


def plain_logs(ax: Axes) -> None:
    """Ticks of two logarithmic axes as plain numbers."""
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
