"""Regenerates the snapshots in README.md and docs/: `python tests/benchmarks/pictures.py [SCENE ...]`.

Each scene is simulated in this process and drawn as `softseam run SCENE --model MODEL --pictures FOLDER` draws it; of
that, the snapshots are kept, smaller, most with the 256 colours that suit both picture and scale.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

import softseam
from softseam.pictures import draw_pictures
from softseam.variants import Model
from softseam.view.colors import stress_colors

ROOT = Path(__file__).resolve().parents[2]
SCENES: dict[str, Model | None] = {
    "tofu_grasp": "hybrid",
    "calamari": None,
    "stiff_inclusion": "hybrid",
    "sausage_bent": None,
    "gelatin": None,
}
IN_FULL = ("stiff_inclusion", "sausage_bent")
"""kept in all their colours: stress that varies little would show bands"""
WIDTH = 1200
"""[pixels]"""
OF_SCALE = 80
"""colours of the palette that are the scale's; the others, and white, are chosen for the picture"""


def main(scenes: list[str]) -> None:
    for scene in scenes:
        with TemporaryDirectory() as scratch:
            recording = Path(scratch) / "run.mcap"
            with softseam.open(scene, model=SCENES[scene], record=recording) as session:
                session.run()
            snapshots = Image.open(draw_pictures(recording, scratch)[0]).convert("RGB")
        path = ROOT / "docs" / "pictures" / f"{scene}.png"
        kept = smaller(snapshots)
        (kept if scene in IN_FULL else few_colours(kept)).save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


def smaller(picture: Image.Image) -> Image.Image:
    """The picture, `WIDTH` wide."""
    return picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.Resampling.LANCZOS)


def few_colours(picture: Image.Image) -> Image.Image:
    """The picture with a palette of its own in which white stays white and the scale of stress even."""
    seen = np.asarray(picture)
    scale = stress_colors(np.linspace(0.0, 1.0, OF_SCALE), 1.0)
    chosen = picture.quantize(255 - OF_SCALE, Image.Quantize.MEDIANCUT, kmeans=3).getpalette() or []
    palette = np.array([*scale.ravel(), *chosen[: 3 * (255 - OF_SCALE)], 255, 255, 255], dtype=np.int64).reshape(-1, 3)
    colours, where = np.unique(seen.reshape(-1, 3), axis=0, return_inverse=True)
    nearest = np.array([int(((palette - colour) ** 2).sum(axis=1).argmin()) for colour in colours.astype(np.int64)])
    found = Image.fromarray(nearest[where.reshape(seen.shape[:2])].astype(np.uint8), "P")
    found.putpalette(palette.ravel().tolist())
    return found


if __name__ == "__main__":
    main(sys.argv[1:] or list(SCENES))
