"""Pieces of tofu between two pads, for tests and benchmarks of many at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from pbd_run import Floats

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.pbd.batch.batch import Batch
from softseam_services.pbd.batch.pieces import Pieces

STEP, SUBSTEPS = 0.04, 40
EVERYWHERE = {"boxes": [{"min": [-1, -1, -1], "max": [1, 1, 1]}]}
PAD = {"kind": "box", "size": [0.01, 0.09, 0.09], "friction": 0.6}


def scene(cells: int = 3, kind: str = "neo_hookean", **material: Any) -> Scene:
    """A cube of tofu, 2 mm from two pads."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "pieces",
            "gravity": [0, 0, -9.81],
            "step": STEP,
            "body": {
                "shape": {"kind": "block", "size": [0.05] * 3},
                "cell": [0.05 / cells] * 3,
                "material": {"kind": kind, "young": 2e4, "poisson": 0.45, "density": 1050, **material},
            },
            "tools": {
                "ground": {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1], "friction": 0.6},
                "left": {**PAD, "position": [-0.032, 0, 0.044]},
                "right": {**PAD, "position": [0.032, 0, 0.044]},
            },
            "motion": [{"tools": ["left", "right"], "close": 0.02, "until": {"time": 1.0}}],
            "models": {"pbd": {"coarse": EVERYWHERE, "substeps": SUBSTEPS}},
        }
    )


def velocity(number: int) -> Floats:
    """Of the tools (3, 3) [m/s]: close by 3.2 mm, hold, rise."""
    found = np.zeros((3, 3))
    if number < 4:
        found[1, 0], found[2, 0] = 0.02, -0.02
    elif number > 5:
        found[1:, 2] = 0.05
    return found


def drawn(batch: Batch) -> Pieces:
    """Pieces that differ in all that they can."""
    count, random = batch.count, np.random.default_rng(7)

    def about(shape: tuple[int, ...], spread: float = 0.3) -> Floats:
        return 1.0 + spread * random.uniform(-1.0, 1.0, shape)

    own = batch.structure.own(count)
    position = own.position.copy()
    size = own.size * about((count, 3), 0.1)
    position[:, 1, 0] = -0.5 * size[:, 0] - 0.007
    position[:, 2, 0] = 0.5 * size[:, 0] + 0.007
    return Pieces(
        size=size,
        young=own.young * about((count,)),
        poisson=random.uniform(0.32, 0.47, count),
        density=own.density * about((count,)),
        friction=own.friction * about((count, 3)),
        friction_field=[FrictionFieldSpec(spread=0.3, length=0.02, seed=seed) for seed in range(count)],
        position=position,
        orientation=own.orientation,
    )
