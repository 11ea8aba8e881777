"""What a seam at 1:4 reflects, sharp or spread over an overlap: `python tests/benchmarks/overlap.py`.

Draws docs/pictures/overlap.png, prints the table of docs/results/verification.md; bars are endless: there is no noise.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.overlap_bar import linear, reflected, sharp_seam

RATIO = 4
LAYERS = (1, 2, 4, 8)
WAVES = (6, 10, 20, 40)
"""coarse nodes a wavelength"""


def draw(path: Path) -> None:
    """Reflected energy over the wavelength, and over the layer's length in wavelengths."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6))
    nodes = np.geomspace(4.0, 60.0, 140)
    blues = plt.get_cmap("Blues")(np.linspace(0.4, 0.95, len(LAYERS)))
    left.plot(nodes, [sharp_seam(n, RATIO) for n in nodes], color="#b2182b", lw=2.2, label="sharp seam")
    for layer, color in zip(LAYERS, blues, strict=True):
        label = f"overlap of {layer} coarse cell{'s' if layer > 1 else ''}"
        left.plot(nodes, [reflected(n, RATIO, layer) for n in nodes], color=color, label=label)
    ramp = [reflected(n, RATIO, 4, linear) for n in nodes]
    left.plot(nodes, ramp, color="#888888", ls="--", label="4 cells, share linear within cells")
    left.set(xscale="log", yscale="log", ylim=(1e-8, 3.0), xlim=(4, 60))
    left.set_xticks([4, 6, 10, 20, 40], ["4", "6", "10", "20", "40"])
    left.minorticks_off()
    left.set(xlabel="coarse nodes a wavelength", ylabel="energy reflected [1]")
    left.legend(fontsize=8, loc="upper right", ncols=2)
    for n, color in zip((6, 10, 20), ("#1b7837", "#2166ac", "#762a83"), strict=True):
        layers = range(1, int(0.8 * n) + 1)
        rest = [reflected(n, RATIO, layer) / sharp_seam(n, RATIO) for layer in layers]
        right.plot([layer / n for layer in layers], rest, "o-", ms=4, color=color, label=f"{n} coarse nodes a wave")
    right.axhline(0.5, color="#888888", lw=0.8, ls=":")
    right.text(0.79, 0.52, "half", ha="right", fontsize=8, color="#555555")
    right.set(xlim=(0, 0.8), ylim=(0, 1))
    right.set(xlabel="length of the overlap over the wavelength", ylabel="energy reflected, over the sharp seam's [1]")
    right.legend(fontsize=8)
    for axis in (left, right):
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle("A wave meets cells a quarter as long (lumped cells of a bar)", fontsize=11)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    print("| coarse nodes a wavelength | sharp seam | " + " | ".join(f"{layer} cells" for layer in LAYERS) + " |")
    print("|---" * (len(LAYERS) + 2) + "|")
    for nodes in WAVES:
        sharp = sharp_seam(nodes, RATIO)
        shown = " | ".join(f"{reflected(nodes, RATIO, layer) / sharp:.2g}" for layer in LAYERS)
        print(f"| {nodes} | {100.0 * sharp:.2g} % | {shown} |")
    draw(Path(__file__).resolve().parents[2] / "docs" / "pictures" / "overlap.png")


if __name__ == "__main__":
    main()
