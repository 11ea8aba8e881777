"""What the page and the picture of `front` have of other simulators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from softseam.view.paper import INK, PAPER, RULE, SOFT

OWN = "#23262d"
COLORS = {"MuJoCo": "#3d8f6f", "Newton": "#9a5fb0", "PyBullet": "#b0763d"}
"""of rivals, by the first word of their labels"""
SECTION = """## Beside other simulators

The same tray with {bodies} bodies ({side}³ and the gripped one), for with 28 most rivals take from half an hour to
hours. Beside ours there are {versions}.
Cubes, walls, friction and, where they have it, retardation time are ours; fingers go the way that ours went. One
process on one thread each, one after the other. The force is held against {force} N, made for this tray as the larger
one's reference and known to {known:.1%}. Forces of others are means of the last 40 ms, for not all rest by then.

| | CPU s a second | force [%] | held, in the air [N] | in one another [mm] | floor | between | momentum |
|---|---|---|---|---|---|---|---|
{rows}

*In one another*: the deepest point of a cube's surface in another, at rest, held and in the air; of coupled solvers the
surface is that of the particles' middles, 4 mm inside their spheres. *Floor*: what it bears by the simulator's word
over the weight, as all rests. *Between*: what the gripped cube stands on, by its word, over its weight. *Momentum*: two
such cubes, free, one running into the other with .2 m/s, the second by what the others are simulated with: change over
what there was. "-": the simulator does not give it. Of stress none gives anything. A run is stopped after 100 CPU s.
The reference is of our FEM alone, so what our law, contact and grip have in common is not in these errors.

MuJoCo has trilinear flex cells and St. Venant-Kirchhoff's law. *Stiff* contact is `solref` 4 ms, `solimp` .95 .99 .5 mm
between bodies, and stiffer at tools; *default* between bodies is MuJoCo's own. It may sleep below 5 mm/s, but the pile,
which is one island, was never so calm. By CG, 100 iterations do not solve its contact. Newton's VBD has five tetrahedra
a cell, and 10 iterations, which leave it out of balance: the floor reads four to six times the weight. The force on the
fingers is read off in the same way. XPBD's cubes let the gripped one sink between the four that it stands on; at 2 ms
XPBD diverges. What fingers bear there is computed from the shape, by VBD's law.

PyBullet has five tetrahedra a cell, too, of a neo-Hookean law that it integrates explicitly. Fingers and floor are
boxes that motors hold, and the motors' forces count. With a margin of contact of .2 mm its cubes just do not touch at
first. Whatever the margin they sink into one another, by 7 to 8 mm in 4³ cells at .5 ms and by more in 2³ or at 1 ms,
where the floor reads 2.7 and .9 times the weight. By its source, contact between bodies does not move nodes that a tool
touches, which may be why; two free cubes keep their momentum. It was measured while other programs kept both cores
busy, which makes its times longer.

{said}
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
    versions = ", ".join(dict.fromkeys(row["version"] for row in rivals["rows"] if row["version"]))
    return SECTION.format(
        said=_said(rivals["rows"], rivals["known"]),
        versions=versions,
        bodies=rivals["cubes"],
        side=side,
        force=force,
        known=rivals["known"],
        rows="\n".join(lines),
    )


def _said(rows: Sequence[Mapping[str, Any]], known: float) -> str:
    """Which rivals no choice of ours is as fast and as near to the force as, in a sentence."""
    done = [row for row in rows if row["stopped"] is None]
    own = [row for row in done if row["own"]]
    outside = [
        f"{row['label']} ({100 * row['error']:.2g} %)"
        for row in done
        if not row["own"] and not any(o["seconds"] <= row["seconds"] and o["error"] <= row["error"] for o in own)
    ]
    if not outside:
        return "None is outside our front of this table in force: some choice of ours is as near, and as fast."
    return (
        f"Outside our front of this table in force: {', '.join(outside)}. Of errors within the {100 * known:.2g} % to "
        "which the force is known none is the smaller one for sure."
    )


def draw_rivals(ax: Axes, rivals: Mapping[str, Any]) -> None:
    """Error of force over time, of ours and of others."""
    ax.set(xscale="log", yscale="log", xlabel="CPU seconds a simulated second", ylabel="error of force [%]")
    ax.set_title(
        f"tofu among {rivals['cubes'] - 1}: force, beside other simulators", color=INK, loc="left", fontsize=11
    )
    ax.set_facecolor(PAPER)
    ax.grid(True, which="major", color=RULE, linewidth=0.6)
    done = [row for row in rivals["rows"] if row["stopped"] is None]
    aside: list[Mapping[str, Any]] = []
    for row in done:
        color = OWN if row["own"] else COLORS[row["label"].split()[0]]
        at = row["seconds"], max(100 * row["error"], 0.1)
        ax.plot(*at, "o" if row["own"] else "D", color=color, markersize=7)
        # to the left where another mark is to the right, and below what is there already
        left = any(row["seconds"] < other["seconds"] and _near(row, other) for other in done)
        low = 11 * sum(_near(row, other) for other in aside) if left else 0
        aside += [row] if left else []
        place: dict[str, Any] = {"xytext": (-7 if left else 7, 3 - low), "ha": "right" if left else "left"}
        ax.annotate(row["label"], at, textcoords="offset points", fontsize=8, color=color, **place)
    ax.axhline(100 * rivals["known"], color=SOFT, lw=0.8, ls="--", zorder=0)
    ax.set_xlim(right=3.0 * ax.get_xlim()[1])
    plain_logs(ax)


def _near(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether a label beside one mark would meet the other's."""
    apart = max(one["seconds"], other["seconds"]) / min(one["seconds"], other["seconds"])
    return bool(apart < 2.0 and 0.93 < one["error"] / other["error"] < 1.07)


def plain_logs(ax: Axes) -> None:
    """Ticks of two logarithmic axes as plain numbers."""
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
