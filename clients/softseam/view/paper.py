"""The look that all pictures share."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from softseam.outputs import whole

PAPER = "#ffffff"
INK = "#23262d"
SOFT = "#6b7280"
RULE = "#e4e5e8"


def heading(figure: Figure, title: str, text: str) -> None:
    """Title and one sentence, at the top left."""
    figure.text(0.014, 1.0 - 0.22 / figure.get_figheight(), title, fontsize=17, color=INK, weight="bold", va="top")
    figure.text(0.014, 1.0 - 0.60 / figure.get_figheight(), text, fontsize=11, color=SOFT, va="top")


def plain(axes: Axes, title: str, x: str | None = None) -> None:
    """Axes without a box: a title that says what and in which unit, light horizontal rules."""
    axes.set_title(title, loc="left", fontsize=10.5, color=INK, pad=7)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelsize=9, length=3)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", color=RULE, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    if x is not None:
        axes.set_xlabel(x, fontsize=9.5, color=SOFT)


def write(figure: Figure, path: Path) -> Path:
    """Write a PNG, all or nothing."""
    with whole(path) as fresh:
        figure.savefig(fresh, format="png", facecolor=figure.get_facecolor())
    return path
